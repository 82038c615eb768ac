//! One-sided materials made to act on both sides.

use super::{Bsdf, BsdfSample, DeltaLobe, Lobes, Mode};
use crate::math::Rgb;
use glam::{Vec2, Vec3};

/// The front material seen from the front, the back material (or the front one again) seen from behind.
///
/// What is seen from behind is mirrored in the tangent plane: both directions change the sign of their z.
#[derive(Clone, Debug)]
pub struct TwoSided {
    /// Acts on the side of the normal. Not transmissive.
    pub front: Box<Bsdf>,
    /// Acts on the other side; the same as `front` where absent. Not transmissive.
    pub back: Option<Box<Bsdf>>,
}

/// The mirror image of a direction where `side` is -1, itself where it is 1.
#[inline(always)]
pub(super) fn turned(w: Vec3, side: f32) -> Vec3 {
    Vec3::new(w.x, w.y, w.z * side)
}

impl TwoSided {
    /// The material that faces `w`, and the side it is on: directions are [`turned`] to it.
    #[inline(always)]
    pub(super) fn facing(&self, w: Vec3) -> (&Bsdf, f32) {
        if w.z >= 0.0 { (&self.front, 1.0) } else { (self.back.as_ref().unwrap_or(&self.front), -1.0) }
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        let (b, side) = self.facing(wo);
        b.eval(uv, turned(wi, side), turned(wo, side), lobes)
    }

    #[inline]
    pub(super) fn pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        let (b, side) = self.facing(given);
        b.pdf(uv, turned(given, side), turned(sampled, side), lobes)
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        let (b, side) = self.facing(given);
        b.eval_pdf(uv, turned(given, side), turned(sampled, side), mode, lobes)
    }

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (b, side) = self.facing(given);
        b.sample(uv, turned(given, side), mode, lobes, u_lobe, u).map(|s| BsdfSample { w: turned(s.w, side), ..s })
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        let (b, side) = self.facing(given);
        b.albedo(uv, turned(given, side), lobes)
    }

    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        self.front.admitted_by(lobes) || self.back.as_ref().is_some_and(|b| b.admitted_by(lobes))
    }

    #[inline]
    pub(super) fn max_roughness(&self) -> f32 {
        let of = |b: &Bsdf| match b {
            Bsdf::Diffuse(b) => b.max_roughness(),
            _ => b.max_roughness_any(),
        };
        self.back.as_ref().map_or(0.0, |b| of(b)).max(of(&self.front))
    }

    pub(super) fn anisotropic(&self) -> bool {
        self.front.anisotropic() || self.back.as_ref().is_some_and(|b| b.anisotropic())
    }

    pub(super) fn delta(&self, uv: Vec2, given: Vec3, sampled: Vec3) -> Option<DeltaLobe> {
        let (b, side) = self.facing(given);
        b.delta(uv, turned(given, side), turned(sampled, side))
    }

    pub(super) fn transmissive(&self) -> bool {
        false
    }

    pub(super) fn varies(&self) -> bool {
        self.front.varies() || self.back.as_ref().is_some_and(|b| b.varies())
    }
}
