//! What a handful of runs say of one number: mean, median, and what part of the error is noise.

use super::bootstrap::Interval;
use super::hypothesis::student_quantile;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Mean and variance of a list of observations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Observations.
    pub n: f64,
    /// Their mean.
    pub mean: f64,
    /// Variance **of the mean**, unbiased.
    pub variance: f64,
    /// Degrees of freedom behind the variance.
    pub freedom: f64,
}

impl Sample {
    /// Of independent, equally distributed observations; at least two for a variance.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        Self { n, mean, variance: squares / (n - 1.0) / n, freedom: n - 1.0 }
    }

    /// Two-sided confidence interval of the mean by Student's t at `level`, such as 0.95.
    pub fn interval(&self, level: f64) -> (f64, f64) {
        let half = student_quantile(0.5 + 0.5 * level, self.freedom) * self.variance.sqrt();
        (self.mean - half, self.mean + half)
    }
}

/// The middle value, or the mean of the middle two. `None` of nothing, and where a value is not finite.
pub fn median(values: &[f64]) -> Option<f64> {
    if values.is_empty() || values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let mut sorted = values.to_vec();
    Some(median_of(&mut sorted))
}

/// The median of finite values, at least one; they are put in order.
pub(super) fn median_of(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}

/// The error of a number that several runs estimate, parted into what changes from run to run and what does not.
///
/// With `m` and `s^2` the mean and the unbiased variance of `K` runs, `r` the reference and `v` the variance of the reference:
/// `variance = s^2`, `squared_bias = (m - r)^2 - s^2 / K - v`, `mse = variance + squared_bias`. All three are unbiased, so that
/// `squared_bias` is negative about half the time when there is no bias: averages over pixels and studies need it so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// Runs.
    pub runs: usize,
    /// Variance of one run.
    pub variance: f64,
    /// Mean of the runs less the reference.
    pub bias: f64,
    /// Unbiased estimate of the squared bias; may be negative.
    pub squared_bias: f64,
    /// Unbiased estimate of one run's mean squared error against the truth; may be negative where all of the error is the reference's.
    pub mse: f64,
    /// Variance of `bias`: that of the mean of the runs and that of the reference.
    pub bias_variance: f64,
    reference_variance: f64,
}

/// Parts the error of independent runs against a reference whose own variance (of its mean) is known; 0 for an exact truth.
///
/// `None` with fewer than two runs, where a number is not finite, and for a negative variance.
pub fn split(values: &[f64], reference: f64, reference_variance: f64) -> Option<Split> {
    let usable = reference.is_finite() && reference_variance.is_finite() && reference_variance >= 0.0;
    if values.len() < 2 || !usable || values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let sample = Sample::of(values);
    let bias = sample.mean - reference;
    let bias_variance = sample.variance + reference_variance;
    let variance = sample.variance * sample.n;
    let squared_bias = bias * bias - bias_variance;
    let split = Split { runs: values.len(), variance, bias, squared_bias, mse: variance + squared_bias, bias_variance, reference_variance };
    (split.mse.is_finite()).then_some(split)
}

impl Split {
    /// Confidence interval of the bias: Student's t with the degrees of freedom of \[WELCH47\], the reference's variance taken as known.
    /// `None` for a level outside (0, 1).
    pub fn bias_interval(&self, level: f64) -> Option<Interval> {
        let of_the_runs = self.bias_variance - self.reference_variance;
        let freedom = (self.runs - 1) as f64 * (self.bias_variance / of_the_runs).powi(2);
        // Runs that agree exactly leave only the reference's noise, and that is normal: 0 / 0 where that is nil too.
        let freedom = if freedom.is_finite() { freedom } else { f64::MAX };
        let half = (level > 0.0 && level < 1.0).then(|| student_quantile(0.5 + 0.5 * level, freedom))? * self.bias_variance.sqrt();
        Interval::around(self.bias, half)
    }

    /// Confidence interval of the variance by the chi-squared law, for runs that are normally distributed. Runs with heavier tails are
    /// covered less often than `level` says (docs/statistics.md has numbers). `None` for a level outside (0, 1).
    pub fn variance_interval(&self, level: f64) -> Option<Interval> {
        if !(level > 0.0 && level < 1.0) {
            return None;
        }
        let freedom = (self.runs - 1) as f64;
        let law = ChiSquared::new(freedom).ok()?;
        let end = |p: f64| self.variance * freedom / law.inverse_cdf(p);
        Interval::of(end(0.5 + 0.5 * level), end(0.5 - 0.5 * level))
    }
}

