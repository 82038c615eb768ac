//! `isophote diagnose SCENE.xml --sampler NAME`.

pub(super) mod table;
mod traces;

use super::common::{CommonArgs, on_threads, progress};
use super::failure::{Failure, Outcome};
use super::{Verbosity, output, signals};
use crate::image::file::{check_writable, replace};
use crate::image::picture::ImageError;
use crate::integrators::chains::ChainReport;
use crate::integrators::photon_settings::RestName;
use crate::integrators::sppm::SppmSettings;
use crate::integrators::{BoxedSettings, Integrator};
use crate::render::{Budget, Diagnosis, Interrupt, SceneRecord, diagnose};
use clap::{Args, Command};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// The method whose photons are drawn.
const METHOD: &str = "sppm";
/// Iterations without `--iterations` and `--time`.
const ITERATIONS: u64 = 10;

/// Arguments of `diagnose`.
#[derive(Args, Clone, Debug)]
pub(super) struct DiagnoseArgs {
    #[command(flatten)]
    settings: SppmSettings,
    #[command(flatten)]
    common: CommonArgs,
    /// Seed of the random numbers
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Picture of the chains' traces in the last iteration
    #[arg(short, long, value_name = "TRACES.svg")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The command.
pub(super) fn command() -> Command {
    DiagnoseArgs::augment_args(Command::new("diagnose"))
        .about("Chain diagnostics of a photon sampler")
        .long_about(None)
        .after_help("More in docs/cli.md.")
        .mut_arg("iterations", |arg| arg.help("Iterations [default: 10; none with --time]"))
}

/// Runs it.
pub(super) fn run(arguments: &DiagnoseArgs, verbosity: Verbosity) -> Outcome {
    let photons = &arguments.settings.photons;
    photons.validate().map_err(|message| Failure::new(format!("{METHOD}: {message}")))?;
    // Of one rung is the uniform sampler's ladder as well.
    if photons.ladder().is_none_or(|ladder| ladder.rungs.len() < 2) {
        let message = "independent light paths: there is no chain to diagnose";
        return Err(Failure::new(message).help("give --sampler visibility, kernel, image or spatial"));
    }
    if let Some(path) = &arguments.output {
        check(path)?;
    }
    on_threads(arguments.common.threads, || diagnose_scene(arguments, verbosity))
}

/// Refuses a place that the traces cannot be written to.
fn check(path: &Path) -> Result<(), Failure> {
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg")) {
        return Err(Failure::new(format!("{}: traces are written as a file that ends in .svg", path.display())));
    }
    Ok(check_writable(path)?)
}

fn diagnose_scene(arguments: &DiagnoseArgs, verbosity: Verbosity) -> Outcome {
    let interrupt = Interrupt::default();
    let running = signals::listen(&interrupt, verbosity, "ending after the running iteration")?;
    let shared = &arguments.common;
    let loaded = shared.open(verbosity)?;
    shared.check_memory(&loaded, false, [0, 0])?;
    let size = loaded.scene.camera().resolution();
    let changes = shared.changes();
    let common = changes.common(arguments.seed, &loaded.defaults);
    // Chains that rest tell nothing.
    let mut settings = arguments.settings.clone();
    settings.photons.chains.rest.get_or_insert(RestName::Never);
    let settings: &dyn BoxedSettings = &settings;
    let mut method: Box<dyn Integrator + '_> = settings.build(&loaded.scene, size, &common)?;
    let budget = Budget::new(shared.iterations, shared.time, ITERATIONS);
    running.store(true, Ordering::SeqCst);
    let diagnosis = diagnose((METHOD, method.as_mut()), size, &budget, progress(verbosity).as_mut(), &interrupt)?;
    let scene = SceneRecord { path: shared.scene.scene.display().to_string(), hash: loaded.content_hash.clone() };
    let settings = changes.settings_json(settings, &common, &loaded.film);
    report(arguments, &diagnosis, (scene, settings), verbosity)
}

/// Prints what was found and writes the traces; the exit status.
fn report(arguments: &DiagnoseArgs, diagnosis: &Diagnosis, (scene, settings): (SceneRecord, Value), verbosity: Verbosity) -> Outcome {
    let chains = diagnosis.chains.as_ref().filter(|_| diagnosis.iterations > 0);
    let status = ExitCode::from(diagnosis.interrupted.map_or(0, signals::status));
    if verbosity != Verbosity::Quiet {
        match diagnosis.iterations {
            0 => eprintln!("interrupted before the first iteration was done: nothing to tell"),
            n => eprintln!("{n} iterations, {} light paths in {:.2} s", diagnosis.stats.light_paths, diagnosis.seconds),
        }
    }
    if let (Some(path), Some(chains)) = (&arguments.output, chains) {
        let drawing = traces::draw(chains)?;
        replace(path, |file| file.write_all(drawing.as_bytes()).map_err(|error| ImageError::io(path, error)))?;
    }
    if arguments.json {
        output::print_json(&json!({
            "scene": scene,
            "method": METHOD,
            "settings": settings,
            "seed": arguments.seed,
            "iterations": diagnosis.iterations,
            "seconds": diagnosis.seconds,
            "light_paths": diagnosis.stats.light_paths,
            "camera_paths": diagnosis.stats.camera_paths,
            "rays": diagnosis.stats.rays,
            "traces": arguments.output.as_ref().filter(|_| chains.is_some()).map(|path| path.display().to_string()),
            "interrupted": diagnosis.interrupted.map(signals::name),
            "sampler": chains.map(ChainReport::to_json),
            "warnings": chains.map_or_else(Vec::new, warnings_json),
        }))?;
    } else if let Some(chains) = chains {
        output::print(&table::text(chains))?;
    }
    Ok(status)
}

fn warnings_json(chains: &ChainReport) -> Vec<Value> {
    let warning = |w: &crate::samplers::Warning| {
        json!({
            "kind": w.kind(),
            "severe": w.severe(),
            "rung": w.rung().map(|rung| chains.name(rung)),
            "value": w.value(),
            "text": chains.words(w),
        })
    };
    chains.warnings().iter().map(warning).collect()
}
