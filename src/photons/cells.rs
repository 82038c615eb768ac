//! Cells of space and the numbers they hash to, laid out so that neighbours share memory and never a number.

use glam::{IVec3, Vec3};
use wide::bytemuck::cast;
use wide::{i32x8, u32x8};

/// Cells of a block along an axis, as a power of two: a block's 64 buckets lie side by side.
const BLOCK: i32 = 2;
/// Cells of a region along an axis, as a power of two: two blocks, told apart by the parity of their place.
const REGION: i32 = BLOCK + 1;
/// Buckets of a region.
pub(super) const REGION_BUCKETS: usize = 1 << (3 * REGION);
/// Widest range of cells along an axis that lies in two blocks wherever it begins.
pub(super) const NEAR: i32 = (1 << BLOCK) + 1;

/// Buckets by cell: a power of two of regions, each hashed, within a region by place.
///
/// Blocks next to each other, diagonally too, differ in the parity of their place along some axis and thus in their buckets, whatever the
/// hashes of their regions. So cells within [`NEAR`] of each other never collide; cells farther apart may.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    inverse_side: f32,
    /// Number of regions kept apart, less one.
    mask: u32,
}

/// Odd multipliers of a region's coordinates: sums of their multiples keep small offsets apart.
const FACTORS: [u32; 3] = [0x9e37_79b1, 0x85eb_ca77, 0xc2b2_ae3d];
/// Multiplier of the sum.
const MIX: u32 = 0x2c1b_3c6d;

/// A block's share of the way to a bucket.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    first: u32,
    /// Flips of the rows' places, by region: regions that share their buckets seldom fill the same ones with the same plane.
    turn: u32,
}

impl Cells {
    /// Cells of side `side` (world units, positive) in at least `buckets` buckets, at most 2^31.
    pub(super) fn new(side: f32, buckets: usize) -> Self {
        let regions = buckets.div_ceil(REGION_BUCKETS).next_power_of_two().min((1 << 31) / REGION_BUCKETS);
        Self { inverse_side: 1.0 / side, mask: (regions - 1) as u32 }
    }

    /// Buckets there are: a power of two.
    pub(super) fn buckets(&self) -> usize {
        (self.mask as usize + 1) * REGION_BUCKETS
    }

    /// The position in units of a cell's side.
    #[inline(always)]
    pub(super) fn scaled(&self, p: Vec3) -> Vec3 {
        p * self.inverse_side
    }

    /// The cell of a position; far beyond 2^31 cells from the origin the last one there is.
    #[inline(always)]
    pub(super) fn of(&self, p: Vec3) -> IVec3 {
        Self::of_scaled(self.scaled(p))
    }

    /// The cell of a position in units of a cell's side.
    #[inline(always)]
    pub(super) fn of_scaled(p: Vec3) -> IVec3 {
        p.floor().as_ivec3()
    }

    /// First bucket of the block that holds the cell.
    #[inline(always)]
    pub(super) fn block(&self, cell: IVec3) -> Block {
        let region = cell >> REGION;
        let [x, y, z] = [(region.x, FACTORS[0]), (region.y, FACTORS[1]), (region.z, FACTORS[2])].map(|(c, f)| (c as u32).wrapping_mul(f));
        let h = x.wrapping_add(y).wrapping_add(z);
        // The low bits shall depend on every bit.
        let h = (h ^ (h >> 15)).wrapping_mul(MIX);
        let hash = (h ^ (h >> 14)) & self.mask;
        let parity = cell >> BLOCK & 1;
        let parity = parity.x | parity.y << 1 | parity.z << 2;
        Block { first: (hash << 3 | parity as u32) << (3 * BLOCK), turn: h >> 28 << BLOCK }
    }

    /// The cell's bucket. Cells along x within a block have buckets in sequence.
    #[inline(always)]
    pub(super) fn bucket(&self, cell: IVec3) -> u32 {
        self.block(cell).bucket(cell)
    }
}