/// How good a method is for the time it takes: `1 / (error * seconds)`, the error a mean squared one (relMSE as a rule), which falls as
/// `1 / seconds` for a method that is only noise; then the efficiency is the same at any time, and twice the efficiency is half the time.
///
/// `None` unless both are finite and positive.
pub fn efficiency(error: f64, seconds: f64) -> Option<f64> {
    positive(1.0 / inefficiency(error, seconds)?)
}

/// `error * seconds`, the inverse of [`efficiency`]. `None` unless both are finite and positive.
pub fn inefficiency(error: f64, seconds: f64) -> Option<f64> {
    positive(positive(error)? * positive(seconds)?)
}

/// Seconds until the variance is one: `variance * seconds`, for a variance that falls as `1 / seconds`. `None` unless both are finite and
/// positive.
pub fn time_to_unit_variance(variance: f64, seconds: f64) -> Option<f64> {
    inefficiency(variance, seconds)
}

/// The number, if it is finite and above zero.
pub(super) fn positive(x: f64) -> Option<f64> {
    (x.is_finite() && x > 0.0).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_odd_even_and_unusable_lists() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[1.0, f64::NAN]), None);
        assert_eq!(median(&[f64::INFINITY]), None);
    }

    #[test]
    fn a_split_by_hand() {
        let s = split(&[1.0, 2.0, 3.0, 6.0], 1.0, 0.25).unwrap();
        assert!((s.variance - 14.0 / 3.0).abs() < 1e-12);
        assert!((s.squared_bias - (4.0 - 14.0 / 12.0 - 0.25)).abs() < 1e-12);
        // One run's mean squared distance to the reference, less the reference's own variance, is the same number.
        assert!((s.mse - ((0.0 + 1.0 + 4.0 + 25.0) / 4.0 - 0.25)).abs() < 1e-12);
        for level in [0.0, 1.0, f64::NAN] {
            assert_eq!((s.bias_interval(level), s.variance_interval(level)), (None, None));
        }
    }

    /// 2.5 % and 97.5 % quantiles of chi-squared with 9 degrees of freedom, and of Student's t: 2.700, 19.023, 2.262 in any table.
    #[test]
    fn intervals_of_a_split_are_those_of_the_tables() {
        let values: Vec<f64> = (0..10).map(f64::from).collect();
        let s = split(&values, 4.0, 0.0).unwrap();
        let v = s.variance_interval(0.95).unwrap();
        assert!((s.variance * 9.0 / v.high - 2.700).abs() < 5e-4 && (s.variance * 9.0 / v.low - 19.023).abs() < 5e-4);
        let b = s.bias_interval(0.95).unwrap();
        assert!(((b.high - 0.5) / s.bias_variance.sqrt() - 2.262).abs() < 5e-4);
        // Runs that agree exactly: the reference's noise is what is left, by the normal law.
        let b = split(&[1.0, 1.0], 1.0, 4.0).unwrap().bias_interval(0.95).unwrap();
        assert!((b.high - 2.0 * 1.959_964).abs() < 1e-4, "{b:?}");
    }

    #[test]
    fn no_numbers_are_made_of_unusable_ones() {
        assert_eq!(split(&[1.0], 0.0, 0.0), None);
        assert_eq!(split(&[1.0, f64::NAN], 0.0, 0.0), None);
        assert_eq!(split(&[1.0, 2.0], f64::INFINITY, 0.0), None);
        assert_eq!(split(&[1.0, 2.0], 0.0, -1.0), None);
        assert_eq!(split(&[1e200, 2e200], 0.0, 0.0), None);
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!((efficiency(bad, 1.0), efficiency(1.0, bad)), (None, None));
            assert_eq!(time_to_unit_variance(bad, 1.0), None);
        }
        assert_eq!(efficiency(0.25, 2.0), Some(2.0));
        assert_eq!(time_to_unit_variance(0.25, 2.0), Some(0.5));
        assert_eq!(efficiency(1e-200, 1e-200), None);
    }
}
