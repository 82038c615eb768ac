//! Values of small cubes of space that are computed when first asked for and then read with two loads, one of which nearly always meets the
//! processor's nearest cache.
//!
//! A value must depend on its cube alone. Then it does not matter which thread computes it, nor whether it is kept: what is read is the same,
//! bit by bit, as what would be computed.

use glam::IVec3;
use std::sync::atomic::{AtomicU16, AtomicU64, Ordering};

/// Bits of a cell's coordinate: cells 2^17 apart along an axis are one.
const COORDINATE: u32 = 17;
/// Half cells of a block along an axis, as a power of two, and bits of a block's coordinate.
const BLOCK: u32 = 3;
const COARSE: u32 = COORDINATE + 1 - BLOCK;
/// Bits of a block's key.
const KEY: u32 = 3 * COARSE;
/// Odd, so that no two keys have the same product modulo 2^45.
const MIX: u64 = 0x9e37_79b9_7f4a_7c15;
/// Values of a block, one a half cell: 1 KiB.
const VALUES: usize = 1 << (3 * BLOCK);
/// Fewest and most slots for blocks, as powers of two: 64 KiB and 64 MiB.
const SLOTS: [u32; 2] = [6, 16];
/// Slots that a block may lie in, one after another.
const PROBES: usize = 4;

/// The coordinates of cells that are told apart, all others folded onto them.
#[inline(always)]
pub(super) fn folded(cell: IVec3) -> IVec3 {
    fold::<COORDINATE>(cell)
}

/// The same for halves of cells.
#[inline(always)]
pub(super) fn folded_half(half: IVec3) -> IVec3 {
    fold::<{ COORDINATE + 1 }>(half)
}

#[inline(always)]
fn fold<const BITS: u32>(place: IVec3) -> IVec3 {
    // Half the range up, so that the fold is far from the origin: to change the highest bit that is kept is to add it.
    (place ^ (1 << (BITS - 1))) & ((1 << BITS) - 1)
}

/// Numbers of at least 1 and less than 2^31, kept with 11 bits after the first: within 2^-12 of themselves, 1 exactly.
///
/// Values of a block of 64 cells lie together, those of four neighbours in one line of the cache: a surface meets few lines. A slot belongs to
/// the first block that asks for it; blocks that find all of theirs taken are computed every time.
#[derive(Debug)]
pub(super) struct Memo {
    /// One more than the block's key by slot; 0 where no block is.
    blocks: Vec<AtomicU64>,
    /// By slot; 0 where nothing has been computed.
    values: Vec<AtomicU16>,
    /// Bits of a product below those that name the slot.
    shift: u32,
}

impl Memo {
    /// Empty, for about so many cells in use.
    pub(super) fn new(cells: usize) -> Self {
        let [fewest, most] = SLOTS;
        // A surface meets a quarter of a block's cells, more or less.
        let bits = (cells / 8).max(1).next_power_of_two().ilog2().clamp(fewest, most);
        let blocks = std::iter::repeat_with(AtomicU64::default).take(1 << bits).collect();
        let values = std::iter::repeat_with(AtomicU16::default).take(VALUES << bits).collect();
        Self { blocks, values, shift: KEY - bits }
    }

    /// The value of a half cell given by [`folded_half`]: what `value` says of it, as exactly as it is kept.
    #[inline(always)]
    pub(super) fn get(&self, half: IVec3, value: impl FnOnce() -> f32) -> f32 {
        let [x, y, z] = half.to_array().map(|c| (c >> BLOCK) as u64);
        let key = x | y << COARSE | z << (2 * COARSE);
        let home = (key.wrapping_mul(MIX) & ((1 << KEY) - 1)) >> self.shift;
        let Some(slot) = self.slot(home as usize, key + 1) else { return decode(encode(value())) };
        let kept = &self.values[slot * VALUES + place(half)];
        let found = kept.load(Ordering::Relaxed);
        if found != 0 {
            return decode(found);
        }
        let code = encode(value());
        kept.store(code, Ordering::Relaxed);
        decode(code)
    }

    /// Where the block's values are kept. Once it has a slot nothing takes it away, so values need no order among threads.
    #[inline(always)]
    fn slot(&self, home: usize, block: u64) -> Option<usize> {
        if self.blocks[home].load(Ordering::Relaxed) == block { Some(home) } else { self.claim(home, block) }
    }

