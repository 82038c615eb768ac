//! The recursion against the definition, on random paths given as numbers.

use super::*;
use crate::samplers::{Key, Purpose, Stream, UniformStream};
use crate::transport::densities::{FullPath, PathVertex, PathWeights};
use num_traits::{AsPrimitive, Float};

mod scenes;

/// What the light at the path's end is.
#[derive(Clone, Copy, Debug)]
enum Light {
    Surface,
    Position,
    Direction,
    Environment,
}

/// An edge, walked from the light: cosines at its two ends, squared length.
#[derive(Clone, Copy, Debug)]
struct Segment {
    cos_left: f32,
    cos_arrived: f32,
    distance2: f32,
}

/// What happens at an interior vertex: densities per steradian, or probabilities at a delta.
#[derive(Clone, Copy, Debug)]
struct Event {
    /// Of going towards the camera, for a walk from the light, and of going towards the light, for one from the camera.
    to_camera: f32,
    to_light: f32,
    /// At a delta: shading cosines on the light's and the camera's side, and the index on the camera's side over that on the light's.
    delta: Option<[f32; 3]>,
    merges: bool,
    photons: f32,
}

/// A path in f32, so that the definition in f64 and the recursion in either start from the same numbers.
#[derive(Clone, Debug)]
struct Numbers {
    light: Light,
    segments: Vec<Segment>,
    /// Interior vertices, `x_1` first.
    events: Vec<Event>,
    position: f32,
    direction: f32,
    direct: f32,
    pixel: f32,
}

fn stream(index: u64) -> UniformStream {
    Key { seed: 5, iteration: 0, index, purpose: Purpose::Test }.stream()
}

fn between(s: &mut UniformStream, low: f32, high: f32) -> f32 {
    low + (high - low) * s.next_1d()
}

/// Uniform in the logarithm.
fn size(s: &mut UniformStream, low: f32, high: f32) -> f32 {
    between(s, low.ln(), high.ln()).exp()
}

impl Numbers {
    fn random(s: &mut UniformStream) -> Self {
        let edges = 1 + (s.next_1d() * 10.0) as usize;
        let scale2 = size(s, 1e-4, 1e6);
        let light = [Light::Surface, Light::Position, Light::Direction, Light::Environment][(s.next_1d() * 4.0) as usize];
        let mut segment =
            || Segment { cos_left: between(s, 0.02, 1.0), cos_arrived: between(s, 0.02, 1.0), distance2: scale2 * size(s, 1e-2, 10.0) };
        let segments = (0..edges).map(|_| segment()).collect();
        let events = (1..edges).map(|_| Event::random(s)).collect();
        // Per area on a surface, probabilities of choice elsewhere.
        let per_area = if matches!(light, Light::Surface) { scale2.recip() } else { 1.0 };
        let disk = if matches!(light, Light::Direction | Light::Environment) { scale2.recip() } else { 1.0 };
        Self {
            light,
            segments,
            events,
            position: per_area * size(s, 0.01, 100.0),
            direction: disk * size(s, 0.01, 10.0),
            direct: per_area * size(s, 0.01, 100.0),
            pixel: size(s, 1e3, 1e7),
        }
    }

    fn edge<R: Float + 'static>(&self, i: usize) -> Edge<R>
    where
        f32: AsPrimitive<R>,
    {
        let Segment { cos_left, cos_arrived, distance2 } = self.segments[i];
        let (left, arrived, distance2) = (cos_left.as_(), cos_arrived.as_(), distance2.as_());
        match self.light {
            Light::Position if i == 0 => Edge::from_position(arrived, distance2),
            Light::Direction if i == 0 => Edge::from_direction(arrived),
            Light::Environment if i == 0 => Edge::from_environment(arrived),
            _ => Edge::between(left, arrived, distance2),
        }
    }

    /// Every technique's density, multiplied out from the definition of the measure, with no help of [`Edge`] or [`Scatter`].
    fn full(&self) -> FullPath {
        let edges = self.segments.len();
        let wide = f64::from;
        let mut vertices = vec![PathVertex::default(); edges + 1];
        for (i, event) in self.events.iter().enumerate() {
            let v = &mut vertices[i + 1];
            (v.delta, v.merges, v.photons) = (event.delta.is_some(), event.merges, wide(event.photons));
        }
        vertices[0].from_light = wide(self.position);
        vertices[edges].from_camera = 1.0;
        for (i, segment) in self.segments.iter().enumerate() {
            let far = i == 0 && matches!(self.light, Light::Direction | Light::Environment);
            let distance2 = if far { 1.0 } else { wide(segment.distance2) };
            let to_camera = match i {
                0 => wide(self.direction),
                _ => self.events[i - 1].light_measure(),
            };
            let to_light = if i + 1 == edges { wide(self.pixel) } else { wide(self.events[i].to_light) };
            vertices[i + 1].from_light = to_camera * wide(segment.cos_arrived) / distance2;
            vertices[i].from_camera = match self.light {
                Light::Position | Light::Direction if i == 0 => 0.0,
                Light::Environment if i == 0 => to_light,
                _ => to_light * wide(segment.cos_left) / distance2,
            };
        }
        FullPath::new(vertices, wide(self.direct)).unwrap()
    }

