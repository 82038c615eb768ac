//! How many photons a merge finds at a place, on average: counters in hashed cells, summed over passes [VCM* 5.1].
//!
//! A pass reads what earlier passes counted and no more, so its weights are given before its samples are drawn: whatever the counts are, they
//! cost noise and never bias.

use super::cells::{Cells, REGION_BUCKETS, floor};
use super::memo::{Memo, folded, folded_half};
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use wide::{f32x8, i32x8};

/// How the map is laid out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensitySettings {
    /// Side `r_c` of a cell, world units, positive.
    pub cell: f32,
    /// Counters, at least; a power of two of them can be told apart, at 8 bytes, in regions of 512 that exist where something is counted.
    /// Cells that share one are not told apart.
    pub counters: usize,
    /// Passes that are counted; then the map stays as it is [VCM* 5.1].
    pub passes: u32,
}

impl DensitySettings {
    /// Cells four times the first pass's merge radius wide, 2^24 counters, 50 passes.
    pub fn for_radius(radius: f32) -> Self {
        Self { cell: 4.0 * radius, counters: 1 << 24, passes: 50 }
    }
}

/// Light vertices counted by cell, over passes.
#[derive(Debug)]
pub struct DensityMap {
    cells: Cells,
    /// Counters, where any is needed.
    regions: Vec<OnceLock<Box<Region>>>,
    settings: DensitySettings,
    passes: u32,
    /// Vertices counted in all, so that no counter overflows.
    total: u64,
    /// What is read.
    snapshot: Snapshot,
}

/// Counters of a region's cells.
#[derive(Debug)]
struct Region {
    /// Until the last snapshot.
    earlier: [u32; REGION_BUCKETS],
    /// After it.
    since: [AtomicU32; REGION_BUCKETS],
}

/// The counts as they stood after some pass.
#[derive(Debug)]
struct Snapshot {
    passes: u32,
    /// Filtered counts that were asked for.
    filtered: Memo,
}

/// The lattice's offset in cells, so that floors at height 0 and other round numbers, where rounding throws a vertex to either side, lie inside
/// cells.
const OFFSET: Vec3 = Vec3::new(0.313, 0.427, 0.581);

/// Vertices counted together in one task, and runs of one cell in it at once.
const TASK: usize = 1 << 14;

impl DensityMap {
    /// A map that has seen no pass.
    pub fn new(settings: DensitySettings) -> Self {
        let cells = Cells::new(settings.cell, settings.counters);
        let regions = std::iter::repeat_with(OnceLock::default).take(cells.buckets() / REGION_BUCKETS).collect();
        Self { cells, regions, settings, passes: 0, total: 0, snapshot: Snapshot { passes: 0, filtered: Memo::new(0) } }
    }

    /// Passes counted.
    pub fn passes(&self) -> u32 {
        self.passes
    }

    /// Nothing is counted any more.
    pub fn is_frozen(&self) -> bool {
        self.passes >= self.settings.passes || self.total > u64::from(u32::MAX / 2)
    }

    /// Counts a pass's light vertices, those that merges can find, each as one whatever its flux; nothing once the map is frozen. Call it when
    /// every weight of the pass is known. Vertices in the order of a grid ([`super::Grid::position`]) are counted fastest.
    pub fn insert(&mut self, count: usize, position: impl Fn(usize) -> Vec3 + Sync) {
        if self.is_frozen() {
            return;
        }
        (0..count.div_ceil(TASK)).into_par_iter().for_each(|task| {
            let places = task * TASK..((task + 1) * TASK).min(count);
            let (mut last, mut run) = (IVec3::ZERO, 0);
            for place in places {
                let cell = floor(self.cells.scaled(position(place)) + OFFSET);
                if cell != last {
                    self.add(last, run);
                    (last, run) = (cell, 0);
                }
                run += 1;
            }
            self.add(last, run);
        });
        self.passes += 1;
        self.total += count as u64;
        if shows(self.passes) || self.is_frozen() {
            self.take_snapshot();
        }
    }

