//! Chains of light paths that follow a target over the iteration's measurement points.
//!
//! [STF, algorithm 1]: measurement points, targets at them, light paths by replica exchange, statistics of regions.

use super::super::chains::{ChainReport, RegionReport};
use super::super::photon_settings::{LadderPlan, PhotonSettings, RegionKind};
use super::{Eye, Glossy, IterationStats, Radius, Sppm};
use crate::image::film::Film;
use crate::math::Rgb;
use crate::photons::radius::shrink;
use crate::samplers::{Ladder, PhotonSampler};
use crate::targets::aim::{Aimer, Place, Rung};
use crate::targets::aimed::AimedPaths;
use crate::targets::deposits::{Deposits, collect};
use crate::targets::points::{MeasurementPoint, Points};
use crate::targets::regions::Regions;
use crate::targets::tallies::Tallies;
use crate::transport::walk::Tally;
use rayon::prelude::*;

/// Camera paths a pixel in the pilot that targets and regions [STF 4.2] are built over.
const PILOT: u64 = 4;

/// A ladder and what it aims at, from iteration to iteration.
pub(super) struct Aimed {
    ladder: Ladder,
    /// Set by [`Aimed::prepare`].
    aimer: Option<Aimer>,
    rungs: Vec<Rung>,
    regions: RegionKind,
}

impl Aimed {
    pub(super) fn new(settings: &PhotonSettings, plan: &LadderPlan, seed: u64) -> Self {
        Self { ladder: Ladder::new(plan.settings(settings, seed)), aimer: None, rungs: plan.rungs.clone(), regions: plan.regions }
    }

    /// Looks where the camera measures, and builds the tree of regions.
    pub(super) fn prepare(&mut self, sppm: &Sppm<'_>, stats: &mut IterationStats) {
        self.aimer = Some(self.aimer(sppm, stats));
    }

    fn aimer(&self, sppm: &Sppm<'_>, stats: &mut IterationStats) -> Aimer {
        let pilot = pilot(&sppm.eye, sppm.radius_at(0), stats);
        let regions = match self.regions {
            RegionKind::None => None,
            RegionKind::Image => Some(Regions::image(sppm.eye.size.0, sppm.eye.size.1)),
            RegionKind::Space => Some(Regions::spatial(pilot.iter().map(|m| m.point.end.p).collect())),
        };
        Aimer::new(regions, self.place(&sppm.eye), sppm.settings.refinement(), sppm.eye.depths(), &pilot)
    }

    fn place(&self, eye: &Eye<'_>) -> Place {
        match self.regions {
            RegionKind::Image => Place::Image { width: eye.size.0 as u32 },
            RegionKind::None | RegionKind::Space => Place::Space,
        }
    }

