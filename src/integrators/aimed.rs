//! Chains of light paths that follow a target over an iteration's measurement points, whatever method uses the paths.
//!
//! [STF, algorithm 1]: measurement points, targets at them, light paths by replica exchange, statistics of regions.

use super::IterationStats;
use super::chains::{ChainReport, RegionReport};
use super::eye::{Eye, Radius, Seen};
use super::photon_settings::{LadderPlan, PhotonSettings, RegionKind};
use crate::samplers::{Draw, Drawn, Ladder, LightPathSpace, PhotonSampler, Purpose};
use crate::targets::Arrivals;
use crate::targets::aim::{Aim, Aimer, Place, Rung};
use crate::targets::aimed::{AimedPath, AimedPaths, Gain};
use crate::targets::cells::Site;
use crate::targets::deposits::{Collected, halves};
use crate::targets::points::{MeasurementPoint, PointGrid, Points};
use crate::targets::regions::{Refinement, Regions};
use crate::targets::tallies::Tallies;
use crate::transport::walk::Tally;
use rayon::prelude::*;

/// Camera paths a pixel in the pilot that targets and regions [STF 4.2] are built over.
const PILOT: u64 = 4;

/// A ladder and what it aims at, from iteration to iteration.
pub(super) struct Aimed {
    ladder: Ladder,
    /// Set by [`Aimed::prepare`], away during an iteration.
    aimer: Option<Aimer>,
    rungs: Vec<Rung>,
    regions: RegionKind,
    refinement: Refinement,
    /// Leaves iterations to independent paths where chains are not worth their cost.
    rest: bool,
}

/// What the light paths of an iteration are aimed at.
pub(super) struct Sights<'a> {
    aimer: Aimer,
    /// The measurement points.
    pub(super) points: Points<'a>,
    aims: Vec<Aim>,
}

impl Sights<'_> {
    /// Are statistics asked for, by which regions learn?
    pub(super) fn has_regions(&self) -> bool {
        self.aimer.regions.is_some()
    }

    /// The density of the region around a measurement point that the target uses, by the point's number; `None` without one.
    pub(super) fn region_density(&self, point: usize) -> Option<f64> {
        self.aimer.density(self.aims[point].leaf)
    }
}

impl Aimed {
    pub(super) fn new(settings: &PhotonSettings, plan: &LadderPlan, seed: u64) -> Self {
        Self {
            ladder: Ladder::new(plan.settings(settings, seed)),
            aimer: None,
            rungs: plan.rungs.clone(),
            regions: plan.regions,
            refinement: settings.refinement(),
            rest: plan.rest,
        }
    }

    /// Do targets read the densities of regions?
    pub(super) fn has_regions(&self) -> bool {
        self.regions != RegionKind::None
    }

