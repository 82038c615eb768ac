//! How many steps each rung should get.
//!
//! With a time budget shared as `s_c` (`sum s_c = 1`), rung c makes steps at a rate `s_c/k_c` for a mean cost `k_c`, worth `1/tau_c` each
//! (module `dispersion`). Joined by the balance heuristic with effective counts, a path has the density
//!
//! `q(u) = sum_c s_c g_c(u)`,  `g_c = T_c/(b_c tau_c k_c)`,
//!
//! and an estimate of a measurement j with contribution `f_j` has variance `integral f_j^2/q` less a term that no share changes. Summed over
//! measurements relative to their values this is `V(s) = integral h/q`, with `h` the usefulness a space tells. `V` is convex in `s`.
//!
//! It is minimised by majorisation: since `1/x` is convex, with weights `s_c g_c/q` (old shares) Jensen's inequality gives
//! `V(new) <= sum_c s_c^2 G_c / new_c`, `G_c = integral h g_c/q^2`, with equality at the old shares. The right side is least at
//! `new_c ~ s_c sqrt(G_c)`, or at its floor where that is larger, and so V falls at every update; at a fixed point every free rung has the
//! same gain `G_c`, which is the condition of Karush, Kuhn and Tucker. The integral is a sum over sampled paths. This is the multiplicative
//! algorithm of optimal design with exponent 1/2 \[YU10\].
//!
//! Floors keep every rung alive: rung 0 is the only one that finds light no chain has met, and a rung without steps has no normalisation.

/// Least share of the cost for rung 0.
const FLOOR_UNIFORM: f64 = 0.1;
/// Least share of the cost for every other rung, or half of an equal share if that is less.
const FLOOR_CHAIN: f64 = 0.02;
/// Updates at most; convergence is geometric and tens are typical.
const UPDATES: usize = 100;
/// Shares that move less in an update are found.
const SETTLED: f64 = 1e-4;

/// Least shares of the cost.
pub(crate) fn floors(rungs: usize) -> Vec<f64> {
    let chain = FLOOR_CHAIN.min(0.5 / rungs as f64);
    (0..rungs).map(|rung| if rung == 0 { FLOOR_UNIFORM } else { chain }).collect()
}

/// Paths looked at together.
const LANES: usize = 8;

/// Sampled paths: for each the densities `g_c` and its part of `integral h du`.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    rungs: usize,
    /// Of [`LANES`] paths: rung by rung their densities, then their parts of the integral. Places without a path have the density 1 and no part.
    groups: Vec<[f64; LANES]>,
    paths: usize,
}

impl Problem {
    /// Without a path.
    pub(crate) fn new(rungs: usize) -> Self {
        Self { rungs, groups: Vec::new(), paths: 0 }
    }

    /// Adds a path; one that is no use or has no finite part is left out, since it says nothing about shares.
    pub(crate) fn push(&mut self, densities: impl Iterator<Item = f64>, useful: f64) {
        if useful > 0.0 && useful.is_finite() {
            let lane = self.paths % LANES;
            if lane == 0 {
                self.groups.extend(std::iter::repeat_n([1.0; LANES], self.rungs));
                self.groups.push([0.0; LANES]);
            }
            let group = self.groups.len() - self.rungs - 1;
            self.groups[group..].iter_mut().zip(densities.chain([useful])).for_each(|(place, number)| place[lane] = number);
            self.paths += 1;
        }
    }

    /// `V` and the gains `G_c` at given shares.
    fn value(&self, shares: &[f64], gains: &mut [f64]) -> f64 {
        let mut sums = vec![[0.0; LANES]; self.rungs];
        let mut value = [0.0; LANES];
        for group in self.groups.chunks_exact(self.rungs + 1) {
            let (densities, useful) = (&group[..self.rungs], &group[self.rungs]);
            let mut q = [0.0; LANES];
            for (g, share) in densities.iter().zip(shares) {
                (0..LANES).for_each(|i| q[i] += g[i] * share);
            }
            let part: [f64; LANES] = std::array::from_fn(|i| useful[i] / q[i]);
            (0..LANES).for_each(|i| value[i] += part[i]);
            let part: [f64; LANES] = std::array::from_fn(|i| part[i] / q[i]);
            for (sum, g) in sums.iter_mut().zip(densities) {
                (0..LANES).for_each(|i| sum[i] += part[i] * g[i]);
            }
        }
        gains.iter_mut().zip(&sums).for_each(|(gain, sum)| *gain = sum.iter().sum());
        value.iter().sum()
    }

    /// `V` at these shares over `V` of rung 0 alone: what chains do to the variance for the same cost. 1 if no path is any use.
    pub(crate) fn gain(&self, shares: &[f64]) -> f64 {
        let mut gains = vec![0.0; self.rungs];
        let alone: Vec<f64> = (0..self.rungs).map(|rung| if rung == 0 { 1.0 } else { 0.0 }).collect();
        let (with, without) = (self.value(shares, &mut gains), self.value(&alone, &mut gains));
        if without > 0.0 { with / without } else { 1.0 }
    }

    /// Shares of the cost that minimise `V`, none below its floor. `None` if no path is any use. Updates begin with all that floors leave on
    /// rung 0, and rungs with equal densities keep their proportion: of equally good shares it is the one with most independent paths.
    pub(crate) fn solve(&self, floors: &[f64]) -> Option<Vec<f64>> {
        if self.paths == 0 {
            return None;
        }
        let mut shares = floors.to_vec();
        shares[0] = 1.0 - floors[1..].iter().sum::<f64>();
        let mut gains = vec![0.0; self.rungs];
        for _ in 0..UPDATES {
            self.value(&shares, &mut gains);
            let wanted: Vec<f64> = shares.iter().zip(&gains).map(|(s, g)| s * g.sqrt()).collect();
            let new = fill(&wanted, floors)?;
            let moved = new.iter().zip(&shares).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            shares = new;
            if moved < SETTLED {
                break;
            }
        }
        Some(shares)
    }
}

