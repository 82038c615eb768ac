//! What a draw's tallies come to, and what is kept of them for reports.

use super::Ladder;
use super::carry::Carried;
use super::ensemble::Tally;
use crate::allocation::Problem;
use crate::diagnostics::blocks::Mean;
use crate::diagnostics::dispersion::Dispersion;
use crate::diagnostics::rhat::r_hat;
use crate::diagnostics::{LadderReport, RungReport};
use serde::{Deserialize, Serialize};

/// The tallies of one draw: ensembles of rungs.
pub(super) struct DrawSummary {
    tallies: Vec<Vec<Tally>>,
}

impl DrawSummary {
    pub(super) fn new(tallies: Vec<Vec<Tally>>) -> Self {
        Self { tallies }
    }

    fn rung(&self, rung: usize) -> impl Iterator<Item = &Tally> {
        self.tallies.iter().map(move |ensemble| &ensemble[rung])
    }

    fn rungs(&self) -> usize {
        self.tallies.first().map_or(0, Vec::len)
    }

    fn sum(&self, rung: usize, of: impl Fn(&Tally) -> u64) -> u64 {
        self.rung(rung).map(of).sum()
    }

    fn steps(&self, rung: usize) -> u64 {
        self.sum(rung, |tally| tally.steps.iter().sum())
    }

    /// `b/N`; 0 for a rung without a counted step.
    pub(super) fn scale(&self, rung: usize, b: f64) -> f64 {
        match self.steps(rung) {
            0 => 0.0,
            steps => b / steps as f64,
        }
    }

    /// Ratios of each rung's target to the one below, rung 1 first.
    pub(super) fn ratios(&self) -> Vec<Mean> {
        let ratio = |rung| Mean::of_blocks(self.rung(rung).map(|tally| (&tally.ratio, &tally.steps)));
        (0..self.rungs().saturating_sub(1)).map(ratio).collect()
    }

    fn log(&self, rung: usize) -> Mean {
        Mean::of_blocks(self.rung(rung).map(|tally| (&tally.log, &tally.steps)))
    }

    /// States of every rung for the next draw; rungs without any keep what they had.
    pub(super) fn carry(&self, carried: &mut [Carried]) {
        for (rung, carried) in carried.iter_mut().enumerate() {
            let mut new = Carried::default();
            self.rung(rung).for_each(|tally| new.append(&tally.carried));
            if !new.is_empty() {
                *carried = new;
            }
        }
    }

    /// Adds the draw's counts per cell.
    pub(super) fn disperse(&self, rung: usize, dispersion: &mut Dispersion) {
        let ensembles: Vec<(u64, &[u32])> = self.rung(rung).map(|tally| (tally.steps.iter().sum(), tally.cells.as_slice())).collect();
        dispersion.add(&ensembles);
    }

    /// The allocation's problem and the rungs' mean costs. Every rung gave `n_c` samples; joined by the balance heuristic each stands for
    /// `1/sum_c n_c T_c/b_c` of the space [VEACH (9.8)].
    pub(super) fn problem(&self, b: &[f64], dispersions: &[f64]) -> (Problem, Vec<f64>) {
        let rungs = self.rungs();
        let row = rungs + 1;
        let mean_cost = |rung: usize| {
            let cost: f64 = self.rung(rung).map(|tally| tally.cost).sum();
            let mean = cost / self.sum(rung, |tally| tally.proposals).max(1) as f64;
            if mean > 0.0 && mean.is_finite() { mean } else { 1.0 }
        };
        let costs: Vec<f64> = (0..rungs).map(mean_cost).collect();
        let taken: Vec<f64> = (0..rungs).map(|rung| self.sum(rung, |tally| (tally.samples.len() / row) as u64) as f64).collect();
        let mut problem = Problem::new(rungs);
        for sample in self.tallies.iter().flatten().flat_map(|tally| tally.samples.chunks_exact(row)) {
            let (values, useful) = (&sample[..rungs], sample[rungs]);
            let density: f64 = (0..rungs).map(|c| taken[c] * values[c] / b[c]).sum();
            problem.push((0..rungs).map(|c| values[c] / (b[c] * dispersions[c] * costs[c])), useful / density);
        }
        (problem, costs)
    }
}

