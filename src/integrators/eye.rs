//! The camera's side of measurement points: emission seen directly or through smooth chains, and the point where a pixel measures.

use super::{Common, IterationStats};
use crate::math::Rgb;
use crate::samplers::{Key, Purpose, Stream, UniformStream};
use crate::scene::Scene;
use crate::scene::bsdf::{Lobes, Mode};
use crate::targets::points::{DepthRange, MeasurementPoint};
use crate::transport::shading::SurfacePoint;
use crate::transport::walk::{Roulette, Start, Step, Tally, beyond_emitters, walk};
use glam::Vec2;

/// How the radius is given.
#[derive(Clone, Copy, Debug)]
pub(super) enum Radius {
    /// World units.
    World(f32),
    /// In footprints of the pixel at the measurement point.
    Footprints(f32),
}

impl Radius {
    fn of(self, footprint: f32) -> f32 {
        match self {
            Radius::World(r) => r,
            Radius::Footprints(p) => p * footprint,
        }
    }
}

/// What a camera subpath found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<'a> {
    /// Emission along a chain of deltas, the first edge included.
    pub(super) emission: Rgb,
    /// Emission along a smooth chain with an event that was no delta: [STF 5] leaves these paths out.
    pub(super) glossy: Rgb,
    /// The subpath met a smooth lobe that was no delta, and no lobe rough enough.
    pub(super) unmeasured: bool,
    /// Where it measures, if it came to a rough lobe.
    pub(super) measured: Option<MeasurementPoint<'a>>,
}

/// Camera subpaths of a scene.
#[derive(Clone)]
pub(super) struct Eye<'a> {
    pub(super) scene: &'a Scene,
    pub(super) common: Common,
    /// Width and height, pixels.
    pub(super) size: (usize, usize),
    /// Roughness from which lobes are measured at.
    pub(super) threshold: f32,
}

impl<'a> Eye<'a> {
    /// Path lengths that count.
    pub(super) fn depths(&self) -> DepthRange {
        DepthRange { min: self.common.min_depth, max: self.common.max_depth.unwrap_or(u32::MAX) }
    }

    /// Pixels.
    pub(super) fn pixels(&self) -> usize {
        self.size.0 * self.size.1
    }

