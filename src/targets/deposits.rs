//! What light paths leave at measurement points and in regions, summed in one order whatever the number of threads.

use super::light_paths::Arrivals;
use super::points::{Points, Search, Touch};
use super::regions::Half;
use super::shares::Shares;
use crate::math::Rgb;
use crate::samplers::Drawn;
use crate::transport::walk::Tally;
use rayon::prelude::*;

/// What is summed at a point beside counts: flux, or nothing.
pub trait Left: Copy + Send + Sync {
    /// As three numbers.
    fn values(self) -> [f32; 3];
}

impl Left for Rgb {
    #[inline(always)]
    fn values(self) -> [f32; 3] {
        self.to_array()
    }
}

impl Left for () {
    #[inline(always)]
    fn values(self) -> [f32; 3] {
        [0.0; 3]
    }
}

/// What a path left at a point.
#[derive(Clone, Copy, Debug)]
struct Deposit<V> {
    point: u32,
    path: PathNumber,
    value: V,
}

/// Number of a path within its ensemble, and whether this is its first deposit at the point and in the point's region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PathNumber(u32);

impl PathNumber {
    const FIRST_AT_POINT: u32 = 1 << 31;
    const FIRST_IN_REGION: u32 = 1 << 30;

    fn index(self) -> usize {
        (self.0 & !(Self::FIRST_AT_POINT | Self::FIRST_IN_REGION)) as usize
    }

    fn is(self, flag: u32) -> bool {
        self.0 & flag != 0
    }
}

/// Points of consecutive numbers share a list, so that lists are summed side by side.
const LISTS: usize = 32;

/// What one ensemble leaves.
#[derive(Debug)]
pub struct Deposits<V> {
    lists: Vec<Vec<Deposit<V>>>,
    points_a_list: u32,
    /// Strata of the paths that left something.
    shares: Shares,
    /// Regions are asked for.
    regions: bool,
    /// Pairs of the path at hand.
    touches: Vec<Touch>,
    search: Search,
    /// What tracing cost and gave up.
    pub tally: Tally,
}

/// What light paths left at one point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Collected {
    /// Flux, strata scaled, not yet divided by the kernel size.
    pub flux: [f64; 3],
    /// By half of the ensembles (those of even and of odd number): the estimated probability that a uniform path reaches the point,
    /// `psi_k` [STF (6), (7)]. Each half is an estimate by itself.
    pub psi: [f64; 2],
    /// By half: paths whose first deposit in the point's region was here.
    pub paths: [f64; 2],
}

impl<V: Left> Deposits<V> {
    /// Nothing yet. `regions` is whether statistics for them are kept.
    pub fn new(points: usize, regions: bool) -> Self {
        Self {
            lists: vec![Vec::new(); LISTS],
            points_a_list: points.div_ceil(LISTS).max(1) as u32,
            shares: Shares::default(),
            regions,
            touches: Vec::new(),
            search: Search::default(),
            tally: Tally::default(),
        }
    }

    /// Takes a path as the sampler hands it out: at most 2^30 that leave something. `value` is what a vertex leaves at a point that takes it.
    pub fn add<P: Arrivals>(&mut self, points: &Points<'_>, path: &P, drawn: &[Drawn], value: impl Fn(&mut Tally, u32, &P::Vertex) -> V) {
        points.touched(path.vertices(), &mut self.search, &mut self.touches);
        if self.touches.is_empty() {
            return;
        }
        self.touches.iter().for_each(|touch| points.fetch(touch.point));
        let number = self.shares.paths();
        self.shares.add(drawn);
        for (i, touch) in self.touches.iter().enumerate() {
            let value = value(&mut self.tally, touch.point, &path.vertices()[touch.vertex as usize]);
            let flags = if self.regions { firsts(points, &self.touches[..i], touch.point) } else { 0 };
            let list = &mut self.lists[(touch.point / self.points_a_list) as usize];
            list.push(Deposit { point: touch.point, path: PathNumber(number | flags), value });
        }
    }

    /// Pairs of a light vertex and a measurement point that took it.
    pub fn count(&self) -> u64 {
        self.lists.iter().map(|list| list.len() as u64).sum()
    }
}

/// A path counts once a point, however many of its vertices lie there: `P_k` is a probability.
fn firsts(points: &Points<'_>, before: &[Touch], point: u32) -> u32 {
    let leaf = points.aim(point).leaf;
    let (mut at_point, mut in_region) = (PathNumber::FIRST_AT_POINT, PathNumber::FIRST_IN_REGION);
    for earlier in before {
        if earlier.point == point {
            at_point = 0;
        }
        if points.aim(earlier.point).leaf == leaf {
            in_region = 0;
        }
    }
    at_point | in_region
}

/// Sums at every point of what a draw's batches left, by its scales.
pub fn collect<V: Left>(batches: &[Deposits<V>], scales: &[f64], points: usize) -> Vec<Collected> {
    let factors: Vec<Vec<[f64; 2]>> = batches.par_iter().map(|batch| batch.shares.factors(scales)).collect();
    // Scales are for all ensembles together.
    let count = batches.len();
    let halves = [count.div_ceil(2), count / 2].map(|members| count as f64 / members.max(1) as f64);
    let mut sums = vec![Collected::default(); points];
    let each = points.div_ceil(LISTS).max(1);
    sums.par_chunks_mut(each).enumerate().with_max_len(1).for_each(|(list, sums)| {
        for (number, (batch, factors)) in batches.iter().zip(&factors).enumerate() {
            let half = number % 2;
            for deposit in &batch.lists[list] {
                let [flux, psi] = factors[deposit.path.index()];
                let sum = &mut sums[deposit.point as usize - list * each];
                deposit.value.values().into_iter().zip(&mut sum.flux).for_each(|(value, sum)| *sum += flux * f64::from(value));
                // A path of the last rung alone has no part in statistics.
                if psi > 0.0 {
                    sum.psi[half] += if deposit.path.is(PathNumber::FIRST_AT_POINT) { halves[half] * psi } else { 0.0 };
                    sum.paths[half] += if deposit.path.is(PathNumber::FIRST_IN_REGION) { 1.0 } else { 0.0 };
                }
            }
        }
    });
    sums
}

/// At every point the light vertices that it took, as many as independent paths would have left were there one of them: paths by what they count
/// for, strata scaled.
pub fn vertices<V: Left>(batches: &[Deposits<V>], scales: &[f64], points: usize) -> Vec<f64> {
    let factors: Vec<Vec<[f64; 2]>> = batches.par_iter().map(|batch| batch.shares.factors(scales)).collect();
    let mut sums = vec![0.0; points];
    let each = points.div_ceil(LISTS).max(1);
    sums.par_chunks_mut(each).enumerate().with_max_len(1).for_each(|(list, sums)| {
        for (batch, factors) in batches.iter().zip(&factors) {
            for deposit in &batch.lists[list] {
                sums[deposit.point as usize - list * each] += factors[deposit.path.index()][0];
            }
        }
    });
    sums
}

/// The two halves' statistics of regions, from those of their points.
pub fn halves(collected: &[Collected], leaf: impl Fn(usize) -> u32, leaves: usize) -> [Half; 2] {
    [0, 1].map(|half| {
        let mut sums = Half { psi: vec![0.0; leaves], paths: vec![0.0; leaves] };
        for (point, at) in collected.iter().enumerate() {
            let leaf = leaf(point) as usize;
            sums.psi[leaf] += at.psi[half];
            sums.paths[leaf] += at.paths[half];
        }
        sums
    })
}
