//! From lines to scenes, methods and runs.

use super::ReportError;
use crate::image::metrics::{Better, EPSILON, metric};
use crate::study::records::{CellRecord, Record, ReferenceRecord, SnapshotRecord, Status, StudyRecord};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Everything a page is made from.
pub(super) struct Study {
    /// The study's folder.
    pub(super) folder: PathBuf,
    /// One a start, in order.
    pub(super) starts: Vec<StudyRecord>,
    /// In the order of the plan, then of the records.
    pub(super) scenes: Vec<Scene>,
    /// Labels, likewise.
    pub(super) methods: Vec<String>,
    /// Metrics on record, the default first.
    pub(super) metrics: Vec<String>,
    /// Cells the plan asks for, where it says.
    pub(super) planned: Option<usize>,
}

/// One scene's cells.
pub(super) struct Scene {
    pub(super) name: String,
    pub(super) reference: Option<ReferenceRecord>,
    /// Methods with at least one cell that is done.
    pub(super) rows: Vec<MethodRuns>,
    pub(super) failed: Vec<CellRecord>,
}

/// One method's runs on one scene.
pub(super) struct MethodRuns {
    pub(super) label: String,
    /// Index among all the study's labels; decides colour, dash and marker.
    pub(super) style: usize,
    /// By ascending seed; never empty.
    pub(super) runs: Vec<CellRecord>,
}

/// What a chart runs over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    Time,
    Iterations,
    Photons,
}

impl Axis {
    pub(super) const ALL: [Axis; 3] = [Axis::Time, Axis::Iterations, Axis::Photons];

    /// Key in the page.
    pub(super) fn key(self) -> &'static str {
        match self {
            Axis::Time => "time",
            Axis::Iterations => "iterations",
            Axis::Photons => "photons",
        }
    }

    /// Name at the axis.
    pub(super) fn label(self) -> &'static str {
        match self {
            Axis::Time => "render time, s",
            Axis::Iterations => "iterations",
            Axis::Photons => "light paths",
        }
    }

    fn of(self, snapshot: &SnapshotRecord) -> f64 {
        match self {
            Axis::Time => snapshot.seconds,
            Axis::Iterations => snapshot.iteration as f64,
            Axis::Photons => snapshot.light_paths as f64,
        }
    }
}

/// Runs at one iteration (or all at their ends).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CurvePoint {
    /// Median over runs.
    pub(super) x: f64,
    pub(super) iteration: f64,
    pub(super) seconds: f64,
    /// One a run, in the order of the runs.
    pub(super) losses: Vec<f64>,
}

/// Zero is perfect: the metric itself, or its distance from one.
pub(super) fn loss(name: &str, value: f64) -> f64 {
    if is_flipped(name) { 1.0 - value } else { value }
}

/// What [`loss`] is called.
pub(super) fn loss_name(name: &str) -> String {
    if is_flipped(name) { format!("1 − {name}") } else { name.to_string() }
}

fn is_flipped(name: &str) -> bool {
    metric(name).is_some_and(|m| m.better == Better::Higher)
}

/// The loss at a snapshot: positive and finite, or nothing.
fn loss_at(snapshot: &SnapshotRecord, name: &str) -> Option<f64> {
    let value = snapshot.values.get(name).copied().flatten()?;
    Some(loss(name, value)).filter(|v| v.is_finite() && *v > 0.0)
}

impl MethodRuns {
    /// Settings; those of the first run, since they decide the cell.
    pub(super) fn settings(&self) -> &Value {
        &self.runs[0].settings
    }

    /// The method's name, without its settings.
    pub(super) fn name(&self) -> &str {
        &self.runs[0].name
    }

    /// Seeds.
    pub(super) fn seeds(&self) -> Vec<u64> {
        self.runs.iter().map(|r| r.seed).collect()
    }

