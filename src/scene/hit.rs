//! Points on surfaces, and rays that start and end there without meeting the surface itself.

use super::ray::Ray;
use super::{EmitterId, ShapeId};
use crate::math::Frame;
use crate::math::eight::{Lanes, Vec3x8, copysign};
use glam::{Vec2, Vec3};
use wide::f32x8;

/// A point that a ray may start from or end at, with what is known of its rounding error. Laid out with the normal first, so that an
/// owner of many can place it in the cache line of what is read with it.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Endpoint {
    /// Unit geometric normal; zero for a point in free space.
    pub n_g: Vec3,
    /// Position, world units.
    pub p: Vec3,
    /// How far `p` may lie off its surface along `n_g`, world units: a bound on rounding error, not a tuning constant.
    pub offset: f32,
}

impl Endpoint {
    /// A point in free space: a camera, a point light.
    pub fn free(p: Vec3) -> Self {
        Self { p, n_g: Vec3::ZERO, offset: 0.0 }
    }

    /// The position moved off its surface to the side that `d` points to.
    #[inline(always)]
    pub fn toward(&self, d: Vec3) -> Vec3 {
        let away = self.n_g * self.offset.copysign(d.dot(self.n_g));
        let moved = self.p + away;
        // Rounding the sum must not undo the offset: step on, away from the surface, by one or two units in the last place
        // ([PBRT 6.8.6]). A sum that is zero or subnormal is exact and stays.
        // Masked, not chosen: which components of a normal vanish cannot be predicted.
        let mask = |a: f32| 0u32.wrapping_sub(u32::from(a != 0.0));
        let step = |o: f32, a: f32| o + f32::from_bits((o.abs() * f32::EPSILON).copysign(a).to_bits() & mask(a));
        Vec3::new(step(moved.x, away.x), step(moved.y, away.y), step(moved.z, away.z))
    }

    /// The endless ray that leaves along `d`.
    #[inline(always)]
    pub fn ray(&self, d: Vec3) -> Ray {
        Ray::new(self.toward(d), d)
    }

    /// The ray that ends just before `other`; its direction has the length of the segment.
    #[inline(always)]
    pub fn segment(&self, other: &Endpoint) -> Ray {
        let o = self.toward(other.p - self.p);
        let end = other.toward(self.p - other.p);
        Ray { o, d: end - o, t_max: SEGMENT_END }
    }
}

/// Eight points like [`Endpoint`], one in each lane.
#[derive(Clone, Copy, Debug)]
pub struct Endpoint8 {
    /// Positions.
    pub p: Vec3x8,
    /// Unit geometric normals.
    pub n_g: Vec3x8,
    /// Error bounds, none negative.
    pub offset: f32x8,
}

impl Endpoint8 {
    /// [`Endpoint::toward`] of eight, bit for bit.
    #[inline(always)]
    pub fn toward(&self, d: Vec3x8) -> Vec3x8 {
        let away = self.n_g * copysign(self.offset, d.dot(self.n_g));
        (self.p + away).zip(away, |o, a| o + (copysign(o.abs() * f32x8::splat(f32::EPSILON), a) & a.simd_ne(f32x8::ZERO)))
    }

    /// [`Endpoint::segment`] of eight, bit for bit: origins and directions. A direction of zero leads nowhere.
    #[inline(always)]
    pub fn segment(&self, other: &Endpoint8) -> (Vec3x8, Vec3x8) {
        let o = self.toward(other.p - self.p);
        (o, other.toward(self.p - other.p) - o)
    }
}

/// The ray in one lane of [`Endpoint8::segment`].
#[inline(always)]
pub fn segment_lane((o, d): (&[Lanes; 3], &[Lanes; 3]), lane: usize) -> Ray {
    Ray { o: Vec3x8::lane(o, lane), d: Vec3x8::lane(d, lane), t_max: SEGMENT_END }
}

/// Segments stop this short of their end, relative to their length: the far end's own rounding error is covered by its offset,
/// the error of the intersection's `t` by this.
const SEGMENT_END: f32 = 1.0 - 1e-4;

/// A ray's meeting with a surface, worked out.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Ray parameter.
    pub t: f32,
    /// Position, geometric normal and error bound.
    pub end: Endpoint,
    /// Shading frame; `frame.n` is the shading normal and may lie on the other side of `end.n_g` than a given direction.
    /// `frame.s` follows the surface's `dp/du` where a material of the shape is anisotropic, else it is any tangent.
    pub frame: Frame,
    /// Texture coordinates; of a quadric zero, where no texture of the shape's material or light asks for them.
    pub uv: Vec2,
    /// The primitive hit, as the accelerator counts them.
    pub prim: u32,
    /// The shape hit.
    pub shape: ShapeId,
    /// The emitter of the shape, if it has one.
    pub emitter: Option<EmitterId>,
}
