//! The one random walk of both directions.

use super::shading::SurfacePoint;
use crate::math::Rgb;
use crate::samplers::Stream;
use crate::scene::Scene;
use crate::scene::bsdf::{Lobes, Mode};
use crate::scene::hit::Hit;
use crate::scene::ray::Ray;
use glam::{Vec2, Vec3};

/// What a walk costs and what it had to give up. Adds over walks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Rays traced, shadow rays counted.
    pub rays: u64,
    /// Contributions or throughputs that were not finite; they count as zero.
    pub non_finite: u64,
    /// Walks that met a surface whose geometric and shading sides disagree about where they came from.
    pub sides_disagree: u64,
}

impl Tally {
    /// The contribution itself, or nothing, counted, if it is not finite.
    #[inline]
    pub fn finite(&mut self, contribution: Rgb) -> Rgb {
        if contribution.is_finite() {
            return contribution;
        }
        self.non_finite += 1;
        Rgb::BLACK
    }

    /// Adds another's counts.
    pub fn add(&mut self, other: &Tally) {
        self.rays += other.rays;
        self.non_finite += other.non_finite;
        self.sides_disagree += other.sides_disagree;
    }

    /// The counts of what was given up, by cause.
    pub fn rejected(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [("non_finite", self.non_finite), ("sides_disagree", self.sides_disagree)].into_iter().filter(|(_, count)| *count > 0)
    }
}

/// A vertex that a walk has reached.
#[derive(Clone, Copy, Debug)]
pub struct Vertex<'a> {
    /// The hit there.
    pub hit: Hit,
    /// Ready to scatter; `None` where the sides of the arriving direction disagree, so that nothing but emission counts.
    pub point: Option<SurfacePoint<'a>>,
    /// Origin of the ray that arrived.
    pub from: Vec3,
    /// Unit direction of the ray that arrived.
    pub d: Vec3,
    /// Throughput of the walk on arrival.
    pub throughput: Rgb,
    /// Edges walked.
    pub depth: u32,
    /// Length walked, world units.
    pub length: f32,
    /// Every event so far was at a delta lobe; true at the first vertex.
    pub specular: bool,
}

/// What to do at a vertex.
#[derive(Clone, Copy, Debug)]
pub enum Step {
    /// The walk ends here.
    Stop,
    /// It goes on through these lobes, chosen with this probability, by which the throughput is divided.
    Scatter(Lobes, f32),
}

/// Where a walk starts.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// The first ray; unit direction.
    pub ray: Ray,
    /// Throughput along it.
    pub throughput: Rgb,
    /// Length already behind it, world units.
    pub length: f32,
}

/// A walk that left the scene.
#[derive(Clone, Copy, Debug)]
pub struct Escape {
    /// The last ray.
    pub ray: Ray,
    /// Throughput along it.
    pub throughput: Rgb,
    /// Edges walked, the last included.
    pub depth: u32,
    /// Every event was at a delta lobe.
    pub specular: bool,
}

/// The camera's ray beyond the emitters it meets first, with the length passed: what `hide_emitters` means in Mitsuba 3. A hidden emitter is
/// hidden from the camera's first edge alone; it casts light, shows in mirrors, and blocks every other ray.
pub fn beyond_emitters(scene: &Scene, mut ray: Ray, tally: &mut Tally) -> (Ray, f32) {
    let mut passed = 0.0;
    while let Some(hit) = scene.intersect(&ray) {
        tally.rays += 1;
        if hit.emitter.is_none() {
            break;
        }
        passed += hit.t;
        ray = Ray { t_max: ray.t_max - hit.t, ..hit.end.ray(ray.d) };
    }
    (ray, passed)
}

/// Russian roulette, local to the vertex: a walk survives with the share of light its scattering kept (largest component), and from
/// `depth` edges on at most with [`CEILING`], so that lossless mirrors end too.
#[derive(Clone, Copy, Debug)]
pub struct Roulette {
    /// Edges from which the ceiling applies.
    pub depth: u32,
}

/// Largest survival probability once roulette has its ceiling; Mitsuba's number.
pub const CEILING: f32 = 0.95;

/// Walks from `start` until the walk escapes, is absorbed, loses its roulette or is told to stop. `visit` sees every vertex.
///
/// Coordinates used a bounce: one for the lobe, two for the direction, one for the roulette.
pub fn walk<'a, S: Stream>(
    scene: &'a Scene,
    mode: Mode,
    start: Start,
    roulette: Roulette,
    stream: &mut S,
    tally: &mut Tally,
    mut visit: impl FnMut(&Vertex<'a>, &mut S, &mut Tally) -> Step,
) -> Option<Escape> {
    let Start { mut ray, mut throughput, mut length } = start;
    let (mut depth, mut specular) = (0, true);
    loop {
        depth += 1;
        tally.rays += 1;
        let Some(hit) = scene.intersect(&ray) else {
            return Some(Escape { ray, throughput, depth, specular });
        };
        length += hit.t;
        let point = SurfacePoint::new(&hit, scene.bsdf(hit.shape), ray.d);
        let vertex = Vertex { hit, point, from: ray.o, d: ray.d, throughput, depth, length, specular };
        let Step::Scatter(lobes, probability) = visit(&vertex, stream, tally) else { return None };
        let Some(point) = point else {
            tally.sides_disagree += 1;
            return None;
        };

        // The next direction.
        let u_lobe = stream.next_1d();
        let u = Vec2::from(stream.next_2d());
        let u_survive = stream.next_1d();
        let scattered = point.sample(mode, lobes, u_lobe, u)?;
        let kept = scattered.weight.max_component();
        let ceiling = if depth >= roulette.depth { CEILING } else { 1.0 };
        let survival = kept.min(ceiling);
        if u_survive >= survival {
            return None;
        }
        throughput *= scattered.weight * (1.0 / (survival * probability));
        if !throughput.is_finite() {
            tally.non_finite += 1;
            return None;
        }
        specular &= scattered.delta;
        ray = point.end.ray(scattered.d);
    }
}
