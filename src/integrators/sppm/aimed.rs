//! Chains of light paths that follow a target over the iteration's measurement points.
//!
//! [STF, algorithm 1]: measurement points, targets at them, light paths by replica exchange, statistics of regions.

use super::super::chains::{ChainReport, RegionReport};
use super::super::photon_settings::{LadderPlan, PhotonSettings, RegionKind};
use super::{Counts, Eye, Glossy, IterationStats, Radius, Sppm};
use crate::image::film::Film;
use crate::math::Rgb;
use crate::photons::radius::shrink;
use crate::samplers::{Ladder, PhotonSampler};
use crate::targets::aim::{Aimer, Place, Rung};
use crate::targets::aimed::AimedPaths;
use crate::targets::cells::Site;
use crate::targets::deposits::{Deposits, collect, halves};
use crate::targets::points::{MeasurementPoint, PointGrid, Points};
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
    /// Leaves iterations to independent paths where chains are not worth their cost.
    rest: bool,
}

impl Aimed {
    pub(super) fn new(settings: &PhotonSettings, plan: &LadderPlan, seed: u64) -> Self {
        Self {
            ladder: Ladder::new(plan.settings(settings, seed)),
            aimer: None,
            rungs: plan.rungs.clone(),
            regions: plan.regions,
            rest: plan.rest,
        }
    }

