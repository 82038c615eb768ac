//! Balls of many sizes, found by the points inside them.

use crate::math::fetch;
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use wide::f32x8;

/// Eight balls of a bucket's list, component by component. A place that is not taken holds no point.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
struct Group {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
    radius2: [f32; LANES],
    index: [u32; LANES],
}

/// Balls tested at once.
const LANES: usize = 8;

impl Group {
    /// A bit for each ball that holds the point.
    #[inline(always)]
    fn holding(&self, p: [f32x8; 3]) -> u32 {
        let (x, y, z) = (f32x8::new(self.x) - p[0], f32x8::new(self.y) - p[1], f32x8::new(self.z) - p[2]);
        (x * x + y * y + z * z).simd_lt(f32x8::new(self.radius2)).to_bitmask()
    }
}

/// Levels of cells, each twice as wide as the one below; their set fits a word.
const LEVELS: u32 = 24;

/// A hash grid of several cell sizes. A ball lies in the level whose cells are as wide as its diameter to twice that, in the list of every
/// cell that it meets, so that a query reads one list a level; a grid of the widest cells tells beforehand which levels have anything near.
#[derive(Debug)]
pub(super) struct DiskGrid {
    /// Widest cells first.
    levels: Vec<Level>,
    /// Runs of buckets that are filled side by side.
    parts: Vec<Part>,
    /// Binary logarithm of the buckets a part.
    part_bits: u32,
    /// Levels present in each bucket of the widest cells.
    present: Vec<u32>,
}

/// A run of buckets.
#[derive(Debug, Default)]
struct Part {
    /// Its bucket `b` holds `groups[starts[b]..starts[b + 1]]`.
    starts: Vec<u32>,
    groups: Vec<Group>,
}

/// Binary logarithm of the number of parts, whatever the number of threads.
const PART_BITS: u32 = 6;
/// Balls that one task sorts into parts.
const CHUNK: usize = 4096;

/// Cells of one size. Levels have buckets of their own: a ball lies in several buckets of its level, and in one list that a query reads.
#[derive(Clone, Copy, Debug)]
struct Level {
    /// Reciprocal of the side of a cell.
    inverse_cell: f32,
    /// Number of its first bucket.
    first: u32,
    /// One less than the number of its buckets, a power of two.
    mask: u32,
}

impl Level {
    #[inline(always)]
    fn bucket(&self, cell: IVec3) -> u32 {
        self.first + (hash(cell) & self.mask)
    }
}

