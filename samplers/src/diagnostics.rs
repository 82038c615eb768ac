//! What a ladder can say about itself.

pub(crate) mod blocks;
pub(crate) mod dispersion;
pub(crate) mod rhat;
mod warnings;

pub use warnings::{AGREEING_R_HAT, KNOWN_NORMALISATION, USEFUL_EXCHANGE_RATES, Warning, warnings};

use serde::{Deserialize, Serialize};

/// The state of a [`Ladder`](crate::Ladder) after its last draw. "Cumulative" means over all draws, burn-in left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LadderReport {
    /// Draws made.
    pub draws: u64,
    /// Iterations left to independent paths because chains were not worth their cost.
    #[serde(default)]
    pub rested: u64,
    /// Paths traced over all draws and rested iterations, start-up and burn-in counted.
    pub traced: u64,
    /// Independent groups of chains.
    pub ensembles: usize,
    /// States that came from rung 0, reached the last rung and were dropped at rung 1 again. Cumulative, all ensembles together.
    pub round_trips: u64,
    /// One entry a rung, rung 0 first.
    pub rungs: Vec<RungReport>,
}

/// One rung of a [`LadderReport`]. `None` where a number does not exist: rung 0 has no chain, the last rung no next one, and a rung
/// that was never visited has no autocorrelation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RungReport {
    /// Share of the steps of the last draw, in [0, 1].
    pub share: f64,
    /// Share the next draw will use.
    pub next_share: f64,
    /// Counted steps; cumulative.
    pub steps: u64,
    /// Steps that were made and not counted because the chain stood on a dead state or had none; cumulative, burn-in left out.
    pub uncounted: u64,
    /// Fraction of small steps accepted in the last draw.
    pub acceptance: Option<f64>,
    /// Fraction of redrawn ends accepted in the last draw.
    pub redraw_acceptance: Option<f64>,
    /// Step size `d`, mean over ensembles.
    pub step_size: Option<f64>,
    /// Dispersion of counts per cell over ensembles, at least 1; pooled over draws. 1 while unknown.
    pub dispersion: f64,
    /// Normalisation `b` that the last draw's scale used.
    pub normalisation: f64,
    /// Standard error of `b` from batch means. If nothing was found, the bound `3/n` that a probability keeps with 95 % confidence
    /// when `n` independent draws do not meet it.
    pub normalisation_error: f64,
    /// `normalisation_error / normalisation`; `None` if `b` is 0.
    pub normalisation_relative_error: Option<f64>,
    /// Attempted exchanges with the next rung; cumulative.
    pub exchange_attempts: u64,
    /// Fraction of these that were accepted.
    pub exchange_rate: Option<f64>,
    /// Stored states that were worth nothing under a later draw's targets; cumulative.
    pub dead_states: u64,
    /// Integrated autocorrelation time of the logarithm of the last rung's target, in steps of this rung; pooled over draws.
    pub target_time: Option<f64>,
    /// Effective sample size of the same: `steps / target_time`; cumulative.
    pub target_effective: Option<f64>,
    /// Integrated autocorrelation time of the ratio of the next rung's target to this one's, in steps of this rung; pooled over draws.
    pub ratio_time: Option<f64>,
    /// Effective sample size of the same; cumulative.
    pub ratio_effective: Option<f64>,
    /// Rank-normalised split R-hat over ensembles of the trace below, the larger of bulk and folded \[VEHTARI21\]; last draw.
    pub r_hat: Option<f64>,
    /// Thinned series of the logarithm of the last rung's target, one an ensemble, at most [`TRACE_POINTS`] points; last draw. Files that
    /// keep a report leave them out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub traces: Vec<Vec<f32>>,
    /// Steps of this rung between two points of a trace.
    pub trace_stride: u64,
}

/// The largest number of points in a trace.
pub const TRACE_POINTS: usize = 512;
