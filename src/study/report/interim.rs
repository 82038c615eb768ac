//! Intervals, slopes and ratios over independent runs.

use crate::samplers::{Key, Stream};

/// From `low` to `high`, both included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A straight line through logarithms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slope {
    pub(super) slope: f64,
    pub(super) interval: Option<Interval>,
}

/// Of two medians, paired by seed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ratio {
    pub(super) ratio: f64,
    pub(super) interval: Option<Interval>,
    pub(super) runs: usize,
}

/// What an interval says about a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Holds,
    Refuted,
    Undecided { more_runs: Option<usize> },
}

/// Middle of a list.
pub(super) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    (n > 0).then(|| 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]))
}

/// Percentile bootstrap over runs.
pub(super) fn bootstrap(runs: usize, resamples: usize, level: f64, key: Key, statistic: impl Fn(&[usize]) -> f64) -> Option<Interval> {
    if runs < 2 {
        return None;
    }
    let mut stream = key.stream();
    let mut draw = || (stream.next_1d() * runs as f32) as usize;
    let mut values: Vec<f64> = (0..resamples)
        .map(|_| {
            let chosen: Vec<usize> = (0..runs).map(|_| draw()).collect();
            statistic(&chosen)
        })
        .filter(|v| v.is_finite())
        .collect();
    values.sort_by(f64::total_cmp);
    let at = |q: f64| values.get(((values.len() as f64 - 1.0) * q).round() as usize).copied();
    Some(Interval { low: at(0.5 * (1.0 - level))?, high: at(0.5 * (1.0 + level))? })
}

/// Slope of log y on log x of the runs' mean curve.
pub(super) fn log_log_slope(x: &[f64], y: &[Vec<f64>], window: (f64, f64), level: f64, key: Key) -> Option<Slope> {
    let inside: Vec<usize> = (0..x.len()).filter(|&i| x[i] >= window.0 && x[i] <= window.1).collect();
    if inside.len() < 3 || y.is_empty() {
        return None;
    }
    let of = |chosen: &[usize]| {
        let points = inside.iter().map(|&i| (x[i].ln(), (chosen.iter().map(|&k| y[k][i]).sum::<f64>() / chosen.len() as f64).ln()));
        let (mut n, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (a, b) in points {
            (n, sx, sy, sxx, sxy) = (n + 1.0, sx + a, sy + b, sxx + a * a, sxy + a * b);
        }
        (n * sxy - sx * sy) / (n * sxx - sx * sx)
    };
    let all: Vec<usize> = (0..y.len()).collect();
    let slope = of(&all);
    slope.is_finite().then(|| Slope { slope, interval: bootstrap(y.len(), 1000, level, key, of) })
}

/// Ratio of the medians of `a` and `b`.
pub(super) fn paired_ratio(a: &[f64], b: &[f64], level: f64, key: Key) -> Option<Ratio> {
    if a.len() != b.len() {
        return None;
    }
    let of = |chosen: &[usize]| {
        let pick = |v: &[f64]| median(&chosen.iter().map(|&i| v[i]).collect::<Vec<_>>()).unwrap_or(f64::NAN);
        pick(a) / pick(b)
    };
    let all: Vec<usize> = (0..a.len()).collect();
    let ratio = of(&all);
    ratio.is_finite().then(|| Ratio { ratio, interval: bootstrap(a.len(), 1000, level, key, of), runs: a.len() })
}

/// Whether the ratio is at most `bound`.
pub(super) fn at_most(ratio: &Ratio, bound: f64) -> Verdict {
    match ratio.interval {
        Some(i) if i.high <= bound => Verdict::Holds,
        Some(i) if i.low > bound => Verdict::Refuted,
        Some(i) if i.low > 0.0 => {
            // The interval's width in the logarithm falls with the root of the number of runs.
            let half = 0.5 * (i.high / i.low).ln();
            let distance = (ratio.ratio / bound).ln().abs();
            let needed = ratio.runs as f64 * (half / distance).powi(2);
            let more = (needed - ratio.runs as f64).ceil();
            Verdict::Undecided { more_runs: (more.is_finite() && more < 1e4).then_some(more.max(1.0) as usize) }
        }
        _ => Verdict::Undecided { more_runs: None },
    }
}
