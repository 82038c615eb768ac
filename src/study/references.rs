//! References: the mean of independent runs, and the variance of that mean.
//!
//! Runs have seeds of their own, from [`FIRST_SEED`] on, which no study counts up to. Each run is kept as a picture until the last is done, so
//! that a reference killed on the way goes on run by run; the mean is made from these pictures in the order of their seeds, so that it does not
//! matter when they were rendered.

use crate::image::exr::{self, read_file};
use crate::image::file::replace;
use crate::image::picture::{ImageError, Picture};
use crate::image::runs::Runs;
use crate::integrators::{BoxedSettings, Method};
use crate::math::Rgb;
use crate::render::{
    Budget, Changes, Interrupt, Layers, Metadata, Output, Plan, Progress, RenderError, Run, SceneRecord, Snapshots, render,
};
use crate::scene::mitsuba::LoadedScene;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Seed of a reference's first run; the others follow.
pub const FIRST_SEED: u64 = 1 << 32;

/// What is rendered.
pub struct Job<'a> {
    /// The scene.
    pub loaded: &'a LoadedScene,
    /// Its file, for the record.
    pub scene: SceneRecord,
    /// What is changed in it.
    pub changes: &'a Changes,
    /// The method.
    pub method: &'static Method,
    /// Its settings.
    pub settings: &'a dyn BoxedSettings,
    /// Independent runs, at least 2.
    pub runs: u64,
    /// Seed of the first.
    pub first_seed: u64,
    /// When a run ends.
    pub budget: Budget,
}

/// The files of a reference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    /// `NAME.mean.exr`.
    pub mean: PathBuf,
    /// `NAME.var.exr`.
    pub var: PathBuf,
    /// `NAME.json`, written last.
    pub about: PathBuf,
    /// `NAME.runs`, a folder with the runs done so far; gone when the reference is complete.
    pub runs: PathBuf,
}

impl Files {
    /// From `NAME`.
    pub fn named(name: &Path) -> Self {
        let with = |end: &str| {
            let mut text = name.as_os_str().to_owned();
            text.push(end);
            PathBuf::from(text)
        };
        Self { mean: with(".mean.exr"), var: with(".var.exr"), about: with(".json"), runs: with(".runs") }
    }

    /// What `NAME.json` says, if the reference is complete and readable.
    pub fn complete(&self) -> Option<About> {
        let about = std::fs::read(&self.about).ok()?;
        (self.mean.is_file() && self.var.is_file()).then(|| serde_json::from_slice(&about).ok())?
    }

    /// Removes the runs of a complete reference, which a kill may have left. A folder that stays is only untidy.
    pub fn tidy(&self) {
        match std::fs::remove_dir_all(&self.runs) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => tracing::warn!("{}: {error}", self.runs.display()),
            _ => (),
        }
    }
}

/// How a reference was made; `NAME.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Version of the metadata's layout.
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// The scene.
    pub scene: SceneRecord,
    /// The method.
    pub method: String,
    /// All settings that decide the image but the seed.
    pub settings: Value,
    /// Independent runs.
    pub runs: u64,
    /// Seeds, one a run.
    pub seeds: Vec<u64>,
    /// Iterations of each run.
    pub iterations: Vec<u64>,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Mean of the mean image, by channel.
    pub mean: [f64; 3],
    /// Standard error of that mean, by channel, from the runs' variances as if pixels were independent.
    pub mean_stderr: [f64; 3],
    /// Mean of the variance over pixels and channels.
    pub noise: f64,
    /// Pixels of the mean that are infinite or not a number; left out of `mean`, `mean_stderr` and `noise`.
    pub non_finite: u64,
    /// Render time of all runs, wall seconds.
    pub seconds: f64,
    /// Processor seconds of all runs.
    pub cpu_seconds: f64,
}

impl Job<'_> {
    /// All settings but the seed.
    pub fn settings_json(&self) -> Value {
        let common = self.changes.common(0, &self.loaded.defaults);
        self.changes.settings_json(self.settings, &common, &self.loaded.film)
    }

    /// Seeds of the runs.
    pub fn seeds(&self) -> std::ops::Range<u64> {
        self.first_seed..self.first_seed.saturating_add(self.runs)
    }
}

/// Somebody who wants to know how far a reference is.
pub trait RunProgress: Progress {
    /// A run begins; they count from 0.
    fn begin(&mut self, run: u64, runs: u64);
}

/// Renders the runs that are not there yet and joins them; `None` if a signal came first.
pub fn make(job: &Job, files: &Files, progress: &mut dyn RunProgress, interrupt: &Interrupt) -> Result<Option<About>, RenderError> {
    std::fs::create_dir_all(&files.runs).map_err(|error| ImageError::io(&files.runs, error))?;
    let settings = job.settings_json();
    let (width, height) = job.loaded.scene.camera().resolution();
    let (mut together, mut metadatas) = (Runs::new(width, height), Vec::new());
    for (number, seed) in job.seeds().enumerate() {
        let path = files.runs.join(format!("{seed}.exr"));
        let (picture, metadata) = match kept(job, &settings, &path, seed) {
            Some(run) => run,
            None => {
                progress.begin(number as u64, job.runs);
                match run(job, &settings, &path, seed, progress, interrupt)? {
                    Some(run) => run,
                    None => return Ok(None),
                }
            }
        };
        together.add(&picture).map_err(|size| ImageError::content(&path, size.to_string()))?;
        metadatas.push(metadata);
    }
    let about = write(job, files, settings, &together, metadatas)?;
    files.tidy();
    Ok(Some(about))
}