    fn recursion<R: Float + Default + AsPrimitive<f64>>(&self, sampling: &Sampling) -> PathWeights
    where
        f32: AsPrimitive<R>,
        f64: AsPrimitive<R>,
    {
        let weights = Weights::<R>::new(sampling);
        let edges = self.segments.len();
        // A surface with lobes of both kinds merges, though not where the path goes by its delta.
        let share = |i: usize| match self.events[i - 1] {
            Event { merges, delta, photons, .. } if merges || delta.is_some() => weights.share(photons.as_()),
            _ => R::zero(),
        };
        let (position, direction): (R, R) = (self.position.as_(), self.direction.as_());
        let emission = Emission { sampled: position * direction, direct: self.direct.as_() };
        let pixel: R = self.pixel.as_();

        // --- what both sides carry; light[0] is never used
        let mut light = vec![Carried::default(); edges];
        let mut camera = light.clone();
        for i in 1..edges {
            light[i] = match i {
                1 => weights.from_light(&emission, self.edge(0), share(1)),
                _ => weights.extend(&light[i - 1], self.events[i - 2].walked_from_light(), self.edge(i - 1), share(i)),
            };
        }
        for i in (0..edges).rev() {
            let (edge, own) = (self.edge::<R>(i).reversed(), if i == 0 { R::zero() } else { share(i) });
            camera[i] = match i + 1 == edges {
                true => weights.from_camera(pixel, edge, own),
                false => weights.extend(&camera[i + 1], self.events[i].walked_from_camera(), edge, own),
            };
        }

        // --- every technique that an engine would evaluate
        let rough = |i: usize| i == 0 || i == edges || self.events[i - 1].delta.is_none();
        let mut found = PathWeights { connections: vec![0.0; edges + 1], merges: vec![0.0; edges + 1] };
        if self.edge::<R>(0).back > R::zero() {
            found.connections[0] = weights.emitter_hit(&camera[0], &emission).as_();
        }
        for s in (1..=edges).filter(|&s| edges > 1 && rough(s) && rough(s - 1)) {
            // Densities per steradian at interior vertices.
            let to_light = |i: usize| -> R { self.events[i - 1].to_light.as_() };
            let to_camera = |i: usize| -> R { self.events[i - 1].to_camera.as_() };
            let edge = self.edge::<R>(s - 1);
            let weight = if s == 1 {
                weights.next_event(&camera[1], &emission, edge, to_light(1), to_camera(1))
            } else if s == edges {
                weights.splat(&Connector { carried: &light[s - 1], rev: to_light(s - 1), found: pixel * edge.back })
            } else {
                weights.connection(
                    &Connector { carried: &light[s - 1], rev: to_light(s - 1), found: to_light(s) * edge.back },
                    &Connector { carried: &camera[s], rev: to_camera(s), found: to_camera(s - 1) * edge.ahead },
                )
            };
            found.connections[s] = weight.as_();
        }
        for i in (1..edges).filter(|&i| self.events[i - 1].merges) {
            let event = self.events[i - 1];
            // A photon's own share has no say.
            let photon = Carried { share: R::nan(), ..light[i] };
            found.merges[i] = weights.merge(&photon, event.to_light.as_(), &camera[i], event.to_camera.as_()).as_();
        }
        found
    }
}

impl Event {
    fn random(s: &mut UniformStream) -> Self {
        let kind = s.next_1d();
        let mut event = Self { to_camera: 0.0, to_light: 0.0, delta: None, merges: false, photons: size(s, 1e-3, 1e3) };
        if kind < 0.3 {
            (event.to_camera, event.to_light) = (between(s, 0.05, 1.0), between(s, 0.05, 1.0));
            event.delta = match kind < 0.15 {
                true => Some([0.5, 0.5, 1.0]),
                false => Some([between(s, 0.1, 1.0), between(s, 0.1, 1.0), size(s, 0.5, 2.0)]),
            };
        } else {
            (event.to_camera, event.to_light) = (size(s, 1e-2, 1e2), size(s, 1e-2, 1e2));
            event.merges = kind < 0.85;
        }
        event
    }

