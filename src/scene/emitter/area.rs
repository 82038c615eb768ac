//! A shape that shines.

use super::{EmissionPdf, Emitted, LightPoint};
use crate::math::distribution::Discrete;
use crate::math::elementary::sin_cos_turns;
use crate::math::{AreaPdf, Frame, Rgb, SolidAnglePdf, warp};
use crate::scene::ShapeId;
use crate::scene::hit::Endpoint;
use crate::scene::shape::quadric::Quadric;
use crate::scene::shape::surface::{SurfacePoint, Surfaces};
use crate::scene::texture::Texture;
use glam::{DVec3, Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, PI};
use std::f64::consts::TAU;
use std::ops::Range;

/// Radiance leaving a shape's emitting side, the same in all directions.
#[derive(Clone, Debug)]
pub struct Area {
    shape: ShapeId,
    radiance: Texture,
    /// The shape's first primitive.
    first: usize,
    /// Choice of a primitive by area, where there are several.
    choice: Option<Discrete>,
    /// Area of the shape, world units squared.
    area: f32,
    /// Density of a point chosen uniformly by area.
    pdf: AreaPdf,
    /// Centre and radius, if it is a sphere that shines outwards.
    sphere: Option<(DVec3, f64)>,
}

/// A light sample on a surface, the choice of emitter not included.
pub(super) struct AreaSample {
    pub(super) end: Endpoint,
    pub(super) wi: Vec3,
    pub(super) distance: f32,
    pub(super) cos_light: f32,
    pub(super) radiance: Rgb,
    pub(super) pdf: SolidAnglePdf,
}

/// Points at which the mean of a textured radiance is taken.
const MEAN_POINTS: u32 = 4096;

impl Area {
    /// A light on these primitives of the scene.
    pub(in crate::scene) fn new(shape: ShapeId, radiance: Texture, primitives: Range<usize>, surfaces: &Surfaces) -> Self {
        let area: f64 = primitives.clone().map(|i| surfaces.area(i)).sum();
        let choice = if primitives.len() > 1 { Discrete::new(primitives.clone().map(|i| surfaces.area(i))) } else { None };
        let sphere = if primitives.len() == 1 { surfaces.as_quadric(primitives.start).and_then(Quadric::outward_sphere) } else { None };
        Self { shape, radiance, first: primitives.start, choice, area: area as f32, pdf: AreaPdf(1.0 / area as f32), sphere }
    }

    /// The shape that shines.
    pub fn shape(&self) -> ShapeId {
        self.shape
    }

    /// Its radiance, W/(m^2 sr).
    pub fn radiance(&self) -> &Texture {
        &self.radiance
    }

    /// Its area, world units squared.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// Flux, W: `pi` times area times mean radiance. What interpolated normals hide at grazing angles is not subtracted.
    pub(super) fn power(&self, surfaces: &Surfaces) -> Rgb {
        let mean = match &self.radiance {
            Texture::Constant(radiance) => *radiance,
            // No primitive to take a mean over, and no light to lose.
            _ if self.area <= 0.0 => Rgb::BLACK,
            texture => {
                // The generalised golden ratio's lattice: even cover, the same in every run ([ROBERTS18]).
                let point = |i: u32| {
                    let turn = |step: f64| (f64::from(i) * step).fract() as f32;
                    let u = Vec2::new(turn(0.754_877_666_246_692_7), turn(0.569_840_290_998_053_2));
                    texture.eval(self.sample_position(surfaces, (i as f32 + 0.5) / MEAN_POINTS as f32, u).uv)
                };
                (0..MEAN_POINTS).map(point).sum::<Rgb>() / MEAN_POINTS as f32
            }
        };
        mean * (PI * self.area)
    }

    /// A point, uniform by area.
    #[inline(always)]
    fn sample_position(&self, surfaces: &Surfaces, u_primitive: f32, u: Vec2) -> SurfacePoint {
        let index = self.choice.as_ref().map_or(0, |choice| choice.sample(u_primitive).index);
        surfaces.sample(self.first + index, u)
    }

