//! One-sided materials made to act on both sides.

use super::{Bsdf, BsdfSample, Lobes, Mode};
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

#[inline(always)]
fn flip(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

impl TwoSided {
    /// The material that faces `w`, and whether directions must be flipped for it.
    #[inline(always)]
    fn facing(&self, w: Vec3) -> (&Bsdf, bool) {
        if w.z >= 0.0 { (&self.front, false) } else { (self.back.as_ref().unwrap_or(&self.front), true) }
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        match self.facing(wo) {
            (b, false) => b.eval(uv, wi, wo, lobes),
            (b, true) => b.eval(uv, flip(wi), flip(wo), lobes),
        }
    }

    #[inline]
    pub(super) fn pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        match self.facing(given) {
            (b, false) => b.pdf(uv, given, sampled, lobes),
            (b, true) => b.pdf(uv, flip(given), flip(sampled), lobes),
        }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        match self.facing(given) {
            (b, false) => b.eval_pdf(uv, given, sampled, mode, lobes),
            (b, true) => b.eval_pdf(uv, flip(given), flip(sampled), mode, lobes),
        }
    }

    #[inline]
    pub(super) fn sample(&self, uv: Vec2, given: Vec3, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        match self.facing(given) {
            (b, false) => b.sample(uv, given, mode, lobes, u_lobe, u),
            (b, true) => b.sample(uv, flip(given), mode, lobes, u_lobe, u).map(|s| BsdfSample { w: flip(s.w), ..s }),
        }
    }

    pub(super) fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        match self.facing(given) {
            (b, false) => b.albedo(uv, given, lobes),
            (b, true) => b.albedo(uv, flip(given), lobes),
        }
    }

    pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
        self.front.admitted_by(lobes) || self.back.as_ref().is_some_and(|b| b.admitted_by(lobes))
    }

    pub(super) fn max_roughness(&self) -> f32 {
        self.back.as_ref().map_or(0.0, |b| b.max_roughness()).max(self.front.max_roughness())
    }

    pub(super) fn anisotropic(&self) -> bool {
        self.front.anisotropic() || self.back.as_ref().is_some_and(|b| b.anisotropic())
    }

    pub(super) fn transmissive(&self) -> bool {
        false
    }
}
