//! `isophote reference METHOD SCENE.xml --runs K -o NAME`.

use super::common::{CommonArgs, chosen, on_threads, progress, with_methods};
use super::failure::{Failure, Outcome};
use super::output::print_json;
use super::{Verbosity, signals};
use crate::image::file::check_writable;
use crate::integrators::{BoxedSettings, Method};
use crate::render::{Budget, Interrupt, Progress, SceneRecord, Step};
use crate::study::references::{About, FIRST_SEED, Files, Job, RunProgress, make};
use clap::{ArgMatches, Args, Command};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// Options of making a reference.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
struct ReferenceArgs {
    #[command(flatten)]
    common: CommonArgs,
    /// Independent runs, at least 2
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u64).range(2..=1_000_000))]
    runs: u64,
    /// Files to write: NAME.mean.exr, NAME.var.exr and NAME.json
    #[arg(short, long, value_name = "NAME")]
    output: PathBuf,
    /// Seed of the first run; the others follow. The default, 2^32, is beyond the seeds that studies count up to
    #[arg(long, value_name = "S", default_value_t = FIRST_SEED)]
    seed: u64,
    /// Print how it was made as JSON
    #[arg(long)]
    json: bool,
}

/// The command with one subcommand a method.
pub(super) fn command(methods: &'static [Method]) -> Command {
    with_methods::<ReferenceArgs>(Command::new("reference").about("Mean and variance of the mean over independent runs"), methods)
}

/// Runs it.
pub(super) fn run(matches: &ArgMatches, methods: &'static [Method], verbosity: Verbosity) -> Outcome {
    let (method, settings, arguments) = chosen::<ReferenceArgs>(matches, methods)?;
    on_threads(arguments.common.threads, || reference(&arguments, method, settings.as_ref(), verbosity))
}

fn reference(arguments: &ReferenceArgs, method: &'static Method, settings: &dyn BoxedSettings, verbosity: Verbosity) -> Outcome {
    let interrupt = Interrupt::default();
    let rendering = signals::listen(&interrupt, verbosity, "ending after the running iteration; every run done is kept")?;
    let files = Files::named(&arguments.output);
    for path in [&files.mean, &files.var, &files.about] {
        check_writable(path)?;
    }
    if arguments.seed.checked_add(arguments.runs).is_none() {
        return Err(Failure::new(format!("--seed {} leaves no room for {} runs", arguments.seed, arguments.runs)));
    }
    let shared = &arguments.common;
    let loaded = shared.open(verbosity)?;
    shared.check_memory(&loaded, true, [0, 0])?;
    let job = Job {
        scene: SceneRecord { path: shared.scene.scene.display().to_string(), hash: loaded.content_hash.clone() },
        changes: &shared.changes(),
        method,
        settings,
        runs: arguments.runs,
        first_seed: arguments.seed,
        budget: Budget::new(shared.iterations, shared.time, u64::from(loaded.defaults.sample_count)),
        loaded: &loaded,
    };
    rendering.store(true, Ordering::SeqCst);
    let about = make(&job, &files, &mut Runs { verbosity, progress: None }, &interrupt)?;
    told(arguments, &files, about, &interrupt, verbosity)
}

/// Says what came of it; the exit status.
fn told(arguments: &ReferenceArgs, files: &Files, about: Option<About>, interrupt: &Interrupt, verbosity: Verbosity) -> Outcome {
    let Some(about) = about else {
        if verbosity != Verbosity::Quiet {
            eprintln!("interrupted: the runs done are in {}; the same command goes on from there", files.runs.display());
        }
        return Ok(ExitCode::from(interrupt.signal().map_or(1, signals::status)));
    };
    if about.non_finite > 0 {
        tracing::warn!("{} of {} pixels are infinite or not a number", about.non_finite, about.width * about.height);
    }
    if verbosity != Verbosity::Quiet {
        eprintln!("{}: {} runs in {:.2} s", files.mean.display(), about.runs, about.seconds);
    }
    if arguments.json {
        let mut document = json!({"mean_file": files.mean.display().to_string(), "var_file": files.var.display().to_string()});
        let about = serde_json::to_value(&about).map_err(|error| Failure::new(error.to_string()))?;
        if let (Value::Object(document), Value::Object(about)) = (&mut document, about) {
            document.extend(about);
        }
        print_json(&document)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A bar, or lines, for each run.
struct Runs {
    verbosity: Verbosity,
    progress: Option<Box<dyn Progress>>,
}

impl Progress for Runs {
    fn step(&mut self, step: Step) {
        if let Some(progress) = &mut self.progress {
            progress.step(step);
        }
    }
    fn finish(&mut self) {
        if let Some(mut progress) = self.progress.take() {
            progress.finish();
        }
    }
}

impl RunProgress for Runs {
    fn begin(&mut self, run: u64, runs: u64) {
        if self.verbosity != Verbosity::Quiet {
            eprintln!("run {} of {runs}", run + 1);
        }
        self.progress = Some(progress(self.verbosity));
    }
}
