//! One node of the tree: eight boxes side by side.

use super::probe::Probe;
use crate::math::fetch;
use wide::f32x8;

/// A child that is a leaf: the rest is the place in its list.
pub(super) const LEAF: u32 = 1 << 31;
/// With `LEAF`: the list of analytic shapes instead of triangles.
pub(super) const ANALYTIC: u32 = 1 << 30;
/// A child that is not there, and the root of a tree of nothing.
pub(super) const EMPTY: u32 = u32::MAX;

/// Eight children, four cache lines. Planes `[lower, upper]` per axis; missing children have `[inf, -inf]`.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Node {
    pub(super) x: [f32x8; 2],
    pub(super) y: [f32x8; 2],
    pub(super) z: [f32x8; 2],
    pub(super) child: [u32; 8],
}

impl Node {
    pub(super) const NONE: Self = {
        let empty = [f32x8::splat(f32::INFINITY), f32x8::splat(f32::NEG_INFINITY)];
        Self { x: empty, y: empty, z: empty, child: [EMPTY; 8] }
    };

    /// Asks for the node's four cache lines.
    #[inline(always)]
    pub(super) fn fetch(&self) {
        fetch(&self.x);
        fetch(&self.y);
        fetch(&self.z);
        fetch(&self.child);
    }

    /// Which children the ray may meet before `t_max`, as bits, and where it enters each (never later than it does).
    ///
    /// No NaN can arise: the inverse direction is finite and not zero, so is the origin times it.
    #[inline(always)]
    pub(super) fn meet(&self, p: &Probe, t_max: f32) -> (u32, f32x8) {
        let [i, j, k] = p.enters;
        let spread = f32x8::splat;
        let (x, y, z) = (spread(p.inv[0]), spread(p.inv[1]), spread(p.inv[2]));
        let enter = (self.x[i & 1].mul_add(x, spread(p.near[0])))
            .fast_max(self.y[j & 1].mul_add(y, spread(p.near[1])))
            .fast_max(self.z[k & 1].mul_add(z, spread(p.near[2])))
            .fast_max(f32x8::ZERO);
        let leave = (self.x[!i & 1].mul_add(x, spread(p.far[0])))
            .fast_min(self.y[!j & 1].mul_add(y, spread(p.far[1])))
            .fast_min(self.z[!k & 1].mul_add(z, spread(p.far[2])))
            .fast_min(spread(t_max));
        (enter.simd_le(leave).to_bitmask(), enter)
    }
}
