//! Methods, one file each, and the one table that names them.
//!
//! A method is prepared once and then iterated; it knows no loop, no clock and no file (`render` does).

mod aimed;
pub mod chains;
mod eye;
pub mod path;
pub mod photon_settings;
pub mod sppm;
pub mod vcm;

use crate::image::film::Film;
use crate::image::layers::Layer;
use crate::scene::Scene;
use crate::transport::walk::Tally;
use chains::ChainReport;
use clap::{ArgMatches, Args, Command};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;

/// What every method is told beside its own settings.
#[derive(Clone, Debug)]
pub struct Common {
    /// Seed of every stream.
    pub seed: u64,
    /// Most path edges: 1 is emitters seen directly, 2 direct light; `None` is unlimited.
    pub max_depth: Option<u32>,
    /// Fewest path edges that count.
    pub min_depth: u32,
    /// Russian roulette starts at this many edges, where the method's roulette has a start.
    pub rr_depth: u32,
    /// The camera looks through emitters and sees no environment (depth 1), as in Mitsuba 3.
    pub hide_emitters: bool,
    /// Only paths whose class matches count (Heckbert letters from the light).
    pub paths: Option<regex::Regex>,
}

/// What an iteration did. Counts add over iterations.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IterationStats {
    /// Camera subpaths started.
    pub camera_paths: u64,
    /// Light subpaths started, burn-in and start-up counted.
    pub light_paths: u64,
    /// Rays traced.
    pub rays: u64,
    /// Samples that gave no usable number, by cause. Never silently dropped.
    pub rejected: BTreeMap<&'static str, u64>,
}

impl IterationStats {
    /// Adds what walks cost and gave up.
    pub fn count(&mut self, tally: &Tally) {
        self.rays += tally.rays;
        for (cause, count) in tally.rejected() {
            *self.rejected.entry(cause).or_default() += count;
        }
    }

    /// Adds another's counts.
    pub fn add(&mut self, other: &IterationStats) {
        self.camera_paths += other.camera_paths;
        self.light_paths += other.light_paths;
        self.rays += other.rays;
        for (cause, count) in &other.rejected {
            *self.rejected.entry(cause).or_default() += count;
        }
    }
}

/// A method bound to a scene, a film size and settings.
pub trait Integrator: Send {
    /// Work before the first iteration (a pilot, a radius); counted as render time.
    fn prepare(&mut self) -> Result<IterationStats, MethodError>;
    /// Adds iteration `i` to the film. For a stateless method the result depends on (scene, settings, seed, `i`) only.
    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats;
    /// The merge radius of the first iteration in world units, where there is one radius for all vertices; for the metadata.
    fn radius(&self) -> Option<f64> {
        None
    }
    /// Iterations may be rendered in any order and in disjoint ranges.
    fn stateless(&self) -> bool {
        true
    }
    /// What the method can say about itself so far, as it stands in metadata and records: nothing that depends on time or threads.
    fn diagnostics(&self) -> Option<serde_json::Value> {
        None
    }
    /// The images of single techniques that a film is to keep for `--aov pyramid`, by the numbers under which iterations add to them.
    fn technique_layers(&self) -> Result<Vec<Layer>, MethodError> {
        Err(MethodError::NoTechniques)
    }
    /// The densities of light paths that a film is to keep for `--aov density`, by name; iterations add to them by their place here.
    fn density_images(&self) -> Result<&'static [&'static str], MethodError> {
        Err(MethodError::NoDensity)
    }
    /// What the sampler of light paths tells of its chains, if it has any.
    fn chains(&self) -> Option<ChainReport> {
        None
    }
}

/// A method refuses its settings or its scene.
#[derive(Debug, thiserror::Error)]
pub enum MethodError {
    /// Settings that contradict each other or the scene; the message says what to change.
    #[error("{method}: {message}")]
    Settings {
        /// The method's name.
        method: &'static str,
        /// What is wrong and what to do.
        message: String,
    },
    /// The method has one way to make a path, or does not tell its ways apart.
    #[error("--aov pyramid shows the techniques of bdpt and vcm; this method has none to show: leave it out")]
    NoTechniques,
    /// The method does not know how densely photons lie.
    #[error(
        "--aov density shows how densely photons lie, which sppm knows, and vcm with --merge-weights vcm-plus or vcm-star: leave it out"
    )]
    NoDensity,
    /// A pyramid without end.
    #[error("--aov pyramid keeps an image of every technique of every path length: give --max-depth D, at most {most}")]
    PyramidDepth {
        /// The longest paths it can tell apart, edges.
        most: u32,
    },
}

/// One set of settings serves the command line, study files and metadata.
pub trait Settings: Args + Serialize + DeserializeOwned + Clone + Send + Sync + 'static {
    /// Binds the method to a scene. `size` is the film's width and height in pixels.
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError>;
}

/// [`Settings`] behind a table.
pub trait BoxedSettings: Send + Sync {
    /// See [`Settings::build`].
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError>;
    /// As it stands in the metadata: keys are the long option names with dashes as underscores.
    fn to_json(&self) -> serde_json::Value;
}

impl<S: Settings> BoxedSettings for S {
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError> {
        Settings::build(self, scene, size, common)
    }
    fn to_json(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or(serde_json::Value::Null)
    }
}

/// A line of the table of methods.
pub struct Method {
    /// Name on the command line and in files.
    pub name: &'static str,
    /// One sentence.
    pub about: &'static str,
    /// Its page under `docs/`.
    pub page: &'static str,
    /// Adds the method's options to a command.
    pub augment: fn(Command) -> Command,
    /// Reads them back.
    pub from_matches: fn(&ArgMatches) -> Result<Box<dyn BoxedSettings>, clap::Error>,
    /// Reads them from a study file or from metadata; missing keys take their defaults.
    pub from_json: fn(&serde_json::Value) -> Result<Box<dyn BoxedSettings>, serde_json::Error>,
}

/// Fills a line of the table from a settings type.
pub const fn method<S: Settings>(name: &'static str, about: &'static str, page: &'static str) -> Method {
    Method {
        name,
        about,
        page,
        augment: |command| S::augment_args(command),
        from_matches: |matches| Ok(Box::new(S::from_arg_matches(matches)?)),
        from_json: |value| Ok(Box::new(serde_json::from_value::<S>(value.clone())?)),
    }
}

/// Every method. The command line, `list`, studies, smoke tests and the documentation check walk this slice.
pub const METHODS: &[Method] = &[
    method::<path::PathSettings>("path", "Path tracing with next event estimation", "methods/path.md"),
    method::<vcm::BdptSettings>("bdpt", "Bidirectional path tracing", "methods/vcm.md"),
    method::<sppm::SppmSettings>("sppm", "Stochastic progressive photon mapping", "methods/sppm.md"),
    method::<vcm::VcmSettings>("vcm", "Vertex connection and merging", "methods/vcm.md"),
];