    /// Median of a number of each run.
    pub(super) fn median(&self, of: impl Fn(&CellRecord) -> f64) -> f64 {
        crate::math::statistics::median(&self.runs.iter().map(of).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }

    /// Loss of each run's last snapshot.
    pub(super) fn last_losses(&self, name: &str) -> Vec<Option<f64>> {
        self.runs.iter().map(|r| r.snapshots.last().and_then(|s| loss_at(s, name))).collect()
    }

    /// Points at the iterations that every run has measured, and the ends of the runs.
    pub(super) fn curve(&self, name: &str, axis: Axis) -> Vec<CurvePoint> {
        let mut points: Vec<CurvePoint> = Vec::new();
        let Some(first) = self.runs.first() else { return points };
        for iteration in first.snapshots.iter().map(|s| s.iteration) {
            let same: Option<Vec<&SnapshotRecord>> =
                self.runs.iter().map(|r| r.snapshots.iter().find(|s| s.iteration == iteration)).collect();
            points.extend(same.and_then(|same| CurvePoint::of(&same, name, axis)));
        }
        let ends: Option<Vec<&SnapshotRecord>> = self.runs.iter().map(|r| r.snapshots.last()).collect();
        if let Some(end) = ends.and_then(|ends| CurvePoint::of(&ends, name, axis))
            && points.last().is_none_or(|last| last.iteration < end.iteration)
        {
            points.push(end);
        }
        points
    }
}

impl CurvePoint {
    /// None if a run has no usable number here, or the axis cannot show it on a logarithmic scale.
    fn of(snapshots: &[&SnapshotRecord], name: &str, axis: Axis) -> Option<Self> {
        let losses = snapshots.iter().map(|s| loss_at(s, name)).collect::<Option<Vec<f64>>>()?;
        let median =
            |of: &dyn Fn(&SnapshotRecord) -> f64| crate::math::statistics::median(&snapshots.iter().map(|s| of(s)).collect::<Vec<_>>());
        let x = median(&|s| axis.of(s)).filter(|x| x.is_finite() && *x > 0.0)?;
        Some(Self { x, iteration: median(&|s| s.iteration as f64)?, seconds: median(&|s| s.seconds)?, losses })
    }

    /// Median, smallest and largest over runs.
    pub(super) fn spread(&self) -> (f64, f64, f64) {
        let low = self.losses.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self.losses.iter().copied().fold(0.0, f64::max);
        (crate::math::statistics::median(&self.losses).unwrap_or(f64::NAN), low, high)
    }
}

/// The loss a run had reached at a render time, on straight lines through its snapshots' logarithms; none before the first, none after the last.
pub(super) fn loss_at_time(run: &CellRecord, name: &str, seconds: f64) -> Option<f64> {
    let points: Vec<(f64, f64)> = run.snapshots.iter().filter_map(|s| Some((s.seconds, loss_at(s, name)?))).collect();
    interpolate(&points, seconds)
}

/// The render time at which a run first reached a loss; none if it did not.
pub(super) fn time_to_loss(run: &CellRecord, name: &str, target: f64) -> Option<f64> {
    let points: Vec<(f64, f64)> = run.snapshots.iter().filter_map(|s| Some((s.seconds, loss_at(s, name)?))).collect();
    let reached = points.iter().position(|p| p.1 <= target)?;
    let Some(before) = reached.checked_sub(1).map(|i| points[i]) else { return Some(points[0].0) };
    let after = points[reached];
    interpolate(&[(after.1, after.0), (before.1, before.0)], target)
}

/// Log-log interpolation over ascending abscissae.
fn interpolate(points: &[(f64, f64)], at: f64) -> Option<f64> {
    let after = points.iter().position(|p| p.0 >= at)?;
    let (x1, y1) = points[after];
    if x1 == at {
        return Some(y1);
    }
    let (x0, y0) = *points.get(after.checked_sub(1)?)?;
    if x0 <= 0.0 {
        return None;
    }
    let t = (at / x0).ln() / (x1 / x0).ln();
    Some((y0.ln() * (1.0 - t) + y1.ln() * t).exp())
}

impl Study {
    /// Sorts records; the last record of a cell counts, and one that is done counts more than one that failed.
    pub(super) fn new(folder: &Path, records: Vec<Record>) -> Result<Self, ReportError> {
        let (mut starts, mut references, mut cells) = (Vec::new(), BTreeMap::new(), Vec::<CellRecord>::new());
        for record in records {
            match record {
                Record::Study(start) => starts.push(*start),
                Record::Reference(reference) => {
                    references.insert(reference.scene.clone(), reference);
                }
                Record::Cell(cell) => {
                    let same = |c: &CellRecord| (&c.scene, &c.method, c.seed) == (&cell.scene, &cell.method, cell.seed);
                    match cells.iter_mut().find(|c| same(c)) {
                        Some(old) if old.status == Status::Done && cell.status == Status::Failed => {}
                        Some(old) => *old = *cell,
                        None => cells.push(*cell),
                    }
                }
            }
        }
        if starts.is_empty() && cells.is_empty() {
            return Err(ReportError::Empty { folder: folder.to_path_buf() });
        }
        let plan = starts.last().map_or(&Value::Null, |s| &s.plan);
        let methods = names(plan, "method", &["label", "name"], cells.iter().map(|c| &c.method));
        let scene_names = names(plan, "scene", &["name"], cells.iter().map(|c| &c.scene).chain(references.keys()));
        let seeds = match plan.get("seeds") {
            Some(Value::Array(list)) => Some(list.len()),
            Some(count) => count.as_u64().and_then(|n| usize::try_from(n).ok()),
            None => None,
        };
        let planned = seeds.map(|seeds| seeds * methods.len() * scene_names.len());
        let metrics = metrics(&cells);
        let scenes = scene_names.into_iter().map(|name| scene(name, &mut references, &cells, &methods)).collect();
        Ok(Self { folder: folder.to_path_buf(), starts, scenes, methods, metrics, planned })
    }

