//! Normalisations `b_c`, the integrals of the targets.
//!
//! `b_0 = 1`, and `b_{c+1} = b_c * mean of T_{c+1}/T_c` over the counted states of rung c, repeats included, because
//! `E_{T_c/b_c}[T_{c+1}/T_c] = b_{c+1}/b_c` for nested supports. For c = 0 that is the mean of `T_1` over independent paths.
//! Errors of the ratios come from batch means; relative variances add up along the ladder, as for independent factors.

use crate::diagnostics::blocks::Mean;
use serde::{Deserialize, Serialize};

/// What is known about normalisations between draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Normalisation {
    /// `b'` of the next draw's weights; empty before the first.
    pub(super) assumed: Vec<f64>,
    /// Ratios `b_{c+1}/b_c`, c from 0, summed over the draws at these targets.
    pooled: Vec<Mean>,
    /// `b` of the last draw and its relative variance.
    estimates: Vec<(f64, f64)>,
}

impl Normalisation {
    pub(super) fn new(rungs: usize) -> Self {
        Self { assumed: Vec::new(), pooled: vec![Mean::default(); rungs - 1], estimates: vec![(1.0, 0.0)] }
    }

    /// Independent paths that no draw counts: they serve the pooled first ratio.
    pub(super) fn add_independent(&mut self, first: &Mean) {
        if let Some(pooled) = self.pooled.first_mut() {
            pooled.add(first);
        }
    }

    /// The targets are others from now on. What is assumed stays: any positive numbers are right.
    pub(super) fn forget(&mut self) {
        self.pooled.fill(Mean::default());
    }

    /// Takes a draw's ratios. A ratio that the draw has no step for is taken from the assumed normalisations.
    pub(super) fn update(&mut self, ratios: &[Mean], use_pooled: bool) {
        for (pooled, ratio) in self.pooled.iter_mut().zip(ratios) {
            pooled.add(ratio);
        }
        let mut estimate = (1.0, 0.0);
        self.estimates = vec![estimate];
        for (c, ratio) in ratios.iter().enumerate() {
            let used = if use_pooled { &self.pooled[c] } else { ratio };
            let mean = used.mean().unwrap_or_else(|| self.assumed[c + 1] / self.assumed[c]);
            estimate = (estimate.0 * mean, estimate.1 + used.relative_variance());
            self.estimates.push(estimate);
        }
        // A target that was not met keeps the old b': any positive one is right.
        for (assumed, (b, _)) in self.assumed.iter_mut().zip(&self.estimates) {
            if *b > 0.0 {
                *assumed = *b;
            }
        }
    }

    /// `b` of a rung in the last draw.
    pub(super) fn b(&self, rung: usize) -> f64 {
        self.estimates.get(rung).map_or(0.0, |(b, _)| *b)
    }

    /// Standard error of [`Self::b`]; the bound `3/n` if nothing was found in the `n` independent paths of the last draw.
    pub(super) fn error(&self, rung: usize, independent: u64) -> f64 {
        match self.estimates.get(rung) {
            Some((b, variance)) if *b > 0.0 => b * variance.sqrt(),
            _ => 3.0 / independent.max(3) as f64,
        }
    }

    /// The pooled ratio of the rung after `rung` to it.
    pub(super) fn pooled(&self, rung: usize) -> Option<&Mean> {
        self.pooled.get(rung)
    }
}
