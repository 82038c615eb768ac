//! Glass with a microfacet surface.

use super::microfacet::{EDGE_ON, Microfacet, NormalSampling, reflect};
use super::{BsdfSample, Lobes, Mode, fresnel};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// Microfacet reflection and refraction between two dielectrics ([WALTER07 (20), (21)] with separable shadowing), single scattering.
///
/// A facet is drawn, and its Fresnel term chooses between reflection and refraction: one lobe of one roughness. Refraction is not
/// symmetric: `f(wi -> wo) / eta_o^2 = f(wo -> wi) / eta_i^2` ([VEACH 5.2]).
#[derive(Clone, Debug)]
pub struct RoughDielectric {
    /// Distribution of the microfacets' normals.
    pub distribution: Microfacet,
    /// Index of refraction inside (against the normal) over outside (the normal's side); positive, not 1 (there would be no facets to
    /// see).
    pub eta: f32,
    /// Factor on reflected light, in [0, 1]; 1 is physical.
    pub specular_reflectance: Texture,
    /// Factor on transmitted light, in [0, 1]; 1 is physical.
    pub specular_transmittance: Texture,
}

/// A pair of directions and the facet that joins them.
struct Facet {
    given: Vec3,
    sampled: Vec3,
    /// The facet's normal, above the surface.
    h: Vec3,
    /// Cosines with `h`.
    given_h: f32,
    sampled_h: f32,
    /// `D(h)`.
    d: f32,
    reflection: bool,
    /// Index on the sampled side over that on the given side; 1 for reflection.
    eta: f32,
    reflectance: f32,
}

#[inline(always)]
fn upward(w: Vec3) -> Vec3 {
    if w.z < 0.0 { -w } else { w }
}

impl RoughDielectric {
    /// The facet that takes `given` to `sampled`, if a facet can.
    #[inline(always)]
    fn facet(&self, given: Vec3, sampled: Vec3, lobes: Lobes) -> Option<Facet> {
        if given.z == 0.0 || sampled.z == 0.0 || !lobes.admit(self.distribution.roughness()) {
            return None;
        }
        let reflection = given.z * sampled.z > 0.0;
        let eta = match (reflection, given.z > 0.0) {
            (true, _) => 1.0,
            (false, true) => self.eta,
            (false, false) => 1.0 / self.eta,
        };
        // [WALTER07 (13), (16)]
        let h = upward((given + sampled * eta).normalize_or_zero());
        self.checked(given, sampled, h, eta)
    }

    /// The facet, where both directions see the same side of it as of the surface, and on opposite sides if it refracts.
    #[inline(always)]
    fn checked(&self, given: Vec3, sampled: Vec3, h: Vec3, eta: f32) -> Option<Facet> {
        let (given_h, sampled_h) = (given.dot(h), sampled.dot(h));
        if given_h * given.z.signum() <= EDGE_ON || sampled_h * sampled.z.signum() <= EDGE_ON {
            return None;
        }
        let d = self.distribution.d(h);
        let reflection = given.z * sampled.z > 0.0;
        let reflectance = if reflection {
            fresnel::dielectric(given_h, self.eta).reflectance
        } else {
            // Both cosines are known: near the critical angle one has no digits left to give the other.
            fresnel::reflectance(given_h.abs(), sampled_h.abs(), eta)
        };
        (d > 0.0).then_some(Facet { given, sampled, h, given_h, sampled_h, d, reflection, eta, reflectance })
    }

    #[inline(always)]
    fn value(&self, uv: Vec2, at: &Facet, mode: Mode) -> Rgb {
        let m = &self.distribution;
        let geometry = at.d * m.shadowing(at.given).value * m.shadowing(at.sampled).value;
        if at.reflection {
            return self.specular_reflectance.eval(uv) * (0.25 * at.reflectance * geometry);
        }
        // [WALTER07 (21)] by roles: the square of the index on wo's side over that on the side the denominator is measured in.
        let denominator = at.given_h + at.eta * at.sampled_h;
        let scale = match mode {
            Mode::Radiance => 1.0,
            Mode::Importance => at.eta * at.eta,
        };
        let f = scale * (1.0 - at.reflectance) * geometry * (at.given_h * at.sampled_h).abs() / (denominator * denominator);
        self.specular_transmittance.eval(uv) * f
    }

