//! Intervals by drawing whole runs again (\[EFRON93\]).

use super::hypothesis::student_quantile;
use crate::samplers::{Key, Stream};
use statrs::distribution::{ContinuousCDF, Normal};

/// Resamples for an interval unless a caller asks for another number: the standard error then carries 1.6 % of noise of its own.
pub const RESAMPLES: usize = 2000;

/// A closed interval of finite numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end, not below `low`.
    pub high: f64,
}

impl Interval {
    /// From end to end; `None` unless both are finite and in order.
    pub fn of(low: f64, high: f64) -> Option<Self> {
        (low.is_finite() && high.is_finite() && low <= high).then_some(Self { low, high })
    }

    /// The interval of points no farther than `half` from `centre`.
    pub fn around(centre: f64, half: f64) -> Option<Self> {
        Self::of(centre - half, centre + half)
    }

    /// Whether `x` lies in it, ends included.
    pub fn contains(&self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// Length.
    pub fn width(&self) -> f64 {
        self.high - self.low
    }

    /// Both ends through `e^x`: from a logarithm's interval to its number's. `None` where that is not finite.
    pub fn exp(&self) -> Option<Self> {
        Self::of(self.low.exp(), self.high.exp())
    }
}

/// Confidence interval of a smooth statistic (a mean, a slope, a logarithm of either) of `runs` independent runs.
///
/// `statistic` is given indices of runs, `runs` of them, drawn with replacement, and computes its number as if these were the runs. The
/// interval is `estimate +- t * s * sqrt(K / (K - 1))`: `s` the standard deviation over resamples, `t` Student's quantile with `K - 1`
/// degrees of freedom, the root because a resample's variance is short by that factor (\[EFRON93 12.4\], \[HESTERBERG15\]). Percentile and BCa intervals lack both
/// corrections and hold the truth 75 to 90 % of the time at 4 to 8 runs where 95 % is asked (docs/statistics.md). The interval is
/// symmetric: pass a logarithm where the statistic is positive and skewed. For medians see [`bootstrap_median`].
///
/// All randomness comes from `key` ([`Purpose::Test`](crate::samplers::Purpose::Test) is for this): equal keys, equal intervals. `None` with fewer than two runs or two resamples, for a level outside
/// (0, 1), and where the statistic of the runs or of any resample is not finite.
pub fn bootstrap(runs: usize, resamples: usize, level: f64, key: Key, statistic: impl Fn(&[usize]) -> f64) -> Option<Interval> {
    let (estimate, values) = resample(runs, resamples, level, key, statistic)?;
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let freedom = (runs - 1) as f64;
    let half = student_quantile(0.5 + 0.5 * level, freedom) * (variance * runs as f64 / freedom).sqrt();
    Interval::around(estimate, half)
}

/// Confidence interval of a statistic that jumps, such as a median: the quantiles of its resampled values (\[EFRON93 13.3\]).
///
/// Arguments and outcome as for [`bootstrap`]; also `None` with fewer than `2 / (1 - level)` resamples, where the tail would be empty. From
/// `K` runs a median's interval can reach no level above `1 - 2^(1-K)`, for it ends at the smallest and the largest run at the most:
/// [`bootstrap_median`] sees to that.
pub fn bootstrap_percentile(runs: usize, resamples: usize, level: f64, key: Key, statistic: impl Fn(&[usize]) -> f64) -> Option<Interval> {
    let (_, mut values) = resample(runs, resamples, level, key, statistic)?;
    if 0.5 * (1.0 - level) * (resamples as f64) < 1.0 {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    Interval::of(quantile(&values, 0.5 - 0.5 * level), quantile(&values, 0.5 + 0.5 * level))
}

/// Confidence interval of a statistic made of medians, such as a logarithm of a ratio of two. Arguments and outcome as for [`bootstrap`].
///
/// A median's widest percentile interval, from the smallest run to the largest, has level `1 - 2^(1-K)`. Where that reaches `level` (from 6
/// runs for 95 %) the interval is by percentiles, taken farther out by the root of `K / (K - 1)` on the scale of the normal law
/// (\[HESTERBERG15\]); with fewer runs it is that of [`bootstrap`], which then comes out wide.
pub fn bootstrap_median(runs: usize, resamples: usize, level: f64, key: Key, statistic: impl Fn(&[usize]) -> f64) -> Option<Interval> {
    let missed = 0.5f64.powi(runs.clamp(1, 1000) as i32 - 1);
    if missed > 1.0 - level {
        return bootstrap(runs, resamples, level, key, statistic);
    }
    let law = Normal::standard();
    let farther = (runs as f64 / (runs as f64 - 1.0)).sqrt();
    let out = (level > 0.0 && level < 1.0).then(|| law.inverse_cdf(0.5 + 0.5 * level) * farther)?;
    bootstrap_percentile(runs, resamples, 1.0 - 2.0 * law.cdf(-out), key, statistic)
}

/// Quantile of sorted values: linear between them, the i-th of n (from 1) at i / (n + 1).
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let last = sorted.len() - 1;
    let place = (p * (sorted.len() + 1) as f64 - 1.0).clamp(0.0, last as f64);
    let (below, part) = (place.floor() as usize, place.fract());
    // The second term is left out at the end, where there is no value above.
    if part == 0.0 { sorted[below] } else { sorted[below] + part * (sorted[below + 1] - sorted[below]) }
}

/// The statistic of the runs as they are, and of each resample.
fn resample(runs: usize, resamples: usize, level: f64, key: Key, statistic: impl Fn(&[usize]) -> f64) -> Option<(f64, Vec<f64>)> {
    if runs < 2 || resamples < 2 || !(level > 0.0 && level < 1.0) {
        return None;
    }
    let mut drawn: Vec<usize> = (0..runs).collect();
    let estimate = statistic(&drawn);
    let mut stream = key.stream();
    let mut values = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        // A coordinate has 24 bits: below 2^24 runs every index can be drawn, and the product stays below `runs` in f64.
        drawn.fill_with(|| (f64::from(stream.next_1d()) * runs as f64) as usize);
        values.push(statistic(&drawn));
    }
    (estimate.is_finite() && values.iter().all(|v| v.is_finite())).then_some((estimate, values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::Purpose;

    const KEY: Key = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test };

    /// The standard deviation of a resample's mean is known: that of the runs with divisor `K`, over the root of `K`.
    #[test]
    fn a_mean_gets_students_interval() {
        let values = [3.0, 1.0, 4.0, 1.5, 9.0, 2.6];
        let mean = |drawn: &[usize]| drawn.iter().map(|&i| values[i]).sum::<f64>() / drawn.len() as f64;
        let got = bootstrap(6, 200_000, 0.95, KEY, mean).unwrap();
        let (low, high) = super::super::Sample::of(&values).interval(0.95);
        assert!((got.low - low).abs() < 0.02 && (got.high - high).abs() < 0.02, "{got:?} and {low} .. {high}");
    }

    /// The median of five drawn from five is the largest with probability `P(Binomial(5, 1/5) >= 3) = 0.0579`, and likewise the smallest:
    /// the 90 % interval ends there, the 85 % interval one value further in.
    #[test]
    fn percentiles_of_a_median_end_at_the_order_statistics() {
        let values = [5.0, 1.0, 3.0, 2.0, 4.0];
        let statistic = |drawn: &[usize]| super::super::median(&drawn.iter().map(|&i| values[i]).collect::<Vec<f64>>()).unwrap();
        let at = |level| bootstrap_percentile(5, 20_000, level, KEY, statistic);
        assert_eq!(at(0.90), Interval::of(1.0, 5.0));
        assert_eq!(at(0.85), Interval::of(2.0, 4.0));
        assert_eq!(bootstrap_median(5, RESAMPLES, 0.95, KEY, statistic), bootstrap(5, RESAMPLES, 0.95, KEY, statistic));
        // With six runs percentiles reach 96.875 %, and these are of the level 1 - 2 Phi(-1.95996 * sqrt(6 / 5)) = 0.96821.
        let mean = |drawn: &[usize]| drawn.iter().sum::<usize>() as f64;
        let wide = bootstrap_percentile(6, RESAMPLES, 0.968_21, KEY, mean).unwrap();
        let got = bootstrap_median(6, RESAMPLES, 0.95, KEY, mean).unwrap();
        assert!((got.low - wide.low).abs() < 0.1 && (got.high - wide.high).abs() < 0.1, "{got:?} and {wide:?}");
    }

    #[test]
    fn equal_keys_give_equal_intervals_and_every_run_is_drawn() {
        let statistic = |drawn: &[usize]| drawn.iter().sum::<usize>() as f64;
        let one = bootstrap(7, 100, 0.95, KEY, statistic);
        assert_eq!(one, bootstrap(7, 100, 0.95, KEY, statistic));
        assert_ne!(one, bootstrap(7, 100, 0.95, Key { seed: 2, ..KEY }, statistic));
        let (_, highest) = resample(7, 200, 0.95, KEY, |drawn| drawn.iter().copied().max().unwrap() as f64).unwrap();
        let (_, lowest) = resample(7, 200, 0.95, KEY, |drawn| drawn.iter().copied().min().unwrap() as f64).unwrap();
        assert!(highest.contains(&6.0) && lowest.contains(&0.0) && highest.iter().all(|h| *h <= 6.0));
    }

    #[test]
    fn what_gives_no_interval_says_so() {
        let fine = |_: &[usize]| 1.0;
        assert_eq!(bootstrap(5, 100, 0.95, KEY, fine), Interval::of(1.0, 1.0));
        for runs in [0, 1] {
            assert_eq!(bootstrap(runs, 100, 0.95, KEY, fine), None);
            assert_eq!(bootstrap_median(runs, 100, 0.95, KEY, fine), None);
        }
        for level in [0.0, 1.0, -1.0, f64::NAN] {
            assert_eq!(bootstrap(5, 100, level, KEY, fine), None);
            assert_eq!(bootstrap_percentile(5, 100, level, KEY, fine), None);
        }
        assert_eq!(bootstrap_percentile(5, 39, 0.95, KEY, fine), None);
        assert_eq!(bootstrap(5, 1, 0.95, KEY, fine), None);
        // One bad resample is enough: leaving it out would make the others look better than they are.
        let sometimes = |drawn: &[usize]| if drawn.iter().all(|i| *i != 2) { f64::NEG_INFINITY } else { 0.5 };
        assert_eq!(bootstrap(5, 100, 0.95, KEY, sometimes), None);
        assert_eq!((Interval::of(1.0, 0.0), Interval::around(0.0, f64::NAN)), (None, None));
        assert_eq!(Interval::of(0.0, 1000.0).unwrap().exp(), None);
    }
}
