//! `isophote render METHOD SCENE.xml`.

use super::common::{CommonArgs, chosen, on_threads, progress, with_methods};
use super::failure::{Failure, Outcome};
use super::options::{finite, seconds};
use super::{Verbosity, output, signals};
use crate::image::exr::read_picture;
use crate::image::file::check_writable;
use crate::image::tonemap::Exposure;
use crate::integrators::{BoxedSettings, Method};
use crate::render::{Budget, Interrupt, Layers, Metadata, Output, Plan, Reference, SceneRecord, Snapshots, render};
use clap::{ArgMatches, Args, Command, ValueEnum};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Further layers of the EXR.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Aov {
    /// Variance of the mean image, from the iterations
    Variance,
    /// Camera-side samples of the pixel
    Count,
    /// What every technique brings to paths of every length, with its weight and without, and a contact sheet (bdpt, vcm)
    Pyramid,
    /// Photons per square unit and light subpath where the pixel measures (sppm; vcm with vcm-plus or vcm-star)
    Density,
}

/// Options of rendering one image.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
struct RenderArgs {
    #[command(flatten)]
    common: CommonArgs,
    /// Image to write [default: SCENEFOLDER.METHOD.exr]
    #[arg(short, long, value_name = "OUT.exr")]
    output: Option<PathBuf>,
    /// Seed of the random numbers
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Films kept on the way as OUT.i000064.exr: none, pow2 or every:N [default: none; pow2 with --reference]
    #[arg(long, value_name = "WHEN")]
    snapshots: Option<Snapshots>,
    /// Save the unfinished image every S seconds
    #[arg(long, value_name = "S", default_value = "60", value_parser = seconds, allow_negative_numbers = true)]
    checkpoint: f64,
    /// Record the error against this image after each snapshot and at the end
    #[arg(long, value_name = "REF.exr")]
    reference: Option<PathBuf>,
    /// Further layers of the EXR
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    aov: Vec<Aov>,
    /// Tone-mapped picture beside the EXR
    #[arg(long, value_name = "OUT.png")]
    preview: Option<PathBuf>,
    /// Exposure of the preview in stops [default: from the image]
    #[arg(long, value_name = "EV", value_parser = finite, requires = "preview", allow_negative_numbers = true)]
    exposure: Option<f32>,
    /// Print the final statistics as JSON
    #[arg(long)]
    json: bool,
}

/// The command with one subcommand a method.
pub(super) fn command(methods: &'static [Method]) -> Command {
    with_methods::<RenderArgs>(Command::new("render").about("Renders one image"), methods)
}

/// Runs it.
pub(super) fn run(matches: &ArgMatches, methods: &'static [Method], verbosity: Verbosity) -> Outcome {
    let (method, settings, arguments) = chosen::<RenderArgs>(matches, methods)?;
    on_threads(arguments.common.threads, || render_scene(&arguments, method, settings.as_ref(), verbosity))
}

fn render_scene(arguments: &RenderArgs, method: &Method, settings: &dyn BoxedSettings, verbosity: Verbosity) -> Outcome {
    let interrupt = Interrupt::default();
    let rendering = signals::listen(&interrupt, verbosity, "ending after the running iteration and saving")?;
    // What can be refused is refused before the scene is loaded, what is left before anything is rendered.
    let output = output_of(arguments, method.name)?;
    let reference = arguments.reference.as_ref().map(|path| read_picture(path).map(|picture| Reference { path: path.clone(), picture }));
    let reference = reference.transpose()?;
    let shared = &arguments.common;
    let loaded = shared.open(verbosity)?;
    let changes = shared.changes();
    let common = changes.common(arguments.seed, &loaded.defaults);
    let plan = Plan {
        size: loaded.scene.camera().resolution(),
        budget: Budget::new(shared.iterations, shared.time, u64::from(loaded.defaults.sample_count)),
        seed: arguments.seed,
        snapshots: arguments.snapshots.unwrap_or(if reference.is_some() { Snapshots::PowersOfTwo } else { Snapshots::None }),
        keep: true,
        checkpoint: Some(Duration::from_secs_f64(arguments.checkpoint)),
        reference,
        output,
    };
    let record = SceneRecord { path: shared.scene.scene.display().to_string(), hash: loaded.content_hash.clone() };
    let metadata = Metadata::new(record, method.name, changes.settings_json(settings, &common, &loaded.film));
    let mut integrator = settings.build(&loaded.scene, plan.size, &common)?;
    let techniques = if plan.output.layers.pyramid { integrator.technique_layers()?.len() } else { 0 };
    let densities = if plan.output.layers.density { integrator.density_images()?.len() } else { 0 };
    let images = [techniques, densities];
    shared.check_memory(&loaded, plan.output.layers.variance, images)?;
    let mut progress = progress(verbosity);
    rendering.store(true, Ordering::SeqCst);
    let outcome = render(integrator.as_mut(), &plan, metadata, progress.as_mut(), &interrupt)?;
    report(arguments, &plan, &outcome, verbosity)
}

