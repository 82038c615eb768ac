//! Balls of many sizes, found by a point inside them.

use glam::{IVec3, Vec3};
use wide::f32x8;

/// What decides whether a light vertex inside a ball counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disk {
    /// Unit geometric normal.
    pub(super) n_g: Vec3,
    /// Unit shading normal.
    pub(super) n_s: Vec3,
    /// Camera edges.
    pub(super) depth: u32,
}

/// Balls of the buckets' lists, component by component, so that eight are tested at once.
#[derive(Debug, Default)]
struct Entries {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    radius2: Vec<f32>,
    index: Vec<u32>,
}

/// Balls tested at once.
const LANES: usize = 8;

impl Entries {
    /// `count` balls that hold no point, and as many more as a test of the last one reads.
    fn new(count: usize) -> Self {
        let blank = || vec![0.0; count + LANES];
        Self { x: blank(), y: blank(), z: blank(), radius2: blank(), index: vec![0; count] }
    }

    fn set(&mut self, place: usize, p: Vec3, radius: f32, index: u32) {
        (self.x[place], self.y[place], self.z[place]) = (p.x, p.y, p.z);
        (self.radius2[place], self.index[place]) = (radius * radius, index);
    }

    /// A bit for each of the eight balls from `first` on that hold the point.
    #[inline(always)]
    fn holding(&self, first: usize, p: [f32x8; 3]) -> u32 {
        let load = |list: &[f32]| {
            let mut lanes = [0.0; LANES];
            lanes.copy_from_slice(&list[first..first + LANES]);
            f32x8::new(lanes)
        };
        let (x, y, z) = (load(&self.x) - p[0], load(&self.y) - p[1], load(&self.z) - p[2]);
        (x * x + y * y + z * z).simd_lt(load(&self.radius2)).to_bitmask()
    }
}

/// Levels of cells, each twice as wide as the one below; their set fits a word.
const LEVELS: u32 = 24;

/// A hash grid of several cell sizes. A ball lies in the level whose cells are as wide as its diameter to twice that, in the list of every
/// cell that it meets, so that a query reads one list a level; a grid of the widest cells tells beforehand which levels have anything near.
#[derive(Debug)]
pub(super) struct DiskGrid {
    /// Widest cell first: reciprocal of the side at each level.
    inverse_cells: Vec<f32>,
    /// Bucket `b` holds `entries[starts[b]..starts[b + 1]]`.
    starts: Vec<u32>,
    entries: Entries,
    /// Levels present in each bucket of the widest cells.
    present: Vec<u32>,
}