impl DiskGrid {
    /// Sorts balls, given by centre and radius (positive, world units), into cells. Fewer than 2^28 of them.
    pub(super) fn build(balls: &[(Vec3, f32)]) -> Self {
        let widest = balls.iter().map(|(_, r)| *r).fold(0.0, f32::max);
        let narrowest = balls.iter().map(|(_, r)| *r).fold(f32::INFINITY, f32::min);
        let level_count = if balls.is_empty() { 0 } else { ((widest / narrowest).log2().floor() as u32 + 1).clamp(1, LEVELS) };
        let level_of = |r: f32| ((widest / r).log2().floor() as u32).min(level_count - 1) as usize;

        // Four buckets a ball, in each level.
        let mut of_level = vec![0usize; level_count as usize];
        balls.iter().for_each(|(_, r)| of_level[level_of(*r)] += 1);
        let mut buckets = 0;
        let level = |(level, balls): (usize, &usize)| {
            let size = (4 * balls).next_power_of_two();
            let first = buckets;
            buckets += size;
            Level { inverse_cell: 0.5 * (level as f32).exp2() / widest, first: first as u32, mask: (size - 1) as u32 }
        };
        let levels: Vec<Level> = of_level.iter().enumerate().map(level).collect();
        let part_bits = buckets.next_power_of_two().ilog2().saturating_sub(PART_BITS);

        // Which ball lies in which bucket, sorted into parts.
        let coarse = balls.len().max(1).next_power_of_two();
        let coarse_bits = coarse.ilog2().saturating_sub(PART_BITS);
        let all = Level { inverse_cell: levels.first().map_or(1.0, |level| level.inverse_cell), first: 0, mask: coarse as u32 - 1 };
        let sort = |(chunk, balls): (usize, &[(Vec3, f32)])| {
            let (mut lists, mut present) = (vec![Vec::new(); 1 << PART_BITS], vec![Vec::new(); 1 << PART_BITS]);
            for (index, &(p, r)) in (chunk * CHUNK..).zip(balls) {
                let level = level_of(r);
                cells(p, r, &levels[level], |bucket| lists[(bucket >> part_bits) as usize].push((bucket, index as u32)));
                cells(p, r, &all, |bucket| present[(bucket >> coarse_bits) as usize].push((bucket, 1 << level)));
            }
            (lists, present)
        };
        let chunks: Vec<(Lists, Lists)> = balls.par_chunks(CHUNK).enumerate().with_max_len(1).map(sort).collect();

        let part = |part: usize| Part::build(1 << part_bits, balls, || chunks.iter().flat_map(move |(lists, _)| &lists[part]));
        let parts = (0..1 << PART_BITS).into_par_iter().with_max_len(1).map(part).collect();
        let mut present = vec![0u32; coarse];
        present.par_chunks_mut(1 << coarse_bits).enumerate().for_each(|(part, present)| {
            for &(bucket, level) in chunks.iter().flat_map(|(_, lists)| &lists[part]) {
                present[bucket as usize & ((1 << coarse_bits) - 1)] |= level;
            }
        });
        Self { levels, parts, part_bits, present }
    }

    /// The part of a bucket, and the bucket's number in it.
    #[inline(always)]
    fn part(&self, bucket: u32) -> (&Part, usize) {
        (&self.parts[(bucket >> self.part_bits) as usize], (bucket & ((1 << self.part_bits) - 1)) as usize)
    }

    /// Calls `visit` with the number of a place and of a ball that holds it, for all of them, places in order. `scratch` is memory.
    ///
    /// All places are looked up together, step by step, each step asking for what the next one reads: a look-up is three waits for memory.
    #[inline]
    pub(super) fn containing(
        &self,
        places: impl Iterator<Item = Vec3> + Clone,
        scratch: &mut Vec<Lookup>,
        mut visit: impl FnMut(u32, u32),
    ) {
        let Some(widest) = self.levels.first() else { return };
        let all = Level { first: 0, mask: self.present.len() as u32 - 1, ..*widest };
        scratch.clear();
        for (place, p) in (0u32..).zip(places.clone()) {
            let bucket = all.bucket(cell_of(p, all.inverse_cell));
            fetch(&self.present[bucket as usize]);
            scratch.push(Lookup { place, p, bucket });
        }
        let count = scratch.len();
        for i in 0..count {
            let Lookup { place, p, bucket: coarse } = scratch[i];
            let mut levels = self.present[coarse as usize];
            while levels != 0 {
                let level = &self.levels[levels.trailing_zeros() as usize];
                levels &= levels - 1;
                let bucket = level.bucket(cell_of(p, level.inverse_cell));
                let (part, local) = self.part(bucket);
                fetch(&part.starts[local]);
                scratch.push(Lookup { place, p, bucket });
            }
        }
        for lookup in &scratch[count..] {
            let (part, bucket) = self.part(lookup.bucket);
            if let Some(group) = part.groups.get(part.starts[bucket] as usize) {
                // A group lies in three cache lines.
                fetch(&group.x);
                fetch(&group.z);
                fetch(&group.index);
            }
        }
        for &Lookup { place, p, bucket } in &scratch[count..] {
            let splat = [p.x, p.y, p.z].map(f32x8::splat);
            let (part, bucket) = self.part(bucket);
            for group in &part.groups[part.starts[bucket] as usize..part.starts[bucket + 1] as usize] {
                let mut held = group.holding(splat);
                while held != 0 {
                    visit(place, group.index[held.trailing_zeros() as usize]);
                    held &= held - 1;
                }
            }
        }
    }
}

