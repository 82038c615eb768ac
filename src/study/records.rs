//! What a study leaves behind: one JSON object a line in `records.jsonl`, written as things end.
//!
//! A report is made from these lines and the pictures they name, and from nothing else.

mod file;

pub use file::{RecordFile, RecordsError, read};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Version of the lines' layout.
pub const SCHEMA: u32 = 1;

/// A line of `records.jsonl`.
#[allow(clippy::large_enum_variant, reason = "there are few references, and lists of records are short")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Record {
    /// The study was started, for the first time or again.
    Study(Box<StudyRecord>),
    /// A scene has a reference.
    Reference(ReferenceRecord),
    /// A cell ended.
    Cell(Box<CellRecord>),
}

/// Which study, on which machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StudyRecord {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// The command as typed, program first.
    pub command: Vec<String>,
    /// The study file as given.
    pub file: String,
    /// The plan with every default filled in.
    pub plan: Value,
    /// Hash of what decides the cells' results.
    pub plan_hash: String,
    /// What it runs on.
    pub machine: Machine,
    /// Date and time, UTC, RFC 3339.
    pub started: String,
}

/// What a study ran on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor's name.
    pub cpu: String,
    /// Logical processors.
    pub processors: usize,
    /// Threads a cell used.
    pub threads: usize,
    /// Operating system and architecture.
    pub os: String,
    /// Main memory in bytes, where it is known.
    pub memory: Option<u64>,
}

/// A scene's reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceRecord {
    /// The scene's name in the study.
    pub scene: String,
    /// Mean image; relative to the study's folder where it lies inside.
    pub mean: PathBuf,
    /// Variance of the mean, where it is known.
    pub var: Option<PathBuf>,
    /// Hash of the scene and of everything that decided the reference.
    pub hash: String,
    /// How it was made; `null` for a file that was given.
    pub made: Option<MadeReference>,
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// Mean of the variance over pixels and channels.
    pub noise: Option<f64>,
}

/// How a study made a reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MadeReference {
    /// The method.
    pub method: String,
    /// Its settings.
    pub settings: Value,
    /// Seeds, one a run.
    pub seeds: Vec<u64>,
    /// Iterations of each run.
    pub iterations: Vec<u64>,
    /// Render time of all runs.
    pub seconds: f64,
}

/// How a cell ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// With an image.
    Done,
    /// With an error.
    Failed,
}

/// One scene, one method, one seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellRecord {
    /// The scene's name in the study.
    pub scene: String,
    /// The method's label in the study.
    pub method: String,
    /// The method's name, as in `isophote list methods`.
    pub name: String,
    /// Seed.
    pub seed: u64,
    /// How it ended.
    pub status: Status,
    /// Why it failed.
    pub error: Option<String>,
    /// All settings that decide the image but the seed, as in the EXR's metadata.
    pub settings: Value,
    /// Hash over the scene and every file it names.
    pub scene_hash: String,
    /// Hash of what decides this cell's result; a cell whose hash is on record is not rendered again.
    pub cell_hash: String,
    /// Iterations done.
    pub iterations: u64,
    /// Merge radius of the first iteration in world units, where there is one.
    pub radius: Option<f64>,
    /// Render time, seconds.
    pub seconds: f64,
    /// Processor seconds over the same spans, all threads.
    pub cpu_seconds: f64,
    /// Light subpaths started.
    pub light_paths: u64,
    /// Camera subpaths started.
    pub camera_paths: u64,
    /// Rays traced.
    pub rays: u64,
    /// Samples that gave no usable number, by cause.
    pub rejected: BTreeMap<String, u64>,
    /// Date and time it began, UTC, RFC 3339.
    pub started: String,
    /// On the way and at the end, ascending; the last is the final image.
    pub snapshots: Vec<SnapshotRecord>,
    /// The final image, relative to the study's folder.
    pub image: Option<PathBuf>,
    /// What the method tells of itself (chain statistics, normalisation), by its own keys.
    pub diagnostics: Option<Value>,
}

/// A film measured on the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SnapshotRecord {
    /// Iterations in the film.
    pub iteration: u64,
    /// Render time until then.
    pub seconds: f64,
    /// Processor seconds until then.
    pub cpu_seconds: f64,
    /// Light subpaths until then.
    pub light_paths: u64,
    /// Camera subpaths until then.
    pub camera_paths: u64,
    /// Rays until then.
    pub rays: u64,
    /// Value by metric; `null` where none could be computed; empty without a reference.
    pub values: BTreeMap<String, Option<f64>>,
    /// Pixels left out because a component is not finite.
    pub masked: u64,
    /// The film, relative to the study's folder, if the study keeps snapshots.
    pub image: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_comes_back() {
        let line = Record::Reference(ReferenceRecord {
            scene: "box".into(),
            mean: "references/a.mean.exr".into(),
            var: None,
            hash: "a".into(),
            made: None,
            size: (4, 3),
            noise: Some(0.1 + 0.2),
        });
        let text = serde_json::to_string(&line).expect("JSON");
        assert!(text.starts_with(r#"{"kind":"reference","scene":"box""#), "{text}");
        assert_eq!(serde_json::from_str::<Record>(&text).expect("a record"), line);
    }
}
