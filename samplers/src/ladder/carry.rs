//! States that a draw leaves to the next one, whose targets may be others.
//!
//! At the end of a draw a chain of rung c stands at a state of the law `T_c/b_c`; the next draw wants `T'_c/b'_c`. Going on from the state as if
//! nothing had happened is biased until the chain has forgotten it. So a draw keeps a sample of the states it counted, with their targets. If
//! its targets are new ([`Ladder::retargeted`](crate::Ladder::retargeted)) the next one evaluates its own targets at all of them and resamples every chain's start with probability
//! proportional to `T'_c/T_c`: sampling importance resampling, the step of sequential Monte Carlo from one target to the next. What remains
//! is an error of the order of one over the number of states kept, and what the old target does not cover: states that only the new one sees are
//! not among those kept. With a support that moves in every draw this is a bias that more draws do not mend (docs/methods/samplers.md, bias of
//! moving targets); targets should change seldom, and their supports only grow.

use super::start::evenly;
use crate::mutation::Coordinates;
use crate::sampler::LightPathSpace;
use crate::state::{Chain, Life};
use crate::stream::{Key, Purpose, Stream};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// States kept per rung and ensemble.
pub(super) const KEPT: u64 = 64;
/// States replayed by one task.
const BATCH: usize = 64;

/// States of one rung.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Carried {
    coordinates: Vec<u32>,
    states: Vec<Kept>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Kept {
    /// Where its coordinates end.
    end: usize,
    /// The rung's target at it.
    target: f64,
    climbed: bool,
}

impl Carried {
    /// Adds a state.
    pub(super) fn push(&mut self, coordinates: &[u32], target: f64, climbed: bool) {
        self.coordinates.extend_from_slice(coordinates);
        self.states.push(Kept { end: self.coordinates.len(), target, climbed });
    }

    /// Adds another ensemble's.
    pub(super) fn append(&mut self, other: &Carried) {
        let before = self.coordinates.len();
        self.coordinates.extend_from_slice(&other.coordinates);
        self.states.extend(other.states.iter().map(|kept| Kept { end: before + kept.end, ..kept.clone() }));
    }

    /// Nothing kept.
    pub(super) fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    fn coordinates(&self, state: usize) -> &[u32] {
        let start = if state == 0 { 0 } else { self.states[state - 1].end };
        &self.coordinates[start..self.states[state].end]
    }

    /// Gives every chain of `rung` a start under the present targets; where no state is worth anything the chains keep what they have. Returns
    /// how many states were traced, and how many of them are worth nothing now.
    pub(super) fn start<'a, P: LightPathSpace>(
        &self,
        space: &P,
        (seed, iteration): (u64, u64),
        rung: usize,
        rungs: usize,
        chains: impl ExactSizeIterator<Item = &'a mut Chain>,
    ) -> (u64, u64) {
        let key = |index: u64| Key { seed, iteration, index: (rung as u64) << 32 | index, purpose: Purpose::Pilot };
        let worth = |batch: usize| {
            let (mut path, mut made, mut values) = (P::Path::default(), Vec::new(), vec![0.0; rungs]);
            let mut random = key(1 + batch as u64).stream();
            let states = batch * BATCH..self.states.len().min((batch + 1) * BATCH);
            let of_state = |state: usize| {
                made.clear();
                made.extend_from_slice(self.coordinates(state));
                space.trace(&mut Coordinates::after(&mut random, &mut made), &mut path);
                space.targets(&path, &mut values);
                values[rung] / self.states[state].target
            };
            states.map(of_state).collect::<Vec<f64>>()
        };
        let worths: Vec<Vec<f64>> = (0..self.states.len().div_ceil(BATCH)).into_par_iter().with_max_len(1).map(worth).collect();
        let worths = worths.concat();
        let offset = f64::from(key(0).stream().next_1d());
        let starts = evenly(&worths, offset, chains.len());
        for (chain, state) in chains.zip(starts) {
            chain.coordinates.clear();
            chain.coordinates.extend_from_slice(self.coordinates(state));
            chain.life = Life::Alive;
            chain.climbed = self.states[state].climbed;
        }
        (worths.len() as u64, worths.iter().filter(|worth| **worth <= 0.0).count() as u64)
    }
}
