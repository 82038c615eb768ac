//! One ensemble of a draw: a chain a rung, run by one thread from start to end.
//!
//! A step of rung c mutates its state and accepts with `min(1, T_c(y)/T_c(x))` \[KELEMEN02\]; the state *after* it is counted; then the chain
//! tries an exchange with one neighbour, accepted with `min(1, T_a(x_b) T_b(x_a) / (T_a(x_a) T_b(x_b)))` \[STF\]. A step of rung 0 is an
//! independent path `u`, which rung 1 takes with `min(1, T_1(u)/T_1(x_1))`: its old state would go to rung 0, whose next path is independent
//! of it, so it is dropped \[HACHISUKA11\]. Which rung steps and whom it asks depends on counts alone, never on states: each step is
//! a kernel that keeps the product of all rungs' laws, and so does any fixed sequence of them.
//!
//! **Steps of all sizes.** A small step has the chain's size `d`, or one of `d/4, d/16, ... d/4096`, all equally likely. One size steered to a wanted
//! mean acceptance fits the places where the chain is most of the time; where a target has wide parts and narrow ones (light far off, and
//! near the camera) it is far too large for the narrow ones, and a chain that gets there stands still for hundreds of steps. A mixture of
//! symmetric kernels is symmetric.
//!
//! **Redrawn ends.** Some steps keep the coordinates before a cut and draw the rest afresh: where it is hard to come in and easy to move
//! about inside, they leave a place at once that small steps linger in. The cut is uniform over the `L(x)` coordinates the path used, and a
//! path that keeps the first k of them uses more than k, so the way back exists with probability `1/L(y)`; the acceptance is
//! `min(1, T_c(y) L(x) / (T_c(x) L(y)))`. Neither this nor the sizes are in \[STF\] or \[HACHISUKA11\].

use super::carry::Carried;
use super::schedule::Schedule;
use super::weights::Mixture;
use crate::adapt::StepSize;
use crate::diagnostics::blocks::{BLOCKS, Blocks};
use crate::mutation::mutate_all;
use crate::sampler::{CELLS, Drawn, LightPathSpace};
use crate::state::{Chain, Life, State};
use crate::stream::{Key, Purpose, UniformStream};

/// Sizes of small steps, each a quarter of the one before: down to a 4096th, since a target may be far narrower in some places than in others.
const SIZES: usize = 7;

/// Steps of a slice.
const SLICE: u64 = 512;

/// What all ensembles of a draw share.
pub(super) struct Plan<'a> {
    pub(super) seed: u64,
    pub(super) iteration: u64,
    pub(super) shares: &'a [f64],
    pub(super) mixture: Mixture,
    pub(super) burn_in: u64,
    pub(super) acceptance: f64,
    /// Probability that a step redraws the path's end in place of mutating all of it.
    pub(super) redraw: f64,
    pub(super) exchanges: bool,
    /// Steps of each rung between two points of its trace.
    pub(super) trace_strides: Vec<u64>,
    /// Steps of each rung between two states kept for the next draw.
    pub(super) carry_strides: Vec<u64>,
    /// Steps of each rung between two samples for the allocation; none are taken if it is empty.
    pub(super) sample_strides: Vec<u64>,
}

/// What one rung of one ensemble did in a draw.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    /// Counted steps, by block.
    pub(super) steps: [u64; BLOCKS],
    /// Ratio of the next rung's target to this one's.
    pub(super) ratio: Blocks,
    /// Logarithm of the last rung's target.
    pub(super) log: Blocks,
    pub(super) uncounted: u64,
    /// Small steps.
    pub(super) mutated: u64,
    pub(super) accepted: u64,
    /// Redrawn ends.
    pub(super) redrawn: u64,
    pub(super) redrawn_accepted: u64,
    /// Exchanges with the next rung.
    pub(super) attempts: u64,
    pub(super) exchanged: u64,
    pub(super) round_trips: u64,
    pub(super) dead: u64,
    /// Cost of the proposals after burn-in.
    pub(super) cost: f64,
    pub(super) proposals: u64,
    /// Counted steps by cell.
    pub(super) cells: Vec<u32>,
    pub(super) trace: Vec<f32>,
    /// Rows of all targets and the usefulness.
    pub(super) samples: Vec<f64>,
    /// States kept for the next draw.
    pub(super) carried: Carried,
    until_trace: u64,
    until_carried: u64,
    until_sample: u64,
}

/// Where a step goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Proposal {
    /// An independent path.
    Independent,
    /// A small step in every coordinate.
    Small,
    /// The coordinates before a cut as they are, independent ones from there on.
    End,
}

