//! A diffuse base under a smooth dielectric coat, black from behind.

use super::{BsdfSample, DeltaLobe, Lobes, Mode, fresnel, mirrored, same_direction};
use crate::math::{Rgb, warp};
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Smooth plastic: `F R_s` in the mirror direction, and `(1-F_i)(1-F_o) k_d / (pi eta^2 (1 - R))` with `R` what the coat's inside
/// reflects of diffuse light, times `k_d` if nonlinear (\[DEON11\] and, for many bounces, the geometric series). Made by [`Plastic::new`].
#[derive(Clone, Debug)]
pub struct Plastic {
    /// Index of refraction of the coat over that outside; positive.
    eta: f32,
    diffuse_reflectance: Texture,
    specular_reflectance: Texture,
    nonlinear: bool,
    /// Share of the specular lobe in the choice of a lobe, before the Fresnel term: from the textures' means.
    specular_weight: f32,
    /// Share of the diffuse light inside that the coat reflects back in.
    internal_reflectance: f32,
}

/// Share of the specular lobe in the choice of a lobe, by the textures' mean values.
pub(super) fn specular_weight(diffuse: &Texture, specular: &Texture) -> f32 {
    let (d, s) = (diffuse.mean().mean(), specular.mean().mean());
    if d + s > 0.0 { s / (d + s) } else { 0.0 }
}

/// Albedo of the base seen through the coat's inside: `k_d / (1 - R)`, or `k_d / (1 - k_d R)` if nonlinear.
#[inline(always)]
pub(super) fn base_albedo(diffuse: Rgb, internal_reflectance: f32, nonlinear: bool) -> Rgb {
    if nonlinear { diffuse / (Rgb::WHITE - diffuse * internal_reflectance) } else { diffuse / (1.0 - internal_reflectance) }
}

impl Plastic {
    /// A coat of relative index `eta` (coat over outside) over a base of albedo `diffuse_reflectance`; `specular_reflectance` multiplies
    /// what the coat reflects, `nonlinear` lets the colour shift with multiple reflection inside.
    pub fn new(eta: f32, diffuse_reflectance: Texture, specular_reflectance: Texture, nonlinear: bool) -> Self {
        let specular_weight = specular_weight(&diffuse_reflectance, &specular_reflectance);
        let internal_reflectance = fresnel::diffuse_reflectance(1.0 / eta);
        Self { eta, diffuse_reflectance, specular_reflectance, nonlinear, specular_weight, internal_reflectance }
    }

    #[inline(always)]
    pub(super) fn diffuse_reflectance(&self) -> &Texture {
        &self.diffuse_reflectance
    }

    /// Probability of the specular lobe where the coat reflects `reflectance`; `None` if nothing can be sampled.
    #[inline(always)]
    fn p_specular(&self, reflectance: f32, lobes: Lobes) -> Option<f32> {
        match (lobes.admit(0.0), lobes.admit(1.0)) {
            (true, true) => {
                let (s, d) = (reflectance * self.specular_weight, (1.0 - reflectance) * (1.0 - self.specular_weight));
                (s + d > 0.0).then(|| s / (s + d))
            }
            (true, false) => Some(1.0),
            (false, true) => Some(0.0),
            (false, false) => None,
        }
    }

    #[inline(always)]
    fn diffuse(&self, uv: Vec2, reflectance_a: f32, reflectance_b: f32) -> Rgb {
        base_albedo(self.diffuse_reflectance.eval(uv), self.internal_reflectance, self.nonlinear)
            * ((1.0 - reflectance_a) * (1.0 - reflectance_b) * FRAC_1_PI / (self.eta * self.eta))
    }

    #[inline(always)]
    fn reflectance(&self, w: Vec3) -> f32 {
        fresnel::dielectric(w.z, self.eta).reflectance
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        if wi.z <= 0.0 || wo.z <= 0.0 || !lobes.admit(1.0) {
            return Rgb::BLACK;
        }
        self.diffuse(uv, self.reflectance(wi), self.reflectance(wo))
    }

    #[inline]
    pub(super) fn pdf(&self, _uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 || sampled.z <= 0.0 || !lobes.admit(1.0) {
            return 0.0;
        }
        self.p_specular(self.reflectance(given), lobes).map_or(0.0, |p| (1.0 - p) * sampled.z * FRAC_1_PI)
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, _mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        if given.z <= 0.0 || sampled.z <= 0.0 || !lobes.admit(1.0) {
            return (Rgb::BLACK, 0.0);
        }
        let reflectance = self.reflectance(given);
        let pdf = self.p_specular(reflectance, lobes).map_or(0.0, |p| (1.0 - p) * sampled.z * FRAC_1_PI);
        (self.diffuse(uv, reflectance, self.reflectance(sampled)), pdf)
    }

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, _mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if given.z <= 0.0 {
            return None;
        }
        let reflectance = self.reflectance(given);
        let p = self.p_specular(reflectance, lobes)?;
        if u_lobe < p {
            let w = Vec3::new(-given.x, -given.y, given.z);
            let weight = self.specular_reflectance.eval(uv) * (reflectance / p);
            return BsdfSample { w, weight, pdf_fwd: p, pdf_rev: p, delta: true, roughness: 0.0, eta: 1.0 }.if_not_black();
        }
        let w = warp::cosine_hemisphere(u);
        let reflectance_w = self.reflectance(w);
        let pdf_fwd = (1.0 - p) * w.z * FRAC_1_PI;
        if pdf_fwd <= 0.0 {
            return None;
        }
        let pdf_rev = self.p_specular(reflectance_w, lobes).map_or(0.0, |p| (1.0 - p) * given.z * FRAC_1_PI);
        let weight = self.diffuse(uv, reflectance, reflectance_w) * (w.z / pdf_fwd);
        BsdfSample { w, weight, pdf_fwd, pdf_rev, delta: false, roughness: 1.0, eta: 1.0 }.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 {
            return 0.0;
        }
        let reflectance = self.reflectance(given);
        let specular = if lobes.admit(0.0) { self.specular_reflectance.eval(uv).mean() * reflectance } else { 0.0 };
        if !lobes.admit(1.0) {
            return specular;
        }
        // The mean of (1-F_o)/eta^2 over the hemisphere is what gets out: 1 - R.
        let base = base_albedo(self.diffuse_reflectance.eval(uv), self.internal_reflectance, self.nonlinear).mean();
        specular + (1.0 - reflectance) * (1.0 - self.internal_reflectance) * base
    }

    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        lobes.admit(0.0) || lobes.admit(1.0)
    }

    pub(super) fn max_roughness(&self) -> f32 {
        1.0
    }

    pub(super) fn anisotropic(&self) -> bool {
        false
    }

    pub(super) fn delta(&self, uv: Vec2, given: Vec3, sampled: Vec3) -> Option<DeltaLobe> {
        if given.z <= 0.0 || !same_direction(mirrored(given), sampled) {
            return None;
        }
        let reflectance = self.reflectance(given);
        let value = self.specular_reflectance.eval(uv) * reflectance;
        self.p_specular(reflectance, Lobes::All).map(|probability| DeltaLobe { probability, value, eta: 1.0 })
    }

    pub(super) fn transmissive(&self) -> bool {
        false
    }

    pub(super) fn varies(&self) -> bool {
        self.diffuse_reflectance.varies() || self.specular_reflectance.varies()
    }
}
