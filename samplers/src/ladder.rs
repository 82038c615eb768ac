//! A ladder of Markov chains from the uniform law to a hard target.
//!
//! Rung 0 draws independent paths; rung c is a chain with the law `T_c/b_c`; neighbours exchange states (module `ensemble`). A draw runs
//! `ensembles` such groups side by side, joins their paths by fixed weights (`weights`), and estimates the normalisations (`normalisation`)
//! that only its end knows and [`Draw::scales`] carries. A ladder with two rungs is visibility-driven photon tracing \[HACHISUKA11\], one with
//! four the spatial target function \[STF\].

mod carry;
mod ensemble;
mod normalisation;
mod schedule;
mod settings;
mod start;
mod summary;
mod weights;

pub use settings::{Allocation, Combine, LadderSettings, Normaliser};

use crate::allocation::{floors, steps_for};
use crate::diagnostics::dispersion::Dispersion;
use crate::diagnostics::{LadderReport, TRACE_POINTS};
use crate::sampler::{Draw, Drawn, LightPathSpace, PhotonSampler};
use crate::state::Chain;
use carry::{Carried, KEPT};
use ensemble::{Ensemble, Outcome, Plan};
use normalisation::Normalisation;
use rayon::ScopeFifo;
use serde::{Deserialize, Serialize};
use summary::Summary;
use weights::Mixture;

/// Dispersion of chains that the first allocation assumes.
const FIRST_DISPERSION: f64 = 5.0;
/// Variance that chains must fall below, relative to independent paths at the same cost of paths alone. Easy scenes are foreseen at 0.85 to 1,
/// hard ones below 0.7 (docs/methods/samplers.md).
const WORTHWHILE: f64 = 0.8;
/// Draws whose samples all shape the allocation; later ones do where their targets are new, or by turns, since it moves little.
const SHAPING: u64 = 8;
/// Of later draws one in this many.
const SHAPING_TURN: u64 = 4;
/// Samples for the allocation per rung and ensemble: 4096 for four rungs and sixteen ensembles.
const SAMPLES: u64 = 64;

/// Chains at several target functions that exchange states. Serialises to everything a later draw depends on: coordinates, step sizes,
/// normalisations, dispersions and shares, but no path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ladder {
    settings: LadderSettings,
    draws: u64,
    traced: u64,
    /// Chains of rungs 1 and up, by ensemble.
    chains: Vec<Vec<Chain>>,
    /// States of the last draw, by rung.
    carried: Vec<Carried>,
    normalisation: Normalisation,
    dispersions: Vec<Dispersion>,
    /// Shares of the steps in the next draw.
    shares: Vec<f64>,
    /// Variance with chains over that of independent paths alone at the same cost, as the last allocation foresees it.
    gain: Option<f64>,
    /// Iterations left to independent paths.
    rested: u64,
    exchanges: bool,
    /// The next draw's targets are new to the chains.
    retargeted: bool,
    summary: Summary,
}

impl Ladder {
    /// A ladder that has drawn nothing.
    pub fn new(settings: LadderSettings) -> Self {
        let rungs = settings.rungs.max(1);
        Self {
            draws: 0,
            traced: 0,
            chains: vec![vec![Chain::default(); rungs - 1]; settings.ensembles.max(1)],
            carried: vec![Carried::default(); rungs],
            normalisation: Normalisation::new(rungs),
            dispersions: vec![Dispersion::default(); rungs],
            shares: schedule::fixed_shares(rungs),
            gain: None,
            rested: 0,
            exchanges: true,
            retargeted: false,
            summary: Summary::new(rungs),
            settings,
        }
    }

    /// The same ladder with its rungs on their own: no exchange between chains, no independent path into rung 1. For ablations: chains
    /// keep their laws but not their way from island to island.
    pub fn without_exchanges(self) -> Self {
        Self { exchanges: false, ..self }
    }

    /// Says that the next draw's targets are not the last draw's: its chains start from states of the last draw, resampled by what the new
    /// targets make of them, and burn in again; pooled normalisations begin anew. Without this call the targets must be the same functions,
    /// and chains go on from where they stand: they keep their laws, with no start-up to forget.
    pub fn retargeted(&mut self) {
        self.retargeted = true;
    }

    /// Whether chains are expected to lower the variance by enough to pay for what a draw with chains costs beside its paths. True until
    /// [`Allocation::Measured`] has found otherwise in the last draw.
    pub fn worthwhile(&self) -> bool {
        self.gain.is_none_or(|gain| gain < WORTHWHILE)
    }

    /// Takes note of an iteration of `paths` light paths for which the caller used [`Uniform`](crate::Uniform) instead. The decision must not
    /// depend on these paths; [`Ladder::worthwhile`] is made of earlier ones. Chains go on afterwards from where they stand.
    pub fn rest(&mut self, paths: u64) {
        self.rested += 1;
        self.traced += paths;
    }

