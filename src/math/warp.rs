//! Maps from the unit square to directions and surfaces, each beside its density. Every `u` component lies in [0, 1).

use super::elementary::{sin_cos_eighth, sin_cos_turns};
use super::measure::SolidAnglePdf;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, TAU};

/// Uniform on the unit disk, by the concentric map; density `1/pi`.
#[inline(always)]
pub fn disk(u: Vec2) -> Vec2 {
    let o = 2.0 * u - Vec2::ONE;
    if o == Vec2::ZERO {
        return Vec2::ZERO;
    }
    // Choices of values, not of ways: which half a point falls into cannot be predicted.
    let wide = o.x.abs() > o.y.abs();
    let (r, other) = if wide { (o.x, o.y) } else { (o.y, o.x) };
    let (sin, cos) = sin_cos_eighth(FRAC_PI_4 * (other / r));
    if wide { Vec2::new(r * cos, r * sin) } else { Vec2::new(r * sin, r * cos) }
}

/// Cosine-weighted directions on the hemisphere around +z.
#[inline(always)]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = disk(u);
    d.extend((1.0 - d.length_squared()).max(LOWEST_COSINE2).sqrt())
}

/// Least square of the cosine of [`cosine_hemisphere`]: it keeps the direction strictly above the surface, so that its density is positive.
pub(super) const LOWEST_COSINE2: f32 = 1e-14;

/// Density of [`cosine_hemisphere`]; 0 below the surface.
#[inline(always)]
pub fn cosine_hemisphere_pdf(cos: f32) -> SolidAnglePdf {
    SolidAnglePdf(cos.max(0.0) * FRAC_1_PI)
}

/// Uniform directions on the whole sphere; density `1/(4 pi)`.
#[inline]
pub fn sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos_turns(u.y);
    Vec3::new(r * cos, r * sin, z)
}

/// Density of [`sphere`].
pub const SPHERE_PDF: SolidAnglePdf = SolidAnglePdf(FRAC_1_PI * 0.25);

/// Uniform directions in the cone around +z whose half-angle has `1 - cos = one_minus_cos_max`.
///
/// The cone is given by `1 - cos` because the cosine itself has no digits left for narrow cones.
#[inline]
pub fn cone(u: Vec2, one_minus_cos_max: f32) -> Vec3 {
    let h = u.x * one_minus_cos_max;
    let sin = (h * (2.0 - h)).max(0.0).sqrt();
    let (s, c) = sin_cos_turns(u.y);
    Vec3::new(sin * c, sin * s, 1.0 - h)
}

/// Density of [`cone`] inside it.
#[inline(always)]
pub fn cone_pdf(one_minus_cos_max: f32) -> SolidAnglePdf {
    SolidAnglePdf(1.0 / (TAU * one_minus_cos_max))
}

/// Uniform barycentric weights of a triangle's second and third vertex; density `1/area`.
#[inline]
pub fn triangle(u: Vec2) -> Vec2 {
    let s = (1.0 - u.x).max(0.0).sqrt();
    Vec2::new(1.0 - s, u.y * s)
}
