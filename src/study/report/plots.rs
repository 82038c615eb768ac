//! The charts of a scene: error against time, iterations and light paths; speed against accuracy.

use super::ReportError;
use super::charts::{Chart, Guide, Point, Series};
use super::claims::{front, power, theory};
use super::data::{Axis, CurvePoint, MethodRuns, Scene, Study, loss_name};
use super::interim::median;
use super::load::ScenePictures;
use super::numbers::{count, duration, plain};
use serde_json::Value;

/// Error of every method over one axis, with the band over seeds.
pub(super) fn convergence(
    study: &Study,
    scene: &Scene,
    index: usize,
    metric: &str,
    axis: Axis,
    pictures: &ScenePictures,
) -> Result<Option<String>, ReportError> {
    let curves: Vec<(&MethodRuns, Vec<CurvePoint>)> =
        scene.rows.iter().map(|r| (r, r.curve(metric, axis))).filter(|(_, c)| !c.is_empty()).collect();
    let point = |row: &MethodRuns, p: &CurvePoint| {
        let (y, low, high) = p.spread();
        let seeds = p.losses.len();
        let tip = format!(
            "{}: {} {}, {} to {} over {seeds} {}; iteration {}, {}",
            row.label,
            loss_name(metric),
            plain(y),
            plain(low),
            plain(high),
            if seeds == 1 { "seed" } else { "seeds" },
            count(p.iteration.round() as u64),
            duration(p.seconds)
        );
        Point { x: p.x, y, low, high, tip }
    };
    let series: Vec<Series> = curves
        .iter()
        .map(|(row, curve)| Series {
            label: row.label.clone(),
            style: row.style,
            points: curve.iter().map(|p| point(row, p)).collect(),
            line: true,
        })
        .collect();
    let wanted = study.plan().get("report").and_then(|r| r.get("guides")).and_then(Value::as_bool).unwrap_or(true);
    let guides = if wanted { guides(&curves, metric, scene, pictures) } else { Vec::new() };
    let labels: Vec<&str> = series.iter().map(|s| s.label.as_str()).collect();
    let chart = Chart {
        id: format!("chart-{index}-{metric}-{}", axis.key()),
        title: format!("{} against {} on {}", loss_name(metric), axis.label(), scene.name),
        description: format!(
            "Both axes logarithmic. Medians over seeds with bands from the smallest to the largest, for {}. The numbers are in the table below.",
            labels.join("; ")
        ),
        x_label: axis.label().to_string(),
        y_label: loss_name(metric),
        series,
        guides,
        front: Vec::new(),
    };
    chart.draw()
}

/// The slope of independent samples, every method's own, and the level of the reference's noise.
fn guides(curves: &[(&MethodRuns, Vec<CurvePoint>)], metric: &str, scene: &Scene, pictures: &ScenePictures) -> Vec<Guide> {
    let mut guides: Vec<Guide> = Vec::new();
    let Some(power) = power(metric) else { return guides };
    let first = |curve: &[CurvePoint]| curve.first().map(|p| (p.x, p.spread().0));
    let mut add = |slope: f64, what: &str, through: Option<(f64, f64)>| {
        let known = |g: &Guide| (g.slope - slope).abs() < 1e-9;
        if let Some(through) = through.filter(|_| slope < -1e-9 && !guides.iter().any(known)) {
            guides.push(Guide { label: format!("{what}{}", exponent(slope)), slope, through });
        }
    };
    let highest = curves.iter().filter_map(|(_, c)| first(c)).max_by(|a, b| a.1.total_cmp(&b.1));
    add(-0.5 * power, "", highest);
    for (row, curve) in curves {
        if let Some(own) = theory(row.name(), row.settings()) {
            add(own.deviation * power, &format!("{} noise ", row.name()), first(curve));
            if let Some(bias) = own.bias {
                add(bias * power, &format!("{} bias ", row.name()), first(curve));
            }
        }
    }
    let noise = scene.reference.as_ref().and_then(|r| r.noise);
    let level = match metric {
        "mse" => noise,
        "rmse" => noise.map(f64::sqrt),
        "relmse" => pictures.reference_noise,
        _ => None,
    };
    let left = curves.iter().filter_map(|(_, c)| first(c)).map(|p| p.0).fold(f64::INFINITY, f64::min);
    if let Some(level) = level.filter(|l| *l > 0.0 && left.is_finite()) {
        guides.push(Guide { label: "noise of the reference".into(), slope: 0.0, through: (left, level) });
    }
    guides
}