    /// Looks where the camera measures, and builds the tree of regions. Returns the median radius; `None` without a measurement point.
    pub(super) fn prepare(&mut self, eye: &Eye<'_>, radius: Radius, stats: &mut IterationStats) -> Option<f32> {
        let pilot = pilot(eye, radius, stats);
        self.aimer = Some(self.aimer(eye, &pilot));
        let mut radii: Vec<f32> = pilot.iter().map(|m| m.radius).collect();
        let middle = radii.len() / 2;
        (!radii.is_empty()).then(|| *radii.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    fn aimer(&self, eye: &Eye<'_>, pilot: &[Site]) -> Aimer {
        let (width, height) = eye.size;
        let (regions, place) = match self.regions {
            RegionKind::None => (None, Place::Space),
            RegionKind::Image => (Some(Regions::image(width, height)), Place::Image { width: width as u32 }),
            RegionKind::Space => (Some(Regions::spatial(pilot.iter().map(|m| m.p).collect())), Place::Space),
        };
        Aimer::new(regions, place, self.refinement, eye.depths(), pilot)
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

    /// Aims at an iteration's measurement points; `shrink` is the radius schedule's factor on the first iteration's radii.
    pub(super) fn aim<'a>(&mut self, eye: &Eye<'a>, measured: Vec<MeasurementPoint<'a>>, shrink: f64) -> Sights<'a> {
        let mut aimer = self.aimer.take().unwrap_or_else(|| self.aimer(eye, &sites(&measured)));
        let (grid, (aims, new)) = rayon::join(|| PointGrid::build(&measured), || aimer.aim(&sites(&measured), shrink));
        if new {
            self.ladder.retargeted();
        }
        let points = Points::new(measured, grid, &aims, eye.depths(), eye.threshold);
        Sights { aimer, points, aims }
    }

    /// How densely the iteration's light paths will lie, as far as earlier draws tell.
    pub(super) fn gain<'s>(&self, sights: &'s Sights<'_>) -> Option<Gain<'s>> {
        self.ladder.densities().map(|densities| Gain::new(sights.aimer.cells(), &self.rungs, &densities))
    }

    /// Draws `paths` light paths of iteration `i`, as [`PhotonSampler::draw`] does.
    pub(super) fn draw<L: LightPathSpace<Path: Arrivals>, A: Send>(
        &mut self,
        light: L,
        sights: &Sights<'_>,
        (i, paths): (u64, u64),
        start: impl Fn() -> A + Sync,
        emit: impl Fn(&mut A, &AimedPath<L::Path>, &[Drawn]) + Sync,
        stats: &mut IterationStats,
    ) -> Draw<A> {
        let tallies = Tallies::default();
        let space = AimedPaths { light, cells: sights.aimer.cells(), points: &sights.points, rungs: &self.rungs, tallies: &tallies };
        let draw = self.ladder.draw(&space, i, paths, start, emit);
        stats.light_paths += draw.traced;
        stats.count(&tallies.total());
        draw
    }

    /// Statistics for the next iterations' targets: what the paths left at the iteration's points, asked for where there are regions.
    pub(super) fn learn(&mut self, sights: Sights<'_>, sums: Option<&[Collected]>) {
        let Sights { mut aimer, points, aims } = sights;
        if let (Some(regions), Some(sums)) = (&mut aimer.regions, sums) {
            let leaves = regions.leaves();
            let mut sizes = vec![0.0; leaves];
            points.all().iter().zip(&aims).for_each(|(m, aim)| sizes[aim.leaf as usize] += f64::from(m.kernel_size()));
            let [even, odd] = halves(sums, |point| aims[point].leaf, leaves);
            regions.add(&sizes, [&even, &odd]);
        }
        self.aimer = Some(aimer);
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

/// Camera subpaths of an iteration, for the purpose that their keys have: its measurement points in pixel order, and what `keep` made of every row, from the top.
pub(super) fn look<'a, A: Default + Send>(
    eye: &Eye<'a>,
    radius: Radius,
    key: (u64, Purpose),
    stats: &mut IterationStats,
    keep: impl Fn(&mut A, &Seen<'a>) + Sync,
) -> (Vec<A>, Vec<MeasurementPoint<'a>>) {
    let width = eye.size.0;
    let row = |y: usize| {
        let (mut tally, mut kept) = (Tally::default(), A::default());
        let mut points = Vec::with_capacity(width);
        for pixel in y * width..(y + 1) * width {
            let seen = eye.sample(key, pixel, radius, &mut tally);
            keep(&mut kept, &seen);
            points.extend(seen.measured);
        }
        (kept, points, tally)
    };
    let rows: Vec<_> = (0..eye.size.1).into_par_iter().with_max_len(1).map(row).collect();
    let (mut all, mut points) = (Vec::with_capacity(rows.len()), Vec::with_capacity(eye.pixels()));
    for (kept, found, tally) in rows {
        all.push(kept);
        points.extend(found);
        stats.count(&tally);
    }
    (all, points)
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
    use crate::photons::radius::shrink;
    use crate::samplers::Key;
    use crate::scene::Scene;
    use crate::scene::mitsuba::{LoadOptions, load};
    use crate::targets::cells::CellSearch;
    use crate::targets::points::{Search, Touch};
    use crate::targets::{LightPath, LightPaths};
    use std::path::Path;

    const SIZE: (usize, usize) = (48, 36);

    const RADIUS: Radius = Radius::Footprints(1.0);

    fn eye(scene: &Scene, max_depth: u32) -> Eye<'_> {
        let common = Common { seed: 0, max_depth: Some(max_depth), min_depth: 1, rr_depth: 5, hide_emitters: false, paths: None };
        Eye { scene, common, size: SIZE, threshold: 0.05 }
    }

    fn measured<'a>(eye: &Eye<'a>, i: u64, shrink: f32, stats: &mut IterationStats) -> Vec<MeasurementPoint<'a>> {
        let Radius::Footprints(first) = RADIUS else { panic!("footprints") };
        look(eye, Radius::Footprints(first * shrink), (i, Purpose::Camera), stats, |(): &mut (), _| {}).1
    }

    fn indexed<'a>(eye: &Eye<'a>, measured: Vec<MeasurementPoint<'a>>) -> Points<'a> {
        let (grid, aims) = (PointGrid::build(&measured), vec![Aim::default(); measured.len()]);
        Points::new(measured, grid, &aims, eye.depths(), eye.threshold)
    }

    /// Light paths of a scene, with the number of points that they add light to, and of vertices that cells admit.
    fn paths(eye: &Eye<'_>, aimer: &Aimer, points: &Points<'_>) -> Vec<(usize, u32)> {
        let (mut path, mut touches) = (LightPath::default(), Vec::new());
        let depths = eye.depths();
        let light =
            LightPaths { scene: eye.scene, roughness_threshold: eye.threshold, max_depth: depths.max - 1, rr_depth: eye.common.rr_depth };
        let of_path = |index| {
            let mut stream = Key { seed: 5, iteration: 0, index, purpose: Purpose::Test }.stream();
            light.trace(&mut stream, &mut path);
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
            let eye = eye(&loaded.scene, max_depth);
            let points = measured(&eye, 0, 1.0, &mut IterationStats::default());
            let mut aimer = Aimer::new(None, Place::Space, PhotonSettings::default().refinement(), eye.depths(), &[]);
            assert!(aimer.trial() && aimer.aim(&sites(&points), 1.0).1);
            let points = indexed(&eye, points);
            let paths = paths(&eye, &aimer, &points);
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
        let eye = eye(&loaded.scene, 8);
        let mut stats = IterationStats::default();
        let pilot = pilot(&eye, RADIUS, &mut stats);
        let mut aimer = Aimer::new(None, Place::Space, PhotonSettings::default().refinement(), eye.depths(), &pilot);
        let points = measured(&eye, 0, 1.0, &mut stats);
        aimer.aim(&sites(&points), 1.0);
        let points = measured(&eye, 1, shrink(1, 0.75) as f32, &mut stats);
        let points = indexed(&eye, points);
        let paths = paths(&eye, &aimer, &points);
        let missed = paths.iter().filter(|(touches, reached)| *touches > 0 && *reached == 0).count();
        let touching = paths.iter().filter(|(touches, _)| *touches > 0).count();
        assert!(touching > 500 && missed * 20 < touching, "{missed} of {touching} are missed");
    }
}
