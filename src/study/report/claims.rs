//! Who wins: standings at equal time, speed-ups, the front of speed and accuracy, slopes beside theory.

use super::data::{Axis, MethodRuns, Scene, loss_at_time, time_to_loss};
use crate::math::statistics::{Interval, Ratio, Slope, Verdict, at_most, bootstrap, log_log_slope, median, paired_ratio};
use crate::samplers::{Key, Purpose};
use serde_json::Value;

/// Level of every interval on the page.
pub(super) const LEVEL: f64 = 0.95;

/// Bootstrap resamples behind an interval.
const RESAMPLES: usize = 2000;

/// A number with its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    pub(super) value: f64,
    pub(super) interval: Option<Interval>,
}

/// Methods on one scene at one render time, best first.
pub(super) struct EqualTime {
    /// The longest time that every method's every run reached.
    pub(super) seconds: f64,
    pub(super) standings: Vec<Standing>,
    /// Methods without a measurement by then, with the time of their first.
    pub(super) too_slow: Vec<(String, f64)>,
}

/// A method at equal time.
pub(super) struct Standing {
    pub(super) label: String,
    pub(super) style: usize,
    pub(super) seeds: usize,
    pub(super) error: Estimate,
    /// Its error over the best one's, and whether it is larger than one; none for the best.
    pub(super) against_best: Option<(Ratio, Option<Verdict>)>,
}

/// A row of the table of efficiency.
pub(super) struct Efficiency {
    pub(super) label: String,
    pub(super) style: usize,
    /// Error x seconds at the end: time to unit error.
    pub(super) inefficiency: Estimate,
    /// How many times less of it than the baseline needs; none for the baseline.
    pub(super) speed_up: Option<Ratio>,
    /// Seconds to the error that every run reached.
    pub(super) seconds_to_target: Option<Estimate>,
    pub(super) target_speed_up: Option<Ratio>,
}

/// What a method's error should fall as, in iterations: exponents of standard deviation and of bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Theory {
    pub(super) deviation: f64,
    pub(super) bias: Option<f64>,
}

/// Resampling for the page draws from streams of its own, apart from any render's.
fn key(index: usize) -> Key {
    Key { seed: 0, iteration: u64::MAX, index: index as u64, purpose: Purpose::Test }
}

/// Median with its bootstrap interval.
pub(super) fn estimate(values: &[f64], index: usize) -> Option<Estimate> {
    let of = |chosen: &[usize]| median(&chosen.iter().map(|&i| values[i]).collect::<Vec<_>>()).unwrap_or(f64::NAN);
    let value = median(values)?;
    Some(Estimate { value, interval: bootstrap(values.len(), RESAMPLES, LEVEL, key(index), of) })
}

/// Numbers of the seeds that both methods have, in the same order.
fn paired(a: &MethodRuns, of_a: &[Option<f64>], b: &MethodRuns, of_b: &[Option<f64>]) -> (Vec<f64>, Vec<f64>) {
    let of = |seed: u64| b.runs.iter().position(|r| r.seed == seed).and_then(|i| of_b[i]);
    a.runs.iter().zip(of_a).filter_map(|(run, value)| Some(((*value)?, of(run.seed)?))).unzip()
}

/// Standings at the longest time that every run reached. None without two runs to compare or without a reference.
pub(super) fn equal_time(scene: &Scene, metric: &str) -> Option<EqualTime> {
    let last = |r: &MethodRuns| r.runs.iter().filter_map(|run| run.snapshots.last()).map(|s| s.seconds).fold(f64::INFINITY, f64::min);
    let seconds = scene.rows.iter().map(last).fold(f64::INFINITY, f64::min);
    if !seconds.is_finite() {
        return None;
    }
    let (mut there, mut too_slow) = (Vec::new(), Vec::new());
    for row in &scene.rows {
        let losses: Vec<Option<f64>> = row.runs.iter().map(|run| loss_at_time(run, metric, seconds)).collect();
        let known: Vec<f64> = losses.iter().copied().flatten().collect();
        match estimate(&known, row.style) {
            Some(error) => there.push((row, losses, known.len(), error)),
            None => {
                let first = row.runs.iter().filter_map(|r| r.snapshots.first()).map(|s| s.seconds).fold(f64::INFINITY, f64::min);
                too_slow.push((row.label.clone(), first));
            }
        }
    }
    there.sort_by(|a, b| a.3.value.total_cmp(&b.3.value));
    let standing = |i: usize| {
        let (row, losses, seeds, error) = &there[i];
        let (best_row, best_losses, ..) = &there[0];
        let (mine, best) = paired(row, losses, best_row, best_losses);
        let ratio = if i == 0 { None } else { paired_ratio(&best, &mine, LEVEL, key(1000 + row.style)) };
        let against_best = ratio.map(|ratio| (inverse(ratio), at_most(&ratio, 1.0)));
        Standing { label: row.label.clone(), style: row.style, seeds: *seeds, error: *error, against_best }
    };
    let standings: Vec<Standing> = (0..there.len()).map(standing).collect();
    (!standings.is_empty()).then_some(EqualTime { seconds, standings, too_slow })
}

/// The same statement read the other way round.
fn inverse(ratio: Ratio) -> Ratio {
    let interval = ratio.interval.filter(|i| i.low > 0.0).map(|i| Interval { low: 1.0 / i.high, high: 1.0 / i.low });
    Ratio { ratio: 1.0 / ratio.ratio, interval, ..ratio }
}

