//! Which rung steps next.

/// Deals steps to rungs by error diffusion: every rung's credit grows by its share, the richest pays for a step. After any number of
/// steps a rung is within one step per rung of its share, and no state has a say in it.
#[derive(Clone, Debug)]
pub(crate) struct Schedule<'a> {
    shares: &'a [f64],
    credit: Vec<f64>,
}

impl<'a> Schedule<'a> {
    pub(crate) fn new(shares: &'a [f64]) -> Self {
        Self { shares, credit: vec![0.0; shares.len()] }
    }

    /// The rung of the next step. A rung without a share never has one.
    #[inline]
    pub(crate) fn next(&mut self) -> usize {
        let mut richest = 0;
        let mut most = f64::NEG_INFINITY;
        for (rung, (credit, share)) in self.credit.iter_mut().zip(self.shares).enumerate() {
            *credit += share;
            if *credit > most && *share > 0.0 {
                (richest, most) = (rung, *credit);
            }
        }
        self.credit[richest] -= 1.0;
        richest
    }
}

/// Shares of [`Allocation::Fixed`](super::Allocation::Fixed).
pub(crate) fn fixed_shares(rungs: usize) -> Vec<f64> {
    if rungs == 4 { [2.0, 1.0, 1.0, 2.0].map(|part: f64| part / 6.0).to_vec() } else { vec![1.0 / rungs as f64; rungs] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_follow_the_shares_closely_at_every_moment() {
        for shares in [vec![0.9, 0.02, 0.03, 0.05], fixed_shares(4), fixed_shares(3), vec![0.5, 0.0, 0.5], vec![1.0]] {
            let mut schedule = Schedule::new(&shares);
            let mut dealt = vec![0u32; shares.len()];
            for n in 1..=10_000 {
                dealt[schedule.next()] += 1;
                for (dealt, share) in dealt.iter().zip(&shares) {
                    assert!((f64::from(*dealt) - share * f64::from(n)).abs() < shares.len() as f64);
                    assert!(*share > 0.0 || *dealt == 0);
                }
            }
        }
    }
}
