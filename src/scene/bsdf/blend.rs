//! A weighted sum of two materials.

use super::{Bsdf, BsdfSample, Lobes, Mode};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// `(1 - weight) first + weight second`.
#[derive(Clone, Debug)]
pub struct Blend {
    /// Share of the second material, by [`Texture::eval_1`]; outside [0, 1] the nearer end counts.
    pub weight: Texture,
    /// Where the weight is 0.
    pub first: Box<Bsdf>,
    /// Where the weight is 1.
    pub second: Box<Bsdf>,
}

impl Blend {
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