/// Buckets and what lies in them, by part.
type Lists = Vec<Vec<(u32, u32)>>;

impl Part {
    /// Of `buckets` buckets, a power of two. `entries` are pairs of a bucket's number and a ball's, balls ascending.
    fn build<'a, E: Iterator<Item = &'a (u32, u32)>>(buckets: usize, balls: &[(Vec3, f32)], entries: impl Fn() -> E) -> Self {
        let local = |bucket: u32| bucket as usize & (buckets - 1);
        let mut starts = vec![0u32; buckets + 1];
        entries().for_each(|(bucket, _)| starts[local(*bucket) + 1] += 1);
        // From balls a bucket to the first group of each.
        let mut sum = 0;
        for start in &mut starts {
            sum += start.div_ceil(LANES as u32);
            *start = sum;
        }
        let mut taken = vec![0u32; buckets];
        let mut groups = vec![Group::default(); sum as usize];
        for &(bucket, index) in entries() {
            let (bucket, (p, r)) = (local(bucket), balls[index as usize]);
            let place = taken[bucket] as usize;
            taken[bucket] += 1;
            let (group, lane) = (&mut groups[starts[bucket] as usize + place / LANES], place % LANES);
            (group.x[lane], group.y[lane], group.z[lane]) = (p.x, p.y, p.z);
            (group.radius2[lane], group.index[lane]) = (r * r, index);
        }
        Self { starts, groups }
    }
}

/// A list to be read for a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lookup {
    place: u32,
    p: Vec3,
    bucket: u32,
}

/// Calls `visit` with the bucket of every cell that the ball meets, each bucket once: a ball must not stand twice in a list.
fn cells(p: Vec3, radius: f32, level: &Level, mut visit: impl FnMut(u32)) {
    // Wider by the rounding of these sums, so that no point inside the ball falls outside its cells.
    let reach = Vec3::splat(radius + (p.abs().max_element() + radius) * f32::EPSILON);
    let (low, high) = (cell_of(p - reach, level.inverse_cell), cell_of(p + reach, level.inverse_cell));
    let mut seen = [u32::MAX; 27];
    let mut count = 0;
    // A diameter is no wider than a cell, so at most two cells an axis, three where rounding widens it.
    for z in low.z..=high.z {
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                let bucket = level.bucket(IVec3::new(x, y, z));
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

/// Teschner et al.'s primes, and a last mix so that the low bits depend on all.
#[inline(always)]
fn hash(cell: IVec3) -> u32 {
    let h = (cell.x as u32).wrapping_mul(73_856_093) ^ (cell.y as u32).wrapping_mul(19_349_663) ^ (cell.z as u32).wrapping_mul(83_492_791);
    let h = h.wrapping_mul(0x85eb_ca6b);
    h ^ (h >> 15)
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
            let grid = DiskGrid::build(&balls);
            let (mut found_any, mut scratch) = (0, Vec::new());
            for i in 0..2000 {
                // Near the balls' centres too, or the small ones are never met.
                let p = if i % 2 == 0 { point(scale) } else { balls[i].0 + point(1.0) * balls[i].1 };
                let mut found = Vec::new();
                // Two places at once, one far away.
                grid.containing([Vec3::splat(1e4), p].into_iter(), &mut scratch, |place, index| found.push((place, index)));
                assert!(found.iter().all(|(place, _)| *place == 1));
                let mut found: Vec<u32> = found.into_iter().map(|(_, index)| index).collect();
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
        let grid = DiskGrid::build(&[]);
        grid.containing(std::iter::once(Vec3::ZERO), &mut Vec::new(), |_, _| panic!("found something"));
    }
}
