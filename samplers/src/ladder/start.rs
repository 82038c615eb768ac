//! The start of the first draw: independent paths, of which chains begin.
//!
//! Every chain's first state is resampled from them with probability proportional to its target, which has the chain's law but for the
//! finite pool; the normalisation is not carried by a weight of the chain but estimated apart, so no start-up bias enters it [VEACH 11.3].

use crate::allocation::Problem;
use crate::diagnostics::blocks::Mean;
use crate::mutation::Coordinates;
use crate::sampler::LightPathSpace;
use crate::state::{Chain, Life};
use crate::stream::{Key, Purpose, Stream};
use rayon::prelude::*;

/// Paths a batch.
const BATCH: u64 = 1024;
/// Largest number of paths that the first allocation is found from.
const SAMPLES: usize = 4096;

/// What independent paths tell.
pub(super) struct Pool {
    rungs: usize,
    paths: u64,
    /// Paths that some target above rung 0 sees, and all their targets.
    visible: Vec<Seen>,
    values: Vec<f64>,
    /// Cost and usefulness of the rest.
    rest: (f64, f64),
}

struct Seen {
    index: u64,
    cost: f64,
    useful: f64,
}

/// Traces `paths` independent paths of an iteration. `measured` asks for usefulness as well.
pub(super) fn pool<P: LightPathSpace>(space: &P, (seed, iteration): (u64, u64), rungs: usize, paths: u64, measured: bool) -> Pool {
    let batch = |batch: usize| {
        let batch = batch as u64;
        let mut pool = Pool { rungs, paths: 0, visible: Vec::new(), values: Vec::new(), rest: (0.0, 0.0) };
        let mut path = P::Path::default();
        let mut made = Vec::new();
        let mut values = vec![0.0; rungs];
        for index in batch * BATCH..paths.min((batch + 1) * BATCH) {
            let mut random = key(seed, iteration, index).stream();
            space.trace(&mut Coordinates::fresh(&mut random, &mut made), &mut path);
            space.targets(&path, &mut values);
            let (cost, useful) = if measured { (space.cost(&path), space.usefulness(&path)) } else { (1.0, 0.0) };
            pool.paths += 1;
            if values[1..].iter().any(|value| *value > 0.0) {
                pool.visible.push(Seen { index, cost, useful });
                pool.values.extend_from_slice(&values);
            } else {
                pool.rest.0 += cost;
                pool.rest.1 += useful;
            }
        }
        pool
    };
    let batches: Vec<Pool> = (0..paths.div_ceil(BATCH) as usize).into_par_iter().with_max_len(1).map(batch).collect();
    let mut all = Pool { rungs, paths, visible: Vec::new(), values: Vec::new(), rest: (0.0, 0.0) };
    for batch in batches {
        all.visible.extend(batch.visible);
        all.values.extend(batch.values);
        all.rest.0 += batch.rest.0;
        all.rest.1 += batch.rest.1;
    }
    all
}

fn key(seed: u64, iteration: u64, index: u64) -> Key {
    Key { seed, iteration, index, purpose: Purpose::Pilot }
}

/// `count` numbers of candidates, each taken with probability proportional to its worth; none where nothing is worth anything. Their
/// positions in the cumulated worths are evenly spaced with a common random offset in [0, 1): each has the right law, and no candidate is taken
/// twice while another as good is left out.
pub(super) fn evenly(worths: &[f64], offset: f64, count: usize) -> Vec<usize> {
    let total: f64 = worths.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return Vec::new();
    }
    let spacing = total / count as f64;
    let (mut place, mut sum) = (0, worths[0]);
    let position = |i: usize| {
        while sum <= (i as f64 + offset) * spacing && place + 1 < worths.len() {
            place += 1;
            sum += worths[place];
        }
        // Rounding of the sum can carry the last position past the last candidate that is worth anything.
        while worths[place] <= 0.0 && place > 0 {
            place -= 1;
        }
        place
    };
    (0..count).map(position).collect()
}

impl Pool {
    fn targets(&self, rung: usize) -> impl Iterator<Item = f64> + '_ {
        self.values.chunks_exact(self.rungs).map(move |values| values[rung])
    }

    /// Estimates of all `b`; the bound `1/paths` where nothing was met.
    pub(super) fn normalisations(&self) -> Vec<f64> {
        let count = self.paths.max(1) as f64;
        let mean = |rung| self.targets(rung).sum::<f64>() / count;
        let positive = |b: f64| if b > 0.0 { b } else { 1.0 / count };
        std::iter::once(1.0).chain((1..self.rungs).map(|rung| positive(mean(rung)))).collect()
    }

    /// The mean of the first target.
    pub(super) fn first(&self) -> Mean {
        let (sum, squares) = self.targets(1).fold((0.0, 0.0), |(sum, squares), t| (sum + t, squares + t * t));
        Mean::of_independent(sum, squares, self.paths)
    }

    /// Gives every ensemble's chain of `rung` a start.
    pub(super) fn start<'a, P: LightPathSpace>(
        &self,
        space: &P,
        (seed, iteration): (u64, u64),
        rung: usize,
        chains: impl ExactSizeIterator<Item = &'a mut Chain>,
    ) {
        let offset = f64::from(key(seed, iteration, self.paths + rung as u64).stream().next_1d());
        let worths: Vec<f64> = self.targets(rung).collect();
        let mut path = P::Path::default();
        let places = evenly(&worths, offset, chains.len());
        for (chain, place) in chains.zip(places) {
            let mut random = key(seed, iteration, self.visible[place].index).stream();
            space.trace(&mut Coordinates::fresh(&mut random, &mut chain.coordinates), &mut path);
            chain.life = Life::Alive;
        }
    }

    /// The allocation's problem, with densities per unit of cost as of [`Problem`].
    pub(super) fn problem(&self, dispersions: &[f64]) -> (Problem, Vec<f64>) {
        let b = self.normalisations();
        let count = self.paths.max(1) as f64;
        let cost_of = |rung: usize| {
            let mut sums = if rung == 0 { (self.rest.0, count - self.visible.len() as f64) } else { (0.0, 0.0) };
            for (seen, t) in self.visible.iter().zip(self.targets(rung)) {
                sums = (sums.0 + t * seen.cost, sums.1 + t);
            }
            if sums.1 > 0.0 { sums.0 / sums.1 } else { 1.0 }
        };
        let costs: Vec<f64> = (0..self.rungs).map(cost_of).collect();
        let scales: Vec<f64> = (0..self.rungs).map(|c| 1.0 / (b[c] * dispersions[c] * costs[c])).collect();
        let mut problem = Problem::new(self.rungs);
        let stride = self.visible.len().div_ceil(SAMPLES).max(1);
        for place in (0..self.visible.len()).step_by(stride) {
            let values = &self.values[place * self.rungs..][..self.rungs];
            problem.push(values.iter().zip(&scales).map(|(t, s)| t * s), stride as f64 / count * self.visible[place].useful);
        }
        problem.push((0..self.rungs).map(|c| if c == 0 { scales[0] } else { 0.0 }), self.rest.1 / count);
        (problem, costs)
    }
}
