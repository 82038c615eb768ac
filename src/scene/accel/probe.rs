//! A ray made ready for the tree: everything that is the same for all boxes and all triangles.

use crate::scene::ray::Ray;
use glam::Vec3;
use wide::{f32x4, f32x8};

/// Boxes are widened by this much of the largest coordinates in play, `M = max |o| + max |corner|`.
///
/// With `u = 2^-24`, the slab test errs by less than `4 u M` (`o * inv`, the widening, the multiply-add), and the triangle
/// test moves a corner by less than `16 u M` (translation, shear, edge function). The sum of both, and some slack: a
/// box is never missed when the triangle test of something inside would report a hit.
const PAD: f32 = 32.0 / (1 << 24) as f32;

/// A direction component is never taken for less than this part of the largest one.
///
/// It keeps the inverse finite. Over the scene's whole extent such a component moves the ray by far less than `PAD`.
const FLATTEST: f32 = 1.0 / (1u64 << 36) as f32;

/// A ray ready for the tree. Its direction is scaled by a power of two so that the largest component lies in `[1, 2)`;
/// inside the tree `t` is measured in that direction.
pub(super) struct Probe {
    /// Origin.
    pub(super) o: Vec3,
    /// Scaled direction.
    pub(super) d: Vec3,
    /// What takes an outer `t` to a scaled one, and its inverse.
    pub(super) to_scaled: f32,
    pub(super) from_scaled: f32,
    /// Inverse of the scaled direction, per axis.
    pub(super) inv: [f32x8; 3],
    /// `t = plane * inv + near` for the plane the ray enters by, moved towards the ray.
    pub(super) near: [f32x8; 3],
    /// The same for the plane it leaves by, moved away.
    pub(super) far: [f32x8; 3],
    /// Which of a box's two planes the ray enters by, per axis: 0 the lower, 1 the upper.
    pub(super) enters: [usize; 3],
    /// Axes after permutation, the largest direction component last.
    pub(super) axis: [usize; 3],
    /// Permuted origin.
    pub(super) origin: [f32x4; 3],
    /// Woop's shear: `x - shear[0] * z`, `y - shear[1] * z` take the ray to the z axis.
    pub(super) shear: [f32x4; 2],
    /// Inverse of the largest direction component.
    pub(super) inv_z: f32x4,
}

impl Probe {
    /// None if no hit is possible to define: a component is not finite, or the direction is zero.
    #[inline(always)]
    pub(super) fn new(ray: &Ray, reach: f32) -> Option<Self> {
        let a = ray.d.abs();
        let largest = a.x.max(a.y).max(a.z);
        let far = ray.o.abs();
        let far = far.x.max(far.y).max(far.z);
        // The sum is not finite if any component is not; `max` alone would let a NaN pass.
        let sum = ray.o.x + ray.o.y + ray.o.z + ray.d.x + ray.d.y + ray.d.z;
        if !(sum.is_finite() && largest > 0.0) {
            return None;
        }
        // 2^-e by its bits; clamped so that it and its inverse are normal numbers.
        let e = (largest.to_bits() >> 23).clamp(2, 252);
        let to_unit = f32::from_bits((254 - e) << 23);
        let from_unit = f32::from_bits(e << 23);
        let d = ray.d * to_unit;
        let floor = (largest * to_unit * FLATTEST).max(f32::MIN_POSITIVE);
        let flat = |c: f32| 1.0 / c.abs().max(floor).copysign(c);
        let inv = [flat(d.x), flat(d.y), flat(d.z)];
        let pad = PAD * (far + reach);
        let o = ray.o.to_array();
        let k = if a.x > a.y && a.x > a.z {
            0
        } else if a.y > a.z {
            1
        } else {
            2
        };
        let axis = [(k + 1) % 3, (k + 2) % 3, k];
        let inv_z = inv[k];
        let dir = d.to_array();
        Some(Self {
            o: ray.o,
            d,
            to_scaled: from_unit,
            from_scaled: to_unit,
            inv: inv.map(f32x8::splat),
            near: [0, 1, 2].map(|k| f32x8::splat(-o[k] * inv[k] - pad * inv[k].abs())),
            far: [0, 1, 2].map(|k| f32x8::splat(-o[k] * inv[k] + pad * inv[k].abs())),
            enters: inv.map(|c| usize::from(c < 0.0)),
            axis,
            origin: axis.map(|k| f32x4::splat(o[k])),
            shear: [f32x4::splat(dir[axis[0]] * inv_z), f32x4::splat(dir[axis[1]] * inv_z)],
            inv_z: f32x4::splat(inv_z),
        })
    }
}