/// `−1/2`, `−1`, `−0.75`.
pub(super) fn exponent(slope: f64) -> String {
    if (slope + 0.5).abs() < 1e-9 {
        return "−1/2".to_string();
    }
    let text = format!("{:.3}", slope.abs());
    format!("−{}", text.trim_end_matches('0').trim_end_matches('.'))
}

/// What the cost of the speed-accuracy chart is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cost {
    /// Seconds of one iteration.
    Iteration,
    /// All render time so far.
    Total,
}

impl Cost {
    pub(super) const ALL: [Cost; 2] = [Cost::Iteration, Cost::Total];

    pub(super) fn key(self) -> &'static str {
        match self {
            Cost::Iteration => "iteration",
            Cost::Total => "total",
        }
    }

    fn label(self) -> &'static str {
        match self {
            Cost::Iteration => "seconds per iteration",
            Cost::Total => "total render time, s",
        }
    }
}

/// Error reached against cost, the front drawn; and who is on the front.
pub(super) fn speed_accuracy(
    study: &Study,
    scene: &Scene,
    index: usize,
    metric: &str,
    cost: Cost,
) -> Result<Option<(String, Vec<String>)>, ReportError> {
    let mut series = Vec::new();
    for row in &scene.rows {
        let points = match cost {
            Cost::Iteration => end(row, metric).into_iter().collect(),
            Cost::Total => row.curve(metric, Axis::Time).iter().map(|p| along(row, metric, p)).collect::<Vec<_>>(),
        };
        if !points.is_empty() {
            series.push(Series { label: row.label.clone(), style: row.style, points, line: cost == Cost::Total });
        }
    }
    let all: Vec<(f64, f64, &str)> = series.iter().flat_map(|s| s.points.iter().map(|p| (p.x, p.y, s.label.as_str()))).collect();
    let best = front(&all.iter().map(|(x, y, _)| (*x, *y)).collect::<Vec<_>>());
    let corners: Vec<(f64, f64)> = best.iter().map(|&i| (all[i].0, all[i].1)).collect();
    let mut names: Vec<String> = Vec::new();
    for &i in &best {
        if !names.iter().any(|n| n == all[i].2) {
            names.push(all[i].2.to_string());
        }
    }
    let chart = Chart {
        id: format!("pareto-{index}-{metric}-{}", cost.key()),
        title: format!("{} reached against {} on {}", loss_name(metric), cost.label(), scene.name),
        description: format!(
            "Both axes logarithmic; lower and further left is better. Medians over seeds with their smallest and largest. Nothing beats, \
             in both at once: {}. Study {}.",
            names.join("; "),
            study.name()
        ),
        x_label: cost.label().to_string(),
        y_label: format!("{} reached", loss_name(metric)),
        series,
        guides: Vec::new(),
        front: corners,
    };
    Ok(chart.draw()?.map(|text| (text, names)))
}

/// A method's end, over seconds per iteration.
fn end(row: &MethodRuns, metric: &str) -> Option<Point> {
    let losses: Vec<f64> = row.last_losses(metric).into_iter().flatten().collect();
    let x = row.median(|r| r.seconds / r.iterations.max(1) as f64);
    let (low, high) = losses.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
    let y = median(&losses)?;
    let iterations = row.median(|r| r.iterations as f64);
    let tip = format!(
        "{}: {} {} after {} iterations of {} each, {} to {} over {} seeds",
        row.label,
        loss_name(metric),
        plain(y),
        count(iterations.round() as u64),
        duration(x),
        plain(low),
        plain(high),
        losses.len()
    );
    (x.is_finite() && x > 0.0).then_some(Point { x, y, low, high, tip })
}

/// A method on its way, over render time.
fn along(row: &MethodRuns, metric: &str, p: &CurvePoint) -> Point {
    let (y, low, high) = p.spread();
    let tip = format!("{}: {} {} after {}", row.label, loss_name(metric), plain(y), duration(p.seconds));
    Point { x: p.x, y, low, high, tip }
}