impl DiskGrid {
    /// Sorts balls, given by centre and radius (positive, world units), into cells. Fewer than 2^28 of them.
    pub(super) fn build(balls: impl ExactSizeIterator<Item = (Vec3, f32)> + Clone) -> Self {
        let count = balls.len();
        let widest = balls.clone().map(|(_, r)| r).fold(0.0, f32::max);
        let narrowest = balls.clone().map(|(_, r)| r).fold(f32::INFINITY, f32::min);
        let levels = if count == 0 { 0 } else { ((widest / narrowest).log2().floor() as u32 + 1).clamp(1, LEVELS) };
        let inverse_cells: Vec<f32> = (0..levels).map(|level| 0.5 * (level as f32).exp2() / widest).collect();
        let buckets = (4 * count.max(1)).next_power_of_two();
        let mask = (buckets - 1) as u32;
        let coarse_mask = (count.max(1).next_power_of_two() - 1) as u32;

        let mut starts = vec![0u32; buckets + 1];
        let mut present = vec![0u32; coarse_mask as usize + 1];
        let level_of = |r: f32| ((widest / r).log2().floor() as u32).min(levels - 1);
        for (p, r) in balls.clone() {
            let level = level_of(r);
            cells(p, r, inverse_cells[level as usize], level, mask, |bucket| starts[bucket as usize + 1] += 1);
            cells(p, r, inverse_cells[0], LEVELS, coarse_mask, |bucket| present[bucket as usize] |= 1 << level);
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        let mut next = starts.clone();
        let mut entries = Entries::new(sum as usize);
        for (index, (p, r)) in balls.enumerate() {
            let level = level_of(r);
            cells(p, r, inverse_cells[level as usize], level, mask, |bucket| {
                let place = &mut next[bucket as usize];
                entries.set(*place as usize, p, r, index as u32);
                *place += 1;
            });
        }
        Self { inverse_cells, starts, entries, present }
    }

    /// Calls `visit` with the number of every ball that holds `p`, each once.
    #[inline]
    pub(super) fn containing(&self, p: Vec3, mut visit: impl FnMut(u32)) {
        let Some(&widest) = self.inverse_cells.first() else { return };
        let mut levels = self.present[bucket(cell_of(p, widest), LEVELS, self.present.len() as u32 - 1) as usize];
        let splat = [p.x, p.y, p.z].map(f32x8::splat);
        while levels != 0 {
            let level = levels.trailing_zeros();
            levels &= levels - 1;
            let cell = cell_of(p, self.inverse_cells[level as usize]);
            let bucket = bucket(cell, level, self.starts.len() as u32 - 2) as usize;
            let (mut first, end) = (self.starts[bucket] as usize, self.starts[bucket + 1] as usize);
            while first < end {
                let mut held = self.entries.holding(first, splat);
                // What lies beyond the list is another bucket's.
                held &= u32::MAX >> (u32::BITS - (end - first).min(LANES) as u32);
                while held != 0 {
                    visit(self.entries.index[first + held.trailing_zeros() as usize]);
                    held &= held - 1;
                }
                first += LANES;
            }
        }
    }
}

/// Calls `visit` with the bucket of every cell that the ball meets, each bucket once: a ball must not stand twice in a list.
fn cells(p: Vec3, radius: f32, inverse_cell: f32, level: u32, mask: u32, mut visit: impl FnMut(u32)) {
    // Wider by the rounding of these sums, so that no point inside the ball falls outside its cells.
    let reach = Vec3::splat(radius + (p.abs().max_element() + radius) * f32::EPSILON);
    let (low, high) = (cell_of(p - reach, inverse_cell), cell_of(p + reach, inverse_cell));
    let mut seen = [u32::MAX; 27];
    let mut count = 0;
    // A diameter is no wider than a cell, so at most two cells an axis, three where rounding widens it.
    for z in low.z..=high.z {
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                let bucket = bucket(IVec3::new(x, y, z), level, mask);
                if !seen[..count].contains(&bucket) && count < seen.len() {
                    seen[count] = bucket;
                    count += 1;
                    visit(bucket);
                }
            }
        }
    }
}

#[inline(always)]
fn cell_of(p: Vec3, inverse_cell: f32) -> IVec3 {
    (p * inverse_cell).floor().as_ivec3()
}

/// Teschner et al.'s primes, the level among them, and a last mix so that the low bits depend on all.
#[inline(always)]
fn bucket(cell: IVec3, level: u32, mask: u32) -> u32 {
    let h = (cell.x as u32).wrapping_mul(73_856_093) ^ (cell.y as u32).wrapping_mul(19_349_663) ^ (cell.z as u32).wrapping_mul(83_492_791);
    let h = (h ^ level.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x85eb_ca6b);
    (h ^ (h >> 15)) & mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use isophote_samplers::{Key, Purpose, Stream};

    #[test]
    fn finds_exactly_the_balls_around_a_point() {
        let mut s = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
        let mut point = |scale: f32| Vec3::new(s.next_1d() - 0.5, s.next_1d() - 0.5, 0.1 * s.next_1d()) * scale;
        // Radii over a range of 1, of 50, and of 1e9, wider than the levels.
        for (scale, spread) in [(1.0f32, 0.0f32), (1e3, 4.0), (1e-3, 21.0)] {
            let balls: Vec<(Vec3, f32)> = (0..3000).map(|i| (point(scale), 0.05 * scale * (-spread * (i as f32 / 3000.0)).exp())).collect();
            let grid = DiskGrid::build(balls.iter().copied());
            let mut found_any = 0;
            for i in 0..2000 {
                // Near the balls' centres too, or the small ones are never met.
                let p = if i % 2 == 0 { point(scale) } else { balls[i].0 + point(1.0) * balls[i].1 };
                let mut found = Vec::new();
                grid.containing(p, |index| found.push(index));
                found.sort_unstable();
                let expected: Vec<u32> = (0u32..).zip(&balls).filter(|(_, (c, r))| c.distance_squared(p) < r * r).map(|(i, _)| i).collect();
                found_any += expected.len();
                assert_eq!(found, expected, "scale {scale}, spread {spread}");
            }
            assert!(found_any > 1000);
        }
    }

    #[test]
    fn an_empty_grid_answers_nothing() {
        DiskGrid::build(std::iter::empty::<(Vec3, f32)>()).containing(Vec3::ZERO, |_| panic!("found something"));
    }
}
