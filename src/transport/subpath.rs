//! The random walk of bidirectional methods: as [`walk`](super::walk), with the densities of both directions at every vertex and what weights
//! carry from one to the next. Its roulette is that of [`survival`](super::survival).

use super::class::Letters;
use super::mis::{Carried, Edge, Scatter, Weights};
use super::shading::SurfacePoint;
use super::walk::Tally;
use crate::math::Rgb;
use crate::samplers::Stream;
use crate::scene::Scene;
use crate::scene::bsdf::{Lobes, Mode};
use crate::scene::hit::{Endpoint, Hit};
use crate::scene::ray::Ray;
use glam::{Vec2, Vec3};

/// A vertex that a subpath has reached.
#[derive(Clone, Copy, Debug)]
pub struct SubpathVertex<'a> {
    /// The hit there.
    pub hit: Hit,
    /// Ready to scatter; `None` where the sides of the arriving direction disagree, so that nothing but emission counts.
    pub point: Option<SurfacePoint<'a>>,
    /// Has the surface, on the side arrived at, a lobe that is no delta, by which subpaths can be joined?
    pub joins: bool,
    /// The vertex before: on the light, in the camera or on a surface.
    pub from: Endpoint,
    /// Unit direction of the ray that arrived.
    pub d: Vec3,
    /// Throughput on arrival.
    pub throughput: Rgb,
    /// What weights ask for; its `edges` are those walked.
    pub carried: Carried<f32>,
    /// Events so far, where classes are kept.
    pub letters: Letters,
}

/// Where a subpath starts.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// The first ray; unit direction.
    pub ray: Ray,
    /// The light or the lens.
    pub from: Endpoint,
    /// Throughput along the ray.
    pub throughput: Rgb,
}

/// A subpath between two vertices.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    ray: Ray,
    from: Endpoint,
    throughput: Rgb,
    last: Option<(Endpoint, Carried<f32>, Scatter<f32>)>,
    letters: Letters,
}

impl Walk {
    /// On its first edge.
    pub fn new(start: Start) -> Self {
        let Start { ray, from, throughput } = start;
        Self { ray, from, throughput, last: None, letters: Letters::default() }
    }

    /// The ray along its edge; unit direction.
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    /// What it is when its edge meets nothing.
    pub fn departure(&self) -> Departure {
        let Self { ray, throughput, last, letters, .. } = *self;
        let edges = 1 + last.map_or(0, |(_, carried, _)| carried.edges);
        Departure { d: ray.d, throughput, edges, last, letters }
    }
}

/// A subpath that left the scene.
#[derive(Clone, Copy, Debug)]
pub struct Departure {
    /// Unit direction of the last ray.
    pub d: Vec3,
    /// Throughput along it.
    pub throughput: Rgb,
    /// Edges walked, the last included.
    pub edges: u32,
    /// The last vertex, what it carried and how it scattered; `None` where the first ray met nothing.
    pub last: Option<(Endpoint, Carried<f32>, Scatter<f32>)>,
    /// Events so far, where classes are kept.
    pub letters: Letters,
}

/// Expected number of photons that a merge finds at a point, positive.
pub type Photons<'w> = &'w (dyn Fn(&Endpoint) -> f32 + Sync);

/// What all subpaths of an iteration have in common.
#[derive(Clone, Copy)]
pub struct Subpaths<'a, 'w> {
    /// The scene.
    pub scene: &'a Scene,
    /// The techniques and their heuristic.
    pub weights: &'w Weights<f32>,
    /// Roughness of the roughest lobe from which a surface merges.
    pub roughness_threshold: f32,
    /// How dense photons lie; `None` for heuristics that do not ask.
    pub photons: Option<Photons<'w>>,
    /// Keep each path's class: an event at a surface with several lobes is then one of them, by their shares of the light kept, and
    /// the throughput divided by the probability.
    pub classes: bool,
}