    /// A sum of whole numbers is the same in any order.
    #[inline(always)]
    fn add(&self, cell: IVec3, count: u32) {
        if count > 0 {
            let bucket = self.cells.bucket(folded(cell)) as usize;
            let region = self.regions[bucket / REGION_BUCKETS].get_or_init(Region::empty);
            region.since[bucket % REGION_BUCKETS].fetch_add(count, Ordering::Relaxed);
        }
    }

    /// From now on all that is counted so far is read.
    fn take_snapshot(&mut self) {
        let used: usize = self.regions.par_iter_mut().filter_map(OnceLock::get_mut).map(|region| region.count_all()).sum();
        self.snapshot = Snapshot { passes: self.passes, filtered: Memo::new(used) };
    }

    /// Expected number `k` of light vertices that a merge over the area `area` (the disk's, `pi r^2` with the radius of the pass that asks)
    /// finds around `p`: `q area / (r_c^2 passes)`, `q` the mean of the counts of the eight nearest cells that have any, weighted by
    /// `exp(-d / r_c)` with the distance to the cell's centre, and 1 where none has any: a place that no vertex reached in n passes is taken to
    /// be reached by one in n [VCM* 5.1]. Positive. Before the first pass it is 1 everywhere, which leaves every heuristic as it is without
    /// densities.
    ///
    /// Distances are those of the middle of the half cell around `p`, and passes those until the last of 1, 2, 3, 4, 6, 8, 12, .. or of all
    /// that are counted: so most answers are remembered.
    #[inline]
    pub fn photons(&self, p: Vec3, area: f32) -> f32 {
        let Snapshot { passes, filtered } = &self.snapshot;
        if *passes == 0 {
            return 1.0;
        }
        // In half cells, from the centre of a cell: the eight nearest centres are the corners of the unit cube of cells that holds the point.
        let half = folded_half(floor((self.cells.scaled(p) + (OFFSET - 0.5)) * 2.0));
        let count = filtered.get(half, || self.count_around(half));
        count * (area / (self.settings.cell * self.settings.cell * *passes as f32))
    }

    /// Light vertices per world unit squared and pass around `p`, as [`DensityMap::photons`] has them; `None` before the first pass.
    pub fn density(&self, p: Vec3) -> Option<f32> {
        (self.snapshot.passes > 0).then(|| self.photons(p, 1.0))
    }

    /// Filtered count in an eighth of the cube whose corners are the centres of eight cells, rounding kept from going below 1; 1 where all eight are empty.
    #[cold]
    #[inline(never)]
    fn count_around(&self, half: IVec3) -> f32 {
        let (corner, inside) = (half >> 1, half & 1);
        let part = (inside.x | inside.y << 1 | inside.z << 2) as usize;
        let counts = i32x8::new(self.cells.buckets_of_eight(corner).map(|bucket| self.count(bucket as usize) as i32));
        let counts = f32x8::from_i32x8(counts);
        let weights = f32x8::new(DECAY[part]) & counts.simd_gt(f32x8::ZERO);
        let weight = weights.reduce_add();
        if weight > 0.0 { ((weights * counts).reduce_add() / weight).max(1.0) } else { 1.0 }
    }

    /// What a counter said when the snapshot was taken.
    #[inline(always)]
    fn count(&self, bucket: usize) -> u32 {
        self.regions[bucket / REGION_BUCKETS].get().map_or(0, |region| region.earlier[bucket % REGION_BUCKETS])
    }
}

impl Region {
    fn empty() -> Box<Self> {
        Box::new(Self { earlier: [0; REGION_BUCKETS], since: std::array::from_fn(|_| AtomicU32::new(0)) })
    }

    /// What was counted since the last snapshot becomes part of it; counters that are not 0.
    fn count_all(&mut self) -> usize {
        for (earlier, since) in self.earlier.iter_mut().zip(&mut self.since) {
            *earlier += std::mem::take(since.get_mut());
        }
        self.earlier.iter().filter(|&&count| count > 0).count()
    }
}

