//! How much more a chain's contributions scatter than those of independent draws.
//!
//! A space names for every path one of [`CELLS`] cells that it contributes to. Ensemble e counts `n_ek` steps in cell k of `N_e`. For
//! independent draws with `p_k = sum_e n_ek / sum_e N_e` the count is binomial: mean `p_k N_e`, variance `p_k (1 - p_k) N_e`. A chain
//! that lingers multiplies that by its integrated autocorrelation time for the cell's indicator. So
//!
//! `tau = sum_k sum_e (n_ek - p_k N_e)^2 / (E - 1)  over  sum_k p_k (1 - p_k) mean_e N_e`
//!
//! is the mean of the cells' times weighted by what each contributes to the variance, and it sees what no single chain can: ensembles stuck
//! on different islands. Numerator and denominator are summed over draws before they are divided, the past fading: shares, step sizes
//! and targets move, and the number with them.

use crate::sampler::CELLS;
use serde::{Deserialize, Serialize};

/// What a draw keeps of the past.
const KEPT: f64 = 0.75;

/// Numerator and denominator of one rung, summed over draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Dispersion {
    scatter: f64,
    independent: f64,
}

impl Dispersion {
    /// Adds a draw: for every ensemble its counted steps and its counts per cell.
    pub(crate) fn add(&mut self, ensembles: &[(u64, &[u32])]) {
        let ensembles: Vec<_> = ensembles.iter().filter(|(steps, _)| *steps > 0).collect();
        let count = ensembles.len() as f64;
        if ensembles.len() < 2 {
            return;
        }
        self.scatter *= KEPT;
        self.independent *= KEPT;
        let steps: f64 = ensembles.iter().map(|(steps, _)| *steps as f64).sum();
        for cell in 0..CELLS {
            let hits: u64 = ensembles.iter().map(|(_, cells)| u64::from(cells[cell])).sum();
            if hits == 0 {
                continue;
            }
            let p = hits as f64 / steps;
            let residual = |(n, cells): &&(u64, &[u32])| (f64::from(cells[cell]) - p * *n as f64).powi(2);
            self.scatter += ensembles.iter().map(residual).sum::<f64>() / (count - 1.0);
            self.independent += p * (1.0 - p) * steps / count;
        }
    }

    /// `tau`, at least 1: what would follow from negative correlation is not trusted. `None` before a cell has been seen.
    pub(crate) fn tau(&self) -> Option<f64> {
        (self.independent > 0.0).then(|| (self.scatter / self.independent).max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Key, Purpose, Stream};

    /// States that each stay for exactly `stay` steps: the variance of a count is `stay` times the binomial one.
    fn tau_of(stay: u32, cells: usize) -> f64 {
        let mut dispersion = Dispersion::default();
        for draw in 0..20 {
            let counts: Vec<Vec<u32>> = (0..16)
                .map(|ensemble| {
                    let mut counts = vec![0; CELLS];
                    let mut stream = Key { seed: 1, iteration: draw, index: ensemble, purpose: Purpose::Test }.stream();
                    for _ in 0..1000 {
                        counts[(stream.next_1d() * cells as f32) as usize] += stay;
                    }
                    counts
                })
                .collect();
            let ensembles: Vec<(u64, &[u32])> = counts.iter().map(|c| (1000 * u64::from(stay), c.as_slice())).collect();
            dispersion.add(&ensembles);
        }
        dispersion.tau().unwrap()
    }

    /// The estimate has `20 * 15 * (cells - 1)` degrees of freedom: 1 % for 64 cells; five of that.
    #[test]
    fn states_that_stay_are_dispersed_by_their_stay() {
        for stay in [1, 3, 20] {
            for cells in [64, 1000] {
                let tau = tau_of(stay, cells);
                assert!((tau / f64::from(stay) - 1.0).abs() < 0.05, "{tau} for a stay of {stay} in {cells} cells");
            }
        }
    }

    #[test]
    fn nothing_seen_is_nothing_known() {
        let mut dispersion = Dispersion::default();
        dispersion.add(&[(10, &[0; CELLS]), (10, &[0; CELLS])]);
        assert_eq!(dispersion.tau(), None);
    }
}