    /// How densely the next draw's paths will lie, over as many independent ones: the sum over rungs of these factors times the rung's target, in
    /// paths that are worth an independent one. From earlier draws alone; `None` before the first.
    pub fn densities(&self) -> Option<Vec<f64>> {
        let known = self.normalisation.assumed.len() == self.strata();
        known.then(|| Mixture::new(Combine::Mis, &self.shares, &self.normalisation.assumed, &self.taus(1.0)).densities().to_vec())
    }

    /// The settings it was made with.
    pub fn settings(&self) -> &LadderSettings {
        &self.settings
    }

    /// What the ladder knows about itself after its last draw.
    pub fn report(&self) -> LadderReport {
        self.summary.report(self)
    }

    /// Replaces the normalisations that the weights of the next draw assume, rung 0 first. Any positive numbers leave the estimates
    /// unbiased, wrong ones cost variance: a test of the first, or knowledge from elsewhere for the second. Returns whether the list has one
    /// positive finite number a rung; otherwise nothing changes.
    pub fn assume_normalisations(&mut self, b: &[f64]) -> bool {
        let fits = b.len() == self.strata() && b.iter().all(|b| *b > 0.0 && b.is_finite());
        if fits {
            self.normalisation.assumed = b.to_vec();
        }
        fits
    }

    /// `tau` of every rung: 1 for rung 0, `unknown` where nothing is known.
    fn taus(&self, unknown: f64) -> Vec<f64> {
        // A chain that few steps are dealt to begins each with a state that is new to it, and scatters less than it would alone. Rejections
        // alone would make a chain of acceptance a worth (2 - a)/a of its steps less.
        let alone = |rung: usize| self.summary.acceptance(rung).map_or(1.0, |a| (2.0 - a) / a.max(1e-6));
        let tau = |(rung, dispersion): (usize, &Dispersion)| match rung {
            0 => 1.0,
            _ => dispersion.tau().map_or(unknown, |tau| tau.max(alone(rung))),
        };
        self.dispersions.iter().enumerate().map(tau).collect()
    }

    /// Independent paths, starts of all chains, first normalisations and shares.
    fn start<P: LightPathSpace>(&mut self, space: &P, iteration: u64) {
        let address = (self.settings.seed, iteration);
        let measured = self.settings.allocation == Allocation::Measured;
        let pool = start::pool(space, address, self.strata(), self.settings.start_up, measured);
        self.traced += self.settings.start_up;
        if self.normalisation.assumed.is_empty() {
            self.normalisation.assumed = pool.normalisations();
        }
        self.normalisation.add_independent(&pool.first());
        for rung in 1..self.strata() {
            pool.start(space, address, rung, self.chains.iter_mut().map(|chains| &mut chains[rung - 1]));
        }
        if measured {
            let (problem, costs) = pool.problem(&self.taus(FIRST_DISPERSION));
            if let Some(shares) = problem.solve(&floors(self.strata())) {
                self.shares = steps_for(&shares, &costs);
            }
        }
    }

    /// Starts of all chains under new targets, from the last draw's states.
    fn restart<P: LightPathSpace>(&mut self, space: &P, iteration: u64) {
        self.normalisation.forget();
        for rung in 1..self.strata() {
            let chains = self.chains.iter_mut().map(|chains| &mut chains[rung - 1]);
            let (traced, dead) = self.carried[rung].start(space, (self.settings.seed, iteration), rung, self.settings.rungs, chains);
            self.traced += traced;
            self.summary.add_dead(rung, dead);
        }
    }

    fn plan<'a>(&self, iteration: u64, count: u64, shares: &'a [f64]) -> Plan<'a> {
        let settings = &self.settings;
        // Every ensemble takes the same strides, from the steps of the largest.
        let steps = |share: &f64| (share * count.div_ceil(self.chains.len() as u64) as f64).ceil() as u64 + shares.len() as u64;
        let stride = |points: u64| shares.iter().map(|share| steps(share).div_ceil(points).max(1)).collect();
        Plan {
            seed: settings.seed,
            iteration,
            shares,
            mixture: Mixture::new(settings.combine, shares, &self.normalisation.assumed, &self.taus(1.0)),
            burn_in: match (self.draws, self.retargeted) {
                (0, _) => settings.first_burn_in,
                (_, true) => settings.later_burn_in,
                (_, false) => 0,
            },
            acceptance: settings.acceptance,
            redraw: settings.redraw,
            exchanges: self.exchanges,
            trace_strides: stride(TRACE_POINTS as u64),
            carry_strides: stride(KEPT),
            sample_strides: if self.shaping() { stride(SAMPLES) } else { Vec::new() },
        }
    }

    /// Whether this draw's samples decide on the shares of the next.
    fn shaping(&self) -> bool {
        let turn = self.draws < SHAPING || self.retargeted || self.draws.is_multiple_of(SHAPING_TURN);
        self.settings.allocation == Allocation::Measured && self.strata() > 1 && turn
    }

    /// Shares of the next draw, from this one's samples.
    fn allocate(&mut self, summary: &summary::DrawSummary) {
        let (problem, costs) = summary.problem(&self.normalisation.assumed, &self.taus(FIRST_DISPERSION));
        if let Some(shares) = problem.solve(&floors(self.strata())) {
            self.gain = Some(problem.gain(&shares));
            // Half way: what a rung is worth depends on the shares it is measured at.
            let wanted = steps_for(&shares, &costs);
            self.shares.iter_mut().zip(wanted).for_each(|(share, wanted)| *share = 0.5 * (*share + wanted));
        }
    }
}

