//! A thin smooth pane of glass.

use super::{BsdfSample, DeltaLobe, Lobes, Mode, fresnel, mirrored, same_direction};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// A pane so thin that its two faces are one surface: light is reflected, or passes straight through.
#[derive(Clone, Debug)]
pub struct ThinDielectric {
    /// Index of refraction inside (against the normal) over outside (the normal's side); positive.
    pub eta: f32,
    /// Factor on reflected light, in [0, 1]; 1 is physical.
    pub specular_reflectance: Texture,
    /// Factor on transmitted light, in [0, 1]; 1 is physical.
    pub specular_transmittance: Texture,
}

impl ThinDielectric {
    /// Share reflected by both faces and all that happens between them: with `r` for one face, `r + (1-r)^2 r / (1-r^2)`.
    #[inline(always)]
    fn reflectance(&self, given: Vec3) -> f32 {
        let r = fresnel::dielectric(given.z.abs(), self.eta).reflectance;
        2.0 * r / (1.0 + r)
    }

    all_deltas!();

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, _mode: Mode, lobes: Lobes, u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        if !lobes.admit(0.0) || given.z == 0.0 {
            return None;
        }
        let reflectance = self.reflectance(given);
        let (w, weight, probability) = if u_lobe < reflectance {
            (Vec3::new(-given.x, -given.y, given.z), self.specular_reflectance.eval(uv), reflectance)
        } else {
            (-given, self.specular_transmittance.eval(uv), 1.0 - reflectance)
        };
        BsdfSample { w, weight, pdf_fwd: probability, pdf_rev: probability, delta: true, roughness: 0.0, eta: 1.0 }.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if !lobes.admit(0.0) || given.z == 0.0 {
            return 0.0;
        }
        self.specular_transmittance.eval(uv).lerp(self.specular_reflectance.eval(uv), self.reflectance(given)).mean()
    }

    pub(super) fn delta(&self, uv: Vec2, given: Vec3, sampled: Vec3) -> Option<DeltaLobe> {
        if given.z == 0.0 {
            return None;
        }
        let reflectance = self.reflectance(given);
        let reflected = given.z * sampled.z > 0.0;
        let (w, factor, probability) = match reflected {
            true => (mirrored(given), &self.specular_reflectance, reflectance),
            false => (-given, &self.specular_transmittance, 1.0 - reflectance),
        };
        same_direction(w, sampled).then(|| DeltaLobe { probability, value: factor.eval(uv) * probability, eta: 1.0 })
    }

    pub(super) fn transmissive(&self) -> bool {
        true
    }

    pub(super) fn varies(&self) -> bool {
        self.specular_reflectance.varies() || self.specular_transmittance.varies()
    }
}