    /// An iteration: camera subpaths first, then light paths aimed at what they found.
    pub(super) fn iterate(&mut self, sppm: &Sppm<'_>, i: u64, film: &mut Film, stats: &mut IterationStats) -> Glossy {
        let (mut values, mut points, glossy) = look(sppm, sppm.radius_at(i), i, stats);

        // Light paths.
        let mut aimer = self.aimer.take().unwrap_or_else(|| self.aimer(sppm, stats));
        let (aims, new) = aimer.aim(points.all(), shrink(i, sppm.settings.alpha));
        if new {
            self.ladder.retargeted();
        }
        points.set_aims(aims.iter().copied());
        let light = sppm.light_paths();
        let tallies = Tallies::default();
        let space = AimedPaths { light, cells: aimer.cells(), points: &points, rungs: &self.rungs, tallies: &tallies };
        let leaves = aimer.regions.as_ref().map_or(0, Regions::leaves);
        let (count, strata) = (points.all().len(), self.ladder.strata());
        let start = || Deposits::new(count, strata, leaves);
        let paths = if light.max_depth == 0 { 0 } else { sppm.photon_count };
        let draw = self.ladder.draw(&space, i, paths, start, |deposits, path, drawn| deposits.add(&points, path, drawn));
        stats.light_paths += draw.traced;
        stats.count(&tallies.total());
        draw.batches.iter().for_each(|deposits| stats.count(&deposits.tally));
        let (sums, halves) = collect(&draw, count);

        // Statistics for the next iteration's target.
        if let Some(regions) = &mut aimer.regions {
            let mut sizes = vec![0.0; leaves];
            points.all().iter().zip(&aims).for_each(|(m, aim)| sizes[aim.leaf as usize] += f64::from(m.kernel_size()));
            regions.add(&sizes, [&halves[0], &halves[1]]);
        }

        self.aimer = Some(aimer);

        // The image.
        for (at, sum) in points.all().iter().zip(sums) {
            let scale = 1.0 / f64::from(at.kernel_size());
            let [r, g, b] = sum.map(|v| (v * scale) as f32);
            values[at.pixel as usize] += at.throughput * Rgb::new(r, g, b);
        }
        let width = sppm.eye.size.0;
        let sample = |tally: &mut Tally, x: usize, y: usize| tally.finite(values[y * width + x]);
        film.add_eye_samples(Tally::default, sample, |tally| stats.count(&tally));
        glossy
    }

    /// The ladder's diagnostics and the number of regions.
    pub(super) fn report(&self) -> ChainReport {
        let report =
            |regions: &Regions| RegionReport { leaves: regions.leaves(), in_use: self.aimer.as_ref().map_or(0, Aimer::region_count) };
        ChainReport {
            names: self.rungs.clone(),
            ladder: self.ladder.report(),
            regions: self.aimer.as_ref().and_then(|aimer| aimer.regions.as_ref()).map(report),
        }
    }
}

/// Camera subpaths of an iteration: emission per pixel, and the measurement points in pixel order.
fn look<'a>(sppm: &Sppm<'a>, radius: Radius, i: u64, stats: &mut IterationStats) -> (Vec<Rgb>, Points<'a>, Glossy) {
    let (eye, width) = (&sppm.eye, sppm.eye.size.0);
    let row = |y: usize| {
        let (mut tally, mut glossy) = (Tally::default(), Glossy::default());
        let (mut emission, mut points) = (Vec::with_capacity(width), Vec::with_capacity(width));
        for pixel in y * width..(y + 1) * width {
            let seen = eye.sample(i, pixel, radius, &mut tally);
            glossy.see(&seen);
            emission.push(sppm.emission(&seen));
            points.extend(seen.measured);
        }
        (emission, points, tally, glossy)
    };
    let rows: Vec<_> = (0..eye.size.1).into_par_iter().map(row).collect();
    let (mut values, mut points, mut all) = (Vec::with_capacity(eye.pixels()), Vec::with_capacity(eye.pixels()), Glossy::default());
    for (emission, found, tally, glossy) in rows {
        values.extend(emission);
        points.extend(found);
        stats.count(&tally);
        all.add(&glossy);
    }
    (values, Points::new(points, eye.depths(), eye.threshold), all)
}

/// Measurement points, some a pixel.
fn pilot<'a>(eye: &Eye<'a>, radius: Radius, stats: &mut IterationStats) -> Vec<MeasurementPoint<'a>> {
    let row = |y: usize| {
        let mut tally = Tally::default();
        let pixels = y * eye.size.0..(y + 1) * eye.size.0;
        let samples = pixels.flat_map(|pixel| (0..PILOT).map(move |number| (pixel, number)));
        let found: Vec<_> = samples.filter_map(|(pixel, number)| eye.pilot(number, pixel, radius, &mut tally)).collect();
        (found, tally)
    };
    let rows: Vec<_> = (0..eye.size.1).into_par_iter().map(row).collect();
    stats.camera_paths += PILOT * eye.pixels() as u64;
    let mut points = Vec::new();
    for (found, tally) in rows {
        points.extend(found);
        stats.count(&tally);
    }
    points
}