/// The table of efficiency; the first method is the baseline. Also the error that every run reached.
pub(super) fn efficiency(scene: &Scene, metric: &str) -> (Vec<Efficiency>, Option<f64>) {
    let Some(baseline) = scene.rows.first() else { return (Vec::new(), None) };
    let work = |row: &MethodRuns| -> Vec<Option<f64>> {
        row.last_losses(metric).into_iter().zip(&row.runs).map(|(loss, run)| Some(loss? * run.snapshots.last()?.seconds)).collect()
    };
    let target = scene.rows.iter().flat_map(|row| row.last_losses(metric)).flatten().max_by(f64::total_cmp);
    let to_target = |row: &MethodRuns| -> Vec<Option<f64>> {
        row.runs.iter().map(|run| target.and_then(|target| time_to_loss(run, metric, target))).collect()
    };
    let (base_work, base_time) = (work(baseline), to_target(baseline));
    let rows = scene.rows.iter().enumerate().filter_map(|(i, row)| {
        let (mine, times) = (work(row), to_target(row));
        let ratio = |base: &[Option<f64>], own: &[Option<f64>]| {
            let (own, base) = paired(row, own, baseline, base);
            if i == 0 || own.is_empty() { None } else { paired_ratio(&base, &own, LEVEL, key(2000 + row.style)) }
        };
        let all = times.iter().copied().collect::<Option<Vec<f64>>>();
        Some(Efficiency {
            label: row.label.clone(),
            style: row.style,
            inefficiency: estimate(&mine.iter().copied().flatten().collect::<Vec<_>>(), 3000 + row.style)?,
            speed_up: ratio(&base_work, &mine),
            seconds_to_target: all.and_then(|times| estimate(&times, 4000 + row.style)),
            target_speed_up: ratio(&base_time, &times),
        })
    });
    (rows.collect(), target)
}

/// Which of the points (cost, error) no other beats in both, by ascending cost.
pub(super) fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1)));
    let mut lowest = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i].1 < lowest;
        lowest = lowest.min(points[i].1);
        better
    });
    order
}

/// What theory says of a method: independent samples fall as -1/2; photon maps with a shrinking radius as -alpha/2 in their noise and as
/// alpha - 1 in their bias \[KNAUS11\].
pub(super) fn theory(name: &str, settings: &Value) -> Option<Theory> {
    match name {
        "path" | "bdpt" => Some(Theory { deviation: -0.5, bias: None }),
        "sppm" => {
            let alpha = settings.get("alpha").and_then(Value::as_f64)?;
            Some(Theory { deviation: -0.5 * alpha, bias: Some(alpha - 1.0) })
        }
        _ => None,
    }
}

/// How a metric goes with the size of an error: its square, its absolute value, or neither.
pub(super) fn power(metric: &str) -> Option<f64> {
    match metric {
        "mse" | "relmse" | "relmse_trimmed" => Some(2.0),
        "rmse" | "mape" | "smape" | "srrmse" => Some(1.0),
        _ => None,
    }
}

/// The last two decades of a curve, or the window in iterations that the study asks for.
fn window(plan: &Value, axis: Axis, last: f64) -> (f64, f64) {
    let asked = |key: &str| plan.get("report")?.get("slope")?.get(key)?.as_f64().filter(|_| axis == Axis::Iterations);
    (asked("from").unwrap_or(last / 100.0), asked("to").unwrap_or(last))
}

/// A method's fitted slope and its window.
pub(super) fn slope(row: &MethodRuns, metric: &str, axis: Axis, plan: &Value) -> Option<(Slope, (f64, f64))> {
    let curve = row.curve(metric, axis);
    let x: Vec<f64> = curve.iter().map(|p| p.x).collect();
    let y: Vec<Vec<f64>> = (0..row.runs.len()).map(|k| curve.iter().map(|p| p.losses[k]).collect()).collect();
    let window = window(plan, axis, *x.last()?);
    let inside = |x: &&f64| **x >= window.0 * (1.0 - 1e-9) && **x <= window.1 * (1.0 + 1e-9);
    let (from, to) = (*x.iter().find(inside)?, *x.iter().rev().find(inside)?);
    Some((log_log_slope(&x, &y, (from, to), LEVEL, key(5000 + row.style))?, (from, to)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_keeps_what_nothing_beats() {
        let points = [(1.0, 5.0), (2.0, 6.0), (2.0, 3.0), (4.0, 3.0), (8.0, 1.0), (0.5, 9.0)];
        assert_eq!(front(&points), [5, 0, 2, 4]);
        assert_eq!(front(&[]), [0_usize; 0]);
    }

    #[test]
    fn theory_comes_from_the_settings() {
        let settings = serde_json::json!({"alpha": 0.6});
        assert_eq!(theory("sppm", &settings), Some(Theory { deviation: -0.3, bias: Some(-0.4) }));
        assert_eq!(theory("path", &settings), Some(Theory { deviation: -0.5, bias: None }));
        assert_eq!(theory("vcm", &settings), None);
        assert_eq!(theory("sppm", &Value::Null), None);
    }

    #[test]
    fn a_ratio_reads_both_ways() {
        let ratio = inverse(Ratio { ratio: 0.5, interval: Some(Interval { low: 0.25, high: 0.8 }), runs: 5, level: 0.95, spread: None });
        assert_eq!((ratio.ratio, ratio.interval), (2.0, Some(Interval { low: 1.25, high: 4.0 })));
    }
}