/// What an ensemble leaves.
pub(super) struct Outcome<A> {
    pub(super) accumulator: A,
    pub(super) tallies: Vec<Tally>,
    pub(super) traced: u64,
}

/// Where a counted step stands.
#[derive(Clone, Copy)]
struct Place {
    block: usize,
    /// Number of the step within the iteration.
    index: u64,
}

/// A running ensemble, advanced slice by slice so that threads finish together.
pub(super) struct Ensemble<'a, P: LightPathSpace, A, E> {
    space: &'a P,
    plan: &'a Plan<'a>,
    schedule: Schedule<'a>,
    /// Number of the first step, and how many there are.
    steps: (u64, u64),
    /// Steps done.
    done: u64,
    /// The block that the next step belongs to.
    block: usize,
    /// Where it ends.
    block_end: u64,
    /// Rounds of the burn-in that remain.
    burn_in: u64,
    chains: &'a mut [Chain],
    random: UniformStream,
    /// States of rungs 1 and up. They and the proposal change places in nearly every step, so what moves is where they are.
    states: Vec<Box<State<P::Path>>>,
    /// Step sizes and turns of the chains.
    sizes: Vec<(StepSize, u64)>,
    proposal: Box<State<P::Path>>,
    tallies: Vec<Tally>,
    accumulator: A,
    emit: &'a E,
    /// Of the path handed out.
    drawn: Vec<Drawn>,
    traced: u64,
}

impl<'a, P: LightPathSpace, A, E: Fn(&mut A, &P::Path, &[Drawn])> Ensemble<'a, P, A, E> {
    /// Ensemble number `ensemble` with its stored chains `chains`, replayed under the present targets, for `steps.1` steps, whose numbers
    /// begin with `steps.0`.
    pub(super) fn new(
        space: &'a P,
        plan: &'a Plan<'a>,
        ensemble: u64,
        steps: (u64, u64),
        chains: &'a mut [Chain],
        accumulator: A,
        emit: &'a E,
    ) -> Self {
        let rungs = plan.shares.len();
        let mut random = Key { seed: plan.seed, iteration: plan.iteration, index: ensemble, purpose: Purpose::Mutate }.stream();
        let mut tallies: Vec<Tally> = (0..rungs).map(|_| Tally { cells: vec![0; CELLS], ..Tally::default() }).collect();
        let mut traced = 0;
        let mut states = Vec::with_capacity(chains.len());
        for (rung, chain) in chains.iter().enumerate().map(|(i, chain)| (i + 1, chain)) {
            let mut state = Box::new(State::new(rungs));
            state.climbed = chain.climbed;
            if chain.life != Life::Empty {
                state.replay(space, rung, &chain.coordinates, &mut random);
                state.settle(rung);
                traced += 1;
                tallies[rung].dead += u64::from(state.life == Life::Dead);
            }
            states.push(state);
        }
        let sizes = chains.iter().map(|chain| (chain.step.clone(), chain.turn)).collect();
        Self {
            space,
            plan,
            schedule: Schedule::new(plan.shares),
            steps,
            done: 0,
            block: 0,
            block_end: end_of_block(0, steps.1),
            burn_in: if rungs > 1 { plan.burn_in } else { 0 },
            chains,
            random,
            states,
            sizes,
            proposal: Box::new(State::new(rungs)),
            tallies,
            accumulator,
            emit,
            drawn: Vec::new(),
            traced,
        }
    }

    /// Goes on by a slice. Returns whether there is more to do.
    pub(super) fn advance(&mut self) -> bool {
        if self.burn_in > 0 {
            let rounds = self.burn_in.min((SLICE / self.plan.shares.len() as u64).max(1));
            for _ in 0..rounds {
                for rung in 0..self.plan.shares.len() {
                    self.step(rung, None);
                }
            }
            self.burn_in -= rounds;
            return true;
        }
        let (first, steps) = self.steps;
        for _ in 0..SLICE.min(steps - self.done) {
            while self.done >= self.block_end {
                self.block += 1;
                self.block_end = end_of_block(self.block, steps);
            }
            let rung = self.schedule.next();
            self.step(rung, Some(Place { block: self.block, index: first + self.done }));
            self.done += 1;
        }
        self.done < steps
    }

