//! What a ladder can be told.

use serde::{Deserialize, Serialize};

/// How paths of several rungs are joined in one estimate. All three are unbiased for what every used rung's support covers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Combine {
    /// The balance heuristic over rungs, with effective counts ([VEACH (9.8)]; module `weights`).
    #[default]
    Mis,
    /// Every rung's own estimate, weighted by the rung's share of the steps.
    Average,
    /// The last rung's estimate alone.
    Last,
}

/// How steps are shared between rungs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Allocation {
    /// Fixed shares: for four rungs 2/6, 1/6, 1/6, 2/6, those of the program of \[STF\]; equal shares otherwise.
    #[default]
    Fixed,
    /// Shares that minimise the estimated variance for the cost, from earlier draws alone (module `allocation`).
    Measured,
}

/// Which draws a rung's normalisation is estimated from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Normaliser {
    /// This draw alone.
    #[default]
    Pass,
    /// All draws since the targets last changed ([`Ladder::retargeted`](crate::Ladder::retargeted)): less noise.
    Pooled,
}

/// Settings of a [`Ladder`](crate::Ladder).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LadderSettings {
    /// Seed of the run.
    pub seed: u64,
    /// Rungs, the uniform one counted: at least one (0 counts as 1). A space gives as many targets.
    pub rungs: usize,
    /// Independent groups of chains, one chain a rung: at least one (0 counts as 1). Work is shared between threads by ensemble, and
    /// standard errors, dispersion and R-hat compare ensembles.
    pub ensembles: usize,
    /// Steps of every rung that are thrown away at the start of the first draw.
    pub first_burn_in: u64,
    /// The same at the start of a draw after [`Ladder::retargeted`](crate::Ladder::retargeted).
    pub later_burn_in: u64,
    /// Acceptance that step sizes are steered to, in (0, 1).
    pub acceptance: f64,
    /// Share of a chain's steps, in [0, 1), that redraw the path from a random coordinate on; the rest are small steps.
    pub redraw: f64,
    /// How rungs are joined.
    pub combine: Combine,
    /// How steps are shared.
    pub allocation: Allocation,
    /// Which draws normalisations come from.
    pub normaliser: Normaliser,
    /// Independent paths of the first draw from which chains start and the first normalisations come.
    pub start_up: u64,
}

impl Default for LadderSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            rungs: 4,
            ensembles: 16,
            first_burn_in: 250,
            later_burn_in: 64,
            acceptance: 0.234,
            redraw: 0.15,
            combine: Combine::Mis,
            allocation: Allocation::Fixed,
            normaliser: Normaliser::Pass,
            start_up: 100_000,
        }
    }
}
