//! Weighted least squares.

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
