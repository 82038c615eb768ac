//! What several runs of one method say together: noise, bias, and where the error is.
//!
//! All from the products of the runs' differences to the reference, G_ij = mean (x_i - r)(x_j - r): noise of different runs is independent,
//! so the mean over i != j is the squared bias and the reference's own variance, and the mean over i = j adds the variance of a run.

use super::claims::{Estimate, LEVEL};
use crate::image::picture::Picture;
use crate::math::statistics::Interval;
use crate::math::statistics::student_quantile;

/// Variance of one run and squared bias of a method, averaged over pixels and channels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    /// Variance of one run.
    pub(super) variance: Estimate,
    /// Squared bias; may come out below zero when it is lost in noise.
    pub(super) bias: Estimate,
    /// Whether the reference's own variance was known and taken out of the bias.
    pub(super) corrected: bool,
}

/// Products of differences, and what the reference adds to each.
struct Products {
    gram: Vec<Vec<f64>>,
    reference_variance: f64,
}

/// Runs beside a reference.
pub(super) struct Against<'a> {
    pub(super) runs: &'a [&'a Picture],
    pub(super) reference: &'a Picture,
    pub(super) variance: Option<&'a Picture>,
    pub(super) epsilon: f64,
}

impl Against<'_> {
    /// Pixels that are finite everywhere.
    fn usable(&self) -> Vec<usize> {
        let all = |i: &usize| {
            self.reference.pixels[*i].is_finite()
                && self.variance.is_none_or(|v| v.pixels[*i].is_finite())
                && self.runs.iter().all(|r| r.pixels[*i].is_finite())
        };
        (0..self.reference.pixels.len()).filter(all).collect()
    }

    /// Pixels left out because a run, the reference or its variance is not finite there.
    pub(super) fn masked(&self) -> usize {
        self.reference.pixels.len() - self.usable().len()
    }

    /// Averages weighted by 1, or by 1 / (r^2 + epsilon).
    fn products(&self, relative: bool) -> Products {
        let count = self.runs.len();
        let (mut gram, mut reference_variance) = (vec![vec![0.0; count]; count], 0.0);
        let usable = self.usable();
        let mut differences = vec![0.0; count];
        for &i in &usable {
            for c in 0..3 {
                let r = f64::from(self.reference.pixels[i][c]);
                let weight = if relative { 1.0 / (r * r + self.epsilon) } else { 1.0 };
                for (difference, run) in differences.iter_mut().zip(self.runs) {
                    *difference = f64::from(run.pixels[i][c]) - r;
                }
                for (row, a) in gram.iter_mut().zip(&differences) {
                    for (product, b) in row.iter_mut().zip(&differences) {
                        *product += weight * a * b;
                    }
                }
                reference_variance += self.variance.map_or(0.0, |v| weight * f64::from(v.pixels[i][c]));
            }
        }
        let values = 3.0 * usable.len() as f64;
        gram.iter_mut().flatten().for_each(|product| *product /= values);
        Products { gram, reference_variance: reference_variance / values }
    }

    /// The split; relative: of relmse, else of mse. None for fewer than two runs.
    pub(super) fn split(&self, relative: bool) -> Option<Split> {
        if self.runs.len() < 2 || self.usable().is_empty() {
            return None;
        }
        let products = self.products(relative);
        let variance = products.jackknife(|diagonal, others| diagonal - others);
        let bias = products.jackknife(|_, others| others - products.reference_variance);
        Some(Split { variance, bias, corrected: self.variance.is_some() })
    }

    /// Per pixel, the root over runs and channels of the mean squared relative error; NaN where it is masked.
    pub(super) fn relative_error(&self) -> Vec<f32> {
        let pixel = |i: usize| {
            let sum: f64 = self.runs.iter().flat_map(|run| (0..3).map(move |c| (run.pixels[i][c], c))).fold(0.0, |sum, (x, c)| {
                let r = f64::from(self.reference.pixels[i][c]);
                sum + (f64::from(x) - r).powi(2) / (r * r + self.epsilon)
            });
            (sum / (3.0 * self.runs.len() as f64)).sqrt() as f32
        };
        (0..self.reference.pixels.len()).map(pixel).collect()
    }
}

