//! The energy-conserving Phong model. Mitsuba 3 has no such material.

use super::{BsdfSample, Lobes, Mode};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// `k_d / pi + k_s (n + 2)/(2 pi) cos^n(alpha)`, alpha between the mirror direction and the other ([LW94], [THESIS (3.1)]); black
/// from behind.
#[derive(Clone, Debug)]
pub struct Phong {
    /// `k_d`, the diffuse albedo. `k_d + k_s <= 1` everywhere conserves energy.
    pub diffuse_reflectance: Texture,
    /// `k_s`, the albedo of the specular lobe at normal incidence.
    pub specular_reflectance: Texture,
    /// `n`, the lobe's exponent, >= 0.
    pub exponent: f32,
}

impl Phong {
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
