//! Weights of paths drawn by several rungs.
//!
//! Rung i has density `T_i/b_i` and `N_i` counted states. With `w_i(u) = e_i (T_i/b'_i) / sum_j e_j T_j/b'_j` the weights of a path add up
//! to 1 for *any* positive `e` and `b'`, so that `sum_i (b_i/N_i) sum_u w_i(u)/T_i(u) f(u)` is unbiased with the `b_i` outside alone
//! (the balance heuristic [VEACH (9.8)] over the rungs of \[STF\]). `b'` is the last draw's estimate and frozen; a wrong one costs variance. With the
//! same `b'` outside the estimate would be wrong by its error.
//!
//! **Effective counts.** The balance heuristic is derived for independent draws. `N` states of a chain whose contributions scatter `tau`
//! times as much as those of independent draws are worth `N/tau` of them, so `e_i = N_i/tau_i`: the sum over a cell has the variance
//! `sum_i (N_i tau_i) integral w_i^2 f^2/(N_i^2 p_i)`, and minimising it point by point under `sum w_i = 1` gives `w_i ~ N_i p_i/tau_i`.

use super::Combine;

/// The weights of one draw.
#[derive(Clone, Debug)]
pub(crate) struct Mixture {
    combine: Combine,
    shares: Vec<f64>,
    /// `e_i/b'_i` up to a common factor.
    densities: Vec<f64>,
}

impl Mixture {
    /// For planned `shares` of the steps, frozen normalisations and dispersions.
    pub(crate) fn new(combine: Combine, shares: &[f64], assumed: &[f64], dispersions: &[f64]) -> Self {
        let densities = (0..shares.len()).map(|i| shares[i] / (dispersions[i] * assumed[i])).collect();
        Self { combine, shares: shares.to_vec(), densities }
    }

    /// Factors of the targets in the density of all rungs together, in paths that are worth an independent one, over that of as many independent paths.
    pub(crate) fn densities(&self) -> &[f64] {
        &self.densities
    }

    /// Weight and pilot weight, `w/T`, of one state of `rung` with these targets.
    #[inline]
    pub(crate) fn of(&self, rung: usize, values: &[f64]) -> (f64, f64) {
        let last = self.shares.len() - 1;
        let mut pilots = 0.0;
        for (density, value) in self.densities[..last].iter().zip(values) {
            pilots += density * value;
        }
        let all = pilots + self.densities[last] * values[last];
        let weight = match self.combine {
            Combine::Mis => self.densities[rung] / all,
            Combine::Average => self.shares[rung] / values[rung],
            Combine::Last if rung == last => 1.0 / values[rung],
            Combine::Last => 0.0,
        };
        let pilot = match (last, rung == last) {
            (0, _) => weight,
            (_, true) => 0.0,
            (_, false) => self.densities[rung] / pilots,
        };
        (weight, pilot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `sum_i w_i = 1`, whatever the normalisations and dispersions claim.
    #[test]
    fn weights_of_a_path_add_up_to_one() {
        let shares = [0.4, 0.1, 0.2, 0.3];
        let values = [1.0, 1.0, 0.3, 0.007];
        for assumed in [[1.0, 0.2, 0.05, 0.001], [1.0, 7.0, 1e-9, 3.0]] {
            for dispersion in [[1.0; 4], [1.0, 5.0, 20.0, 80.0]] {
                for combine in [Combine::Mis, Combine::Average, Combine::Last] {
                    let mixture = Mixture::new(combine, &shares, &assumed, &dispersion);
                    let (mut all, mut pilots) = (0.0, 0.0);
                    for (rung, value) in values.iter().enumerate() {
                        let (weight, pilot) = mixture.of(rung, &values);
                        all += weight * value;
                        pilots += pilot * value;
                    }
                    assert!((all - 1.0).abs() < 1e-12, "{combine:?}: {all}");
                    assert!((pilots - 1.0).abs() < 1e-12, "{combine:?}: pilots {pilots}");
                }
            }
        }
    }

    #[test]
    fn the_only_rung_is_its_own_pilot() {
        assert_eq!(Mixture::new(Combine::Mis, &[1.0], &[1.0], &[1.0]).of(0, &[1.0]), (1.0, 1.0));
    }
}
