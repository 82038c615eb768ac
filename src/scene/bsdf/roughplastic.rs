//! A diffuse base under a microfacet dielectric coat, black from behind.

use super::microfacet::{Microfacet, NormalSampling, Shadowing, reflect};
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
    /// `1 / (pi eta^2)`.
    base_scale: f32,
    coat: CoatTransmittance,
}

/// A direction pair's facet: its normal, cosine with both directions, `D`.
struct Facet {
    h: Vec3,
    cos_h: f32,
    d: f32,
}

/// What a direction meets on its own: its cosine, the facets' shadowing, and the coat's transmittance.
#[derive(Clone, Copy)]
struct Side {
    cos: f32,
    g: Shadowing,
    transmittance: f32,
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
        let base_scale = FRAC_1_PI / (eta * eta);
        Self { distribution, eta, diffuse_reflectance, specular_reflectance, nonlinear, specular_weight, base_scale, coat }
    }

    #[inline(always)]
    pub(super) fn diffuse_reflectance(&self) -> &Texture {
        &self.diffuse_reflectance
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

    #[inline(always)]
    fn side(&self, w: Vec3) -> Side {
        Side { cos: w.z, g: self.distribution.shadowing(w), transmittance: self.coat.at(w.z) }
    }

    /// `f` over the lobes asked for, both directions above the surface.
    #[inline(always)]
    fn value(&self, uv: Vec2, a: Side, b: Side, at: &Facet, lobes: Lobes) -> Rgb {
        let mut f = Rgb::BLACK;
        if lobes.admit(self.distribution.alpha_u) {
            let reflectance = fresnel::dielectric(at.cos_h, self.eta).reflectance;
            f += self.specular_reflectance.eval(uv) * (0.25 * reflectance * at.d * a.g.value * b.g.value);
        }
        if lobes.admit(1.0) {
            let base = base_albedo(self.diffuse_reflectance.eval(uv), self.coat.internal_reflectance, self.nonlinear);
            f += base * (a.transmittance * b.transmittance * self.base_scale);
        }
        f
    }

    /// Density of the other direction given this one, where the lobe is chosen with these odds.
    #[inline(always)]
    fn density(&self, given: Side, sampled: Side, at: &Facet, p_specular: f32) -> f32 {
        let specular = if p_specular > 0.0 { p_specular * self.distribution.reflection_pdf(given.g, at.h, at.cos_h, at.d) } else { 0.0 };
        specular + (1.0 - p_specular) * sampled.cos * FRAC_1_PI
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Rgb::BLACK;
        }
        self.value(uv, self.side(wi), self.side(wo), &self.facet(wi, wo), lobes)
    }

    #[inline]
    pub(super) fn pdf(&self, _uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        if given.z <= 0.0 || sampled.z <= 0.0 {
            return 0.0;
        }
        let a = self.side(given);
        let p = self.p_specular(a.transmittance, lobes);
        p.map_or(0.0, |p| self.density(a, self.side(sampled), &self.facet(given, sampled), p))
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, _mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        if given.z <= 0.0 || sampled.z <= 0.0 {
            return (Rgb::BLACK, 0.0);
        }
        let (a, b, at) = (self.side(given), self.side(sampled), self.facet(given, sampled));
        let pdf = self.p_specular(a.transmittance, lobes).map_or(0.0, |p| self.density(a, b, &at, p));
        (self.value(uv, a, b, &at, lobes), pdf)
    }

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, _mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if given.z <= 0.0 {
            return None;
        }
        let a = self.side(given);
        let p = self.p_specular(a.transmittance, lobes)?;
        // ## A direction from one lobe, with the facet it came from
        let (w, h, roughness) = if u_lobe < p {
            let h = self.distribution.sample(given, u);
            if self.distribution.sampling == NormalSampling::All && given.dot(h) <= 0.0 {
                return None;
            }
            (reflect(given, h), h, self.distribution.alpha_u)
        } else {
            let w = warp::cosine_hemisphere(u);
            (w, (given + w).normalize(), 1.0)
        };
        if w.z <= 0.0 {
            return None;
        }
        // ## Value and densities of all lobes there
        let (b, at) = (self.side(w), Facet { h, cos_h: given.dot(h), d: self.distribution.d(h) });
        let pdf_fwd = self.density(a, b, &at, p);
        if pdf_fwd <= 0.0 {
            return None;
        }
        let pdf_rev = self.p_specular(b.transmittance, lobes).map_or(0.0, |p| self.density(b, a, &at, p));
        let weight = self.value(uv, a, b, &at, lobes) * (w.z / pdf_fwd);
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

    no_delta!();

    pub(super) fn transmissive(&self) -> bool {
        false
    }

    pub(super) fn varies(&self) -> bool {
        self.diffuse_reflectance.varies() || self.specular_reflectance.varies()
    }
}