/// Is a snapshot taken after so many passes: 1, 2, 3, 4, 6, 8, 12, 16, ..?
fn shows(passes: u32) -> bool {
    passes.is_power_of_two() || passes.is_multiple_of(3) && (passes / 3).is_power_of_two()
}

/// `exp(-d)`, `d` the distances in cells from the middle of an eighth of the unit cube to the cube's corners. Bits 0, 1, 2 of the eighth's number:
/// the farther half along x, y, z; corners in the order of [`Cells::buckets_of_eight`], which is the same.
const DECAY: [[f32; 8]; 8] = {
    // By the number of axes along which the corner is on the far side: d^2 is 3, 11, 19, 27 sixteenths.
    let near_to_far: [f32; 4] = [0.648_552_24, 0.436_417_4, 0.336_309_05, 0.272_794_07];
    let mut weights = [[0.0; 8]; 8];
    let mut pair = 0;
    while pair < 64 {
        let (part, corner) = (pair / 8, pair % 8);
        weights[part][corner] = near_to_far[(part ^ corner).count_ones() as usize];
        pair += 1;
    }
    weights
};

#[cfg(test)]
mod tests {
    use super::*;
    use isophote_samplers::{Key, Purpose, Stream, UniformStream};
    use rayon::ThreadPoolBuilder;
    use std::f32::consts::PI;

    const COUNT: usize = 200_000;

    fn stream(iteration: u64) -> UniformStream {
        Key { seed: 3, iteration, index: 0, purpose: Purpose::Test }.stream()
    }

    /// A pass's vertices, uniform on a square of side 2 at height 0, where rounding throws them to either side.
    fn plane(iteration: u64) -> Vec<Vec3> {
        let mut s = stream(iteration);
        (0..COUNT).map(|i| Vec3::new(2.0 * s.next_1d() - 1.0, if i % 2 == 0 { 1e-8 } else { -1e-8 }, 2.0 * s.next_1d() - 1.0)).collect()
    }

    fn map(cell: f32, passes: u64) -> DensityMap {
        let mut map = DensityMap::new(DensitySettings { cell, counters: 1 << 24, passes: 50 });
        for pass in 0..passes {
            let points = plane(pass);
            map.insert(points.len(), |i| points[i]);
        }
        map
    }

