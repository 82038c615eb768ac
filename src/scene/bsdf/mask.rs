//! A material with holes.

use super::{Bsdf, BsdfSample, DeltaLobe, Lobes, Mode, same_direction};
use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

/// `opacity nested`, and light that passes straight through for the rest: a delta lobe that does not bend.
#[derive(Clone, Debug)]
pub struct Mask {
    /// Share of the material, by [`Texture::eval_1`]; outside [0, 1] the nearer end counts, as in Mitsuba.
    pub opacity: Texture,
    /// What is there where the opacity is 1.
    pub nested: Box<Bsdf>,
}

impl Mask {
    /// Opacity, and probability of sampling the nested material among these lobes.
    #[inline(always)]
    fn shares(&self, uv: Vec2, lobes: Lobes) -> (f32, f32) {
        let opacity = self.opacity.eval_1(uv).clamp(0.0, 1.0);
        let probability = match lobes {
            Lobes::All => opacity,
            // Where there is nothing, there is nothing to sample.
            Lobes::Rough(_) => f32::from(u8::from(opacity > 0.0)),
            Lobes::Smooth(_) if self.nested.admitted_by(lobes) => opacity,
            Lobes::Smooth(_) => 0.0,
        };
        (opacity, probability)
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        self.nested.eval(uv, wi, wo, lobes) * self.shares(uv, lobes).0
    }

    #[inline]
    pub(super) fn pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        self.nested.pdf(uv, given, sampled, lobes) * self.shares(uv, lobes).1
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        let (opacity, p) = self.shares(uv, lobes);
        let (f, pdf) = self.nested.eval_pdf(uv, given, sampled, mode, lobes);
        (f * opacity, pdf * p)
    }

    pub(super) fn sample(&self, uv: Vec2, given: Vec3, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (opacity, p) = self.shares(uv, lobes);
        if u_lobe < p {
            let mut s = self.nested.sample(uv, given, mode, lobes, (u_lobe / p).min(1.0 - f32::EPSILON), u)?;
            s.weight *= opacity / p;
            s.pdf_fwd *= p;
            s.pdf_rev *= p;
            return s.if_not_black();
        }
        if !lobes.admit(0.0) {
            return None;
        }
        let weight = Rgb::splat((1.0 - opacity) / (1.0 - p));
        BsdfSample { w: -given, weight, pdf_fwd: 1.0 - p, pdf_rev: 1.0 - p, delta: true, roughness: 0.0, eta: 1.0 }.if_not_black()
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        let (opacity, _) = self.shares(uv, lobes);
        let through = if lobes.admit(0.0) { 1.0 - opacity } else { 0.0 };
        self.nested.albedo(uv, given, lobes) * opacity + through
    }

    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        lobes.admit(0.0) || self.nested.admitted_by(lobes)
    }

    pub(super) fn max_roughness(&self) -> f32 {
        self.nested.max_roughness()
    }

    pub(super) fn anisotropic(&self) -> bool {
        self.nested.anisotropic()
    }

    pub(super) fn delta(&self, uv: Vec2, given: Vec3, sampled: Vec3) -> Option<DeltaLobe> {
        let (opacity, p) = self.shares(uv, Lobes::All);
        let hole = DeltaLobe { probability: 1.0 - p, value: Rgb::splat(1.0 - opacity), eta: 1.0 };
        let through = || (same_direction(-given, sampled) && opacity < 1.0).then_some(hole);
        self.nested.delta(uv, given, sampled).map(|lobe| lobe.part(p, opacity)).or_else(through)
    }

    pub(super) fn transmissive(&self) -> bool {
        true
    }

    pub(super) fn varies(&self) -> bool {
        self.opacity.varies() || self.nested.varies()
    }
}