    /// [`Event::to_camera`] in the measure of the definition. At a delta, `d omega` towards the light over `d omega` towards the camera is `eta^2 cos_camera / cos_light`.
    fn light_measure(&self) -> f64 {
        let [cos_light, cos_camera, eta] = self.delta.unwrap_or([1.0; 3]).map(f64::from);
        f64::from(self.to_camera) * eta * eta * cos_camera / cos_light
    }

    /// How a walk from the light goes on.
    fn walked_from_light<R: Float + 'static>(&self) -> Scatter<R>
    where
        f32: AsPrimitive<R>,
    {
        let (fwd, rev) = (self.to_camera.as_(), self.to_light.as_());
        match self.delta {
            None => Scatter::rough(fwd, rev),
            Some([_, _, 1.0]) => Scatter::reflection(fwd, rev),
            Some([light, camera, eta]) => Scatter::refraction(fwd, rev, light.as_(), camera.as_(), eta.as_()),
        }
    }

    /// How a walk from the camera goes on.
    fn walked_from_camera<R: Float + 'static>(&self) -> Scatter<R>
    where
        f32: AsPrimitive<R>,
    {
        let (fwd, rev) = (self.to_light.as_(), self.to_camera.as_());
        match self.delta {
            None => Scatter::rough(fwd, rev),
            Some([_, _, 1.0]) => Scatter::reflection(fwd, rev),
            Some([light, camera, eta]) => Scatter::refraction(fwd, rev, camera.as_(), light.as_(), AsPrimitive::<R>::as_(eta).recip()),
        }
    }
}

const SETS: [Techniques; 7] = [
    Techniques::VCM,
    Techniques::BDPT,
    Techniques::BPM,
    Techniques::LIGHT_TRACING,
    Techniques { connections: true, light_tracing: false, merges: false },
    Techniques { connections: true, light_tracing: false, merges: true },
    Techniques { connections: false, light_tracing: true, merges: true },
];

fn heuristics() -> Vec<Heuristic> {
    let mut all = vec![Heuristic::default()];
    for merges in [MergeWeights::Power, MergeWeights::VcmPlus, MergeWeights::VcmStar] {
        all.extend([1.0, 2.0, 1.5].map(|beta| Heuristic::new(merges, beta).unwrap()));
    }
    all
}

fn sampling(s: &mut UniformStream, path: &Numbers, techniques: Techniques, heuristic: Heuristic) -> Sampling {
    let room = path.segments[0].distance2.sqrt();
    let (light_paths, radius) = (f64::from(size(s, 1.0, 1e6).round()), f64::from(room * size(s, 1e-4, 0.1)));
    let camera_paths = f64::from(size(&mut stream(1_000_000 + path.segments.len() as u64), 1.0, 50.0).round());
    Sampling { techniques, heuristic, light_paths, camera_paths, radius }
}

/// Largest relative error of a weight, and largest error of their sum. Weights below `tiny` must be as small in the recursion.
fn compare<R: Float + Default + AsPrimitive<f64>>(tiny: f64) -> (f64, f64)
where
    f32: AsPrimitive<R>,
    f64: AsPrimitive<R>,
{
    let (mut relative, mut sum): (f64, f64) = (0.0, 0.0);
    for index in 0..10_000 {
        let mut s = stream(index);
        let path = Numbers::random(&mut s);
        let full = path.full();
        for techniques in SETS {
            for heuristic in heuristics() {
                let sampling = sampling(&mut s, &path, techniques, heuristic);
                let defined = full.weights(&sampling);
                let carried = path.recursion::<R>(&sampling);
                let pairs = |a: &PathWeights, b: &PathWeights| -> Vec<(f64, f64)> {
                    let of = |w: &PathWeights| w.connections.iter().chain(&w.merges).copied().collect::<Vec<_>>();
                    of(a).into_iter().zip(of(b)).collect()
                };
                for (technique, (carried, defined)) in pairs(&carried, &defined).into_iter().enumerate() {
                    assert!(carried.is_finite(), "path {index}, {sampling:?}, technique {technique}");
                    let error = if defined > tiny { (carried - defined).abs() / defined } else { f64::from(carried > 2.0 * tiny) };
                    assert!(error < 0.01, "path {index}, {sampling:?}, technique {technique}: {carried} is not {defined}; {path:?}");
                    relative = relative.max(error);
                }
                sum = sum.max((carried.total() - defined.total()).abs());
            }
        }
    }
    (relative, sum)
}

