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
/// `None` also where the curve of the runs is not finite and positive in the window. Where that befalls a resample, there is no
/// interval: a deviation over runs needs eight of them, because a resample of fewer now and then is one run alone, and has none.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::Purpose;

    const KEY: Key = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test };
    const ALL: (f64, f64) = (0.0, f64::INFINITY);

    fn powers(from: u32, to: u32) -> Vec<f64> {
        (from..=to).map(|e| f64::from(1u32 << e)).collect()
    }

    #[test]
    fn an_exact_power_is_recovered_in_its_window() {
        let x = powers(0, 10);
        let run = |scale: f64| x.iter().map(|x| if *x < 8.0 { 77.0 } else { scale * x.powf(-0.75) }).collect::<Vec<f64>>();
        let y = [run(2.0), run(4.0), run(6.0)];
        let fit = log_log_slope(&x, &y, (8.0, 512.0), 0.95, KEY).unwrap();
        assert!((fit.slope + 0.75).abs() < 1e-12 && (fit.intercept - 4f64.ln()).abs() < 1e-12, "{fit:?}");
        assert_eq!((fit.from, fit.to, fit.points), (8.0, 512.0, 7));
        assert!((fit.at(16.0) - 4.0 * 16f64.powf(-0.75)).abs() < 1e-12);
        assert!(fit.interval.unwrap().width() < 1e-12);
        assert_eq!(log_log_slope(&x, &y[..1], (8.0, 512.0), 0.95, KEY).unwrap().interval, None);
    }

    #[test]
    fn a_fit_leaves_nothing_out() {
        let x = powers(0, 4);
        let fine = vec![1.0, 0.5, 0.25, 0.125, 0.0625];
        let fit = |y: Vec<f64>| log_log_slope(&x, &[fine.clone(), y], ALL, 0.95, KEY);
        assert!(fit(fine.clone()).is_some());
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut y = fine.clone();
            y[4] = bad;
            assert_eq!(fit(y.clone()), None);
            // Outside the window it does not matter.
            assert!(log_log_slope(&x, &[fine.clone(), y], (1.0, 8.0), 0.95, KEY).is_some());
        }
        assert_eq!(fit(fine[..4].to_vec()), None);
        assert_eq!(log_log_slope(&x, &[], ALL, 0.95, KEY), None);
        assert_eq!(log_log_slope(&x, std::slice::from_ref(&fine), (1.0, 2.0), 0.95, KEY), None);
        assert_eq!(log_log_slope(&[1.0, 1.0, 2.0], &[vec![1.0; 3]], ALL, 0.95, KEY), None);
        assert_eq!(log_log_slope(&[0.0, 1.0, 2.0, 4.0], &[vec![1.0; 4]], ALL, 0.95, KEY), None);
        assert_eq!(log_log_slope(&x, std::slice::from_ref(&fine), (f64::NAN, 8.0), 0.95, KEY), None);
    }

    /// The slope of a curve that some resamples bring below zero has an estimate and no interval.
    #[test]
    fn a_curve_that_dips_below_zero_has_no_interval() {
        let x = powers(0, 4);
        let curve = |drawn: &[usize], point: usize| if drawn.contains(&0) { x[point] } else { -1.0 };
        let fit = log_log_slope_of(&x, 4, ALL, 0.95, KEY, curve).unwrap();
        assert!((fit.slope - 1.0).abs() < 1e-12);
        assert_eq!(fit.interval, None);
        assert_eq!(log_log_slope_of(&x, 4, ALL, 0.95, KEY, |_, _| -1.0), None);
    }
}