/// A run done before, if it is this one and went to its end.
fn kept(job: &Job, settings: &Value, path: &Path, seed: u64) -> Option<(Picture, Metadata)> {
    let file = read_file(path).ok()?;
    let metadata: Metadata = serde_json::from_str(file.metadata.as_deref()?).ok()?;
    let [Run { seed: found, ranges }] = metadata.runs.as_slice() else { return None };
    let [[start, end]] = ranges.as_slice() else { return None };
    let Budget { iterations, time, light_paths } = &job.budget;
    let ended = *end == iterations.end
        || time.is_some_and(|limit| metadata.seconds >= limit)
        || light_paths.is_some_and(|limit| metadata.light_paths >= limit);
    let same = metadata.version == env!("CARGO_PKG_VERSION")
        && metadata.scene.hash == job.scene.hash
        && metadata.method == job.method.name
        && metadata.settings == *settings
        && (*found, *start) == (seed, iterations.start);
    (same && ended).then(|| file.picture().ok())?.map(|picture| (picture, metadata))
}

/// Renders one run; `None` if a signal ended it.
fn run(
    job: &Job,
    settings: &Value,
    path: &Path,
    seed: u64,
    progress: &mut dyn Progress,
    interrupt: &Interrupt,
) -> Result<Option<(Picture, Metadata)>, RenderError> {
    let size = job.loaded.scene.camera().resolution();
    let mut integrator = job.settings.build(&job.loaded.scene, size, &job.changes.common(seed, &job.loaded.defaults))?;
    let metadata = Metadata::new(job.scene.clone(), job.method.name, settings.clone());
    let output = Output { path: path.to_path_buf(), layers: Layers::default(), preview: None };
    let (budget, snapshots) = (job.budget.clone(), Snapshots::None);
    let plan = Plan { size, budget, seed, snapshots, keep: false, checkpoint: None, reference: None, output };
    let outcome = render(integrator.as_mut(), &plan, metadata, progress, interrupt)?;
    if outcome.interrupted.is_some() {
        // Part of a run is of no use; without this it would only be rendered over.
        let _ = std::fs::remove_file(path);
        return Ok(None);
    }
    Ok(Some((Picture::new(size.0, size.1, outcome.film.mean()), outcome.metadata)))
}

fn write(job: &Job, files: &Files, settings: Value, together: &Runs, runs: Vec<Metadata>) -> Result<About, RenderError> {
    // Of no run no mean is known, of one no variance; NaN says so.
    let unknown = || Picture::new(together.size().0, together.size().1, vec![Rgb::splat(f32::NAN); together.size().0 * together.size().1]);
    let (mean, variance) = (together.mean().unwrap_or_else(unknown), together.variance_of_mean().unwrap_or_else(unknown));
    let mut metadata = Metadata::new(job.scene.clone(), job.method.name, settings.clone());
    for run in &runs {
        metadata.radius = run.radius;
        metadata.runs.extend(run.runs.iter().cloned());
        metadata.seconds += run.seconds;
        metadata.cpu_seconds += run.cpu_seconds;
        metadata.threads = run.threads;
        metadata.light_paths += run.light_paths;
        metadata.camera_paths += run.camera_paths;
        metadata.rays += run.rays;
        for (cause, count) in &run.rejected {
            *metadata.rejected.entry(cause.clone()).or_default() += count;
        }
    }
    let json = |value: serde_json::Result<Value>, path: &Path| value.map_err(|e| ImageError::content(path, e.to_string()));
    exr::write(&files.mean, &mean, &[], Some(&json(serde_json::to_value(&metadata), &files.mean)?))?;
    exr::write(&files.var, &variance, &[], None)?;
    let about = about(job, settings, &metadata, &mean, &variance);
    let text = json(serde_json::to_value(&about), &files.about)?;
    replace(&files.about, |out| writeln!(out, "{text:#}").map_err(|error| ImageError::io(&files.about, error)))?;
    Ok(about)
}

fn about(job: &Job, settings: Value, metadata: &Metadata, mean: &Picture, variance: &Picture) -> About {
    let (mut average, mut spread, mut count) = ([0.0; 3], [0.0; 3], 0_u64);
    for (m, v) in mean.pixels.iter().zip(&variance.pixels).filter(|(m, v)| m.is_finite() && v.is_finite()) {
        count += 1;
        for c in 0..3 {
            average[c] += f64::from(m[c]);
            spread[c] += f64::from(v[c]);
        }
    }
    let finite = count.max(1) as f64;
    let length = |run: &Run| run.ranges.iter().map(|[start, end]| end - start).sum();
    About {
        schema: metadata.schema,
        version: metadata.version.clone(),
        scene: job.scene.clone(),
        method: job.method.name.to_string(),
        settings,
        runs: job.runs,
        seeds: job.seeds().collect(),
        iterations: metadata.runs.iter().map(length).collect(),
        width: mean.width,
        height: mean.height,
        mean: average.map(|sum| sum / finite),
        mean_stderr: spread.map(|sum| sum.sqrt() / finite),
        noise: spread.iter().sum::<f64>() / (3.0 * finite),
        non_finite: mean.pixels.len() as u64 - count,
        seconds: metadata.seconds,
        cpu_seconds: metadata.cpu_seconds,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_by_adding() {
        let files = Files::named(Path::new("a/box.v2"));
        assert_eq!((files.mean, files.about), (PathBuf::from("a/box.v2.mean.exr"), PathBuf::from("a/box.v2.json")));
    }
}