    /// Hands out what is left and stores the chains.
    pub(super) fn finish(mut self) -> Outcome<A> {
        for (rung, chain) in (1..).zip(std::mem::take(&mut self.chains)) {
            let state = &mut self.states[rung - 1];
            let (step, turn) = self.sizes[rung - 1].clone();
            *chain = Chain { coordinates: std::mem::take(&mut state.coordinates), life: state.life, climbed: state.climbed, step, turn };
            std::mem::swap(state, &mut self.proposal);
            self.hand_out();
        }
        Outcome { accumulator: self.accumulator, tallies: self.tallies, traced: self.traced }
    }

    #[inline]
    fn step(&mut self, rung: usize, counted: Option<Place>) {
        if rung == 0 {
            self.uniform_step(counted);
        } else {
            self.chain_step(rung, counted);
        }
    }

    /// Traces a proposal.
    #[inline]
    fn propose(&mut self, rung: usize, how: Proposal, counted: bool) {
        let made = &mut self.proposal.coordinates;
        made.clear();
        match how {
            Proposal::Independent => {}
            Proposal::Small => {
                let size = self.sizes[rung - 1].0.finer(self.random.below(SIZES));
                mutate_all(&self.states[rung - 1].coordinates, size, &mut self.random, made);
            }
            Proposal::End => {
                let kept = &self.states[rung - 1].coordinates;
                made.extend_from_slice(&kept[..self.random.below(kept.len())]);
            }
        }
        self.proposal.trace(self.space, &mut self.random);
        self.traced += 1;
        if counted {
            self.tallies[rung].proposals += 1;
            self.tallies[rung].cost += self.space.cost(&self.proposal.path);
        }
    }

    fn uniform_step(&mut self, counted: Option<Place>) {
        self.propose(0, Proposal::Independent, counted.is_some());
        if let Some(place) = counted {
            let tally = &mut self.tallies[0];
            tally.steps[place.block] += 1;
            if let Some(next) = self.proposal.values.get(1) {
                tally.ratio.add(place.block, *next);
            }
            sample(tally, self.plan, 0, &self.proposal, self.space);
            self.proposal.count(0, place.index);
        }
        if !self.states.is_empty() && self.plan.exchanges {
            self.exchange_with_independent(counted.is_some());
        }
        // Left at once, unless rung 1 has taken it and left its own.
        self.hand_out();
    }

    fn exchange_with_independent(&mut self, counted: bool) {
        let (new, old) = (self.proposal.values[1], self.states[0].values[1]);
        let alive = self.states[0].life == Life::Alive;
        let taken = new > 0.0 && (!alive || self.random.chance() * old < new);
        if counted {
            self.tallies[0].attempts += 1;
            self.tallies[0].exchanged += u64::from(taken);
        }
        if taken {
            self.tallies[0].round_trips += u64::from(self.states[0].climbed && counted);
            self.take(1, false);
        }
    }

    /// The proposal becomes the state of `rung`; `climbed` is whether it has been on the last rung. The old state is left.
    #[inline]
    fn take(&mut self, rung: usize, climbed: bool) {
        let state = &mut self.states[rung - 1];
        std::mem::swap(state, &mut self.proposal);
        state.life = Life::Alive;
        state.climbed = climbed;
        state.settle(rung);
        self.hand_out();
    }

    fn chain_step(&mut self, rung: usize, counted: Option<Place>) {
        let state = &self.states[rung - 1];
        let (life, old, climbed, length) = (state.life, state.values[rung], state.climbed, state.coordinates.len());
        let how = match life {
            Life::Empty => Proposal::Independent,
            Life::Alive if length > 0 && self.random.chance() < self.plan.redraw => Proposal::End,
            Life::Alive | Life::Dead => Proposal::Small,
        };
        self.propose(rung, how, counted.is_some());
        let new = self.proposal.values[rung];
        if life == Life::Alive {
            // The cut is one of `length` places on the way there, and the same one of as many as the proposal has on the way back.
            let lengths = if how == Proposal::End { length as f64 / self.proposal.coordinates.len() as f64 } else { 1.0 };
            let accepted = self.random.chance() * old < new * lengths;
            if how == Proposal::Small {
                self.sizes[rung - 1].0.learn(accepted, self.plan.acceptance);
            }
            if accepted {
                self.take(rung, climbed);
            }
            if let Some(place) = counted {
                let tally = &mut self.tallies[rung];
                let (made, taken) = match how {
                    Proposal::End => (&mut tally.redrawn, &mut tally.redrawn_accepted),
                    Proposal::Small | Proposal::Independent => (&mut tally.mutated, &mut tally.accepted),
                };
                *made += 1;
                *taken += u64::from(accepted);
                self.count(rung, place);
            }
        } else {
            // The first visible proposal is forced; the step that found it is not counted.
            if new > 0.0 {
                self.take(rung, false);
            }
            self.tallies[rung].uncounted += u64::from(counted.is_some());
        }
        self.exchange_by_turns(rung, counted.is_some());
    }

