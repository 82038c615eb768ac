//! Smooth glass.

use super::{BsdfSample, DeltaLobe, Lobes, Mode, fresnel, mirrored, same_direction};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// A smooth boundary between two dielectrics; light is reflected or refracted.
///
/// The lobe is chosen by the Fresnel term. Refracted radiance changes by the squared relative index ([VEACH 5.2]); what light paths
/// carry does not.
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
    all_deltas!();

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, mode: Mode, lobes: Lobes, u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        if !lobes.admit(0.0) || given.z == 0.0 {
            return None;
        }
        let at = fresnel::dielectric(given.z, self.eta);
        let (w, weight, probability, eta) = if u_lobe < at.reflectance {
            (Vec3::new(-given.x, -given.y, given.z), self.specular_reflectance.eval(uv), at.reflectance, 1.0)
        } else {
            let w = Vec3::new(-given.x / at.eta, -given.y / at.eta, at.cos_transmitted).normalize();
            let scale = match mode {
                Mode::Radiance => 1.0 / (at.eta * at.eta),
                Mode::Importance => 1.0,
            };
            (w, self.specular_transmittance.eval(uv) * scale, 1.0 - at.reflectance, at.eta)
        };
        // The way back is chosen with the same probability: the Fresnel term is the same from both sides.
        BsdfSample { w, weight, pdf_fwd: probability, pdf_rev: probability, delta: true, roughness: 0.0, eta }.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if !lobes.admit(0.0) || given.z == 0.0 {
            return 0.0;
        }
        let reflectance = fresnel::dielectric(given.z, self.eta).reflectance;
        self.specular_transmittance.eval(uv).lerp(self.specular_reflectance.eval(uv), reflectance).mean()
    }

    pub(super) fn delta(&self, uv: Vec2, given: Vec3, sampled: Vec3) -> Option<DeltaLobe> {
        if given.z == 0.0 {
            return None;
        }
        let at = fresnel::dielectric(given.z, self.eta);
        if given.z * sampled.z > 0.0 {
            let value = self.specular_reflectance.eval(uv) * at.reflectance;
            return same_direction(mirrored(given), sampled).then_some(DeltaLobe { probability: at.reflectance, value, eta: 1.0 });
        }
        let refracted = Vec3::new(-given.x / at.eta, -given.y / at.eta, at.cos_transmitted).normalize();
        let found = at.reflectance < 1.0 && same_direction(refracted, sampled);
        let probability = 1.0 - at.reflectance;
        found.then(|| DeltaLobe { probability, value: self.specular_transmittance.eval(uv) * probability, eta: at.eta })
    }

    pub(super) fn transmissive(&self) -> bool {
        true
    }

    pub(super) fn varies(&self) -> bool {
        self.specular_reflectance.varies() || self.specular_transmittance.varies()
    }
}
