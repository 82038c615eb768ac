//! The light's end of a path: the scene's answers in the measures that weights ask for.

use super::carried::{Edge, Emission};
use crate::math::SolidAnglePdf;
use crate::scene::Scene;
use crate::scene::emitter::{DirectSample, EmissionPdf, EmissionSample, EmitterKind};
use crate::scene::hit::{Endpoint, Hit};
use glam::Vec3;

/// A light and the edge from it to the path's next vertex `x_1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightEnd {
    /// Densities at the light.
    pub emission: Emission<f32>,
    /// From the light to `x_1`; a camera's walk that finds the light goes it [`Edge::reversed`].
    pub edge: Edge<f32>,
}

/// Cosines and squared length of the edge.
struct Geometry {
    cos_light: f32,
    cos_surface: f32,
    distance2: f32,
}

impl LightEnd {
    /// `direct` is what the scene says for a light sample at `x_1`: per steradian, or the choice's probability for a light that is a single
    /// position or direction.
    fn new(kind: EmitterKind, emission: EmissionPdf, direct: SolidAnglePdf, geometry: &Geometry) -> Self {
        let Geometry { cos_light, cos_surface, distance2 } = *geometry;
        let (direct, edge) = match kind {
            EmitterKind::Surface => (direct.to_area(cos_light, distance2).0, Edge::between(cos_light, cos_surface, distance2)),
            EmitterKind::DeltaPosition => (direct.0, Edge::from_position(cos_surface, distance2)),
            EmitterKind::DeltaDirection => (direct.0, Edge::from_direction(cos_surface)),
            EmitterKind::Infinite => (direct.0, Edge::from_environment(cos_surface)),
        };
        Self { emission: Emission { sampled: emission.position.0 * emission.direction.0, direct }, edge }
    }

    /// Of a light sample drawn at the surface point `at`.
    #[inline]
    pub fn of_direct(scene: &Scene, sample: &DirectSample, at: &Endpoint) -> Self {
        let geometry = Geometry {
            cos_light: sample.cos_light,
            cos_surface: sample.wi.dot(at.n_g).abs(),
            distance2: sample.distance * sample.distance,
        };
        Self::new(sample.kind, scene.emission_pdf_direct(sample), sample.pdf, &geometry)
    }

    /// Of a ray of light that reached the surface point `at`.
    #[inline]
    pub fn of_emission(scene: &Scene, sample: &EmissionSample, at: &Endpoint) -> Self {
        let emission = EmissionPdf { position: sample.pdf_position, direction: sample.pdf_direction };
        let geometry = Geometry {
            cos_light: sample.cos_light,
            cos_surface: sample.d.dot(at.n_g).abs(),
            distance2: at.p.distance_squared(sample.end.p),
        };
        Self::new(sample.kind, emission, scene.direct_pdf(sample, at.p), &geometry)
    }

    /// Of a light that a ray along `d` from the surface point `from` hit; `None` where it does not shine back. A camera that sees a light
    /// directly needs no weight.
    #[inline]
    pub fn of_hit(scene: &Scene, hit: &Hit, d: Vec3, from: &Endpoint) -> Option<Self> {
        let emission = scene.emission_pdf(hit, -d);
        let direct = scene.emitted(hit, -d, from.p).pdf_direct;
        let geometry = Geometry {
            cos_light: d.dot(hit.end.n_g).abs(),
            cos_surface: d.dot(from.n_g).abs(),
            distance2: hit.end.p.distance_squared(from.p),
        };
        (emission.direction.0 > 0.0).then(|| Self::new(EmitterKind::Surface, emission, direct, &geometry))
    }

    /// Of the light all around that a ray along `d` from the surface point `from` escaped to; `None` where none comes from.
    #[inline]
    pub fn of_escape(scene: &Scene, d: Vec3, from: &Endpoint) -> Option<Self> {
        let emission = scene.emission_pdf_escaped(d);
        let geometry = Geometry { cos_light: 1.0, cos_surface: d.dot(from.n_g).abs(), distance2: f32::INFINITY };
        (emission.direction.0 > 0.0).then(|| Self::new(EmitterKind::Infinite, emission, scene.escaped(d).pdf_direct, &geometry))
    }
}