    #[inline]
    fn count(&mut self, rung: usize, place: Place) {
        let (state, tally) = (&mut self.states[rung - 1], &mut self.tallies[rung]);
        state.count(rung, place.index);
        tally.steps[place.block] += 1;
        tally.ratio.add(place.block, state.ratio);
        tally.log.add(place.block, state.log());
        if tally.until_trace == 0 {
            tally.until_trace = self.plan.trace_strides[rung];
            tally.trace.push(state.log() as f32);
        }
        tally.until_trace -= 1;
        if tally.until_carried == 0 {
            tally.until_carried = self.plan.carry_strides[rung];
            tally.carried.push(&state.coordinates, state.values[rung], state.climbed);
        }
        tally.until_carried -= 1;
        sample(tally, self.plan, rung, state, self.space);
    }

    /// Hands out what the buffer of proposals holds, for the steps it was counted in at every rung.
    #[inline]
    fn hand_out(&mut self) {
        let state = &mut self.proposal;
        let Some(index) = state.index.take() else { return };
        let cell = self.space.cell(&state.path).map(|cell| cell as usize % CELLS);
        self.drawn.clear();
        for (rung, count) in state.counts.iter_mut().enumerate().filter(|(_, count)| **count > 0) {
            let repeats = std::mem::take(count);
            let (weight, pilot) = self.plan.mixture.of(rung, &state.values);
            let [weight, pilot_weight] = [weight, pilot].map(|weight| f64::from(repeats) * weight);
            self.drawn.push(Drawn { index, stratum: rung, weight, pilot_weight, repeats });
            if let Some(cell) = cell {
                self.tallies[rung].cells[cell] += repeats;
            }
        }
        (self.emit)(&mut self.accumulator, &state.path, &self.drawn);
    }

    /// Exchanges with the rung above on even steps of the chain, with the one below on odd ones; rung 0 has its own way.
    #[inline]
    fn exchange_by_turns(&mut self, rung: usize, counted: bool) {
        let turn = &mut self.sizes[rung - 1].1;
        *turn += 1;
        if !self.plan.exchanges {
            return;
        }
        if turn.is_multiple_of(2) {
            if rung < self.states.len() {
                self.exchange(rung, counted);
            }
        } else if rung > 1 {
            self.exchange(rung - 1, counted);
        }
    }

    /// Tries to exchange the states of rungs `low >= 1` and `low + 1`. A chain without a living state takes a copy of its neighbour's.
    fn exchange(&mut self, low: usize, counted: bool) {
        let high = low + 1;
        let (a, b) = (&self.states[low - 1], &self.states[high - 1]);
        if a.life != Life::Alive || b.life != Life::Alive {
            self.revive(low, high);
            return;
        }
        let there = a.values[high] * b.values[low];
        let here = a.values[low] * b.values[high];
        let swapped = self.random.chance() * here < there;
        if counted {
            self.tallies[low].attempts += 1;
            self.tallies[low].exchanged += u64::from(swapped);
        }
        if swapped {
            self.states.swap(low - 1, high - 1);
            self.states[low - 1].settle(low);
            self.states[high - 1].settle(high);
        }
    }

    /// A start like a forced acceptance: it costs a path and is counted only from its own next step on.
    #[cold]
    fn revive(&mut self, low: usize, high: usize) {
        for (from, to) in [(low, high), (high, low)] {
            let (source, target) = (&self.states[from - 1], &self.states[to - 1]);
            if source.life == Life::Alive && target.life != Life::Alive && source.values[to] > 0.0 {
                self.proposal.replay(self.space, to, &source.coordinates, &mut self.random);
                self.traced += 1;
                self.take(to, false);
                return;
            }
        }
    }
}

/// The first step after a block, of `steps` in all.
fn end_of_block(block: usize, steps: u64) -> u64 {
    (u128::from(steps) * (block as u128 + 1) / BLOCKS as u128) as u64
}

/// Takes every n-th counted step of a rung as a sample for the allocation.
#[inline]
fn sample<P: LightPathSpace>(tally: &mut Tally, plan: &Plan<'_>, rung: usize, state: &State<P::Path>, space: &P) {
    let Some(stride) = plan.sample_strides.get(rung) else { return };
    if tally.until_sample == 0 {
        tally.until_sample = *stride;
        tally.samples.extend_from_slice(&state.values);
        tally.samples.push(space.usefulness(&state.path));
    }
    tally.until_sample -= 1;
}
