//! Hypothesis tests and fits shared by tests, `compare` and studies, on `statrs`.
//!
//! The unit of observation is an independent run (a seed), not a sample: pixels of one photon map and states of one chain are correlated.

use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// Level of one of `tests` independent tests so that the family keeps `family` (\[SIDAK67\]).
pub fn sidak(family: f64, tests: usize) -> f64 {
    -((-family).ln_1p() / tests.max(1) as f64).exp_m1()
}

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

/// Quantile of Student's t.
pub fn student_quantile(p: f64, freedom: f64) -> f64 {
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

/// A weighted least-squares fit `y = X beta`.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Coefficients, in the order of the columns of `X`.
    pub coefficients: Vec<f64>,
    /// Their covariance, from the given variances of `y`.
    pub covariance: Vec<Vec<f64>>,
    /// Weighted sum of squared residuals: chi-squared with `rows - columns` degrees of freedom if the model holds.
    pub chi_squared: f64,
}

/// Fits rows of `X` to `y` with known variances of `y`. `None` if the columns are not independent.
pub fn least_squares(rows: &[Vec<f64>], y: &[f64], variance: &[f64]) -> Option<Fit> {
    let columns = rows.first()?.len();
    let mut normal = vec![vec![0.0; columns]; columns];
    let mut right = vec![0.0; columns];
    for ((row, y), variance) in rows.iter().zip(y).zip(variance) {
        for i in 0..columns {
            right[i] += row[i] * y / variance;
            for j in 0..columns {
                normal[i][j] += row[i] * row[j] / variance;
            }
        }
    }
    let covariance = invert(normal)?;
    let coefficients: Vec<f64> = covariance.iter().map(|row| row.iter().zip(&right).map(|(a, b)| a * b).sum()).collect();
    let residual = |row: &Vec<f64>, y: f64| y - row.iter().zip(&coefficients).map(|(a, b)| a * b).sum::<f64>();
    let chi_squared = rows.iter().zip(y).zip(variance).map(|((row, y), v)| residual(row, *y).powi(2) / v).sum();
    Some(Fit { coefficients, covariance, chi_squared })
}

/// Inverse of a small symmetric positive matrix by Gauss-Jordan elimination with pivoting.
fn invert(mut a: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let n = a.len();
    let mut inverse: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for column in 0..n {
        let pivot = (column..n).max_by(|&i, &j| a[i][column].abs().total_cmp(&a[j][column].abs()))?;
        if a[pivot][column] == 0.0 || !a[pivot][column].is_finite() {
            return None;
        }
        a.swap(column, pivot);
        inverse.swap(column, pivot);
        let scale = 1.0 / a[column][column];
        for j in 0..n {
            a[column][j] *= scale;
            inverse[column][j] *= scale;
        }
        for i in (0..n).filter(|&i| i != column) {
            let factor = a[i][column];
            for j in 0..n {
                a[i][j] -= factor * a[column][j];
                inverse[i][j] -= factor * inverse[column][j];
            }
        }
    }
    Some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sidak_keeps_the_family() {
        for n in [1, 10, 1000] {
            assert!((1.0 - (1.0 - sidak(0.01, n)).powi(n as i32) - 0.01).abs() < 1e-12);
        }
    }

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
    fn least_squares_recovers_a_parabola() {
        let x = [0.5, 1.0, 2.0, 3.0, 4.0];
        let rows: Vec<Vec<f64>> = x.iter().map(|r| vec![1.0, *r, r * r]).collect();
        let y: Vec<f64> = x.iter().map(|r| 2.0 - 0.5 * r + 0.25 * r * r).collect();
        let fit = least_squares(&rows, &y, &[1.0, 2.0, 1.0, 0.5, 1.0]).unwrap();
        for (got, want) in fit.coefficients.iter().zip([2.0, -0.5, 0.25]) {
            assert!((got - want).abs() < 1e-10);
        }
        assert!(fit.chi_squared < 1e-18 && fit.covariance[0][0] > 0.0);
    }
}
