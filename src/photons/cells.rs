//! Cells of space and the numbers they hash to, laid out so that neighbours share memory and never a number.

use glam::{IVec3, Vec3};
use wide::bytemuck::cast;
use wide::{f32x4, i32x8, u32x8};

/// Cells of a region along an axis, as a power of two: its 512 buckets lie side by side, row by row.
const REGION: i32 = 3;
/// Buckets of a region.
pub(super) const REGION_BUCKETS: usize = 1 << (3 * REGION);
/// Widest range of cells along an axis in which no two share a bucket.
pub(super) const NEAR: i32 = 5;
/// Odd multipliers of a region's coordinates: sums of their multiples keep small offsets apart.
const FACTORS: [u32; 3] = [0x9e37_79b1, 0x85eb_ca77, 0xc2b2_ae3d];
/// Multiplier of the sum.
const MIX: u32 = 0x2c1b_3c6d;
/// Which bits of a row's place in its region the region's hash flips: the low two of y and of z.
const FLIPS: u32 = 0b011_011_000;

/// Buckets by cell: a power of two of regions, each hashed, within a region by place.
///
/// The rows of a region change places, four by four, by its hash, so that regions that share their buckets seldom fill the same ones with the
/// same plane. The highest bit of a place is never flipped: cells that lie within [`NEAR`] of each other and in different quarters differ
/// in it along some axis, those in the same quarter belong to one region and differ by their places. So they never collide, whatever
/// the hashes; cells farther apart may.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    inverse_side: f32,
    /// Number of regions kept apart, less one.
    mask: u32,
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

    /// The cell of a position.
    #[inline(always)]
    pub(super) fn of(&self, p: Vec3) -> IVec3 {
        floor(self.scaled(p))
    }

    /// The cell's bucket. Cells along x within a region have buckets in sequence.
    #[inline(always)]
    pub(super) fn bucket(&self, cell: IVec3) -> u32 {
        self.row(cell.y, cell.z).bucket(cell.x)
    }

    /// All cells at a `y` and a `z`.
    #[inline(always)]
    pub(super) fn row(&self, y: i32, z: i32) -> Row {
        let sum = share(y, FACTORS[1]).wrapping_add(share(z, FACTORS[2]));
        Row { sum, place: place(y) << REGION | place(z) << (2 * REGION), mask: self.mask }
    }

    /// Buckets of a cell and of the seven after it along x, y, z and their sums, x first: what [`Cells::bucket`] says of each.
    #[inline(always)]
    pub(super) fn buckets_of_eight(&self, cell: IVec3) -> [u32; 8] {
        let [x, y, z] = [(cell.x, NEXT[0]), (cell.y, NEXT[1]), (cell.z, NEXT[2])].map(|(c, next)| i32x8::splat(c) + i32x8::new(next));
        let share = |c: i32x8, factor: u32| (c >> REGION) * i32x8::splat(factor as i32);
        let h: u32x8 = cast(share(x, FACTORS[0]) + share(y, FACTORS[1]) + share(z, FACTORS[2]));
        let h = (h ^ (h >> 15)) * u32x8::splat(MIX);
        let hash = (h ^ (h >> 14)) & u32x8::splat(self.mask);
        let inside = i32x8::splat((1 << REGION) - 1);
        let place: u32x8 = cast((x & inside) | ((y & inside) << REGION) | ((z & inside) << (2 * REGION)));
        let buckets: u32x8 = (hash << (3 * REGION)) | (place ^ ((h >> 21) & u32x8::splat(FLIPS)));
        buckets.to_array()
    }
}

/// A row of cells along x.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// What y and z add to a region's hash.
    sum: u32,
    place: u32,
    mask: u32,
}

impl Row {
    /// The bucket of the row's cell at `x`.
    #[inline(always)]
    pub(super) fn bucket(&self, x: i32) -> u32 {
        let h = self.sum.wrapping_add(share(x, FACTORS[0]));
        // The low bits shall depend on every bit.
        let h = (h ^ (h >> 15)).wrapping_mul(MIX);
        let hash = (h ^ (h >> 14)) & self.mask;
        hash << (3 * REGION) | ((self.place | place(x)) ^ (h >> 21 & FLIPS))
    }
}

/// What a coordinate adds to its region's hash.
#[inline(always)]
fn share(coordinate: i32, factor: u32) -> u32 {
    ((coordinate >> REGION) as u32).wrapping_mul(factor)
}

/// A coordinate within its region.
#[inline(always)]
fn place(coordinate: i32) -> u32 {
    (coordinate & ((1 << REGION) - 1)) as u32
}

/// Corners of a cube, coordinate by coordinate.
const NEXT: [[i32; 8]; 3] = [[0, 1, 0, 1, 0, 1, 0, 1], [0, 0, 1, 1, 0, 0, 1, 1], [0, 0, 0, 0, 1, 1, 1, 1]];

/// Whole parts, downwards; beyond what 32 bits hold the last number there is, and 0 for what is no number.
#[inline(always)]
pub(super) fn floor(p: Vec3) -> IVec3 {
    let [x, y, z, _] = f32x4::new([p.x, p.y, p.z, 0.0]).floor().trunc_int().to_array();
    IVec3::new(x, y, z)
}

/// The last cell along x of the region that holds cell `x`.
#[inline(always)]
pub(super) fn end_of_row(x: i32) -> i32 {
    x | ((1 << REGION) - 1)
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
    fn whole_parts_saturate() {
        let p = Vec3::new(-0.5, 3e9, f32::NAN);
        assert_eq!(floor(p), IVec3::new(-1, i32::MAX, 0));
        assert_eq!(floor(Vec3::new(7.9, -3e9, -8.0)), IVec3::new(7, i32::MIN, -8));
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
