//! Which of two methods is better, by how much, and whether that is certain.

use super::bootstrap::{Interval, RESAMPLES, bootstrap, bootstrap_percentile};
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
/// The interval is by percentiles ([`bootstrap_percentile`]) where as many runs can carry one, and [`bootstrap`] on the ratio's
/// logarithm with fewer (docs/statistics.md has the coverage of both). All randomness comes from `key`.
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
    let interval = if percentiles_reach(runs, level) {
        bootstrap_percentile(runs, RESAMPLES, level, key, statistic)
    } else {
        bootstrap(runs, RESAMPLES, level, key, statistic)
    };
    let ratio = positive(statistic(&(0..runs).collect::<Vec<usize>>()).exp())?;
    Some(Ratio { ratio, interval: interval.and_then(|i| i.exp()), runs, level, spread: spread(&log_a, &log_b) })
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

/// Whether the median's widest percentile interval, from the smallest run to the largest, reaches the level. Its level is
/// `1 - 2^(1-K)`; a shortfall of a quarter of `1 - level` is let pass, which lets 5 runs give 93.75 % for 95 %.
fn percentiles_reach(runs: usize, level: f64) -> bool {
    0.5f64.powi(runs.saturating_sub(1).min(1000) as i32) <= 1.25 * (1.0 - level)
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
