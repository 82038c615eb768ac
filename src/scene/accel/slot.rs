//! What the tree's memory is made of: pieces of one size, each a node or a leaf.
//!
//! One list for both, so that a child can be asked for ahead of its visit without knowing which it is: that question is one branch a
//! child that nobody can foretell.

use crate::math::fetch;
use wide::f32x8;

/// Ten vectors, five cache lines. What they mean is `node.rs`'s or `triangle.rs`'s business.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Slot {
    pub(super) rows: [f32x8; 10],
}

impl Slot {
    /// Asks for all five cache lines.
    #[inline(always)]
    pub(super) fn fetch(&self) {
        for line in [0, 2, 4, 6, 8] {
            fetch(&self.rows[line]);
        }
    }

    /// The bits of one number.
    #[inline(always)]
    pub(super) fn bits(&self, row: usize, lane: usize) -> u32 {
        self.rows[row].as_array()[lane & 7].to_bits()
    }
}