impl<'a> Subpaths<'a, '_> {
    /// What a merge at the point counts for; 0 where none is evaluated.
    #[inline]
    pub fn share(&self, point: &SurfacePoint<'_>) -> f32 {
        self.share_of(point, point.max_roughness())
    }

    #[inline(always)]
    fn share_of(&self, point: &SurfacePoint<'_>, max_roughness: f32) -> f32 {
        let merges = Lobes::Rough(self.roughness_threshold).admit(max_roughness);
        if merges { self.weights.share(self.photons.map_or(1.0, |photons| photons(&point.end))) } else { 0.0 }
    }

    /// Walks from `start` until the subpath departs, ends, or `visit` says no more. `first` makes what the first vertex carries, of the hit and
    /// the vertex's share.
    ///
    /// Coordinates a bounce: one for the lobe, two for the direction, one for the roulette; where classes are kept one more for the class of
    /// an event that is no delta.
    pub fn walk<S: Stream>(
        &self,
        mode: Mode,
        start: Start,
        stream: &mut S,
        tally: &mut Tally,
        first: impl Fn(&Hit, f32) -> Carried<f32>,
        mut visit: impl FnMut(&SubpathVertex<'a>, &mut S, &mut Tally) -> bool,
    ) -> Option<Departure> {
        let mut walk = Walk::new(start);
        loop {
            tally.rays += 1;
            let Some(hit) = self.scene.intersect(&walk.ray) else { return Some(walk.departure()) };
            let vertex = self.reach(&walk, hit, &first);
            if !visit(&vertex, stream, tally) || !self.go_on(mode, &mut walk, &vertex, stream, tally) {
                return None;
            }
        }
    }

    /// The vertex where a walk has met a surface; `first` as with [`Subpaths::walk`], asked at the first vertex alone.
    #[inline(always)]
    pub fn reach(&self, walk: &Walk, hit: Hit, first: impl Fn(&Hit, f32) -> Carried<f32>) -> SubpathVertex<'a> {
        let Walk { ray, from, throughput, last, letters } = *walk;
        let point = SurfacePoint::new(&hit, self.scene.bsdf(hit.shape), ray.d);
        let max_roughness = point.as_ref().map_or(0.0, |point| point.max_roughness());
        let share = point.as_ref().map_or(0.0, |point| self.share_of(point, max_roughness));
        let carried = match &last {
            Some((end, carried, scatter)) => {
                let cosines = (ray.d.dot(end.n_g).abs(), ray.d.dot(hit.end.n_g).abs());
                let edge = Edge::between(cosines.0, cosines.1, end.p.distance_squared(hit.end.p));
                self.weights.extend(carried, *scatter, edge, share)
            }
            None => first(&hit, share),
        };
        SubpathVertex { hit, point, joins: max_roughness > 0.0, from, d: ray.d, throughput, carried, letters }
    }

    /// The next edge of a walk that is at `vertex`; false where it ends. Coordinates as with [`Subpaths::walk`].
    #[inline(always)]
    pub fn go_on<S: Stream>(&self, mode: Mode, walk: &mut Walk, vertex: &SubpathVertex<'a>, stream: &mut S, tally: &mut Tally) -> bool {
        let Some(point) = vertex.point else {
            tally.sides_disagree += 1;
            return false;
        };
        let u_lobe = stream.next_1d();
        let u = Vec2::from(stream.next_2d());
        let u_survive = stream.next_1d();
        let Some(onward) = point.scatter(mode, u_lobe, u, u_survive) else { return false };
        walk.throughput *= onward.weight;
        if self.classes {
            let (letter, factor) = event(&point, mode, &onward.scatter, onward.d, stream);
            walk.letters = walk.letters.then(letter);
            walk.throughput *= factor;
        }
        if !walk.throughput.is_finite() {
            tally.non_finite += 1;
            return false;
        }
        walk.from = point.end;
        walk.last = Some((point.end, vertex.carried, onward.scatter));
        walk.ray = point.end.ray(onward.d);
        true
    }
}

/// Lobes that make an event diffuse and those that make it glossy, with their letters.
pub const EVENTS: [(Lobes, u8); 2] = [(Lobes::Rough(1.0), b'D'), (Lobes::Smooth(1.0), b'G')];

/// The values of [`EVENTS`] at a point, for a walk in `mode` that goes on along `w`: they add up to the value of all lobes.
pub fn event_values(point: &SurfacePoint<'_>, mode: Mode, w: Vec3) -> [Rgb; 2] {
    let (wi, wo) = mode.roles(point.given_local, point.frame.to_local(w));
    EVENTS.map(|(lobes, _)| point.bsdf.eval(point.uv, wi, wo, lobes))
}

/// The letter of an event, and the factor that leaves of all lobes those the letter stands for, over the probability of the letter.
fn event<S: Stream>(point: &SurfacePoint<'_>, mode: Mode, scatter: &Scatter<f32>, d: Vec3, stream: &mut S) -> (u8, Rgb) {
    if scatter.delta {
        return (b'S', Rgb::WHITE);
    }
    let values = event_values(point, mode, d);
    let all = values[0] + values[1];
    let diffuse = values[0].mean() / all.mean();
    let (number, probability) = if stream.next_1d() < diffuse { (0, diffuse) } else { (1, 1.0 - diffuse) };
    (EVENTS[number].1, values[number].over(all) * (1.0 / probability))
}
