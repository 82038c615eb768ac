//! What a study compares: a TOML file, read and checked whole before anything is rendered (`docs/studies.md`).

mod labels;
mod reader;
mod sections;

pub use reader::PlanError;

use crate::integrators::{BoxedSettings, Method};
use crate::render::{Budget, Changes, IterationRange, Snapshots};
use crate::scene::mitsuba::Position;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// When a cell ends. In JSON and TOML a table with one key, as in `{"time": 4.0}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Until {
    /// After so many seconds of render time; the running iteration is finished.
    Time(f64),
    /// After so many iterations.
    Iterations(u64),
    /// After the iteration that reaches so many light paths.
    Photons(u64),
}

impl Until {
    /// For the loop.
    pub fn budget(self) -> Budget {
        match self {
            Until::Time(seconds) => Budget::new(None, Some(seconds), 1),
            Until::Iterations(end) => Budget::new(Some(IterationRange { start: 0, end }), None, 1),
            Until::Photons(count) => Budget::of_light_paths(count),
        }
    }
}

/// Which films are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// The last of each cell.
    #[default]
    Final,
    /// The film at each snapshot as well.
    Snapshots,
}

/// A scene of the study.
#[derive(Debug)]
pub struct ScenePlan {
    /// Unique in the study.
    pub name: String,
    /// The XML file.
    pub file: PathBuf,
    /// What the study changes in it.
    pub changes: Changes,
    /// The reference given, if any.
    pub reference: Option<PathBuf>,
    /// Variance of the reference's mean.
    pub reference_var: Option<PathBuf>,
    /// Where the study file speaks of it, and of its reference.
    pub position: Position,
}

/// A method of the study.
pub struct MethodPlan {
    /// Unique in the study.
    pub label: String,
    /// The line of the table of methods.
    pub method: &'static Method,
    /// Its settings.
    pub settings: Box<dyn BoxedSettings>,
    /// When a cell of it ends.
    pub until: Until,
    /// Where the study file speaks of it.
    pub position: Position,
    /// Where each of its keys stands.
    pub keys: Vec<(String, Position)>,
}

/// How references are made for scenes that have none.
pub struct ReferencePlan {
    /// The method.
    pub method: &'static Method,
    /// Its settings.
    pub settings: Box<dyn BoxedSettings>,
    /// Independent runs, at least 2.
    pub runs: u64,
    /// When a run ends.
    pub until: Until,
    /// A folder where references are looked for first and kept for other studies.
    pub cache: Option<PathBuf>,
    /// Where the study file speaks of it.
    pub position: Position,
}

/// A study, checked as far as can be without loading a scene.
pub struct StudyPlan {
    /// The study file as given.
    pub file: PathBuf,
    /// The study's name.
    pub name: String,
    /// Seeds, each once.
    pub seeds: Vec<u64>,
    /// Films to keep.
    pub keep: Keep,
    /// After which iterations cells are measured.
    pub snapshots: Snapshots,
    /// Threads of a cell; `None` is all processors.
    pub threads: Option<usize>,
    /// How references are made.
    pub reference: ReferencePlan,
    /// Scenes, at least one.
    pub scenes: Vec<ScenePlan>,
    /// Methods, at least one.
    pub methods: Vec<MethodPlan>,
    /// The `[report]` table.
    pub report: Value,
}

impl StudyPlan {
    /// Reads a study file. `methods` is the table of what may be named.
    pub fn read(file: &Path, methods: &'static [Method]) -> Result<Self, PlanError> {
        let whole = Position::whole(file);
        let text = std::fs::read_to_string(file).map_err(|error| PlanError::new(&whole, format!("cannot be read: {error}")))?;
        sections::study(file, &text, methods)
    }
}

impl ReferencePlan {
    /// For the record.
    pub fn to_json(&self) -> Value {
        json!({
            "method": self.method.name,
            "settings": self.settings.to_json(),
            "runs": self.runs,
            "budget": self.until,
        })
    }
}

impl MethodPlan {
    /// For the record.
    pub fn to_json(&self) -> Value {
        json!({"label": self.label, "name": self.method.name, "settings": self.settings.to_json(), "budget": self.until})
    }
}

#[cfg(test)]
mod tests;
