//! Metal with a microfacet surface, black from behind.

use super::microfacet::{Microfacet, NormalSampling, reflect};
use super::{BsdfSample, Lobes, Mode, fresnel};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// Microfacet reflection of a metal, `F D G1 G1 / (4 cos cos)` ([WALTER07 (20)] with separable shadowing), single scattering.
#[derive(Clone, Debug)]
pub struct RoughConductor {
    /// Distribution of the microfacets' normals.
    pub distribution: Microfacet,
    /// Real part of the complex index of refraction, relative to the outside.
    pub eta: Rgb,
    /// Imaginary part of the complex index of refraction, relative to the outside.
    pub k: Rgb,
    /// Factor on reflected light, in [0, 1]; 1 is physical.
    pub specular_reflectance: Texture,
}

impl RoughConductor {
    /// Does any light pass between these directions?
    #[inline(always)]
    fn blocked(&self, a: Vec3, b: Vec3, lobes: Lobes) -> bool {
        a.z <= 0.0 || b.z <= 0.0 || !lobes.admit(self.distribution.roughness())
    }

    #[inline(always)]
    fn fresnel(&self, uv: Vec2, cos: f32) -> Rgb {
        fresnel::conductor(cos, self.eta, self.k) * self.specular_reflectance.eval(uv)
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        if self.blocked(wi, wo, lobes) {
            return Rgb::BLACK;
        }
        let h = (wi + wo).normalize();
        let m = &self.distribution;
        self.fresnel(uv, wi.dot(h).clamp(0.0, 1.0)) * (0.25 * m.d(h) * m.shadowing(wi).value * m.shadowing(wo).value)
    }

    #[inline]
    pub(super) fn pdf(&self, _uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        if self.blocked(given, sampled, lobes) {
            return 0.0;
        }
        let h = (given + sampled).normalize();
        let m = &self.distribution;
        m.reflection_pdf(m.shadowing(given), h, given.dot(h), m.d(h))
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, _mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        let (f, [pdf, _]) = self.eval_pdfs(uv, given, sampled, lobes);
        (f, pdf)
    }

    #[inline(always)]
    pub(super) fn eval_pdfs(&self, uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> (Rgb, [f32; 2]) {
        if self.blocked(given, sampled, lobes) {
            return (Rgb::BLACK, [0.0; 2]);
        }
        let h = (given + sampled).normalize();
        let (m, cos_h) = (&self.distribution, given.dot(h));
        let (d, g, g_sampled) = (m.d(h), m.shadowing(given), m.shadowing(sampled));
        let f = self.fresnel(uv, cos_h.clamp(0.0, 1.0)) * (0.25 * d * g.value * g_sampled.value);
        (f, [m.reflection_pdf(g, h, cos_h, d), m.reflection_pdf(g_sampled, h, sampled.dot(h), d)])
    }

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, _mode: Mode, lobes: Lobes, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let roughness = self.distribution.roughness();
        if given.z <= 0.0 || !lobes.admit(roughness) {
            return None;
        }
        let m = &self.distribution;
        let h = m.sample(given, u);
        let cos_h = given.dot(h);
        let w = reflect(given, h);
        if cos_h <= 0.0 || w.z <= 0.0 {
            return None;
        }
        let (d, g_given, g_w) = (m.d(h), m.shadowing(given), m.shadowing(w));
        let (pdf_fwd, pdf_rev) = (m.reflection_pdf(g_given, h, cos_h, d), m.reflection_pdf(g_w, h, cos_h, d));
        if pdf_fwd <= 0.0 {
            return None;
        }
        // f cos / pdf with D, and what else is in both, cancelled.
        let geometry = match m.sampling {
            NormalSampling::Visible => g_given.value / g_given.exact,
            NormalSampling::All => g_given.value * cos_h / h.z,
        };
        let weight = self.fresnel(uv, cos_h.min(1.0)) * (geometry * g_w.value * w.z);
        BsdfSample { w, weight, pdf_fwd, pdf_rev, delta: false, roughness, eta: 1.0 }.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 || !lobes.admit(self.distribution.roughness()) { 0.0 } else { self.fresnel(uv, given.z.min(1.0)).mean() }
    }

    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        lobes.admit(self.distribution.roughness())
    }

    pub(super) fn max_roughness(&self) -> f32 {
        self.distribution.roughness()
    }

    pub(super) fn anisotropic(&self) -> bool {
        self.distribution.anisotropic()
    }

    no_delta!();

    pub(super) fn transmissive(&self) -> bool {
        false
    }

    pub(super) fn varies(&self) -> bool {
        self.specular_reflectance.varies()
    }
}
