//! A ray made ready for the tree: everything that is the same for all boxes and all triangles.

use crate::scene::ray::Ray;
use glam::Vec3;
use wide::f32x4;

/// Boxes are widened by this much of the largest coordinates in play, `M = max |o| + max |corner|`.
///
/// With `u = 2^-24`, the slab test errs by less than `4 u M` (`o * inv`, the widening, the multiply-add), and the triangle
/// test moves a corner by less than `16 u M` (translation, shear, edge function). The sum of both, and some slack: a
/// box is never missed when the triangle test of something inside would report a hit.
pub(super) const PAD: f32 = 32.0 / (1 << 24) as f32;

/// A direction component is never taken for less than this part of the largest one.
///
/// It keeps the inverse finite. Over the scene's whole extent such a component moves the ray by far less than `PAD`.
pub(super) const FLATTEST: f32 = 1.0 / (1u64 << 36) as f32;

/// The two axes that follow each, cyclically.
pub(super) const NEXT: [[usize; 2]; 4] = [[1, 2], [2, 0], [0, 1], [0, 1]];

/// A ray ready for the tree. Its direction is scaled by a power of two so that the largest component lies in `[1, 2)`;
/// inside the tree `t` is measured in that direction.
///
/// Scalars, not vectors full of them: a load that spreads costs what a plain one costs, and most rays visit few nodes. The fourth
/// number of an array is only there to make it a vector.
pub(super) struct Probe {
    /// Origin.
    pub(super) o: Vec3,
    /// Scaled direction.
    pub(super) d: Vec3,
    /// What takes an outer `t` to a scaled one, and its inverse.
    pub(super) to_scaled: f32,
    pub(super) from_scaled: f32,
    /// Inverse of the scaled direction, per axis.
    pub(super) inv: [f32; 4],
    /// `t = plane * inv + near` for the plane the ray enters by, moved towards the ray.
    pub(super) near: [f32; 4],
    /// The same for the plane it leaves by, moved away.
    pub(super) far: [f32; 4],
    /// Which of a box's two planes the ray enters by, per axis: 0 the lower, 1 the upper.
    pub(super) enters: [usize; 3],
    /// Axes after permutation, the largest direction component last.
    pub(super) axis: [usize; 3],
    /// Permuted origin, negated.
    pub(super) minus_origin: [f32; 3],
    /// Woop's shear: `x - shear_x * z`, `y - shear_y * z` take the ray to the z axis.
    pub(super) shear_x: f32,
    pub(super) shear_y: f32,
    /// Inverse of the largest direction component.
    pub(super) inv_z: f32,
}

impl Probe {
    /// None if no hit is possible to define: a component is not finite, or the direction is zero.
    #[inline(always)]
    pub(super) fn new(ray: &Ray, reach: f32) -> Option<Self> {
        // Comparisons instead of `max` on the way: that takes care of NaN, which the sum below sorts out.
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let (a, far) = (ray.d.abs(), ray.o.abs());
        let largest = larger(larger(a.x, a.y), a.z);
        let far = larger(larger(far.x, far.y), far.z);
        // The sum is not finite if any component is not.
        let sum = ray.o.x + ray.o.y + ray.o.z + ray.d.x + ray.d.y + ray.d.z;
        if !(sum.is_finite() && largest > 0.0) {
            return None;
        }
        // 2^-e by its bits; clamped so that it and its inverse are normal numbers.
        let e = (largest.to_bits() >> 23).clamp(2, 252);
        let to_unit = f32::from_bits((254 - e) << 23);
        let from_unit = f32::from_bits(e << 23);
        // ## Slabs, all axes at once
        let sign = f32x4::splat(-0.0);
        let minus_o4 = f32x4::new([ray.o.x, ray.o.y, ray.o.z, 0.0]) ^ sign;
        let d4 = f32x4::new([ray.d.x, ray.d.y, ray.d.z, 0.0]) * f32x4::splat(to_unit);
        let floor = f32x4::splat(larger(largest * to_unit * FLATTEST, f32::MIN_POSITIVE));
        let inv4 = f32x4::ONE / (d4.abs().fast_max(floor) | (d4 & sign));
        let pad4 = f32x4::splat(PAD * (far + reach)) * inv4.abs();
        let middle = minus_o4 * inv4;
        let negative = inv4.to_bitmask() as usize;
        // ## The shear: of equally large components the last
        let z_largest = usize::from(a.z == largest);
        let k = 2 * z_largest + (usize::from(a.y == largest) & (z_largest ^ 1));
        let [i, j] = NEXT[k & 3];
        let (minus_o, d, inv) = (minus_o4.to_array(), d4.to_array(), inv4.to_array());
        let inv_z = inv[k & 3];
        Some(Self {
            o: ray.o,
            d: Vec3::new(d[0], d[1], d[2]),
            to_scaled: from_unit,
            from_scaled: to_unit,
            inv,
            near: (middle - pad4).to_array(),
            far: (middle + pad4).to_array(),
            enters: [negative & 1, negative >> 1 & 1, negative >> 2 & 1],
            axis: [i, j, k],
            minus_origin: [minus_o[i & 3], minus_o[j & 3], minus_o[k & 3]],
            shear_x: d[i & 3] * inv_z,
            shear_y: d[j & 3] * inv_z,
            inv_z,
        })
    }
}