    /// Mean and root mean square error of k over places well inside the square, relative to the truth.
    fn errors(map: &DensityMap, area: f32) -> (f64, f64) {
        let truth = f64::from(area) * COUNT as f64 / 4.0;
        let mut s = stream(99);
        let errors: Vec<f64> = (0..4000)
            .map(|_| {
                let p = Vec3::new(1.8 * s.next_1d() - 0.9, 0.0, 1.8 * s.next_1d() - 0.9);
                f64::from(map.photons(p, area)) / truth - 1.0
            })
            .collect();
        let n = errors.len() as f64;
        (errors.iter().sum::<f64>() / n, (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt())
    }

    /// Counts in the cells follow the area, whatever the cells' side, at whatever radius they are asked.
    #[test]
    fn an_even_plane_gives_its_density_with_cells_of_any_side() {
        for cell in [0.01, 0.023, 0.05, 0.1] {
            let map = map(cell, 8);
            for radius in [0.003f32, 0.02] {
                let (mean, root) = errors(&map, PI * radius * radius);
                // A cell of side 0.01 counts 40 vertices in 8 passes, give or take a sixth; eight cells, four of them in the plane.
                assert!(mean.abs() < 0.01 && root < 0.12, "cell {cell}: mean {mean:.4}, root mean square {root:.4}");
            }
        }
    }

    /// The mean over passes, not their sum.
    #[test]
    fn more_passes_change_noise_and_not_the_number() {
        let area = 1e-3;
        let (one, many) = (errors(&map(0.02, 1), area), errors(&map(0.02, 16), area));
        assert!(one.0.abs() < 0.02 && many.0.abs() < 0.01, "{one:?}, {many:?}");
        assert!(many.1 < 0.4 * one.1, "sixteen passes have a quarter of the noise: {one:?}, {many:?}");
    }

    #[test]
    fn a_map_that_saw_no_pass_says_one() {
        let map = map(0.02, 0);
        for radius in [1e-4, 1.0] {
            assert_eq!(map.photons(Vec3::new(0.1, 0.2, 0.3), radius), 1.0);
        }
        assert!(!map.is_frozen());
    }

    /// One vertex in as many passes as there were, where there was none.
    #[test]
    fn an_empty_place_counts_as_seen_once() {
        for passes in [1u64, 4] {
            let map = map(0.02, passes);
            let k = map.photons(Vec3::new(0.0, 0.5, 0.0), 1e-4);
            assert!((k - 1e-4 / (4e-4 * passes as f32)).abs() < 1e-6, "{k}");
        }
    }

    #[test]
    fn a_frozen_map_stays() {
        let points = plane(0);
        let mut map = DensityMap::new(DensitySettings { cell: 0.02, counters: 1 << 20, passes: 3 });
        for _ in 0..3 {
            assert!(!map.is_frozen());
            map.insert(points.len(), |i| points[i]);
        }
        assert!(map.is_frozen());
        let before = map.photons(Vec3::ZERO, 1e-3);
        map.insert(points.len(), |i| points[i] * 0.1);
        assert_eq!((map.photons(Vec3::ZERO, 1e-3), map.passes()), (before, 3));
    }

    #[test]
    fn the_weights_fall_as_the_exponential() {
        let bits = |i: usize| Vec3::from_array([0, 1, 2].map(|axis| (i >> axis & 1) as f32));
        for (part, weights) in DECAY.into_iter().enumerate() {
            let middle = 0.25 + 0.5 * bits(part);
            for (corner, weight) in weights.into_iter().enumerate() {
                let d = middle.distance(bits(corner));
                assert!((weight * d.exp() - 1.0).abs() < 1e-6, "{part} {corner}");
            }
        }
    }

    /// Memory follows what is counted, not the number of counters.
    #[test]
    fn a_small_scene_has_few_regions() {
        let map = map(0.05, 2);
        let regions = map.regions.iter().filter(|region| region.get().is_some()).count();
        // 40 x 40 cells in one layer, which may touch 6 x 6 regions.
        assert!((25..=36).contains(&regions), "{regions}");
    }

    #[test]
    fn what_is_read_is_never_the_running_pass_and_at_most_a_third_older() {
        let shown: Vec<u32> = (1..=50).filter(|&n| shows(n)).collect();
        assert_eq!(shown, [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48]);
        let points = plane(0);
        let mut map = DensityMap::new(DensitySettings { cell: 0.02, counters: 1 << 20, passes: 50 });
        for pass in 1..=10 {
            map.insert(points.len(), |i| points[i]);
            let k = map.photons(Vec3::new(0.1, 0.0, 0.1), 1e-3);
            // The same points again and again: the mean over passes stays, whichever are read.
            let mut first = DensityMap::new(map.settings);
            first.insert(points.len(), |i| points[i]);
            assert!((k / first.photons(Vec3::new(0.1, 0.0, 0.1), 1e-3) - 1.0).abs() < 1e-3, "{pass}: {k}");
            assert!(map.snapshot.passes <= pass && 3 * map.snapshot.passes >= 2 * pass, "{pass}: {}", map.snapshot.passes);
        }
    }

    /// Same counts at any number of threads, and in whatever order vertices come.
    #[test]
    fn threads_and_order_change_no_bit() {
        let mut points = plane(0);
        let mut maps = Vec::new();
        for threads in [1, 2, 5] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut map = DensityMap::new(DensitySettings { cell: 0.02, counters: 1 << 16, passes: 3 });
            pool.install(|| map.insert(points.len(), |i| points[i]));
            maps.push(map);
            points.reverse();
        }
        let counts = |map: &DensityMap| (0..map.cells.buckets()).map(|bucket| map.count(bucket)).collect::<Vec<_>>();
        assert_eq!(counts(&maps[0]), counts(&maps[1]));
        assert_eq!(counts(&maps[0]), counts(&maps[2]));
        assert_eq!(counts(&maps[0]).iter().sum::<u32>(), COUNT as u32);
    }
}
