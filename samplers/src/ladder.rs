//! A ladder of Markov chains from the uniform law to a hard target.

mod settings;

pub use settings::{Allocation, Combine, LadderSettings, Normaliser};

use crate::diagnostics::LadderReport;
use crate::sampler::{Draw, Drawn, LightPathSpace, PhotonSampler, Uniform};
use serde::{Deserialize, Serialize};

/// Chains at several target functions that exchange states. Serialises to everything a later draw depends on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Ladder {
    settings: LadderSettings,
    draws: u64,
    traced: u64,
}

impl Ladder {
    /// A ladder that has drawn nothing.
    pub fn new(settings: LadderSettings) -> Self {
        Self { settings, draws: 0, traced: 0 }
    }

    /// The settings it was made with.
    pub fn settings(&self) -> &LadderSettings {
        &self.settings
    }

    /// What the ladder knows about itself after its last draw.
    pub fn report(&self) -> LadderReport {
        LadderReport { draws: self.draws, traced: self.traced, ensembles: self.settings.ensembles, round_trips: 0, rungs: Vec::new() }
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
        emit: impl Fn(&mut A, &P::Path, Drawn) + Sync,
    ) -> Draw<A>
    where
        P: LightPathSpace,
        A: Send,
    {
        // Rung 0 alone, until the chains stand.
        let mut draw = Uniform { seed: self.settings.seed }.draw(space, iteration, count, start, emit);
        draw.scales.resize(self.strata(), 0.0);
        self.draws += 1;
        self.traced += draw.traced;
        draw
    }
}
