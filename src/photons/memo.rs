//! Values of small cubes of space that are computed when first asked for and then read with one load.
//!
//! A value must depend on its cube alone. Then it does not matter which thread computes it, nor that two cubes that want the same slot push each
//! other out: what is read is the same, bit by bit, as what would be computed.

use glam::IVec3;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bits of a cell's coordinate: cells 2^17 apart along an axis are one.
const COORDINATE: u32 = 17;
/// Bits of a cell's key.
const KEY: u32 = 3 * COORDINATE;
/// Odd, so that no two keys have the same product modulo 2^51.
const MIX: u64 = 0x9e37_79b9_7f4a_7c15;
/// Cubes of a cell: they share a line of the processor's cache.
const CUBES: usize = 8;
/// An entry is this bit, what of the key the line's number does not say, and 16 bits of the value.
const FULL: u64 = 1 << 47;
/// Fewest and most lines, as powers of two: 64 KiB and 16 MiB. The key's lower 47 bits have to tell apart what shares a line: 4 lines would do.
const LINES: [u32; 2] = [10, 18];

/// The coordinates that are told apart, all others folded onto them.
#[inline(always)]
pub(super) fn folded(cell: IVec3) -> IVec3 {
    // Half the range up, so that the fold is far from the origin: to change the highest bit that is kept is to add it.
    (cell ^ (1 << (COORDINATE - 1))) & ((1 << COORDINATE) - 1)
}

/// Numbers of at least 1 and less than 2^32, kept with 11 bits after the first: within 2^-12 of themselves, 1 exactly.
#[derive(Debug)]
pub(super) struct Memo {
    entries: Vec<AtomicU64>,
    /// Bits of a product below those that name the line.
    shift: u32,
}

impl Memo {
    /// Empty, for about so many cells in use.
    pub(super) fn new(cells: usize) -> Self {
        let [fewest, most] = LINES;
        let bits = (2 * cells.max(1)).next_power_of_two().ilog2().clamp(fewest, most);
        let entries = std::iter::repeat_with(AtomicU64::default).take(CUBES << bits).collect();
        Self { entries, shift: KEY - bits }
    }

    /// The value of a cube of a [`folded`] cell: what `value` says of it, as exactly as it is kept.
    #[inline(always)]
    pub(super) fn get(&self, cell: IVec3, cube: usize, value: impl FnOnce() -> f32) -> f32 {
        let [x, y, z] = cell.to_array().map(|c| c as u64);
        let key = x | y << COORDINATE | z << (2 * COORDINATE);
        let product = key.wrapping_mul(MIX) & ((1 << KEY) - 1);
        let entry = &self.entries[(product >> self.shift) as usize * CUBES + cube];
        let tag = product & (FULL - 1) | FULL;
        let found = entry.load(Ordering::Relaxed);
        if found >> 16 == tag {
            return decode(found as u16);
        }
        let code = encode(value());
        entry.store(tag << 16 | u64::from(code), Ordering::Relaxed);
        decode(code)
    }

    /// Bytes held.
    #[cfg(test)]
    fn bytes(&self) -> usize {
        size_of_val(&self.entries[..])
    }
}

/// Bits of 1.0.
const ONE: u32 = 0x3f80_0000;

#[inline(always)]
fn encode(value: f32) -> u16 {
    ((value.to_bits() - ONE + (1 << 11)) >> 12) as u16
}

#[inline(always)]
fn decode(code: u16) -> f32 {
    f32::from_bits(ONE + (u32::from(code) << 12))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn values_are_kept_to_a_4096th() {
        assert_eq!(decode(encode(1.0)), 1.0);
        for i in 0..3100 {
            let value = (0.01 * i as f32).exp2();
            assert!((decode(encode(value)) / value - 1.0).abs() <= 1.0 / 4096.0, "{value}");
        }
    }

    /// A number that every cube has to itself.
    fn of(cell: IVec3, cube: usize) -> f32 {
        1.0 + (cell.x + 131 * cell.y + 17_161 * cell.z) as f32 + cube as f32 * 1e-3
    }

    /// Far more cells than lines, at once and in any order: what comes back is what was computed, of the right cube.
    #[test]
    fn cubes_that_share_a_slot_are_not_mixed_up() {
        let memo = Memo::new(1);
        let ask = |i: usize| {
            let cell = folded(IVec3::new(i as i32 % 130, i as i32 / 130 % 130, 7 * (i as i32 / 16_900) - 3));
            let cube = i % CUBES;
            assert_eq!(memo.get(cell, cube, || of(cell - 65_536, cube)), decode(encode(of(cell - 65_536, cube))), "{cell} {cube}");
        };
        (0..200_000).into_par_iter().for_each(ask);
        (0..200_000).into_par_iter().rev().for_each(ask);
        assert_eq!(memo.bytes(), 64 << 10);
    }

    #[test]
    fn what_was_asked_is_not_computed_again() {
        let memo = Memo::new(1000);
        let mut computed = 0;
        for _ in 0..3 {
            for i in 0..100 {
                memo.get(folded(IVec3::new(i, -i, 3)), 5, || {
                    computed += 1;
                    2.0
                });
            }
        }
        assert!((100..=130).contains(&computed), "{computed}");
    }

    #[test]
    fn far_cells_fold_onto_near_ones() {
        assert_eq!(folded(IVec3::new(-5, 0, 70_000)) - 65_536, IVec3::new(-5, 0, 70_000 - 131_072));
        assert!(folded(IVec3::new(i32::MIN, i32::MAX, -65_537)).cmpge(IVec3::ZERO).all());
    }
}