    /// Is direct sampling a point uniform by area, wherever it is seen from?
    pub(super) fn by_area(&self) -> bool {
        self.sphere.is_none()
    }

    /// The point that [`Area::sample_direct`] looks at, where that is uniform by area.
    #[inline(always)]
    pub(super) fn sample_point(&self, surfaces: &Surfaces, pick: f32, u_primitive: f32, u: Vec2) -> LightPoint {
        let point = self.sample_position(surfaces, u_primitive, u);
        let end = Endpoint { n_g: emitting_normal(point.end.n_g, point.n_s), ..point.end };
        LightPoint { end, n_s: point.n_s, radiance: self.radiance.eval(point.uv), pdf: self.pdf, pick }
    }

    /// A sphere seen from outside fills a cone, which is sampled instead of its area.
    #[inline]
    fn cone(&self, from: Vec3) -> Option<Cone> {
        let (center, radius) = self.sphere?;
        Cone::new(from, center, radius)
    }

    #[inline(never)]
    fn sample_cone(&self, cone: &Cone, surfaces: &Surfaces, from: Vec3, u: Vec2) -> Option<AreaSample> {
        let quadric = surfaces.as_quadric(self.first)?;
        let (outward, wi, cos_light) = cone.sample(u);
        let end = quadric.in_direction(outward)?;
        let radiance = match &self.radiance {
            Texture::Constant(radiance) => *radiance,
            // Coordinates cost more than all the rest, and few lights are textured.
            texture => texture.eval(quadric.uv_in_direction(outward)),
        };
        (cos_light > 0.0).then(|| AreaSample { end, wi, distance: end.p.distance(from), cos_light, radiance, pdf: cone.pdf() })
    }

    #[inline(always)]
    pub(super) fn sample_direct(&self, surfaces: &Surfaces, from: Vec3, u_primitive: f32, u: Vec2) -> Option<AreaSample> {
        if let Some(cone) = self.cone(from) {
            let AreaSample { end: Endpoint { p, n_g, offset }, wi, distance, cos_light, radiance, pdf } =
                self.sample_cone(&cone, surfaces, from, u)?;
            return Some(AreaSample { end: Endpoint { p, n_g, offset }, wi, distance, cos_light, radiance, pdf });
        }
        let point = self.sample_position(surfaces, u_primitive, u);
        let to_light = point.end.p - from;
        // Which side is seen does not wait for the length: a cosine times the distance so far.
        let cos_light = emission_cosine(point.end.n_g, point.n_s, -to_light)?;
        let distance2 = to_light.length_squared();
        let distance = distance2.sqrt();
        let wi = to_light * (1.0 / distance);
        let cos_light = cos_light * (1.0 / distance);
        let pdf = self.pdf.to_solid_angle(cos_light, distance2);
        Some(AreaSample { end: point.end, wi, distance, cos_light, radiance: self.radiance.eval(point.uv), pdf })
    }

    /// What a point of the shape emits along `wo` towards `from`; the choice of emitter is not included in the density.
    #[inline]
    pub(super) fn emitted(&self, end: &Endpoint, n_s: Vec3, uv: Vec2, wo: Vec3, from: Vec3) -> Emitted {
        let Some(cos_light) = emission_cosine(end.n_g, n_s, wo) else {
            return Emitted::default();
        };
        Emitted { radiance: self.radiance.eval(uv), pdf_direct: self.pdf_direct(end, cos_light, from) }
    }

    /// Density with which direct sampling at `from` gives the direction to a point of the shape, which is seen under `cos_light`; the choice
    /// of emitter is not included.
    #[inline]
    pub(super) fn pdf_direct(&self, end: &Endpoint, cos_light: f32, from: Vec3) -> SolidAnglePdf {
        match self.cone(from) {
            Some(cone) => cone.pdf(),
            None => self.pdf.to_solid_angle(cos_light, end.p.distance_squared(from)),
        }
    }