#[test]
fn recursion_is_the_definition_in_f64() {
    let (relative, sum) = compare::<f64>(0.0);
    assert!(relative <= 1e-10, "{relative:e}");
    assert!(sum <= 1e-12, "{sum:e}");
}

#[test]
fn recursion_is_the_definition_in_f32() {
    let (relative, sum) = compare::<f32>(1e-20);
    assert!(relative <= 1e-4, "{relative:e}");
    assert!(sum <= 1e-5, "{sum:e}");
}

/// Of all paths, every technique has some with a weight that is neither 0 nor 1: none is compared idly.
#[test]
fn every_technique_competes() {
    let mut competing = [0; 5];
    for index in 0..2_000 {
        let mut s = stream(index);
        let path = Numbers::random(&mut s);
        let sampling = sampling(&mut s, &path, Techniques::VCM, Heuristic::default());
        let w = path.full().weights(&sampling);
        let edges = path.segments.len();
        let inside = |x: &f64| usize::from(*x > 1e-3 && *x < 0.999);
        competing[0] += inside(&w.connections[0]);
        competing[1] += inside(&w.connections[1]);
        competing[2] += w.connections.iter().take(edges).skip(2).map(inside).sum::<usize>();
        competing[3] += if edges > 1 { inside(&w.connections[edges]) } else { 0 };
        competing[4] += w.merges.iter().map(inside).sum::<usize>();
    }
    assert!(competing.iter().all(|&n| n >= 50), "{competing:?}");
}

/// One photon number everywhere makes VCM* the balance heuristic; a factor on all of them changes VCM+ alone ([VCM* (7)]).
#[test]
fn vcm_star_is_free_of_scale() {
    let mut plus_changed = 0;
    for index in 0..2_000 {
        let mut s = stream(index);
        let mut path = Numbers::random(&mut s);
        let first = sampling(&mut s, &path, Techniques::VCM, Heuristic::default());
        for beta in [1.0, 2.0] {
            let with = |merges| Sampling { heuristic: Heuristic::new(merges, beta).unwrap(), ..first };
            let close = |a: &PathWeights, b: &PathWeights| {
                let error = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
                error(&a.connections, &b.connections).max(error(&a.merges, &b.merges)) <= 1e-12
            };
            let before = [MergeWeights::VcmStar, MergeWeights::VcmPlus].map(|m| path.recursion::<f64>(&with(m)));
            path.events.iter_mut().for_each(|e| e.photons *= 8.0);
            let after = [MergeWeights::VcmStar, MergeWeights::VcmPlus].map(|m| path.recursion::<f64>(&with(m)));
            assert!(close(&before[0], &after[0]), "path {index}");
            plus_changed += usize::from(!close(&before[1], &after[1]));

            let mut even = path.clone();
            even.events.iter_mut().for_each(|e| e.photons = 3.0);
            let star = even.recursion::<f64>(&with(MergeWeights::VcmStar));
            assert!(close(&star, &even.recursion::<f64>(&with(MergeWeights::Power))), "path {index}");
        }
    }
    assert!(plus_changed > 1_000, "{plus_changed}");
}

/// The change of solid angle at a smooth boundary against bundles of directions sent through one by finite differences.
#[test]
fn refraction_spreads_directions() {
    // Tangential components shrink by eta: (x, y, z) goes to (x, y)/eta and what z is left.
    let refract = |d: [f64; 2], eta: f64| [d[0] / eta, d[1] / eta];
    let cos = |d: [f64; 2]| (1.0 - d[0] * d[0] - d[1] * d[1]).sqrt();
    let mut s = stream(0);
    for _ in 0..100 {
        let eta = f64::from(size(&mut s, 0.7, 1.5));
        let d = [f64::from(between(&mut s, -0.4, 0.4)), f64::from(between(&mut s, -0.4, 0.4))];
        // Solid angle is the area of projected directions over the cosine.
        let h = 1e-5;
        let corner = |x: f64, y: f64| refract([d[0] + x * h, d[1] + y * h], eta);
        let (a, b, c) = (corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0));
        let area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
        let spread = (area / cos(refract(d, eta))) / (h * h / cos(d));
        let scatter = Scatter::refraction(0.25, 0.5, cos(d), cos(refract(d, eta)), eta);
        assert!((scatter.fwd * spread - 0.25).abs() < 1e-6 && scatter.rev == 0.5 && scatter.delta, "{scatter:?}, {spread}");
    }
}