    /// Looks where the camera measures, and builds the tree of regions. Returns the median radius; `None` without a measurement point.
    pub(super) fn prepare(&mut self, sppm: &Sppm<'_>, stats: &mut IterationStats) -> Option<f32> {
        let pilot = pilot(&sppm.eye, sppm.radius_at(0), stats);
        self.aimer = Some(self.aimer(sppm, &pilot));
        let mut radii: Vec<f32> = pilot.iter().map(|m| m.radius).collect();
        let middle = radii.len() / 2;
        (!radii.is_empty()).then(|| *radii.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    fn aimer(&self, sppm: &Sppm<'_>, pilot: &[Site]) -> Aimer {
        let regions = match self.regions {
            RegionKind::None => None,
            RegionKind::Image => Some(Regions::image(sppm.eye.size.0, sppm.eye.size.1)),
            RegionKind::Space => Some(Regions::spatial(pilot.iter().map(|m| m.p).collect())),
        };
        Aimer::new(regions, self.place(&sppm.eye), sppm.settings.refinement(), sppm.eye.depths(), pilot)
    }

    fn place(&self, eye: &Eye<'_>) -> Place {
        match self.regions {
            RegionKind::Image => Place::Image { width: eye.size.0 as u32 },
            RegionKind::None | RegionKind::Space => Place::Space,
        }
    }

    /// Whether an iteration of `paths` light paths is better left to independent ones; takes note of it if so.
    pub(super) fn rests(&mut self, paths: u64) -> bool {
        let Some(aimer) = self.aimer.as_mut().filter(|aimer| self.rest && !self.ladder.worthwhile() && !aimer.trial()) else {
            return false;
        };
        aimer.skip();
        self.ladder.rest(paths);
        true
    }

    /// An iteration: camera subpaths first, then light paths aimed at what they found.
    pub(super) fn iterate(&mut self, sppm: &Sppm<'_>, i: u64, film: &mut Film, stats: &mut IterationStats) -> Counts {
        let (mut values, measured, glossy) = look(sppm, sppm.radius_at(i), i, stats);

        // Light paths.
        let mut aimer = self.aimer.take().unwrap_or_else(|| self.aimer(sppm, &sites(&measured)));
        let shrink = shrink(i, sppm.settings.alpha);
        let (grid, (aims, new)) = rayon::join(|| PointGrid::build(&measured), || aimer.aim(&sites(&measured), shrink));
        if new {
            self.ladder.retargeted();
        }
        let points = Points::new(measured, grid, &aims, sppm.eye.depths(), sppm.eye.threshold);
        let light = sppm.light_paths();
        let tallies = Tallies::default();
        let space = AimedPaths { light, cells: aimer.cells(), points: &points, rungs: &self.rungs, tallies: &tallies };
        let leaves = aimer.regions.as_ref().map_or(0, Regions::leaves);
        let count = points.all().len();
        let start = || Deposits::new(count, aimer.regions.is_some());
        let paths = if light.max_depth == 0 { 0 } else { sppm.photon_count };
        let draw = self.ladder.draw(&space, i, paths, start, |deposits, path, drawn| deposits.add(&points, path, drawn));
        stats.light_paths += draw.traced;
        stats.count(&tallies.total());
        draw.batches.iter().for_each(|deposits| stats.count(&deposits.tally));
        let sums = collect(&draw, count);

        // Statistics for the next iteration's target.
        if let Some(regions) = &mut aimer.regions {
            let mut sizes = vec![0.0; leaves];
            points.all().iter().zip(&aims).for_each(|(m, aim)| sizes[aim.leaf as usize] += f64::from(m.kernel_size()));
            let [even, odd] = halves(&sums, |point| aims[point].leaf, leaves);
            regions.add(&sizes, [&even, &odd]);
        }

        self.aimer = Some(aimer);

        // The image.
        for (at, sum) in points.all().iter().zip(sums) {
            let scale = 1.0 / f64::from(at.kernel_size());
            let [r, g, b] = sum.flux.map(|v| (v * scale) as f32);
            values[at.pixel as usize] += at.throughput * Rgb::new(r, g, b);
        }
        let width = sppm.eye.size.0;
        let sample = |tally: &mut Tally, x: usize, y: usize| tally.finite(values[y * width + x]);
        film.add_eye_samples(Tally::default, sample, |tally| stats.count(&tally));
        Counts { deposits: draw.batches.iter().map(Deposits::count).sum(), glossy }
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
fn look<'a>(sppm: &Sppm<'a>, radius: Radius, i: u64, stats: &mut IterationStats) -> (Vec<Rgb>, Vec<MeasurementPoint<'a>>, Glossy) {
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
    let rows: Vec<_> = (0..eye.size.1).into_par_iter().with_max_len(1).map(row).collect();
    let (mut values, mut points, mut all) = (Vec::with_capacity(eye.pixels()), Vec::with_capacity(eye.pixels()), Glossy::default());
    for (emission, found, tally, glossy) in rows {
        values.extend(emission);
        points.extend(found);
        stats.count(&tally);
        all.add(&glossy);
    }
    (values, points, all)
}

fn sites(measured: &[MeasurementPoint<'_>]) -> Vec<Site> {
    measured.par_iter().map(Site::of).collect()
}

/// Measurement points, some a pixel.
fn pilot(eye: &Eye<'_>, radius: Radius, stats: &mut IterationStats) -> Vec<Site> {
    let row = |y: usize| {
        let mut tally = Tally::default();
        let pixels = y * eye.size.0..(y + 1) * eye.size.0;
        let samples = pixels.flat_map(|pixel| (0..PILOT).map(move |number| (pixel, number)));
        let found: Vec<_> =
            samples.filter_map(|(pixel, number)| eye.pilot(number, pixel, radius, &mut tally).as_ref().map(Site::of)).collect();
        (found, tally)
    };
    let rows: Vec<_> = (0..eye.size.1).into_par_iter().with_max_len(1).map(row).collect();
    stats.camera_paths += PILOT * eye.pixels() as u64;
    let mut points = Vec::new();
    for (found, tally) in rows {
        points.extend(found);
        stats.count(&tally);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::Common;
    use crate::samplers::{Key, LightPathSpace, Purpose};
    use crate::scene::Scene;
    use crate::scene::mitsuba::{LoadOptions, load};
    use crate::targets::aim::Aim;
    use crate::targets::cells::CellSearch;
    use crate::targets::points::{Search, Touch};
    use std::path::Path;

    const SIZE: (usize, usize) = (48, 36);

    fn sppm(scene: &Scene, max_depth: u32) -> Sppm<'_> {
        let common = Common { seed: 0, max_depth: Some(max_depth), min_depth: 1, rr_depth: 5, hide_emitters: false, paths: None };
        let eye = Eye { scene, common, size: SIZE, threshold: 0.05 };
        Sppm { eye, settings: PhotonSettings::default(), photon_count: 1, cell: 1.0, aimed: None, counts: Counts::default() }
    }

    fn indexed<'a>(sppm: &Sppm<'a>, measured: Vec<MeasurementPoint<'a>>) -> Points<'a> {
        let (grid, aims) = (PointGrid::build(&measured), vec![Aim::default(); measured.len()]);
        Points::new(measured, grid, &aims, sppm.eye.depths(), sppm.eye.threshold)
    }

    /// Light paths of a scene, with the number of points that they add light to, and of vertices that cells admit.
    fn paths(sppm: &Sppm<'_>, aimer: &Aimer, points: &Points<'_>) -> Vec<(usize, u32)> {
        let (mut path, mut touches) = (crate::targets::LightPath::default(), Vec::new());
        let of_path = |index| {
            let mut stream = Key { seed: 5, iteration: 0, index, purpose: Purpose::Test }.stream();
            sppm.light_paths().trace(&mut stream, &mut path);
            points.touched(&path.vertices, &mut Search::default(), &mut touches);
            let reached = aimer.cells().reached(&path.vertices, &mut CellSearch::default());
            assert_eq!(reached.vertices > 0, reached.kernel > 0.0 && reached.full > 0.0);
            // Light on the back of what lets none through touches a point and adds nothing.
            let adds = |touch: &&Touch| !points.value(touch.point, &path.vertices[touch.vertex as usize]).is_black();
            (touches.iter().filter(adds).count(), reached.vertices)
        };
        (0..20_000).map(of_path).collect()
    }

    /// Targets are positive wherever a point that made them takes a light vertex, whatever its material, its side and its depth, and hardly
    /// anywhere else: surfaces that the camera never sees are left out, the backs of those it sees among them.
    #[test]
    fn targets_cover_the_points_that_made_them() {
        for (name, max_depth, least, most) in [("textured-room", 6, 0.2, 0.98), ("glass-box", 3, 0.2, 0.98), ("villa", 8, 0.0005, 0.02)] {
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml");
            let options = LoadOptions { resolution: Some((SIZE.0 as u32, SIZE.1 as u32)), ..Default::default() };
            let loaded = load(&file, &options).unwrap();
            let sppm = sppm(&loaded.scene, max_depth);
            let (_, measured, _) = look(&sppm, sppm.radius_at(0), 0, &mut IterationStats::default());
            let mut aimer = Aimer::new(None, Place::Space, sppm.settings.refinement(), sppm.eye.depths(), &[]);
            assert!(aimer.trial() && aimer.aim(&sites(&measured), 1.0).1);
            let points = indexed(&sppm, measured);
            let paths = paths(&sppm, &aimer, &points);
            let missed = paths.iter().filter(|(touches, reached)| *touches > 0 && *reached == 0).count();
            let touching = paths.iter().filter(|(touches, _)| *touches > 0).count();
            assert!(touching > 10 && 500 * missed <= touching, "{name}: {missed} of {touching} paths that count are not aimed at");
            let aimed = paths.iter().filter(|(_, reached)| *reached > 0).count() as f64 / paths.len() as f64;
            assert!((least..most).contains(&aimed), "{name}: {aimed} of all paths are aimed at");
        }
    }

    /// A second look finds most of what a pilot of some paths a pixel has seen.
    #[test]
    fn a_pilot_finds_what_later_iterations_see() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/canyon/scene.xml");
        let options = LoadOptions { resolution: Some((SIZE.0 as u32, SIZE.1 as u32)), ..Default::default() };
        let loaded = load(&file, &options).unwrap();
        let sppm = sppm(&loaded.scene, 8);
        let mut stats = IterationStats::default();
        let pilot = pilot(&sppm.eye, sppm.radius_at(0), &mut stats);
        let mut aimer = Aimer::new(None, Place::Space, sppm.settings.refinement(), sppm.eye.depths(), &pilot);
        let (_, measured, _) = look(&sppm, sppm.radius_at(0), 0, &mut stats);
        aimer.aim(&sites(&measured), 1.0);
        let (_, measured, _) = look(&sppm, sppm.radius_at(1), 1, &mut stats);
        let points = indexed(&sppm, measured);
        let paths = paths(&sppm, &aimer, &points);
        let missed = paths.iter().filter(|(touches, reached)| *touches > 0 && *reached == 0).count();
        let touching = paths.iter().filter(|(touches, _)| *touches > 0).count();
        assert!(touching > 500 && missed * 20 < touching, "{missed} of {touching} are missed");
    }
}