/// What reports need, over all draws and of the last.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Summary {
    round_trips: u64,
    /// Independent paths of the last draw.
    independent: u64,
    rungs: Vec<RungSummary>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct RungSummary {
    share: f64,
    steps: u64,
    uncounted: u64,
    acceptance: Option<f64>,
    /// Of redrawn ends.
    redraw_acceptance: Option<f64>,
    /// Of all steps.
    moved: Option<f64>,
    attempts: u64,
    exchanged: u64,
    dead: u64,
    log: Mean,
    traces: Vec<Vec<f32>>,
    trace_stride: u64,
}

fn fraction(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

impl Summary {
    pub(super) fn new(rungs: usize) -> Self {
        Self { rungs: vec![RungSummary::default(); rungs], ..Self::default() }
    }

    /// Fraction of a rung's steps in the last draw that moved.
    pub(super) fn acceptance(&self, rung: usize) -> Option<f64> {
        self.rungs[rung].moved
    }

    /// Counts stored states that are worth nothing under the present targets.
    pub(super) fn add_dead(&mut self, rung: usize, dead: u64) {
        self.rungs[rung].dead += dead;
    }

    /// Adds a draw.
    pub(super) fn add(&mut self, draw: &DrawSummary, shares: &[f64], strides: &[u64]) {
        self.independent = draw.steps(0);
        self.round_trips += draw.sum(0, |tally| tally.round_trips);
        for (rung, summary) in self.rungs.iter_mut().enumerate() {
            summary.share = shares[rung];
            summary.steps += draw.steps(rung);
            summary.uncounted += draw.sum(rung, |tally| tally.uncounted);
            let [accepted, mutated] = [draw.sum(rung, |tally| tally.accepted), draw.sum(rung, |tally| tally.mutated)];
            let [taken, redrawn] = [draw.sum(rung, |tally| tally.redrawn_accepted), draw.sum(rung, |tally| tally.redrawn)];
            summary.acceptance = fraction(accepted, mutated);
            summary.redraw_acceptance = fraction(taken, redrawn);
            summary.moved = fraction(accepted + taken, mutated + redrawn);
            summary.attempts += draw.sum(rung, |tally| tally.attempts);
            summary.exchanged += draw.sum(rung, |tally| tally.exchanged);
            summary.dead += draw.sum(rung, |tally| tally.dead);
            summary.log.add(&draw.log(rung));
            summary.traces = draw.rung(rung).map(|tally| tally.trace.clone()).collect();
            summary.trace_stride = strides[rung];
        }
    }

    pub(super) fn report(&self, ladder: &Ladder) -> LadderReport {
        LadderReport {
            draws: ladder.draws,
            rested: ladder.rested,
            traced: ladder.traced,
            ensembles: ladder.chains.len(),
            round_trips: self.round_trips,
            rungs: (0..self.rungs.len()).map(|rung| self.rung(ladder, rung)).collect(),
        }
    }

    fn rung(&self, ladder: &Ladder, rung: usize) -> RungReport {
        let kept = &self.rungs[rung];
        let normalisation = ladder.normalisation.b(rung);
        let error = ladder.normalisation.error(rung, self.independent);
        let chain = rung > 0;
        let sizes = ladder.chains.iter().filter_map(|chains| chains.get(rung.wrapping_sub(1))).map(|chain| chain.step.size());
        let target_time = if chain { kept.log.time() } else { None };
        let ratio_time = ladder.normalisation.pooled(rung).and_then(Mean::time);
        RungReport {
            share: kept.share,
            next_share: ladder.shares[rung],
            steps: kept.steps,
            uncounted: kept.uncounted,
            acceptance: kept.acceptance,
            redraw_acceptance: kept.redraw_acceptance,
            step_size: chain.then(|| sizes.sum::<f64>() / ladder.chains.len() as f64),
            dispersion: if chain { ladder.dispersions[rung].tau().unwrap_or(1.0) } else { 1.0 },
            normalisation,
            normalisation_error: error,
            normalisation_relative_error: (normalisation > 0.0).then(|| error / normalisation),
            exchange_attempts: kept.attempts,
            exchange_rate: fraction(kept.exchanged, kept.attempts),
            dead_states: kept.dead,
            target_time,
            target_effective: target_time.map(|time| kept.steps as f64 / time),
            ratio_time,
            ratio_effective: ratio_time.map(|time| kept.steps as f64 / time),
            r_hat: if chain { r_hat(&kept.traces) } else { None },
            traces: kept.traces.clone(),
            trace_stride: kept.trace_stride,
        }
    }
}
