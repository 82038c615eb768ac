//! What light paths leave at measurement points and in regions, summed in one order whatever the number of threads.

use super::aimed::AimedPath;
use super::points::{Points, Search, Touch};
use super::regions::Half;
use crate::math::Rgb;
use crate::samplers::{Draw, Drawn};
use crate::transport::walk::Tally;
use rayon::prelude::*;

/// Flux that a path left at a point, in its stratum.
#[derive(Clone, Copy, Debug)]
struct Deposit {
    point: u32,
    stratum: u32,
    value: Rgb,
}

/// Points of consecutive numbers share a list, so that lists are summed side by side.
const LISTS: usize = 32;

/// What one ensemble leaves.
#[derive(Debug)]
pub struct Deposits {
    lists: Vec<Vec<Deposit>>,
    points_a_list: u32,
    /// Per stratum and leaf: sum of the paths' weights in the mixture that statistics use, once a point.
    psi: Vec<Vec<f64>>,
    /// Per leaf: paths that contributed.
    paths: Vec<f64>,
    /// Pairs of the path at hand.
    touches: Vec<Touch>,
    search: Search,
    /// What tracing cost and gave up.
    pub tally: Tally,
}

impl Deposits {
    /// Nothing yet. `leaves` is 0 where no statistics are kept.
    pub fn new(points: usize, strata: usize, leaves: usize) -> Self {
        Self {
            lists: vec![Vec::new(); LISTS],
            points_a_list: points.div_ceil(LISTS).max(1) as u32,
            psi: vec![vec![0.0; leaves]; strata],
            paths: vec![0.0; leaves],
            touches: Vec::new(),
            search: Search::default(),
            tally: Tally::default(),
        }
    }

    /// Takes a path as the sampler hands it out.
    pub fn add(&mut self, points: &Points<'_>, path: &AimedPath, drawn: Drawn) {
        points.touched(&path.light.vertices, &mut self.search, &mut self.touches);
        if drawn.weight > 0.0 {
            self.touches.iter().for_each(|touch| points.fetch(touch.point));
            for touch in &self.touches {
                let value = points.value(touch.point, &path.light.vertices[touch.vertex as usize]) * drawn.weight as f32;
                let value = self.tally.finite(value);
                let list = &mut self.lists[(touch.point / self.points_a_list) as usize];
                list.push(Deposit { point: touch.point, stratum: drawn.stratum as u32, value });
            }
        }
        if drawn.pilot_weight > 0.0 && !self.paths.is_empty() {
            self.learn(points, drawn);
        }
    }

    /// A path counts once a point, however many of its vertices lie there: `P_k` is a probability.
    fn learn(&mut self, points: &Points<'_>, drawn: Drawn) {
        let psi = &mut self.psi[drawn.stratum];
        for (i, touch) in self.touches.iter().enumerate() {
            let before = &self.touches[..i];
            if before.iter().any(|earlier| earlier.point == touch.point) {
                continue;
            }
            let leaf = points.aim(touch.point).leaf;
            psi[leaf as usize] += drawn.pilot_weight;
            if !before.iter().any(|earlier| points.aim(earlier.point).leaf == leaf) {
                self.paths[leaf as usize] += 1.0;
            }
        }
    }
}

/// Sum of deposits at every point, strata scaled, and the two halves' statistics: ensembles of even and of odd number, each half an estimate by
/// itself.
pub fn collect(draw: &Draw<Deposits>, points: usize) -> (Vec<[f64; 3]>, [Half; 2]) {
    let mut sums = vec![[0.0; 3]; points];
    let each = points.div_ceil(LISTS).max(1);
    sums.par_chunks_mut(each).enumerate().for_each(|(list, sums)| {
        for deposit in draw.batches.iter().flat_map(|batch| &batch.lists[list]) {
            let scale = draw.scales[deposit.stratum as usize];
            let sum = &mut sums[deposit.point as usize - list * each];
            deposit.value.to_array().into_iter().zip(sum).for_each(|(value, sum)| *sum += scale * f64::from(value));
        }
    });
    (sums, [half(draw, 0), half(draw, 1)])
}

fn half(draw: &Draw<Deposits>, parity: usize) -> Half {
    let leaves = draw.batches.first().map_or(0, |batch| batch.paths.len());
    let mut half = Half { psi: vec![0.0; leaves], paths: vec![0.0; leaves] };
    let members = || draw.batches.iter().skip(parity).step_by(2);
    // Scales are for all ensembles together.
    let share = draw.batches.len() as f64 / members().count().max(1) as f64;
    for batch in members() {
        for (psi, scale) in batch.psi.iter().zip(&draw.scales) {
            half.psi.iter_mut().zip(psi).for_each(|(sum, value)| *sum += share * scale * value);
        }
        half.paths.iter_mut().zip(&batch.paths).for_each(|(sum, value)| *sum += value);
    }
    half
}
