//! The energy-conserving Phong model. Mitsuba 3 has no such material.

use super::{BsdfSample, Lobes, Mode};
use crate::math::elementary::sin_cos_turns;
use crate::math::{Frame, Rgb, warp};
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, TAU};

/// `k_d / pi + k_s (n + 2)/(2 pi) cos^n(alpha)`, alpha between the mirror direction and the other (\[LW94\], [THESIS (3.1)]); black
/// from behind.
///
/// One lobe is sampled, with its mean albedo as the odds. What the specular lobe sends below the surface is lost.
#[derive(Clone, Debug)]
pub struct Phong {
    /// `k_d`, the diffuse albedo. `k_d + k_s <= 1` everywhere conserves energy.
    pub diffuse_reflectance: Texture,
    /// `k_s`, the albedo of the specular lobe at normal incidence.
    pub specular_reflectance: Texture,
    /// `n`, the lobe's exponent, >= 0.
    pub exponent: f32,
}

/// What the lobes asked for come to at one point.
struct Local {
    diffuse: Rgb,
    specular: Rgb,
    /// Probability of sampling the specular lobe.
    p_specular: f32,
}

impl Phong {
    #[inline(always)]
    fn specular_roughness(&self) -> f32 {
        (2.0 / (self.exponent + 2.0)).sqrt()
    }

    /// `None` where no lobe asked for reflects anything.
    #[inline(always)]
    fn local(&self, uv: Vec2, lobes: Lobes) -> Option<Local> {
        let diffuse = if lobes.admit(1.0) { self.diffuse_reflectance.eval(uv) } else { Rgb::BLACK };
        let specular = if lobes.admit(self.specular_roughness()) { self.specular_reflectance.eval(uv) } else { Rgb::BLACK };
        let (d, s) = (diffuse.mean(), specular.mean());
        (d + s > 0.0).then(|| Local { diffuse, specular, p_specular: s / (d + s) })
    }

    /// `cos^n(alpha) / (2 pi)`: symmetric in its directions.
    #[inline(always)]
    fn lobe(&self, a: Vec3, b: Vec3) -> f32 {
        let cos_alpha = a.z * b.z - a.x * b.x - a.y * b.y;
        if cos_alpha <= 0.0 { 0.0 } else { cos_alpha.min(1.0).powf(self.exponent) * (1.0 / TAU) }
    }

    #[inline(always)]
    fn value(&self, local: &Local, lobe: f32) -> Rgb {
        local.diffuse * FRAC_1_PI + local.specular * ((self.exponent + 2.0) * lobe)
    }

    #[inline(always)]
    fn density(&self, local: &Local, lobe: f32, cos_sampled: f32) -> f32 {
        local.p_specular * (self.exponent + 1.0) * lobe + (1.0 - local.p_specular) * cos_sampled * FRAC_1_PI
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        self.eval_pdf(uv, wo, wi, Mode::Radiance, lobes).0
    }

    #[inline]
    pub(super) fn pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        self.eval_pdf(uv, given, sampled, Mode::Radiance, lobes).1
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, _mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        let (f, [pdf, _]) = self.eval_pdfs(uv, given, sampled, lobes);
        (f, pdf)
    }

    #[inline(always)]
    pub(super) fn eval_pdfs(&self, uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> (Rgb, [f32; 2]) {
        if given.z <= 0.0 || sampled.z <= 0.0 {
            return (Rgb::BLACK, [0.0; 2]);
        }
        let Some(local) = self.local(uv, lobes) else { return (Rgb::BLACK, [0.0; 2]) };
        let lobe = self.lobe(given, sampled);
        (self.value(&local, lobe), [sampled.z, given.z].map(|cos| self.density(&local, lobe, cos)))
    }

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, _mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if given.z <= 0.0 {
            return None;
        }
        let local = self.local(uv, lobes)?;
        let (w, roughness) = if u_lobe < local.p_specular {
            (self.sample_lobe(given, u), self.specular_roughness())
        } else {
            (warp::cosine_hemisphere(u), 1.0)
        };
        if w.z <= 0.0 {
            return None;
        }
        let lobe = self.lobe(given, w);
        let (pdf_fwd, pdf_rev) = (self.density(&local, lobe, w.z), self.density(&local, lobe, given.z));
        if pdf_fwd <= 0.0 {
            return None;
        }
        let weight = self.value(&local, lobe) * (w.z / pdf_fwd);
        BsdfSample { w, weight, pdf_fwd, pdf_rev, delta: false, roughness, eta: 1.0 }.if_not_black()
    }

    /// A direction around the mirror direction, with density `(n + 1)/(2 pi) cos^n(alpha)`.
    #[inline]
    fn sample_lobe(&self, given: Vec3, u: Vec2) -> Vec3 {
        // cos = (1 - u)^(1/(n+1)), and 1 - cos from the same logarithm, so that sharp lobes keep the digits of the sine.
        let log_cos = (-u.x).ln_1p() / (self.exponent + 1.0);
        let (cos, versine) = (log_cos.exp(), -log_cos.exp_m1());
        let sin = (versine * (1.0 + cos)).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos_turns(u.y);
        let axis = Vec3::new(-given.x, -given.y, given.z);
        Frame::from_normal(axis).to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos)).normalize()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 {
            return 0.0;
        }
        let Some(local) = self.local(uv, lobes) else { return 0.0 };
        // Exact at normal incidence (1) and, within a few per cent, at grazing incidence; in between the shape is a guess.
        let roughness = self.specular_roughness();
        let grazing = roughness * (0.28 + 0.22 * roughness);
        let specular = (given.z * given.z + grazing * grazing * (1.0 - given.z * given.z)).sqrt();
        local.diffuse.mean() + local.specular.mean() * specular.min(1.0)
    }

    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        lobes.admit(1.0) || lobes.admit(self.specular_roughness())
    }

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
        self.diffuse_reflectance.varies() || self.specular_reflectance.varies()
    }
}