    /// Density of the facet for the walk from `w`.
    #[inline(always)]
    fn facet_pdf(&self, w: Vec3, at: &Facet, w_h: f32) -> f32 {
        let m = &self.distribution;
        match m.sampling {
            NormalSampling::Visible => m.pdf(m.shadowing(w), at.h, w_h.abs(), at.d),
            NormalSampling::All => self.widened(w).d(at.h) * at.h.z,
        }
    }

    /// The distribution that normals are drawn from if all are: a little rougher towards grazing, which keeps weights small
    /// ([WALTER07 5.3]).
    #[inline(always)]
    fn widened(&self, w: Vec3) -> Microfacet {
        match self.distribution.sampling {
            NormalSampling::Visible => self.distribution,
            NormalSampling::All => self.distribution.scaled(1.2 - 0.2 * w.z.abs().sqrt()),
        }
    }

    /// Density of `sampled` given `given`, [WALTER07 (14), (17)].
    #[inline(always)]
    fn pdf_fwd(&self, at: &Facet) -> f32 {
        let facet = self.facet_pdf(at.given, at, at.given_h);
        if at.reflection {
            return facet * at.reflectance / (4.0 * at.sampled_h.abs());
        }
        let denominator = at.given_h + at.eta * at.sampled_h;
        facet * (1.0 - at.reflectance) * at.eta * at.eta * at.sampled_h.abs() / (denominator * denominator)
    }

    /// Density of `given` given `sampled`: the same with the relative index inverted.
    #[inline(always)]
    fn pdf_rev(&self, at: &Facet) -> f32 {
        let facet = self.facet_pdf(at.sampled, at, at.sampled_h);
        if at.reflection {
            return facet * at.reflectance / (4.0 * at.given_h.abs());
        }
        let denominator = at.given_h + at.eta * at.sampled_h;
        facet * (1.0 - at.reflectance) * at.given_h.abs() / (denominator * denominator)
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        self.facet(wo, wi, lobes).map_or(Rgb::BLACK, |at| self.value(uv, &at, Mode::Radiance))
    }

    #[inline]
    pub(super) fn pdf(&self, _uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        self.facet(given, sampled, lobes).map_or(0.0, |at| self.pdf_fwd(&at))
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        match self.facet(given, sampled, lobes) {
            Some(at) => (self.value(uv, &at, mode), self.pdf_fwd(&at)),
            None => (Rgb::BLACK, 0.0),
        }
    }

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let roughness = self.distribution.roughness();
        if given.z == 0.0 || !lobes.admit(roughness) {
            return None;
        }
        // A facet for the direction seen from its own side: the distribution is even, so mirroring at the origin serves both sides.
        let h = self.widened(given).sample(upward(given), u);
        let interface = fresnel::dielectric(given.dot(h), self.eta);
        let (sampled, eta) =
            if u_lobe < interface.reflectance { (reflect(given, h), 1.0) } else { (fresnel::refract(given, h, &interface), interface.eta) };
        if (sampled.z * given.z > 0.0) != (eta == 1.0) {
            return None;
        }
        let at = self.checked(given, sampled, h, eta)?;
        let pdf_fwd = self.pdf_fwd(&at);
        if pdf_fwd <= 0.0 {
            return None;
        }
        let weight = self.value(uv, &at, mode) * (sampled.z.abs() / pdf_fwd);
        BsdfSample { w: sampled, weight, pdf_fwd, pdf_rev: self.pdf_rev(&at), delta: false, roughness, eta }.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        if given.z == 0.0 || !lobes.admit(self.distribution.roughness()) {
            return 0.0;
        }
        // Facets differ from the surface: neither lobe may be thought impossible.
        let reflectance = fresnel::dielectric(given.z, self.eta).reflectance.clamp(0.02, 0.98);
        self.specular_transmittance.eval(uv).lerp(self.specular_reflectance.eval(uv), reflectance).mean()
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
        true
    }

    pub(super) fn varies(&self) -> bool {
        self.specular_reflectance.varies() || self.specular_transmittance.varies()
    }
}