/// Shares that add up to 1, proportional to `wanted` where that is above the floor: the least `sum wanted^2/share`.
fn fill(wanted: &[f64], floors: &[f64]) -> Option<Vec<f64>> {
    let mut bound = vec![false; wanted.len()];
    loop {
        let free: f64 = wanted.iter().zip(&bound).filter(|(_, bound)| !**bound).map(|(w, _)| w).sum();
        let left = 1.0 - floors.iter().zip(&bound).filter(|(_, bound)| **bound).map(|(f, _)| f).sum::<f64>();
        // Neither happens for finite gains: the largest wanted share stays free, and floors add up to less than 1.
        if !(free > 0.0 && free.is_finite() && left > 0.0) {
            return None;
        }
        let shares: Vec<f64> = (0..wanted.len()).map(|c| if bound[c] { floors[c] } else { wanted[c] / free * left }).collect();
        // What is bound once would only be pushed lower by binding more.
        let violated: Vec<usize> = (0..wanted.len()).filter(|c| !bound[*c] && shares[*c] < floors[*c]).collect();
        if violated.is_empty() {
            return Some(shares);
        }
        for c in violated {
            bound[c] = true;
        }
    }
}

/// Shares of the steps for shares of the cost.
pub(crate) fn steps_for(shares: &[f64], costs: &[f64]) -> Vec<f64> {
    let steps: Vec<f64> = shares.iter().zip(costs).map(|(share, cost)| share / cost).collect();
    let sum: f64 = steps.iter().sum();
    steps.iter().map(|x| x / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Key, Purpose, Stream};

    /// Random problems with nested supports and targets over several magnitudes.
    fn problem(rungs: usize, index: u64) -> Problem {
        let mut stream = Key { seed: 11, iteration: 0, index, purpose: Purpose::Test }.stream();
        let mut next = || f64::from(stream.next_1d());
        let mut problem = Problem::new(rungs);
        let scales: Vec<f64> = (0..rungs).map(|c| if c == 0 { 1.0 } else { 20.0 * next() }).collect();
        for _ in 0..200 {
            let visible = next() < 0.5;
            let row: Vec<f64> = (0..rungs)
                .map(|c| if c == 0 { 1.0 } else { scales[c] * f64::from(u8::from(visible)) * (8.0 * (next() - 0.9)).exp2() })
                .collect();
            let useful = next().powi(4) + 1e-9;
            problem.push(row.into_iter(), useful);
        }
        problem
    }

    /// Every point of a fine grid on the simplex above the floors is no better than the solution.
    #[test]
    fn shares_match_brute_force() {
        const N: usize = 100;
        for index in 0..12 {
            let problem = problem(3, index);
            let floors = floors(3);
            let found = problem.solve(&floors).unwrap();
            let mut gains = vec![0.0; 3];
            let least = problem.value(&found, &mut gains);
            assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(found.iter().zip(&floors).all(|(s, f)| s >= f));
            let (mut best, mut at) = (f64::INFINITY, [0.0; 3]);
            for i in 0..=N {
                for j in 0..=N - i {
                    let parts = [i, j, N - i - j].map(|k| k as f64 / N as f64);
                    let shares = [0, 1, 2].map(|c| floors[c] + (1.0 - floors.iter().sum::<f64>()) * parts[c]);
                    let value = problem.value(&shares, &mut gains);
                    if value < best {
                        (best, at) = (value, shares);
                    }
                }
            }
            assert!(least <= best * (1.0 + 1e-6), "problem {index}: {least} at {found:?}, grid {best} at {at:?}");
            assert!(best < least * 1.01, "problem {index}: the grid is fine enough to come close: {best} against {least}");
        }
    }

    /// The condition of optimality: free rungs have equal gains, bound ones smaller.
    #[test]
    fn gains_are_equal_at_the_solution() {
        for index in 0..12 {
            let problem = problem(4, index);
            let floors = floors(4);
            let shares = problem.solve(&floors).unwrap();
            let mut gains = vec![0.0; 4];
            problem.value(&shares, &mut gains);
            let most = gains.iter().copied().fold(0.0, f64::max);
            for c in 0..4 {
                let free = shares[c] > floors[c] * 1.01;
                assert!(gains[c] <= most && (!free || gains[c] > 0.99 * most), "problem {index}: {gains:?} at {shares:?}");
            }
        }
    }

    #[test]
    fn of_equals_the_independent_rung_is_taken() {
        let mut problem = Problem::new(3);
        problem.push([1.0, 1.0, 0.9].into_iter(), 1.0);
        let shares = problem.solve(&floors(3)).unwrap();
        assert!(shares[0] > 0.95, "{shares:?}");
    }

    #[test]
    fn a_dear_rung_gets_fewer_steps_and_useless_paths_decide_nothing() {
        assert_eq!(steps_for(&[0.5, 0.5], &[1.0, 3.0]), [0.75, 0.25]);
        let mut none = Problem::new(2);
        none.push([1.0, 1.0].into_iter(), 0.0);
        assert_eq!(none.solve(&floors(2)), None);
    }
}