    /// Cells done and failed.
    pub(super) fn ended(&self) -> (usize, usize) {
        let done = self.scenes.iter().flat_map(|s| &s.rows).map(|r| r.runs.len()).sum();
        (done, self.scenes.iter().map(|s| s.failed.len()).sum())
    }

    /// The metric that decides.
    pub(super) fn metric(&self) -> Option<&str> {
        self.metrics.first().map(String::as_str)
    }

    /// The plan with every default filled in.
    pub(super) fn plan(&self) -> &Value {
        self.starts.last().map_or(&Value::Null, |s| &s.plan)
    }

    /// Epsilon of the metrics that have one.
    pub(super) fn epsilon(&self) -> f64 {
        self.plan().get("epsilon").and_then(Value::as_f64).unwrap_or(EPSILON)
    }

    /// The study's name.
    pub(super) fn name(&self) -> String {
        let from_plan = self.plan().get("name").and_then(Value::as_str).map(str::to_owned);
        let from_folder = || self.folder.file_stem().map(|s| s.to_string_lossy().into_owned());
        from_plan.or_else(from_folder).unwrap_or_else(|| "study".to_string())
    }

    /// Where a picture that a record names is.
    pub(super) fn resolve(&self, path: &Path) -> PathBuf {
        self.folder.join(path)
    }
}

fn scene(name: String, references: &mut BTreeMap<String, ReferenceRecord>, cells: &[CellRecord], methods: &[String]) -> Scene {
    let mine = |c: &&CellRecord| c.scene == name;
    let failed = cells.iter().filter(mine).filter(|c| c.status == Status::Failed).cloned().collect();
    let row = |(style, label): (usize, &String)| {
        let mut runs: Vec<CellRecord> =
            cells.iter().filter(mine).filter(|c| c.status == Status::Done && c.method == *label).cloned().collect();
        runs.sort_by_key(|r| r.seed);
        (!runs.is_empty()).then(|| MethodRuns { label: label.clone(), style, runs })
    };
    let rows = methods.iter().enumerate().filter_map(row).collect();
    Scene { reference: references.remove(&name), name, rows, failed }
}

/// Names in a plan's list, then those that only records have.
fn names<'a>(plan: &Value, list: &str, keys: &[&str], on_record: impl Iterator<Item = &'a String>) -> Vec<String> {
    let planned = plan.get(list).or_else(|| plan.get(format!("{list}s"))).and_then(Value::as_array);
    let name = |entry: &Value| keys.iter().find_map(|key| entry.get(key)).and_then(Value::as_str).map(str::to_owned);
    let mut names: Vec<String> = planned.into_iter().flatten().filter_map(name).collect();
    for other in on_record {
        if !names.contains(other) {
            names.push(other.clone());
        }
    }
    names
}

/// Metrics on record: relmse first, then in the table's order, then what the table does not know.
fn metrics(cells: &[CellRecord]) -> Vec<String> {
    let found: BTreeSet<&String> = cells.iter().flat_map(|c| &c.snapshots).flat_map(|s| s.values.keys()).collect();
    let place = |name: &str| {
        let known = crate::image::metrics::METRICS.iter().position(|m| m.name == name);
        (name != "relmse", known.unwrap_or(usize::MAX))
    };
    let mut names: Vec<String> = found.into_iter().cloned().collect();
    names.sort_by_key(|name| place(name));
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_interpolated_and_nothing_is_extrapolated() {
        let points = [(1.0, 1.0), (4.0, 0.25), (16.0, 0.0625)];
        assert!((interpolate(&points, 2.0).expect("inside") - 0.5).abs() < 1e-12);
        assert!((interpolate(&points, 8.0).expect("inside") - 0.125).abs() < 1e-12);
        assert_eq!((interpolate(&points, 0.5), interpolate(&points, 17.0)), (None, None));
        assert_eq!(interpolate(&points, 16.0), Some(0.0625));
    }

    #[test]
    fn planned_names_come_first() {
        let plan = serde_json::json!({"method": [{"name": "sppm", "label": "b"}, {"name": "path"}]});
        let on_record = ["x".to_string(), "b".to_string()];
        assert_eq!(names(&plan, "method", &["label", "name"], on_record.iter()), ["b", "path", "x"]);
    }
}