impl Cells {
    /// Buckets of a cell and of the seven after it along x, y, z and their sums, x first: what [`Cells::bucket`] says of each.
    #[inline(always)]
    pub(super) fn buckets_of_eight(&self, cell: IVec3) -> [u32; 8] {
        let [x, y, z] = [(cell.x, NEXT[0]), (cell.y, NEXT[1]), (cell.z, NEXT[2])].map(|(c, next)| i32x8::splat(c) + i32x8::new(next));
        let share = |c: i32x8, factor: u32| (c >> REGION) * i32x8::splat(factor as i32);
        let h: u32x8 = cast(share(x, FACTORS[0]) + share(y, FACTORS[1]) + share(z, FACTORS[2]));
        let h = (h ^ (h >> 15)) * u32x8::splat(MIX);
        let hash = (h ^ (h >> 14)) & u32x8::splat(self.mask);
        let (one, inside) = (i32x8::splat(1), i32x8::splat((1 << BLOCK) - 1));
        let parity = (x >> BLOCK & one) | ((y >> BLOCK & one) << 1) | ((z >> BLOCK & one) << 2);
        let place = (x & inside) | ((y & inside) << BLOCK) | ((z & inside) << (2 * BLOCK));
        let (parity, place): (u32x8, u32x8) = (cast(parity), cast(place));
        let buckets: u32x8 = (((hash << 3) | parity) << (3 * BLOCK)) | (place ^ ((h >> 28) << BLOCK));
        buckets.to_array()
    }
}

/// Corners of a cube, coordinate by coordinate.
const NEXT: [[i32; 8]; 3] = [[0, 1, 0, 1, 0, 1, 0, 1], [0, 0, 1, 1, 0, 0, 1, 1], [0, 0, 0, 0, 1, 1, 1, 1]];

impl Block {
    /// Bucket of a cell in this block.
    #[inline(always)]
    pub(super) fn bucket(self, cell: IVec3) -> u32 {
        let place = cell & ((1 << BLOCK) - 1);
        self.first | ((place.x | place.y << BLOCK | place.z << (2 * BLOCK)) as u32 ^ self.turn)
    }
}

/// The last cell along x of the block that holds cell `x`.
#[inline(always)]
pub(super) fn end_of_block(x: i32) -> i32 {
    x | ((1 << BLOCK) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Even where all regions share their buckets, cells near each other do not.
    #[test]
    fn near_cells_never_collide() {
        for buckets in [1, 1 << 12, 1 << 20] {
            let cells = Cells::new(1.0, buckets);
            for corner in [IVec3::ZERO, IVec3::new(-3, 6, -1), IVec3::new(1021, -4099, 15), IVec3::splat(i32::MAX - NEAR)] {
                let around = (0..NEAR.pow(3)).map(|i| corner + IVec3::new(i % NEAR, i / NEAR % NEAR, i / NEAR / NEAR));
                let found: BTreeSet<u32> = around.map(|cell| cells.bucket(cell)).collect();
                assert_eq!(found.len() as i32, NEAR.pow(3), "{buckets} buckets, from {corner}");
                assert!(found.iter().all(|bucket| (*bucket as usize) < cells.buckets()));
            }
        }
    }

    #[test]
    fn eight_buckets_are_those_of_eight_cells() {
        let cells = Cells::new(1.0, 1 << 20);
        for i in 0..1000 {
            let corner = IVec3::new(i * 7 - 3000, 5 - i * 3, i * i - 77);
            let one_by_one: [u32; 8] = std::array::from_fn(|k| cells.bucket(corner + IVec3::new(NEXT[0][k], NEXT[1][k], NEXT[2][k])));
            assert_eq!(cells.buckets_of_eight(corner), one_by_one, "{corner}");
        }
    }

    /// Regions of a surface and of a volume fill the buckets as evenly as chance would.
    #[test]
    fn regions_scatter() {
        let cells = Cells::new(1.0, 4096 * REGION_BUCKETS);
        for side in [IVec3::new(64, 64, 1), IVec3::new(16, 16, 16), IVec3::new(1, 64, 64), IVec3::new(4096, 1, 1)] {
            let mut counts = vec![0u32; 4096];
            for i in 0..4096 {
                let region = IVec3::new(i % side.x, i / side.x % side.y, i / side.x / side.y) - side / 2;
                counts[cells.bucket(region << REGION) as usize / REGION_BUCKETS] += 1;
            }
            let crowded = counts.iter().map(|n| n * n).sum::<u32>() as f64 / 4096.0;
            // A Poisson count of mean 1 has mean square 2; the standard error is 0.05.
            assert!(crowded < 2.25, "{side}: {crowded}");
        }
    }
}