impl Products {
    /// Means on and off the diagonal, without one run.
    fn means(&self, without: Option<usize>) -> (f64, f64) {
        let kept: Vec<usize> = (0..self.gram.len()).filter(|k| Some(*k) != without).collect();
        let n = kept.len() as f64;
        let diagonal: f64 = kept.iter().map(|&k| self.gram[k][k]).sum();
        let all: f64 = kept.iter().flat_map(|&a| kept.iter().map(move |&b| self.gram[a][b])).sum();
        (diagonal / n, (all - diagonal) / (n * (n - 1.0)))
    }

    /// A function of both means, with the interval of the jackknife over runs; three runs are the fewest that have one.
    fn jackknife(&self, of: impl Fn(f64, f64) -> f64) -> Estimate {
        let of = |(diagonal, others)| of(diagonal, others);
        let value = of(self.means(None));
        let n = self.gram.len();
        if n < 3 {
            return Estimate { value, interval: None };
        }
        let without: Vec<f64> = (0..n).map(|k| of(self.means(Some(k)))).collect();
        let mean = without.iter().sum::<f64>() / n as f64;
        let variance = (n as f64 - 1.0) / n as f64 * without.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        let half = variance.sqrt() * student_quantile(0.5 * (1.0 + LEVEL), n as f64 - 1.0);
        Estimate { value, interval: Some(Interval { low: value - half, high: value + half }) }
    }
}

/// Mean over pixels and channels of standard deviation over mean, where the mean is positive. None for fewer than two runs.
pub(super) fn noise_over_mean(runs: &[&Picture]) -> Option<f64> {
    let count = runs.len() as f64;
    let first = runs.first()?;
    if runs.len() < 2 {
        return None;
    }
    let (mut sum, mut values) = (0.0, 0_u64);
    for i in 0..first.pixels.len() {
        for c in 0..3 {
            let (s, s2) = runs.iter().map(|r| f64::from(r.pixels[i][c])).fold((0.0, 0.0), |(s, s2), v| (s + v, s2 + v * v));
            let mean = s / count;
            let variance = ((s2 - s * mean) / (count - 1.0)).max(0.0);
            if mean > 0.0 && variance.is_finite() {
                sum += variance.sqrt() / mean;
                values += 1;
            }
        }
    }
    (values > 0).then(|| sum / values as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;
    use crate::samplers::{Key, Purpose, Stream};

    /// Pixels of mean `mean` and variance `deviation`^2, uniform.
    fn picture(seed: u64, mean: f32, deviation: f32) -> Picture {
        let mut s = Key { seed, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
        let mut draw = || mean + deviation * 12_f32.sqrt() * (s.next_1d() - 0.5);
        Picture::new(64, 64, (0..64 * 64).map(|_| Rgb::new(draw(), draw(), draw())).collect())
    }

    #[test]
    fn planted_variance_and_bias_come_back() {
        let runs: Vec<Picture> = (0..8).map(|k| picture(k, 1.05, 0.2)).collect();
        let runs: Vec<&Picture> = runs.iter().collect();
        let reference = picture(99, 1.0, 0.1);
        let variance = Picture::new(64, 64, vec![Rgb::splat(0.01); 64 * 64]);
        let against = Against { runs: &runs, reference: &reference, variance: Some(&variance), epsilon: 0.01 };
        let split = against.split(false).expect("eight runs");
        assert!((split.variance.value / 0.04 - 1.0).abs() < 0.03, "{split:?}");
        assert!((split.bias.value - 0.0025).abs() < 0.0006, "{split:?}");
        let interval = split.variance.interval.expect("eight runs");
        assert!(interval.low < 0.04 && interval.high > 0.04 && interval.high - interval.low < 0.004);
        // Without its variance the reference's noise is taken for bias.
        let blind = Against { variance: None, ..against }.split(false).expect("eight runs");
        assert!((blind.bias.value - 0.0125).abs() < 0.001 && !blind.corrected);
        assert!((noise_over_mean(&runs).expect("eight runs") - 0.2 / 1.05).abs() < 0.02);
    }

    #[test]
    fn what_is_not_finite_is_left_out_and_counted() {
        let mut broken = picture(1, 1.0, 0.1);
        broken.pixels[3] = Rgb::splat(f32::NAN);
        let (other, reference) = (picture(2, 1.0, 0.1), picture(3, 1.0, 0.0));
        let runs = [&broken, &other];
        let against = Against { runs: &runs, reference: &reference, variance: None, epsilon: 0.01 };
        assert_eq!(against.masked(), 1);
        assert!(against.split(true).expect("two runs").variance.value.is_finite());
        assert!(against.relative_error()[3].is_nan());
    }
}
