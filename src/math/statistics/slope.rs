//! Slopes of error curves on doubly logarithmic axes.

use super::bootstrap::{Interval, RESAMPLES, bootstrap};
use crate::samplers::Key;

/// Fewest points a slope is fitted to: two give a line that cannot miss.
const FEWEST_POINTS: usize = 3;

/// A line `log y = intercept + slope * log x`, natural logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Exponent of `x`.
    pub slope: f64,
    /// Confidence interval of the slope over runs; `None` with fewer than two runs.
    pub interval: Option<Interval>,
    /// Logarithm of the fitted `y` at `x = 1`.
    pub intercept: f64,
    /// Smallest `x` of the fit.
    pub from: f64,
    /// Largest `x` of the fit.
    pub to: f64,
    /// Points of the fit.
    pub points: usize,
}

impl Slope {
    /// The fitted `y` at `x`.
    pub fn at(&self, x: f64) -> f64 {
        (self.intercept + self.slope * x.ln()).exp()
    }
}

/// Slope of the mean over runs of a positive error curve (mse, relMSE), `y[run][point]` at `x[point]`: least squares on the logarithms of
/// those points whose `x` lies in the window (ends included), every point with the same weight.
///
/// The interval is by [`bootstrap`] over whole runs, so that it does not matter that the snapshots of one run depend on each other. For a
/// curve of roots (rmse) pass the squares and halve slope and interval, or use [`log_log_slope_of`].
///
/// `None` without runs, where a run's length is not that of `x`, with fewer than three points of different `x` in the window, and where a
/// value in the window is not finite and positive: no point is left out of a fit unsaid.
pub fn log_log_slope(x: &[f64], y: &[Vec<f64>], window: (f64, f64), level: f64, key: Key) -> Option<Slope> {
    let inside = |x: f64| window.0 <= x && x <= window.1;
    let usable = |run: &Vec<f64>| run.len() == x.len() && run.iter().zip(x).all(|(y, x)| !inside(*x) || (y.is_finite() && *y > 0.0));
    if !y.iter().all(usable) {
        return None;
    }
    let mean = |runs: &[usize], point: usize| runs.iter().map(|&run| y[run][point]).sum::<f64>() / runs.len() as f64;
    log_log_slope_of(x, y.len(), window, level, key, mean)
}

/// As [`log_log_slope`] for any curve over runs: `curve(runs, point)` is its height at `x[point]` with these runs, such as a standard
/// deviation over runs or the root of a squared bias averaged over pixels.
///
/// `None` also where the curve of the runs is not finite and positive in the window. Where that befalls a resample, there is no interval.
pub fn log_log_slope_of(
    x: &[f64],
    runs: usize,
    window: (f64, f64),
    level: f64,
    key: Key,
    curve: impl Fn(&[usize], usize) -> f64,
) -> Option<Slope> {
    let points: Vec<usize> = (0..x.len()).filter(|&i| window.0 <= x[i] && x[i] <= window.1).collect();
    let logs: Vec<f64> = points.iter().map(|&i| x[i].ln()).collect();
    if runs == 0 || logs.iter().any(|l| !l.is_finite()) || distinct(&logs) < FEWEST_POINTS {
        return None;
    }
    let centre = logs.iter().sum::<f64>() / logs.len() as f64;
    let spread: f64 = logs.iter().map(|l| (l - centre).powi(2)).sum();
    // The logarithm of what is not positive is not finite, and makes the slope so.
    let height = |drawn: &[usize], point: usize| curve(drawn, point).ln();
    let slope = |drawn: &[usize]| points.iter().zip(&logs).map(|(&i, l)| (l - centre) * height(drawn, i)).sum::<f64>() / spread;
    let all: Vec<usize> = (0..runs).collect();
    let fitted = slope(&all);
    let mean = points.iter().map(|&i| height(&all, i)).sum::<f64>() / points.len() as f64;
    let ends = |least: fn(f64, f64) -> f64, start: f64| points.iter().map(|&i| x[i]).fold(start, least);
    fitted.is_finite().then(|| Slope {
        slope: fitted,
        interval: bootstrap(runs, RESAMPLES, level, key, slope),
        intercept: mean - fitted * centre,
        from: ends(f64::min, f64::INFINITY),
        to: ends(f64::max, f64::NEG_INFINITY),
        points: points.len(),
    })
}

fn distinct(values: &[f64]) -> usize {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.dedup();
    sorted.len()
}