impl PhotonSampler for Ladder {
    fn strata(&self) -> usize {
        self.settings.rungs.max(1)
    }

    fn draw<P, A>(
        &mut self,
        space: &P,
        iteration: u64,
        count: u64,
        start: impl Fn() -> A + Sync,
        emit: impl Fn(&mut A, &P::Path, &[Drawn]) + Sync,
    ) -> Draw<A>
    where
        P: LightPathSpace,
        A: Send,
    {
        let traced_before = self.traced;
        let rungs = self.strata();
        if self.draws == 0 {
            if rungs > 1 {
                self.start(space, iteration);
            } else {
                self.normalisation.assumed = vec![1.0];
            }
        }
        if self.retargeted && self.draws > 0 {
            self.restart(space, iteration);
        }
        let shares = self.shares.clone();
        let plan = self.plan(iteration, count, &shares);
        let ensembles = self.chains.len() as u64;
        let run = |(ensemble, chains)| {
            let e = ensemble as u64;
            let first = e * (count / ensembles) + e.min(count % ensembles);
            let steps = count / ensembles + u64::from(e < count % ensembles);
            Ensemble::new(space, &plan, e, (first, steps), chains, start(), &emit)
        };
        let outcomes = side_by_side(self.chains.iter_mut().map(Vec::as_mut_slice).enumerate(), run);
        let mut batches = Vec::with_capacity(outcomes.len());
        let mut tallies = Vec::with_capacity(outcomes.len());
        for outcome in outcomes {
            self.traced += outcome.traced;
            batches.push(outcome.accumulator);
            tallies.push(outcome.tallies);
        }
        let drawn = summary::DrawSummary::new(tallies);
        for (rung, dispersion) in self.dispersions.iter_mut().enumerate() {
            drawn.disperse(rung, dispersion);
        }
        drawn.carry(&mut self.carried);
        self.summary.add(&drawn, &shares, &plan.trace_strides);
        self.normalisation.update(&drawn.ratios(), self.settings.normaliser == Normaliser::Pooled);
        if self.shaping() {
            self.allocate(&drawn);
        }
        self.draws += 1;
        self.retargeted = false;
        let scales = (0..rungs).map(|rung| drawn.scale(rung, self.normalisation.b(rung))).collect();
        Draw { batches, scales, traced: self.traced - traced_before }
    }
}

/// Runs ensembles, each made by `make`, to their ends, a slice of each in turn: a thread with nothing left to do waits for a slice of
/// another's at most, not for an ensemble.
fn side_by_side<'a, T: Send + 'a, P, A, E>(
    inputs: impl Iterator<Item = T>,
    make: impl Fn(T) -> Ensemble<'a, P, A, E> + Sync,
) -> Vec<Outcome<A>>
where
    P: LightPathSpace + 'a,
    A: Send + 'a,
    E: Fn(&mut A, &P::Path, &[Drawn]) + Sync + 'a,
{
    let mut inputs: Vec<(Option<T>, Option<Outcome<A>>)> = inputs.map(|input| (Some(input), None)).collect();
    rayon::scope_fifo(|scope| {
        for (input, outcome) in &mut inputs {
            let (make, input) = (&make, input.take());
            scope.spawn_fifo(move |scope| {
                if let Some(input) = input {
                    go_on(scope, make(input), outcome);
                }
            });
        }
    });
    inputs.into_iter().filter_map(|(_, outcome)| outcome).collect()
}

/// A slice, and what remains as a task behind those that wait.
fn go_on<'s, 'a: 's, P, A, E>(scope: &ScopeFifo<'s>, mut ensemble: Ensemble<'a, P, A, E>, outcome: &'s mut Option<Outcome<A>>)
where
    P: LightPathSpace + 'a,
    A: Send + 'a,
    E: Fn(&mut A, &P::Path, &[Drawn]) + Sync + 'a,
{
    if ensemble.advance() {
        scope.spawn_fifo(move |scope| go_on(scope, ensemble, outcome));
    } else {
        *outcome = Some(ensemble.finish());
    }
}
