//! A diffuse base under a microfacet dielectric coat, black from behind.

use super::microfacet::{Microfacet, NormalSampling, reflect};
use super::plastic::{base_albedo, specular_weight};
use super::transmittance::CoatTransmittance;
use super::{BsdfSample, Lobes, Mode, fresnel};
use crate::math::{Rgb, warp};
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Rough plastic: microfacet reflection by the coat, and `T_i T_o k_d / (pi eta^2 (1 - R))` from the base, with `T` the coat's
/// transmittance and `R` what its inside reflects of diffuse light, times `k_d` if nonlinear. Made by [`RoughPlastic::new`].
#[derive(Clone, Debug)]
pub struct RoughPlastic {
    distribution: Microfacet,
    /// Index of refraction of the coat over that outside; positive.
    eta: f32,
    diffuse_reflectance: Texture,
    specular_reflectance: Texture,
    nonlinear: bool,
    /// Share of the specular lobe in the choice of a lobe, before the transmittance: from the textures' means.
    specular_weight: f32,
    coat: CoatTransmittance,
}

/// A direction pair's facet: its normal, cosine with both directions, `D`.
struct Facet {
    h: Vec3,
    cos_h: f32,
    d: f32,
}

impl RoughPlastic {
    /// A coat with microfacets of an isotropic `distribution` and relative index `eta` (coat over outside) over a base of albedo
    /// `diffuse_reflectance`; `specular_reflectance` multiplies what the coat reflects, `nonlinear` lets the colour shift with
    /// multiple reflection inside. Integrates the coat's transmittance, which takes some milliseconds.
    ///
    /// # Panics
    ///
    /// If the distribution is anisotropic.
    pub fn new(distribution: Microfacet, eta: f32, diffuse_reflectance: Texture, specular_reflectance: Texture, nonlinear: bool) -> Self {
        assert!(!distribution.anisotropic(), "a rough plastic's coat is isotropic");
        let specular_weight = specular_weight(&diffuse_reflectance, &specular_reflectance);
        let coat = CoatTransmittance::new(&distribution, eta);
        Self { distribution, eta, diffuse_reflectance, specular_reflectance, nonlinear, specular_weight, coat }
    }

    /// Probability of the specular lobe where the coat lets `transmittance` through; `None` if nothing can be sampled.
    #[inline(always)]
    fn p_specular(&self, transmittance: f32, lobes: Lobes) -> Option<f32> {
        match (lobes.admit(self.distribution.alpha_u), lobes.admit(1.0)) {
            (true, true) => {
                let (s, d) = ((1.0 - transmittance) * self.specular_weight, transmittance * (1.0 - self.specular_weight));
                (s + d > 0.0).then(|| s / (s + d))
            }
            (true, false) => Some(1.0),
            (false, true) => Some(0.0),
            (false, false) => None,
        }
    }

    #[inline(always)]
    fn facet(&self, a: Vec3, b: Vec3) -> Facet {
        let h = (a + b).normalize();
        Facet { h, cos_h: a.dot(h), d: self.distribution.d(h) }
    }

    /// `f` over the lobes asked for, both directions above the surface, with the coat's transmittance along both.
    #[inline(always)]
    fn value(&self, uv: Vec2, a: Vec3, b: Vec3, at: &Facet, transmittance: [f32; 2], lobes: Lobes) -> Rgb {
        let mut f = Rgb::BLACK;
        if lobes.admit(self.distribution.alpha_u) {
            let m = &self.distribution;
            let reflectance = fresnel::dielectric(at.cos_h, self.eta).reflectance;
            f += self.specular_reflectance.eval(uv) * (0.25 * reflectance * at.d * m.g1_over_cos(a) * m.g1_over_cos(b));
        }
        if lobes.admit(1.0) {
            let base = base_albedo(self.diffuse_reflectance.eval(uv), self.coat.internal_reflectance, self.nonlinear);
            f += base * (transmittance[0] * transmittance[1] * FRAC_1_PI / (self.eta * self.eta));
        }
        f
    }

    /// Density of `sampled` given `given`, where the coat lets `transmittance` of the latter through.
    #[inline(always)]
    fn density(&self, given: Vec3, sampled: Vec3, at: &Facet, transmittance: f32, lobes: Lobes) -> f32 {
        let Some(p) = self.p_specular(transmittance, lobes) else { return 0.0 };
        let specular = if p > 0.0 { p * self.distribution.reflection_pdf(given, at.h, at.cos_h, at.d) } else { 0.0 };
        specular + (1.0 - p) * sampled.z * FRAC_1_PI
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Rgb::BLACK;
        }
        self.value(uv, wi, wo, &self.facet(wi, wo), [self.coat.at(wi.z), self.coat.at(wo.z)], lobes)
    }

    #[inline]
    pub(super) fn pdf(&self, _uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 || sampled.z <= 0.0 {
            return 0.0;
        }
        self.density(given, sampled, &self.facet(given, sampled), self.coat.at(given.z), lobes)
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, _mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        if given.z <= 0.0 || sampled.z <= 0.0 {
            return (Rgb::BLACK, 0.0);
        }
        let (at, t) = (self.facet(given, sampled), [self.coat.at(given.z), self.coat.at(sampled.z)]);
        (self.value(uv, given, sampled, &at, t, lobes), self.density(given, sampled, &at, t[0], lobes))
    }

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, _mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if given.z <= 0.0 {
            return None;
        }
        let t_given = self.coat.at(given.z);
        let p = self.p_specular(t_given, lobes)?;
        // ## A direction from one lobe, with the facet it came from
        let (w, at, roughness) = if u_lobe < p {
            let h = self.distribution.sample(given, u);
            let cos_h = given.dot(h);
            if self.distribution.sampling == NormalSampling::All && cos_h <= 0.0 {
                return None;
            }
            (reflect(given, h), Facet { h, cos_h, d: self.distribution.d(h) }, self.distribution.alpha_u)
        } else {
            let w = warp::cosine_hemisphere(u);
            (w, self.facet(given, w), 1.0)
        };
        if w.z <= 0.0 {
            return None;
        }
        // ## Value and densities of all lobes there
        let t = [t_given, self.coat.at(w.z)];
        let pdf_fwd = self.density(given, w, &at, t[0], lobes);
        if pdf_fwd <= 0.0 {
            return None;
        }
        let pdf_rev = self.density(w, given, &at, t[1], lobes);
        let weight = self.value(uv, given, w, &at, t, lobes) * (w.z / pdf_fwd);
        BsdfSample { w, weight, pdf_fwd, pdf_rev, delta: false, roughness, eta: 1.0 }.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 {
            return 0.0;
        }
        let t = self.coat.at(given.z);
        let mut albedo = 0.0;
        if lobes.admit(self.distribution.alpha_u) {
            albedo += self.specular_reflectance.eval(uv).mean() * (1.0 - t);
        }
        if lobes.admit(1.0) {
            // The mean of T_o/eta^2 over the hemisphere is what gets out.
            let base = base_albedo(self.diffuse_reflectance.eval(uv), self.coat.internal_reflectance, self.nonlinear).mean();
            albedo += base * t * self.coat.mean_external / (self.eta * self.eta);
        }
        albedo.min(1.0)
    }

    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        lobes.admit(self.distribution.alpha_u) || lobes.admit(1.0)
    }

    pub(super) fn max_roughness(&self) -> f32 {
        1.0
    }

    pub(super) fn anisotropic(&self) -> bool {
        false
    }

    pub(super) fn transmissive(&self) -> bool {
        false
    }
}
