//! Step sizes that steer themselves to a wanted acceptance.

use serde::{Deserialize, Serialize};

/// Bounds of the step size `d`: at the upper one a step has a mean length of a quarter of the unit interval in every
/// coordinate, and nothing larger is worth having; below the lower one the finer sizes would leave a path where it is.
pub(crate) const BOUNDS: (f64, f64) = (1e-4, 1.0);

/// The step size of one chain. After its `n`-th mutation `d += (accepted/n - wanted)/n` \[HACHISUKA11\]: the gain dies out as 1/n,
/// over draws as well, so that the chain keeps its law in the limit (diminishing adaptation).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StepSize {
    d: f64,
    mutated: u64,
    accepted: u64,
}

impl Default for StepSize {
    fn default() -> Self {
        Self { d: 1.0, mutated: 0, accepted: 0 }
    }
}

impl StepSize {
    /// `d`.
    pub(crate) fn size(&self) -> f64 {
        self.d
    }

    /// `d 4^-fineness`.
    #[inline(always)]
    pub(crate) fn finer(&self, fineness: usize) -> f32 {
        self.d as f32 / (1u32 << (2 * fineness)) as f32
    }

    /// Learns from one mutation.
    #[inline(always)]
    pub(crate) fn learn(&mut self, accepted: bool, wanted: f64) {
        self.mutated += 1;
        self.accepted += u64::from(accepted);
        let gain = 1.0 / self.mutated as f64;
        self.d = (self.d + (self.accepted as f64 * gain - wanted) * gain).clamp(BOUNDS.0, BOUNDS.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::mutate_all;
    use crate::stream::{Key, Purpose};

    /// Chain on a Gaussian bump of the given width at 0.5 in `dimensions` coordinates: the step size and the acceptance of its second half.
    fn on_a_bump(width: f64, dimensions: usize, wanted: f64, start: f64) -> (f64, f64) {
        let mut random = Key { seed: 3, iteration: 0, index: dimensions as u64, purpose: Purpose::Test }.stream();
        let mut step = StepSize { d: start, ..StepSize::default() };
        let log = |x: &[u32]| -> f64 { x.iter().map(|x| -0.5 * ((f64::from(*x) / 4_294_967_296.0 - 0.5) / width).powi(2)).sum() };
        let mut x = vec![1u32 << 31; dimensions];
        let mut y = x.clone();
        let mut late = 0u32;
        const STEPS: u32 = 400_000;
        for i in 0..STEPS {
            mutate_all(&x, step.finer(0), &mut random, &mut y);
            let accepted = random.chance() < (log(&y) - log(&x)).exp();
            if accepted {
                std::mem::swap(&mut x, &mut y);
            }
            step.learn(accepted, wanted);
            assert!(step.d >= BOUNDS.0 && step.d <= BOUNDS.1);
            late += u32::from(accepted && i >= STEPS / 2);
        }
        (step.d, f64::from(late) / f64::from(STEPS / 2))
    }

    #[test]
    fn acceptance_converges_to_what_is_wanted() {
        for (width, dimensions) in [(0.001, 1), (0.02, 2), (0.05, 5), (0.01, 20)] {
            for wanted in [0.234, 0.5] {
                for start in [1.0, 0.02] {
                    let (d, acceptance) = on_a_bump(width, dimensions, wanted, start);
                    assert!((acceptance - wanted).abs() < 0.02, "width {width}, {dimensions}D: {acceptance} for {wanted}, d {d}");
                }
            }
        }
    }

    /// Where the largest steps are accepted more often than wanted, they stay the largest.
    #[test]
    fn on_a_wide_bump_the_size_is_the_largest() {
        let (d, acceptance) = on_a_bump(0.1, 1, 0.234, 0.02);
        assert!(d == BOUNDS.1 && acceptance > 0.3, "{acceptance}, d {d}");
    }

    #[test]
    fn the_size_stays_positive_when_nothing_is_accepted_and_bounded_when_all_is() {
        let (mut never, mut always) = (StepSize::default(), StepSize::default());
        for _ in 0..1_000_000 {
            never.learn(false, 0.234);
            always.learn(true, 0.234);
            assert!(never.d > 0.0 && always.d <= BOUNDS.1);
        }
        assert_eq!((never.d, always.d), BOUNDS);
    }
}
