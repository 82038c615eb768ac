//! Tables of a scene. All scroll inside their own box.

use super::claims::{Efficiency, EqualTime, Estimate, LEVEL, power, slope, theory};
use super::data::{Axis, Scene, Study, loss_name};
use super::load::ScenePictures;
use super::numbers::{count, duration, or_dash, plain, with_interval};
use super::plots::exponent;
use super::svg::swatch;
use crate::math::statistics::{Ratio, Verdict};
use maud::{Markup, html};
use serde_json::Value;

/// A table in a box that scrolls and can be reached by keyboard.
pub(super) fn framed(caption: &str, head: &[&str], rows: Vec<Vec<Markup>>) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label=(caption) {
            table {
                caption { (caption) }
                thead { tr { @for name in head { th scope="col" { (name) } } } }
                tbody {
                    @for row in rows {
                        tr {
                            @for (i, cell) in row.into_iter().enumerate() {
                                @if i == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn text(value: impl AsRef<str>) -> Markup {
    html! { (value.as_ref()) }
}

/// A method's name behind its line and marker.
pub(super) fn name(label: &str, style: usize) -> Markup {
    html! { span.name { (swatch(style)) (label) } }
}

pub(super) fn estimated(estimate: Option<Estimate>) -> String {
    estimate.map_or_else(|| "–".to_string(), |e| with_interval(e.value, e.interval))
}

pub(super) fn ratio(ratio: Option<&Ratio>) -> String {
    ratio.map_or_else(|| "–".to_string(), |r| with_interval(r.ratio, r.interval))
}

/// What a comparison with the best says, in two words.
fn verdict(standing: Option<&(Ratio, Option<Verdict>)>) -> String {
    match standing.map(|s| s.1) {
        None => "lowest".to_string(),
        Some(Some(Verdict::Holds)) => "behind".to_string(),
        Some(Some(Verdict::Refuted)) => "ahead".to_string(),
        Some(Some(Verdict::Undecided { more_runs: Some(n) })) => format!("open; about {} more seeds", count(n as u64)),
        Some(_) => "open".to_string(),
    }
}

/// Who is where at equal time.
pub(super) fn standings(equal: &EqualTime, metric: &str) -> Markup {
    let rows = equal.standings.iter().map(|s| {
        let against = s.against_best.as_ref();
        vec![
            name(&s.label, s.style),
            text(with_interval(s.error.value, s.error.interval)),
            text(against.map_or_else(|| "1".to_string(), |(r, _)| with_interval(r.ratio, r.interval))),
            text(verdict(against)),
            text(s.seeds.to_string()),
        ]
    });
    let caption = format!("{} after {} of render time", loss_name(metric), duration(equal.seconds));
    let error = loss_name(metric);
    framed(&caption, &["method", &error, "times the lowest", "against the lowest", "seeds"], rows.collect())
}

/// Time to unit error and to equal error.
pub(super) fn efficiencies(rows: &[Efficiency], target: Option<f64>, metric: &str) -> Markup {
    let base = rows.first().map_or("", |r| r.label.as_str());
    let lines = rows.iter().enumerate().map(|(i, r)| {
        let against = |value: Option<&Ratio>| if i == 0 { text("1") } else { text(ratio(value)) };
        vec![
            name(&r.label, r.style),
            text(with_interval(r.inefficiency.value, r.inefficiency.interval)),
            text(plain(1.0 / r.inefficiency.value)),
            against(r.speed_up.as_ref()),
            text(estimated(r.seconds_to_target)),
            against(r.target_speed_up.as_ref()),
        ]
    });
    let error = loss_name(metric);
    let (work, reach) = (format!("{error} × s"), format!("s to {error} {}", or_dash(target)));
    framed(
        &format!("Efficiency, and speed-up over {base}"),
        &["method", &work, "efficiency, 1/s", "speed-up", &reach, "speed-up to it"],
        lines.collect(),
    )
}

/// Fitted slopes beside theory.
pub(super) fn slopes(study: &Study, scene: &Scene, metric: &str) -> Markup {
    let fitted = |row, axis| slope(row, metric, axis, study.plan());
    let shown = |fit: &Option<(crate::math::statistics::Slope, (f64, f64))>| match fit {
        Some((s, _)) => with_interval(s.slope, s.interval),
        None => "–".to_string(),
    };
    let rows = scene.rows.iter().map(|row| {
        let (iterations, time) = (fitted(row, Axis::Iterations), fitted(row, Axis::Time));
        let window = iterations.as_ref().map_or("–".to_string(), |(_, w)| format!("{} – {}", count(w.0 as u64), count(w.1 as u64)));
        let expected = match (power(metric), theory(row.name(), row.settings())) {
            (Some(p), Some(t)) => match t.bias {
                Some(bias) => {
                    format!("{} noise, {} bias", exponent(t.deviation * p), if bias == 0.0 { "0".into() } else { exponent(bias * p) })
                }
                None => exponent(t.deviation * p),
            },
            _ => "–".to_string(),
        };
        vec![name(&row.label, row.style), text(shown(&iterations)), text(window), text(shown(&time)), text(expected)]
    });
    framed(
        &format!("Slopes of {} in log-log", loss_name(metric)),
        &["method", "against iterations", "fitted over", "against time", "theory"],
        rows.collect(),
    )
}

/// The numbers behind the convergence charts of a metric.
pub(super) fn curves(scene: &Scene, metric: &str) -> Markup {
    let mut rows = Vec::new();
    for row in &scene.rows {
        for p in row.curve(metric, Axis::Iterations) {
            let (middle, low, high) = p.spread();
            let paths =
                row.runs.iter().filter_map(|r| r.snapshots.iter().find(|s| s.iteration as f64 >= p.iteration)).map(|s| s.light_paths);
            rows.push(vec![
                name(&row.label, row.style),
                text(count(p.iteration.round() as u64)),
                text(plain(p.seconds)),
                text(paths.max().map_or("–".into(), count)),
                text(plain(middle)),
                text(plain(low)),
                text(plain(high)),
            ]);
        }
    }
    framed(
        &format!("{} on {}", loss_name(metric), scene.name),
        &["method", "iterations", "seconds", "light paths", "median", "smallest", "largest"],
        rows,
    )
}

/// Noise and bias, and what was left out.
pub(super) fn splits(scene: &Scene, pictures: &ScenePictures) -> Markup {
    let rows = scene.rows.iter().zip(&pictures.methods).map(|(row, p)| {
        let of = |split: &Option<super::split::Split>| {
            let variance = estimated(split.map(|s| s.variance));
            let bias = estimated(split.map(|s| s.bias));
            [text(variance), text(bias)]
        };
        let mut line = vec![name(&row.label, row.style)];
        line.extend(of(&p.relative));
        line.extend(of(&p.absolute));
        line.extend([text(or_dash(p.nsd)), text(p.runs.to_string()), text(p.masked.to_string())]);
        line
    });
    framed(
        "One run's variance, and squared bias",
        &["method", "variance in relmse", "bias² in relmse", "variance in mse", "bias² in mse", "nsd", "runs", "pixels left out"],
        rows.collect(),
    )
}

/// Work done.
pub(super) fn work(scene: &Scene) -> Markup {
    let rows = scene.rows.iter().map(|row| {
        let median = |of: &dyn Fn(&crate::study::records::CellRecord) -> f64| row.median(of);
        let whole = |of: &dyn Fn(&crate::study::records::CellRecord) -> f64| count(median(of).round() as u64);
        let masked: u64 = row.runs.iter().filter_map(|r| r.snapshots.last()).map(|s| s.masked).sum();
        let rejected: u64 = row.runs.iter().flat_map(|r| r.rejected.values()).sum();
        vec![
            name(&row.label, row.style),
            text(row.runs.len().to_string()),
            text(whole(&|r| r.iterations as f64)),
            text(plain(median(&|r| r.seconds))),
            text(plain(median(&|r| r.cpu_seconds))),
            text(whole(&|r| r.camera_paths as f64)),
            text(whole(&|r| r.light_paths as f64)),
            text(whole(&|r| r.rays as f64)),
            text(plain(median(&|r| r.rays as f64 / r.seconds.max(1e-9)) / 1e6)),
            text(count(rejected)),
            text(count(masked)),
        ]
    });
    let head = [
        "method",
        "runs",
        "iterations",
        "seconds",
        "CPU seconds",
        "camera paths",
        "light paths",
        "rays",
        "million rays/s",
        "samples rejected, all runs",
        "pixels masked, all runs",
    ];
    framed("Work of a run, medians over seeds", &head, rows.collect())
}

/// Whatever the methods tell of themselves: one row a key, one column a run.
pub(super) fn diagnostics(scene: &Scene) -> Option<Markup> {
    let mut rows = Vec::new();
    for row in &scene.rows {
        for run in &row.runs {
            let mut flat = Vec::new();
            flatten("", run.diagnostics.as_ref().unwrap_or(&Value::Null), &mut flat);
            for (key, value) in flat {
                rows.push(vec![name(&row.label, row.style), text(run.seed.to_string()), text(key), text(value)]);
            }
        }
    }
    (!rows.is_empty()).then(|| framed("What the methods tell of themselves", &["method", "seed", "key", "value"], rows))
}

/// Paths and values of nested JSON.
fn flatten(path: &str, value: &Value, out: &mut Vec<(String, String)>) {
    match value {
        Value::Null => {}
        Value::Object(map) => {
            for (key, inner) in map {
                flatten(&if path.is_empty() { key.clone() } else { format!("{path}.{key}") }, inner, out);
            }
        }
        // A list of things with names, such as the rungs of a ladder: a line each.
        Value::Array(list) if list.iter().any(Value::is_object) => {
            for (index, inner) in list.iter().enumerate() {
                let name = inner.get("name").and_then(Value::as_str).map_or_else(|| index.to_string(), str::to_owned);
                let mut parts = Vec::new();
                flatten("", inner, &mut parts);
                let told = parts.iter().filter(|(key, _)| key != "name").map(|(key, value)| format!("{key} {value}"));
                out.push((format!("{path}.{name}"), told.collect::<Vec<_>>().join(", ")));
            }
        }
        Value::Array(list) => out.push((path.to_string(), list.iter().map(scalar).collect::<Vec<_>>().join(", "))),
        other => out.push((path.to_string(), scalar(other))),
    }
}

fn scalar(value: &Value) -> String {
    match value {
        Value::String(s) => s.clone(),
        Value::Number(n) if n.is_f64() => n.as_f64().map_or_else(|| n.to_string(), plain),
        other => other.to_string(),
    }
}

/// `95 %`.
pub(super) fn level() -> String {
    format!("{} %", (100.0 * LEVEL).round())
}
