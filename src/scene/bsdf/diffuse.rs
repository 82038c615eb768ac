//! Lambertian reflection, black from behind.

use super::{BsdfSample, Lobes, Mode};
use crate::math::{Rgb, warp};
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// `reflectance / pi` where both directions lie on the normal's side.
#[derive(Clone, Debug)]
pub struct Diffuse {
    /// Share of light reflected, per colour, in [0, 1].
    pub reflectance: Texture,
}

impl Diffuse {
    #[inline(always)]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        if wi.z <= 0.0 || wo.z <= 0.0 || !lobes.admit(1.0) {
            return Rgb::BLACK;
        }
        self.reflectance.eval(uv) * FRAC_1_PI
    }

    #[inline(always)]
    pub(super) fn pdf(&self, _uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 || sampled.z <= 0.0 || !lobes.admit(1.0) {
            return 0.0;
        }
        warp::cosine_hemisphere_pdf(sampled.z).0
    }

    #[inline(always)]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, _mode: Mode, lobes: Lobes, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if given.z <= 0.0 || !lobes.admit(1.0) {
            return None;
        }
        let w = warp::cosine_hemisphere(u);
        Some(BsdfSample {
            w,
            weight: self.reflectance.eval(uv),
            pdf_fwd: warp::cosine_hemisphere_pdf(w.z).0,
            pdf_rev: warp::cosine_hemisphere_pdf(given.z).0,
            delta: false,
            roughness: 1.0,
            eta: 1.0,
        })
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 || !lobes.admit(1.0) { 0.0 } else { self.reflectance.eval(uv).mean() }
    }

    #[inline(always)]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, _mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        (self.eval(uv, sampled, given, lobes), self.pdf(uv, given, sampled, lobes))
    }

    #[inline]
    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        lobes.admit(1.0)
    }

    #[inline(always)]
    pub(super) fn max_roughness(&self) -> f32 {
        1.0
    }

    pub(super) fn anisotropic(&self) -> bool {
        false
    }

    no_delta!();

    pub(super) fn transmissive(&self) -> bool {
        false
    }

    pub(super) fn varies(&self) -> bool {
        self.reflectance.varies()
    }
}
