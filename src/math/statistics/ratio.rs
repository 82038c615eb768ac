//! Which of two methods is better, by how much, and whether that is certain.

use super::bootstrap::{Interval, RESAMPLES, bootstrap_median};
use super::hypothesis::student_quantile;
use super::sample::{median_of, positive};
use crate::samplers::Key;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

/// Most runs a verdict asks for; a claim that needs more is not worth deciding.
const MOST_RUNS: f64 = 1e6;

/// The ratio of the medians of two lists of paired runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// Median of `a` over median of `b`.
    pub ratio: f64,
    /// Its confidence interval; `None` with a single pair.
    pub interval: Option<Interval>,
    /// Pairs.
    pub runs: usize,
    /// The level of the interval.
    pub level: f64,
    /// Standard deviation of the ratio's logarithm, times the root of the number of runs: what one pair contributes. `None` with a
    /// single pair.
    pub spread: Option<f64>,
}

/// What is known of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The whole interval keeps the bound.
    Holds,
    /// The whole interval breaks it.
    Refuted,
    /// The interval holds the bound.
    Undecided {
        /// About how many more pairs the claim needs, if the estimate stays where it is, to be as likely as not to hold. `None`: the
        /// estimate itself is on the wrong side (or on the bound, or within so little of it that a million runs are too few), and more
        /// runs are not expected to make the claim hold.
        more_runs: Option<usize>,
    },
}

/// Ratio of the medians of `a` and `b`, where `a[i]` and `b[i]` are of the same seed, with a paired bootstrap interval: pairs are drawn
/// together, so that what a seed does to both cancels.
///
/// The interval is that of [`bootstrap_median`] on the ratio's logarithm, with [`RESAMPLES`]. All randomness comes from `key`.
///
/// `None` for lists that are empty or of different length, for values that are not finite and positive, and for a level outside (0, 1).
pub fn paired_ratio(a: &[f64], b: &[f64], level: f64, key: Key) -> Option<Ratio> {
    let usable = |list: &[f64]| list.iter().all(|x| positive(*x).is_some());
    if a.is_empty() || a.len() != b.len() || !usable(a) || !usable(b) || !(level > 0.0 && level < 1.0) {
        return None;
    }
    let logs = |list: &[f64]| list.iter().map(|x| x.ln()).collect::<Vec<f64>>();
    let (log_a, log_b) = (logs(a), logs(b));
    let middle = |list: &[f64], drawn: &[usize]| median_of(&mut drawn.iter().map(|&i| list[i]).collect::<Vec<f64>>()).ln();
    let statistic = |drawn: &[usize]| middle(a, drawn) - middle(b, drawn);
    let runs = a.len();
    let interval = bootstrap_median(runs, RESAMPLES, level, key, statistic);
    let ratio = positive(statistic(&(0..runs).collect::<Vec<usize>>()).exp())?;
    Some(Ratio { ratio, interval: interval.and_then(|i| i.exp()), runs, level, spread: spread(&log_a, &log_b) })
}

/// Confidence interval of the median of runs, by [`bootstrap_median`] with [`RESAMPLES`]. `None` with fewer than two runs, for values that
/// are not finite, and for a level outside (0, 1).
pub fn median_interval(values: &[f64], level: f64, key: Key) -> Option<Interval> {
    if values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let statistic = |drawn: &[usize]| median_of(&mut drawn.iter().map(|&i| values[i]).collect::<Vec<f64>>());
    bootstrap_median(values.len(), RESAMPLES, level, key, statistic)
}

/// How many times as fast `method` is as `baseline`, both given as seconds at equal error, or as error times seconds
/// ([`super::inefficiency`]), by seed: the [`paired_ratio`] of the baseline to the method, above 1 where the method wins.
pub fn speed_up(baseline: &[f64], method: &[f64], level: f64, key: Key) -> Option<Ratio> {
    paired_ratio(baseline, method, level, key)
}

/// Decides the claim "A is at most `bound` times B" on the interval of the ratio A to B: it holds if all of the interval is at most the
/// bound, is refuted if all of it is above, and is undecided otherwise.
///
/// `None` where the ratio has no interval, and for a bound that is not finite and positive.
pub fn at_most(ratio: &Ratio, bound: f64) -> Option<Verdict> {
    let bound = positive(bound)?;
    let interval = ratio.interval?;
    Some(if interval.high <= bound {
        Verdict::Holds
    } else if interval.low > bound {
        Verdict::Refuted
    } else {
        Verdict::Undecided { more_runs: more_runs(ratio, bound) }
    })
}

/// Standard deviation of `log median(a) - log median(b)` times the root of the number of runs, for logarithms that are normal: a median's
/// variance is `pi / 2` times a mean's, and two medians correlate by `2 / pi * asin(rho)`.
fn spread(log_a: &[f64], log_b: &[f64]) -> Option<f64> {
    if log_a.len() < 2 {
        return None;
    }
    let n = log_a.len() as f64;
    let mean = |list: &[f64]| list.iter().sum::<f64>() / n;
    let (mean_a, mean_b) = (mean(log_a), mean(log_b));
    let products = |p: &[f64], q: &[f64], mp: f64, mq: f64| p.iter().zip(q).map(|(x, y)| (x - mp) * (y - mq)).sum::<f64>() / (n - 1.0);
    let (aa, bb, ab) =
        (products(log_a, log_a, mean_a, mean_a), products(log_b, log_b, mean_b, mean_b), products(log_a, log_b, mean_a, mean_b));
    let both = (aa * bb).sqrt();
    let together = if both > 0.0 { both * FRAC_2_PI * (ab / both).clamp(-1.0, 1.0).asin() } else { 0.0 };
    Some((FRAC_PI_2 * (aa + bb - 2.0 * together)).max(0.0).sqrt())
}

