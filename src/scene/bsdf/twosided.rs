//! One-sided materials made to act on both sides.

use super::{Bsdf, BsdfSample, Lobes, Mode};
use crate::math::Rgb;
use glam::{Vec2, Vec3};

/// The front material seen from the front, the back material (or the front one again) seen from behind.
///
/// What is seen from behind is mirrored in the tangent plane: both directions change the sign of their z.
#[derive(Clone, Debug)]
pub struct TwoSided {
    /// Acts on the side of the normal. Not transmissive.
    pub front: Box<Bsdf>,
    /// Acts on the other side; the same as `front` where absent. Not transmissive.
    pub back: Option<Box<Bsdf>>,
}

impl TwoSided {
    pub(super) fn eval(&self, _uv: Vec2, _wi: Vec3, _wo: Vec3, _lobes: Lobes) -> Rgb {
        Rgb::BLACK
    }
    pub(super) fn pdf(&self, _uv: Vec2, _given: Vec3, _sampled: Vec3, _lobes: Lobes) -> f32 {
        0.0
    }
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        let (wi, wo) = mode.roles(given, sampled);
        (self.eval(uv, wi, wo, lobes), self.pdf(uv, given, sampled, lobes))
    }
    pub(super) fn sample(&self, _uv: Vec2, _given: Vec3, _mode: Mode, _lobes: Lobes, _u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        None
    }
    pub(super) fn albedo(&self, _uv: Vec2, _given: Vec3, _lobes: Lobes) -> f32 {
        0.0
    }
    pub(super) fn admitted_by(&self, _lobes: Lobes) -> bool {
        false
    }
    pub(super) fn max_roughness(&self) -> f32 {
        0.0
    }
    pub(super) fn anisotropic(&self) -> bool {
        false
    }
    pub(super) fn transmissive(&self) -> bool {
        false
    }
}