    /// A position uniform by area, and a direction in proportion to the cosine there; `None` below the shading normal's horizon.
    #[inline]
    pub(super) fn sample_emission(
        &self,
        surfaces: &Surfaces,
        u_primitive: f32,
        u: Vec2,
        u_direction: Vec2,
    ) -> Option<(Endpoint, Vec3, f32, Rgb)> {
        let point = self.sample_position(surfaces, u_primitive, u);
        let n = emitting_normal(point.end.n_g, point.n_s);
        let local = warp::cosine_hemisphere(u_direction);
        let d = Frame::from_normal(n).to_world(local);
        (d.dot(point.n_s) > 0.0).then(|| (point.end, d, local.z, self.radiance.eval(point.uv)))
    }

    /// Densities of [`Area::sample_emission`] under this cosine.
    #[inline]
    pub(super) fn emission_pdf(&self, cos_light: f32) -> EmissionPdf {
        EmissionPdf { position: self.pdf, direction: SolidAnglePdf(cos_light * FRAC_1_PI) }
    }

    pub(super) fn memory(&self) -> usize {
        self.choice.as_ref().map_or(0, Discrete::memory)
    }
}

/// The geometric normal turned to the side of the shading normal.
#[inline(always)]
fn emitting_normal(n_g: Vec3, n_s: Vec3) -> Vec3 {
    if n_g.dot(n_s) < 0.0 { -n_g } else { n_g }
}

/// Cosine between `d` and the emitting side's geometric normal; `None` for a direction into which nothing is emitted.
#[inline(always)]
pub(super) fn emission_cosine(n_g: Vec3, n_s: Vec3, d: Vec3) -> Option<f32> {
    let cos = emitting_normal(n_g, n_s).dot(d);
    (cos > 0.0 && n_s.dot(d) > 0.0).then_some(cos)
}

/// The directions in which a sphere is seen from outside.
struct Cone {
    /// Unit direction to the centre.
    axis: DVec3,
    /// Radius over distance to the centre: the sine of the half-angle, below 1.
    sin_max: f64,
}

impl Cone {
    #[inline]
    fn new(from: Vec3, center: DVec3, radius: f64) -> Option<Self> {
        let to_center = center - from.as_dvec3();
        let distance = to_center.length();
        (distance > radius).then(|| Self { axis: to_center / distance, sin_max: radius / distance })
    }

    /// `1 - cos` of the half-angle, without cancellation.
    #[inline]
    fn one_minus_cos(&self) -> f64 {
        let sin2 = self.sin_max * self.sin_max;
        sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
    }

    #[inline]
    fn pdf(&self) -> SolidAnglePdf {
        SolidAnglePdf((1.0 / (TAU * self.one_minus_cos())) as f32)
    }

    /// A direction uniform in the cone: the outward unit vector of the point seen there, the direction, and the cosine at the light
    /// ([PBRT 6.2.4]).
    #[inline]
    fn sample(&self, u: Vec2) -> (DVec3, Vec3, f32) {
        let one_minus_cos = f64::from(u.x) * self.one_minus_cos();
        let cos = 1.0 - one_minus_cos;
        let sin2 = one_minus_cos * (1.0 + cos);
        let sin = sin2.sqrt();
        // The law of sines: the sine of the angle at the light.
        let sin_light = (sin / self.sin_max).min(1.0);
        let cos_light = (1.0 - sin_light * sin_light).sqrt();
        // The angle at the centre is what the other two leave.
        let (sin_center, cos_center) = (sin_light * cos - cos_light * sin, cos_light * cos + sin_light * sin);
        let (s, c) = sin_cos_turns(u.y);
        let (across_s, across_t) = self.axis.any_orthonormal_pair();
        let across = across_s * f64::from(c) + across_t * f64::from(s);
        let wi = self.axis * cos + across * sin;
        ((across * sin_center - self.axis * cos_center).normalize_or(DVec3::Z), wi.as_vec3(), cos_light as f32)
    }
}
