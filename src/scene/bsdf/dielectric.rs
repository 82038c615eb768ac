//! Smooth glass.

use super::{BsdfSample, Lobes, Mode};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// A smooth boundary between two dielectrics; light is reflected or refracted.
#[derive(Clone, Debug)]
pub struct Dielectric {
    /// Index of refraction inside (against the normal) over outside (the normal's side); positive.
    pub eta: f32,
    /// Factor on reflected light, in [0, 1]; 1 is physical.
    pub specular_reflectance: Texture,
    /// Factor on transmitted light, in [0, 1]; 1 is physical.
    pub specular_transmittance: Texture,
}

impl Dielectric {
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
