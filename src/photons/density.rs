//! How many photons a merge finds at a place, on average: counters in hashed cells, summed over passes [VCM* 5.1].
//!
//! A pass reads what earlier passes counted and no more, so its weights are given before its samples are drawn: whatever the counts are, they
//! cost noise and never bias.

use super::cells::{Cells, floor};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};
use wide::{f32x8, i32x8};

/// How the map is laid out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensitySettings {
    /// Side `r_c` of a cell, world units, positive.
    pub cell: f32,
    /// Counters, at least; a power of two of them is kept, at 4 bytes. Cells that share one are not told apart.
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
    counters: Vec<AtomicU32>,
    settings: DensitySettings,
    passes: u32,
    /// Vertices counted in all, so that no counter overflows.
    total: u64,
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
        let counters = std::iter::repeat_with(AtomicU32::default).take(cells.buckets()).collect();
        Self { cells, counters, settings, passes: 0, total: 0 }
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
            let (mut last, mut run) = (None, 0);
            for place in places {
                let bucket = self.cells.bucket(floor(self.cells.scaled(position(place)) + OFFSET));
                if last != Some(bucket) {
                    self.add(last, run);
                    (last, run) = (Some(bucket), 0);
                }
                run += 1;
            }
            self.add(last, run);
        });
        self.passes += 1;
        self.total += count as u64;
    }

    /// A sum of whole numbers is the same in any order.
    #[inline(always)]
    fn add(&self, bucket: Option<u32>, count: u32) {
        if let Some(bucket) = bucket {
            self.counters[bucket as usize].fetch_add(count, Ordering::Relaxed);
        }
    }

    /// Expected number `k` of light vertices that a merge over the area `area` (the disk's, `pi r^2` with the radius of the pass that asks)
    /// finds around `p`: `q area / (r_c^2 passes)`, `q` the mean of the counts of the eight nearest cells that have any, weighted by
    /// `exp(-d / r_c)` with the distance to the cell's centre, and 1 where none has any: a place that no vertex reached in n passes is taken to
    /// be reached by one in n [VCM* 5.1]. Positive. Before the first pass it is 1 everywhere, which leaves every heuristic as it is without
    /// densities.
    #[inline]
    pub fn photons(&self, p: Vec3, area: f32) -> f32 {
        if self.passes == 0 {
            return 1.0;
        }
        let count = self.count_around(p).max(1.0);
        count * area / (self.settings.cell * self.settings.cell * self.passes as f32)
    }

    /// Filtered count around a place; 0 where all eight cells are empty.
    #[inline(always)]
    fn count_around(&self, p: Vec3) -> f32 {
        // In units of cells, from the centre of one: the eight nearest centres are the corners of the unit cube that holds the point.
        let from = self.cells.scaled(p) + (OFFSET - 0.5);
        let corner = floor(from);
        let buckets = self.cells.buckets_of_eight(corner);
        let counts = i32x8::new(buckets.map(|bucket| self.counters[bucket as usize].load(Ordering::Relaxed) as i32));
        let counts = f32x8::from_i32x8(counts);
        let square = |d: f32, next: [f32; 8]| {
            let d = f32x8::splat(d) - f32x8::new(next);
            d * d
        };
        let from = from - corner.as_vec3();
        let distance = (square(from.x, NEXT_X) + square(from.y, NEXT_Y) + square(from.z, NEXT_Z)).sqrt();
        let weights = decay(distance) & counts.simd_gt(f32x8::ZERO);
        let weight = weights.reduce_add();
        if weight > 0.0 { (weights * counts).reduce_add() / weight } else { 0.0 }
    }
}

/// Corners of the unit cube in the order of [`Cells::buckets_of_eight`].
const NEXT_X: [f32; 8] = [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0];
const NEXT_Y: [f32; 8] = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0];
const NEXT_Z: [f32; 8] = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];

/// `exp(-d)` for d in [0, sqrt(3)], to 0.03 %: weights need no more, and the library's exponential took a third of a look-up.
#[inline(always)]
fn decay(d: f32x8) -> f32x8 {
    // Least greatest relative error, by iteratively reweighted least squares.
    let [a, b, c, e, f] = [0.999_752_75, -0.994_507_2, 0.477_740_36, -0.132_086_06, 0.016_985_25].map(f32x8::splat);
    f.mul_add(d, e).mul_add(d, c).mul_add(d, b).mul_add(d, a)
}

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
        for i in 0..=1000 {
            let d = 3.0f32.sqrt() * i as f32 / 1000.0;
            assert!((decay(f32x8::splat(d)).to_array()[0] * d.exp() - 1.0).abs() < 3e-4, "{d}");
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
        let counts = |map: &DensityMap| map.counters.iter().map(|c| c.load(Ordering::Relaxed)).collect::<Vec<_>>();
        assert_eq!(counts(&maps[0]), counts(&maps[1]));
        assert_eq!(counts(&maps[0]), counts(&maps[2]));
        assert_eq!(counts(&maps[0]).iter().sum::<u32>(), COUNT as u32);
    }
}
