//! A diffuse base under a smooth dielectric coat, black from behind.

use super::{BsdfSample, Lobes, Mode};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// Smooth plastic. Made by [`Plastic::new`].
#[derive(Clone, Debug)]
pub struct Plastic {
    /// Index of refraction of the coat over that outside; greater than 0.
    eta: f32,
    /// Albedo of the base, in [0, 1].
    diffuse_reflectance: Texture,
    /// Factor on light reflected by the coat, in [0, 1]; 1 is physical.
    specular_reflectance: Texture,
    /// Does the colour shift with multiple reflection inside the coat?
    nonlinear: bool,
}

impl Plastic {
    /// A coat of relative index `eta` (coat over outside) over a base of albedo `diffuse_reflectance`; `specular_reflectance` multiplies
    /// what the coat reflects, `nonlinear` lets the colour shift with multiple reflection inside.
    pub fn new(eta: f32, diffuse_reflectance: Texture, specular_reflectance: Texture, nonlinear: bool) -> Self {
        Self { eta, diffuse_reflectance, specular_reflectance, nonlinear }
    }
}

impl Plastic {
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