    #[inline(never)]
    fn claim(&self, home: usize, block: u64) -> Option<usize> {
        (home..home + PROBES).map(|slot| slot & (self.blocks.len() - 1)).find(|&slot| {
            let held = &self.blocks[slot];
            match held.load(Ordering::Relaxed) {
                0 => held.compare_exchange(0, block, Ordering::Relaxed, Ordering::Relaxed).map_or_else(|other| other == block, |_| true),
                other => other == block,
            }
        })
    }

    /// Bytes held.
    #[cfg(test)]
    fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..]) + size_of_val(&self.values[..])
    }
}

/// Three bits, two places apart.
const SPREAD: [u16; 1 << BLOCK] = [0, 1, 8, 9, 64, 65, 72, 73];

/// A half cell's place in its block: those of a cell next to each other, then those of its neighbours along x and y, then along z, then such
/// pairs of cells likewise.
#[inline(always)]
fn place(half: IVec3) -> usize {
    let [x, y, z] = half.to_array().map(|c| usize::from(SPREAD[c as usize & ((1 << BLOCK) - 1)]));
    x | y << 1 | z << 2
}

/// Bits of 1.0.
const ONE: u32 = 0x3f80_0000;

/// Not 0.
#[inline(always)]
fn encode(value: f32) -> u16 {
    (((value.to_bits() - ONE + (1 << 11)) >> 12) + 1) as u16
}

#[inline(always)]
fn decode(code: u16) -> f32 {
    f32::from_bits(ONE + (u32::from(code - 1) << 12))
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

    /// A number that every half cell has to itself.
    fn of(half: IVec3) -> f32 {
        1.0 + (half.x + 263 * half.y + 69_169 * half.z) as f32 * 0.25
    }

    /// Far more cells than there is room for, at once and in any order: what comes back is what was computed, of the right half cell.
    #[test]
    fn blocks_that_want_the_same_slot_are_not_mixed_up() {
        let memo = Memo::new(1);
        let ask = |i: usize| {
            let half = IVec3::new(i as i32 % 260, i as i32 / 260 % 260, 7 * (i as i32 / 67_600));
            assert_eq!(memo.get(folded_half(half), || of(half)), decode(encode(of(half))), "{half}");
        };
        (0..400_000).into_par_iter().for_each(ask);
        (0..400_000).into_par_iter().rev().for_each(ask);
        assert_eq!(memo.bytes(), (64 << 10) + 512);
    }

    /// Every half cell of a block has a value of its own, those of four neighbouring cells in each line of the cache.
    #[test]
    fn half_cells_of_a_block_have_places_of_their_own() {
        let halves = (0..512).map(|i| IVec3::new(i & 7, i >> 3 & 7, i >> 6));
        let places: std::collections::BTreeSet<usize> = halves.map(place).collect();
        assert_eq!(places.into_iter().collect::<Vec<_>>(), (0..512).collect::<Vec<_>>());
        let near = (0..32).map(|i| place(IVec3::new(8 + (i & 3), 12 + (i >> 2 & 3), 18 + (i >> 4))) / 32);
        assert!(near.collect::<std::collections::BTreeSet<_>>().len() == 1);
    }

    #[test]
    fn what_was_asked_is_not_computed_again() {
        let memo = Memo::new(1000);
        let mut computed = 0;
        for _ in 0..3 {
            for i in 0..100 {
                memo.get(folded_half(IVec3::new(2 * i + 1, -2 * i, 7)), || {
                    computed += 1;
                    2.0
                });
            }
        }
        // A hundred cells in some thirty blocks, nearly all of which find a slot.
        assert!((100..=130).contains(&computed), "{computed}");
    }

    #[test]
    fn far_cells_fold_onto_near_ones() {
        assert_eq!(folded(IVec3::new(-5, 0, 70_000)) - 65_536, IVec3::new(-5, 0, 70_000 - 131_072));
        assert!(folded(IVec3::new(i32::MIN, i32::MAX, -65_537)).cmpge(IVec3::ZERO).all());
        // A half cell's cell is the half of it, folded or not.
        for half in [IVec3::new(-7, 8, 3), IVec3::new(131_071, 131_072, -131_073), IVec3::new(i32::MIN, i32::MAX, 1 << 20)] {
            assert_eq!(folded_half(half) >> 1, folded(half >> 1), "{half}");
        }
    }
}
