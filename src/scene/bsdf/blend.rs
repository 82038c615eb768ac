//! A weighted sum of two materials.

use super::{Bsdf, BsdfSample, DeltaLobe, Lobes, Mode};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// `(1 - weight) first + weight second`.
///
/// One of the two is sampled, with its share as the probability; where the lobes asked for are in one of them only, that one.
#[derive(Clone, Debug)]
pub struct Blend {
    /// Share of the second material, by [`Texture::eval_1`]; outside [0, 1] the nearer end counts, as in Mitsuba.
    pub weight: Texture,
    /// Where the weight is 0.
    pub first: Box<Bsdf>,
    /// Where the weight is 1.
    pub second: Box<Bsdf>,
}

impl Blend {
    /// Share of the second material, and probability of sampling it among these lobes.
    #[inline(always)]
    fn shares(&self, uv: Vec2, lobes: Lobes) -> (f32, f32) {
        let weight = self.weight.eval_1(uv).clamp(0.0, 1.0);
        let probability = match lobes {
            Lobes::All => weight,
            _ => match (self.first.admitted_by(lobes), self.second.admitted_by(lobes)) {
                (true, true) => weight,
                (_, second) => f32::from(u8::from(second)),
            },
        };
        (weight, probability)
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        let (weight, _) = self.shares(uv, lobes);
        self.first.eval(uv, wi, wo, lobes).lerp(self.second.eval(uv, wi, wo, lobes), weight)
    }

    #[inline]
    pub(super) fn pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        let (_, p) = self.shares(uv, lobes);
        self.first.pdf(uv, given, sampled, lobes) * (1.0 - p) + self.second.pdf(uv, given, sampled, lobes) * p
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        let (weight, p) = self.shares(uv, lobes);
        let (f1, pdf1) = self.first.eval_pdf(uv, given, sampled, mode, lobes);
        let (f2, pdf2) = self.second.eval_pdf(uv, given, sampled, mode, lobes);
        (f1.lerp(f2, weight), pdf1 * (1.0 - p) + pdf2 * p)
    }

    #[inline]
    pub(super) fn eval_pdfs(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, [f32; 2]) {
        let (weight, p) = self.shares(uv, lobes);
        let (f1, pdfs1) = self.first.eval_pdfs(uv, given, sampled, mode, lobes);
        let (f2, pdfs2) = self.second.eval_pdfs(uv, given, sampled, mode, lobes);
        (f1.lerp(f2, weight), [0, 1].map(|i| pdfs1[i] * (1.0 - p) + pdfs2[i] * p))
    }

    pub(super) fn sample(&self, uv: Vec2, given: Vec3, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (weight, p) = self.shares(uv, lobes);
        // ## Choose, and use what is left of the number again
        let (chosen, other, share, other_share, p, u_lobe) = if u_lobe < p {
            (&self.second, &self.first, weight, 1.0 - weight, p, u_lobe / p)
        } else {
            (&self.first, &self.second, 1.0 - weight, weight, 1.0 - p, (u_lobe - p) / (1.0 - p))
        };
        let mut s = chosen.sample(uv, given, mode, lobes, u_lobe.min(1.0 - f32::EPSILON), u)?;
        if s.delta {
            s.weight *= share / p;
            s.pdf_fwd *= p;
            s.pdf_rev *= p;
            return s.if_not_black();
        }
        // ## The other one may answer with the same direction
        let cos = s.w.z.abs();
        let (f, [pdf, pdf_rev]) = other.eval_pdfs(uv, given, s.w, mode, lobes);
        let value = s.weight * (s.pdf_fwd * share) + f * (cos * other_share);
        s.pdf_fwd = s.pdf_fwd * p + pdf * (1.0 - p);
        s.pdf_rev = s.pdf_rev * p + pdf_rev * (1.0 - p);
        s.weight = value / s.pdf_fwd;
        s.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        let (weight, _) = self.shares(uv, lobes);
        self.first.albedo(uv, given, lobes) * (1.0 - weight) + self.second.albedo(uv, given, lobes) * weight
    }

    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        self.first.admitted_by(lobes) || self.second.admitted_by(lobes)
    }

    pub(super) fn max_roughness(&self) -> f32 {
        self.first.max_roughness().max(self.second.max_roughness())
    }

    pub(super) fn anisotropic(&self) -> bool {
        self.first.anisotropic() || self.second.anisotropic()
    }

    pub(super) fn delta(&self, uv: Vec2, given: Vec3, sampled: Vec3) -> Option<DeltaLobe> {
        let (weight, p) = self.shares(uv, Lobes::All);
        let first = self.first.delta(uv, given, sampled).map(|lobe| lobe.part(1.0 - p, 1.0 - weight));
        first.or_else(|| self.second.delta(uv, given, sampled).map(|lobe| lobe.part(p, weight)))
    }

    pub(super) fn transmissive(&self) -> bool {
        self.first.transmissive() || self.second.transmissive()
    }

    pub(super) fn varies(&self) -> bool {
        self.weight.varies() || self.first.varies() || self.second.varies()
    }
}