/// Where the image goes; refused if it cannot be written.
fn output_of(arguments: &RenderArgs, method: &str) -> Result<Output, Failure> {
    let path = match &arguments.output {
        Some(path) => path.clone(),
        None => default_output(&arguments.common.scene.scene, method),
    };
    check_writable(&path)?;
    let preview = arguments.preview.clone().map(|path| (path, arguments.exposure.map_or(Exposure::FromImage, Exposure::Stops)));
    if let Some((preview, _)) = &preview {
        check_writable(preview)?;
    }
    let asked = |aov| arguments.aov.contains(&aov);
    let layers =
        Layers { variance: asked(Aov::Variance), count: asked(Aov::Count), pyramid: asked(Aov::Pyramid), density: asked(Aov::Density) };
    let output = Output { path, layers, preview };
    if layers.pyramid {
        check_writable(&output.sheet())?;
    }
    Ok(output)
}

/// `SCENEFOLDER.METHOD.exr` in the current directory.
fn default_output(scene: &Path, method: &str) -> PathBuf {
    let absolute = std::path::absolute(scene).unwrap_or_else(|_| scene.to_path_buf());
    // A scene in the root folder has a folder without a name; its own name is the next best.
    let folder = absolute.parent().and_then(Path::file_name).or(absolute.file_stem());
    PathBuf::from(format!("{}.{method}.exr", folder.map_or_else(|| "scene".into(), |f| f.to_string_lossy())))
}

/// Says what came of it; the exit status.
fn report(arguments: &RenderArgs, plan: &Plan, outcome: &crate::render::Outcome, verbosity: Verbosity) -> Outcome {
    let path = plan.output.path.display();
    let (metadata, iterations) = (&outcome.metadata, outcome.film.iterations());
    if outcome.non_finite > 0 {
        tracing::warn!("{} of {} pixels are infinite or not a number", outcome.non_finite, plan.size.0 * plan.size.1);
    }
    for (cause, count) in &metadata.rejected {
        tracing::warn!("{count} samples rejected: {cause}");
    }
    if verbosity != Verbosity::Quiet {
        match iterations {
            0 => eprintln!("interrupted before the first iteration was done: nothing written"),
            n => eprintln!("{path}: {n} iterations in {:.2} s", metadata.seconds),
        }
    }
    if arguments.json {
        let mut document = json!({
            "output": (iterations > 0).then(|| path.to_string()),
            "preview": plan.output.preview.as_ref().filter(|_| iterations > 0).map(|(p, _)| p.display().to_string()),
            "iterations": iterations,
            "non_finite_pixels": outcome.non_finite,
            "interrupted": outcome.interrupted.map(signals::name),
        });
        if plan.output.layers.pyramid && iterations > 0 {
            document["pyramid"] = plan.output.sheet().display().to_string().into();
        }
        let metadata = serde_json::to_value(metadata).map_err(|error| Failure::new(error.to_string()))?;
        if let (Value::Object(document), Value::Object(metadata)) = (&mut document, metadata) {
            document.extend(metadata);
        }
        output::print_json(&document)?;
    }
    Ok(match outcome.interrupted {
        Some(signal) => ExitCode::from(signals::status(signal)),
        None => ExitCode::SUCCESS,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_output_is_named_after_the_folder() {
        let name = |scene: &str| default_output(Path::new(scene), "sppm").display().to_string();
        assert_eq!(name("/scenes/veach-bidir/scene.xml"), "veach-bidir.sppm.exr");
        assert_eq!(name("/box.xml"), "box.sppm.exr");
        let here = std::env::current_dir().expect("a folder");
        assert_eq!(name("scene.xml"), format!("{}.sppm.exr", here.file_name().expect("a name").to_string_lossy()));
        assert_eq!(name("cornell/scene.xml"), "cornell.sppm.exr");
    }
}
