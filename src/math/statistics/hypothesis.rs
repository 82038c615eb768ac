//! Hypothesis tests: p-values of means and counts.

use super::sample::Sample;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

/// Two-sided p-value that two means are equal, by Welch's t-test (\[WELCH47\]). Equal constants give 1, different constants 0.
pub fn welch(a: &Sample, b: &Sample) -> f64 {
    let variance = a.variance + b.variance;
    if variance <= 0.0 || !variance.is_finite() {
        return if a.mean == b.mean { 1.0 } else { 0.0 };
    }
    let part = |s: &Sample| if s.variance > 0.0 { s.variance * s.variance / s.freedom } else { 0.0 };
    let freedom = variance * variance / (part(a) + part(b));
    let t = (a.mean - b.mean) / variance.sqrt();
    student_two_sided(t, freedom)
}

/// Two-sided p-value of Student's t.
pub fn student_two_sided(t: f64, freedom: f64) -> f64 {
    match StudentsT::new(0.0, 1.0, freedom) {
        Ok(law) => 2.0 * law.cdf(-t.abs()),
        Err(_) => f64::NAN,
    }
}

/// Freedom beyond which Student's law is taken as the normal one; their 97.5 % quantiles then differ by 1.2e-6 of themselves.
const AS_GOOD_AS_NORMAL: f64 = 1e6;

/// Quantile of Student's t. NaN unless `freedom` is positive and `p` lies in [0, 1].
pub fn student_quantile(p: f64, freedom: f64) -> f64 {
    if !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    // The inversion of Student's law in `statrs` does not come to an end at a billion degrees of freedom.
    if freedom > AS_GOOD_AS_NORMAL {
        return Normal::standard().inverse_cdf(p);
    }
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::NAN, |law| law.inverse_cdf(p))
}

/// p-value of Pearson's chi-squared test of counts against expectations. Cells expecting fewer than five are pooled in order of
/// expectation; a count in a cell where nothing may fall refutes the hypothesis outright.
pub fn chi_squared(observed: &[f64], expected: &[f64]) -> f64 {
    if expected.iter().zip(observed).any(|(expect, observe)| *expect <= 0.0 && *observe > 0.0) {
        return 0.0;
    }
    let mut cells: Vec<(f64, f64)> = expected.iter().copied().zip(observed.iter().copied()).collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut statistic, mut freedom) = (0.0, -1.0);
    let mut pooled = (0.0, 0.0);
    for (expect, observe) in cells {
        pooled.0 += expect;
        pooled.1 += observe;
        if pooled.0 >= 5.0 {
            statistic += (pooled.1 - pooled.0).powi(2) / pooled.0;
            freedom += 1.0;
            pooled = (0.0, 0.0);
        }
    }
    if pooled.0 > 0.0 {
        // The largest cells come last, so a rest is small beside what went before only if everything is small.
        statistic += (pooled.1 - pooled.0).powi(2) / pooled.0;
        freedom += 1.0;
    }
    if freedom < 1.0 {
        return 1.0;
    }
    ChiSquared::new(freedom).map_or(f64::NAN, |law| law.sf(statistic))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from scipy 1.11 `stats.ttest_ind(a, b, equal_var=False)`.
    #[test]
    fn welch_agrees_with_scipy() {
        let a = Sample::of(&[1.0, 2.0, 3.0, 4.0, 5.5]);
        let b = Sample::of(&[2.5, 3.5, 3.0, 8.0, 7.0, 6.5]);
        assert!((welch(&a, &b) - 0.144_018_820_730_681_53).abs() < 1e-9, "{}", welch(&a, &b));
        assert_eq!(welch(&Sample::of(&[1.0, 1.0]), &Sample::of(&[1.0, 1.0])), 1.0);
        assert_eq!(welch(&Sample::of(&[1.0, 1.0]), &Sample::of(&[2.0, 2.0])), 0.0);
    }

    #[test]
    fn chi_squared_sees_a_wrong_law_and_an_impossible_cell() {
        assert!(chi_squared(&[100.0, 103.0, 97.0], &[100.0, 100.0, 100.0]) > 0.5);
        assert!(chi_squared(&[150.0, 80.0, 70.0], &[100.0, 100.0, 100.0]) < 1e-5);
        assert!(chi_squared(&[100.0, 100.0, 1.0], &[100.0, 100.0, 0.0]) == 0.0);
    }

    #[test]
    fn student_becomes_normal_without_a_step_or_a_wait() {
        let (below, above) = (student_quantile(0.975, 0.999e6), student_quantile(0.975, 1.001e6));
        assert!((below / above - 1.0).abs() < 2e-6 && (above - 1.959_964).abs() < 1e-6, "{below} {above}");
        assert_eq!(student_quantile(0.975, 1e9), above);
        assert!(student_quantile(f64::NAN, 3.0).is_nan() && student_quantile(1.5, 3.0).is_nan() && student_quantile(0.5, 0.0).is_nan());
    }
}