    /// An iteration's subpath of a pixel, for the purpose that its key has.
    pub(super) fn sample(&self, (iteration, purpose): (u64, Purpose), pixel: usize, radius: Radius, tally: &mut Tally) -> Seen<'a> {
        let mut stream = Key { seed: self.common.seed, iteration, index: pixel as u64, purpose }.stratified();
        let jitter = Vec2::from(stream.next_2d());
        let lens = Vec2::from(stream.next_2d());
        self.measure(pixel, jitter, lens, radius, &mut stream, tally)
    }

    /// The `number`-th subpath of a pixel in a pilot, on streams that no iteration uses.
    pub(super) fn pilot(&self, number: u64, pixel: usize, radius: Radius, tally: &mut Tally) -> Option<MeasurementPoint<'a>> {
        let mut stream = pixel_stream(self.common.seed, number + 1, pixel, Purpose::Pilot);
        let jitter = Vec2::from(stream.next_2d());
        let lens = Vec2::from(stream.next_2d());
        self.measure(pixel, jitter, lens, radius, &mut stream, tally).measured
    }

    fn measure<S: Stream>(&self, pixel: usize, jitter: Vec2, lens: Vec2, radius: Radius, stream: &mut S, tally: &mut Tally) -> Seen<'a> {
        let corner = Vec2::new((pixel % self.size.0) as f32, (pixel / self.size.0) as f32);
        let camera = self.scene.camera();
        let camera_ray = camera.ray(corner + jitter, lens);
        let mut start = Start { ray: camera_ray.ray, throughput: Rgb::WHITE, length: camera_ray.start };
        if self.common.hide_emitters {
            let (ray, passed) = beyond_emitters(self.scene, start.ray, tally);
            start = Start { ray, length: start.length + passed, ..start };
        }
        let DepthRange { min, max } = self.depths();
        let counts = |depth: u32| {
            let hidden = depth == 1 && self.common.hide_emitters;
            !hidden && depth >= min && depth <= max
        };
        let mut seen = Seen { emission: Rgb::BLACK, glossy: Rgb::BLACK, unmeasured: false, measured: None };
        let mut glossy = false;
        let roulette = Roulette { depth: self.common.rr_depth };
        let escape = walk(self.scene, Mode::Radiance, start, roulette, stream, tally, |vertex, stream, _| {
            glossy |= !vertex.specular;
            if vertex.hit.emitter.is_some() && counts(vertex.depth) {
                let emitted = vertex.throughput * self.scene.emitted(&vertex.hit, -vertex.d, vertex.from).radiance;
                *seen.emission_along(vertex.specular) += emitted;
            }
            let Some(point) = vertex.point else { return Step::Scatter(Lobes::All, 1.0) };
            if vertex.depth >= max {
                return Step::Stop;
            }
            match split(&point, self.threshold, stream) {
                Split::Gather(probability) => {
                    let footprint = vertex.length * camera.pixel_on_unit_plane();
                    seen.measured = Some(MeasurementPoint {
                        point,
                        throughput: vertex.throughput * (1.0 / probability),
                        depth: vertex.depth,
                        footprint,
                        pixel: pixel as u32,
                        radius: radius.of(footprint),
                    });
                    Step::Stop
                }
                Split::Continue(probability) => Step::Scatter(Lobes::Smooth(self.threshold), probability),
                Split::Absorbed => Step::Stop,
            }
        });
        if let Some(escape) = escape {
            glossy |= !escape.specular;
            if counts(escape.depth) {
                *seen.emission_along(escape.specular) += escape.throughput * self.scene.escaped(escape.ray.d).radiance;
            }
        }
        seen.unmeasured = glossy && seen.measured.is_none();
        seen
    }

    /// Median footprint over pixel centres, on a key of its own ([interface: Footprint]).
    pub(super) fn median_footprint(&self, stats: &mut IterationStats) -> Option<f32> {
        let mut tally = Tally::default();
        let mut footprints: Vec<f32> = Vec::new();
        for pixel in 0..self.pixels() {
            let mut stream = pixel_stream(0, 0, pixel, Purpose::Pilot);
            let lens = Vec2::from(stream.next_2d());
            let seen = self.measure(pixel, Vec2::splat(0.5), lens, Radius::Footprints(1.0), &mut stream, &mut tally);
            footprints.extend(seen.measured.map(|m| m.footprint));
        }
        stats.camera_paths += self.pixels() as u64;
        stats.count(&tally);
        let middle = footprints.len() / 2;
        (!footprints.is_empty()).then(|| *footprints.select_nth_unstable_by(middle, f32::total_cmp).1)
    }
}

impl Seen<'_> {
    fn emission_along(&mut self, specular: bool) -> &mut Rgb {
        if specular { &mut self.emission } else { &mut self.glossy }
    }
}

fn pixel_stream(seed: u64, iteration: u64, pixel: usize, purpose: Purpose) -> UniformStream {
    Key { seed, iteration, index: pixel as u64, purpose }.stream()
}

/// What a camera subpath does at a vertex, with the probability of the choice.
enum Split {
    Gather(f32),
    Continue(f32),
    Absorbed,
}

/// Lobes at least as rough as the threshold are gathered at, the others are followed: one set is chosen by its albedo. A coordinate is
/// drawn only where there is a choice.
fn split<S: Stream>(point: &SurfacePoint<'_>, threshold: f32, stream: &mut S) -> Split {
    let rough = point.bsdf.albedo(point.uv, point.given_local, Lobes::Rough(threshold));
    let smooth = point.bsdf.albedo(point.uv, point.given_local, Lobes::Smooth(threshold));
    match (rough > 0.0, smooth > 0.0) {
        (false, false) => Split::Absorbed,
        (true, false) => Split::Gather(1.0),
        (false, true) => Split::Continue(1.0),
        (true, true) => {
            let probability = rough / (rough + smooth);
            if stream.next_1d() < probability { Split::Gather(probability) } else { Split::Continue(1.0 - probability) }
        }
    }
}
