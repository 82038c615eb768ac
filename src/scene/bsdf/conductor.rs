//! Smooth metal, black from behind.

use super::{BsdfSample, DeltaLobe, Lobes, Mode, fresnel, mirrored, same_direction};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// Mirror reflection weighted by the Fresnel term of a metal.
#[derive(Clone, Debug)]
pub struct Conductor {
    /// Real part of the complex index of refraction, relative to the outside.
    pub eta: Rgb,
    /// Imaginary part of the complex index of refraction, relative to the outside.
    pub k: Rgb,
    /// Factor on reflected light, in [0, 1]; 1 is physical.
    pub specular_reflectance: Texture,
}

impl Conductor {
    all_deltas!();

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, _mode: Mode, lobes: Lobes, _u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        if given.z <= 0.0 || !lobes.admit(0.0) {
            return None;
        }
        let weight = fresnel::conductor(given.z, self.eta, self.k) * self.specular_reflectance.eval(uv);
        let w = Vec3::new(-given.x, -given.y, given.z);
        BsdfSample { w, weight, pdf_fwd: 1.0, pdf_rev: 1.0, delta: true, roughness: 0.0, eta: 1.0 }.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 || !lobes.admit(0.0) {
            return 0.0;
        }
        (fresnel::conductor(given.z, self.eta, self.k) * self.specular_reflectance.eval(uv)).mean()
    }

    pub(super) fn delta(&self, uv: Vec2, given: Vec3, sampled: Vec3) -> Option<DeltaLobe> {
        let value = || fresnel::conductor(given.z, self.eta, self.k) * self.specular_reflectance.eval(uv);
        (given.z > 0.0 && same_direction(mirrored(given), sampled)).then(|| DeltaLobe { probability: 1.0, value: value(), eta: 1.0 })
    }

    pub(super) fn transmissive(&self) -> bool {
        false
    }

    pub(super) fn varies(&self) -> bool {
        self.specular_reflectance.varies()
    }
}
