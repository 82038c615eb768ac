//! One node of the tree: eight boxes side by side.

use super::probe::Probe;
use super::slot::Slot;
use wide::f32x8;

/// A child that is a leaf: the rest is the place in its list.
pub(super) const LEAF: u32 = 1 << 31;
/// With `LEAF`: the list of analytic shapes instead of triangles.
pub(super) const ANALYTIC: u32 = 1 << 30;
/// A child that is not there, and the root of a tree of nothing.
pub(super) const EMPTY: u32 = u32::MAX;

/// Eight boxes in a slot: rows `2 axis` and `2 axis + 1` hold their lower and upper planes, row 6 the bits of the children. Missing
/// children have the planes `[inf, -inf]`.
#[derive(Clone, Copy)]
pub(super) struct Node<'a>(pub(super) &'a Slot);

/// The row of the children.
const CHILDREN: usize = 6;

impl Node<'_> {
    /// A slot of these planes, `[lower, upper]` of each child per axis, and these children.
    pub(super) fn slot(planes: [[[f32; 2]; 8]; 3], children: [u32; 8]) -> Slot {
        let mut rows = [f32x8::ZERO; 10];
        for (axis, planes) in planes.iter().enumerate() {
            for side in [0, 1] {
                rows[2 * axis + side] = f32x8::new(planes.map(|p| p[side]));
            }
        }
        rows[CHILDREN] = f32x8::new(children.map(f32::from_bits));
        Slot { rows }
    }

    /// One of the eight children.
    #[inline(always)]
    pub(super) fn child(self, i: usize) -> u32 {
        self.0.bits(CHILDREN, i)
    }

    /// The lower and the upper plane of a child's box.
    #[inline(always)]
    pub(super) fn planes(self, axis: usize, child: usize) -> [f32; 2] {
        [self.0.rows[2 * axis].as_array()[child & 7], self.0.rows[2 * axis + 1].as_array()[child & 7]]
    }

    /// Which children the ray may meet before `t_max`, as bits, and where it enters each (never later than it does).
    ///
    /// No NaN can arise: the inverse direction is finite and not zero, so is the origin times it.
    #[inline(always)]
    pub(super) fn meet(self, p: &Probe, t_max: f32) -> (u32, f32x8) {
        let [i, j, k] = p.enters;
        let rows = &self.0.rows;
        let spread = f32x8::splat;
        let (x, y, z) = (spread(p.inv[0]), spread(p.inv[1]), spread(p.inv[2]));
        let enter = (rows[i & 1].mul_add(x, spread(p.near[0])))
            .fast_max(rows[2 + (j & 1)].mul_add(y, spread(p.near[1])))
            .fast_max(rows[4 + (k & 1)].mul_add(z, spread(p.near[2])))
            .fast_max(f32x8::ZERO);
        let leave = (rows[!i & 1].mul_add(x, spread(p.far[0])))
            .fast_min(rows[2 + (!j & 1)].mul_add(y, spread(p.far[1])))
            .fast_min(rows[4 + (!k & 1)].mul_add(z, spread(p.far[2])))
            .fast_min(spread(t_max));
        (enter.simd_le(leave).to_bitmask(), enter)
    }
}