/// Smallest number of runs beyond those at hand at which half the expected interval of the logarithm fits between ratio and bound.
fn more_runs(ratio: &Ratio, bound: f64) -> Option<usize> {
    let room = (bound / ratio.ratio).ln();
    if room <= 0.0 {
        return None;
    }
    let spread = ratio.spread?;
    let fits = |n: f64| student_quantile(0.5 + 0.5 * ratio.level, n - 1.0) * spread / n.sqrt() <= room;
    let (mut low, mut high) = (ratio.runs as f64, MOST_RUNS);
    if !fits(high) {
        return None;
    }
    // The interval at hand was too wide: one more run is the least there can be.
    while high - low > 1.0 {
        let middle = ((low + high) / 2.0).floor();
        if fits(middle) { high = middle } else { low = middle }
    }
    Some(high as usize - ratio.runs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::Purpose;

    const KEY: Key = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test };

    #[test]
    fn what_a_seed_does_to_both_cancels() {
        let b = [1.0, 100.0, 3.0, 0.01, 7.0, 20.0];
        let a = b.map(|x| 2.0 * x);
        let r = paired_ratio(&a, &b, 0.95, KEY).unwrap();
        let i = r.interval.unwrap();
        assert!((r.ratio - 2.0).abs() < 1e-12 && (i.low - 2.0).abs() < 1e-12 && (i.high - 2.0).abs() < 1e-12, "{r:?}");
        assert!(r.spread.unwrap() < 1e-6);
        let other = paired_ratio(&a, &[7.0, 3.0, 20.0, 1.0, 0.01, 100.0], 0.95, KEY).unwrap().interval.unwrap();
        assert!(other.width() > 1.0);
        assert_eq!(speed_up(&a, &b, 0.95, KEY), Some(r));
    }

    #[test]
    fn unusable_lists_have_no_ratio() {
        let fine = [1.0, 2.0, 3.0];
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(paired_ratio(&fine, &[1.0, bad, 3.0], 0.95, KEY), None);
            assert_eq!(paired_ratio(&[1.0, bad, 3.0], &fine, 0.95, KEY), None);
        }
        assert_eq!(paired_ratio(&fine, &fine[..2], 0.95, KEY), None);
        assert_eq!(paired_ratio(&[], &[], 0.95, KEY), None);
        assert_eq!(paired_ratio(&fine, &fine, 1.0, KEY), None);
        let single = paired_ratio(&[6.0], &[2.0], 0.95, KEY).unwrap();
        assert!((single.ratio - 3.0).abs() < 1e-12);
        assert_eq!((single.interval, single.spread, at_most(&single, 1.0)), (None, None, None));
        assert_eq!(median_interval(&[1.0, f64::NAN, 2.0], 0.95, KEY), None);
        assert!(median_interval(&fine, 0.95, KEY).unwrap().contains(2.0));
    }

    fn ratio(ratio: f64, low: f64, high: f64) -> Ratio {
        Ratio { ratio, interval: Interval::of(low, high), runs: 8, level: 0.95, spread: Some(0.5) }
    }

    #[test]
    fn a_claim_is_decided_on_the_whole_interval() {
        let r = ratio(0.9, 0.8, 1.1);
        assert_eq!(at_most(&r, 1.1), Some(Verdict::Holds));
        assert_eq!(at_most(&r, 0.79), Some(Verdict::Refuted));
        assert!(matches!(at_most(&r, 0.8), Some(Verdict::Undecided { .. })));
        for bound in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(at_most(&r, bound), None);
        }
    }

    /// With n pairs the interval reaches `t(n - 1) * 0.5 / sqrt(n)` up; ln(1 / 0.9) = 0.10536. n = 89: 1.9873 * 0.5 / 9.4340 = 0.10533 fits,
    /// n = 88: 1.9876 * 0.5 / 9.3808 = 0.10594 does not.
    #[test]
    fn more_runs_are_counted_from_the_spread() {
        assert_eq!(at_most(&ratio(0.9, 0.8, 1.1), 1.0), Some(Verdict::Undecided { more_runs: Some(89 - 8) }));
        // On the wrong side, on the bound, and hopelessly near it.
        for wrong in [1.0001, 1.0, 1.0 - 1e-9] {
            assert_eq!(at_most(&ratio(wrong, 0.8, 1.1), 1.0), Some(Verdict::Undecided { more_runs: None }));
        }
        // An interval wider than its spread promises still asks for one run.
        assert_eq!(at_most(&ratio(0.1, 0.05, 1.1), 1.0), Some(Verdict::Undecided { more_runs: Some(1) }));
    }

    /// Independent lists: the spreads add. A list and its own multiple: nothing is left.
    #[test]
    fn the_spread_of_two_medians() {
        let log_a = [-1.0, 1.0, -1.0, 1.0];
        let log_b = [-1.0, -1.0, 1.0, 1.0];
        assert!((spread(&log_a, &log_b).unwrap() - (FRAC_PI_2 * 2.0 * 4.0 / 3.0).sqrt()).abs() < 1e-12);
        assert!(spread(&log_a, &log_a).unwrap() < 1e-6);
        assert!((spread(&log_a, &[2.0; 4]).unwrap() - (FRAC_PI_2 * 4.0 / 3.0).sqrt()).abs() < 1e-12);
    }
}
