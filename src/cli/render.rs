//! `isophote render METHOD SCENE.xml`.

use super::failure::{Failure, Outcome};
use super::options::{Size, finite, max_depth, path_class, seconds, typed_class};
use super::scene::{SceneArgs, SceneChanges};
use super::{Verbosity, output, scene, signals};
use crate::image::exr::read_picture;
use crate::image::file::check_writable;
use crate::image::film::Film;
use crate::image::tonemap::Exposure;
use crate::integrators::{BoxedSettings, Common, Method};
use crate::render::{
    Bar, Budget, Interrupt, IterationRange, Layers, Lines, Metadata, Output, Plan, Progress, Reference, SceneRecord, Silent, Snapshots,
    render,
};
use crate::scene::mitsuba::{FilmSize, LoadedScene, RenderDefaults};
use clap::{ArgMatches, Args, Command, ValueEnum};
use serde_json::{Map, Value, json};
use std::io::IsTerminal;
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
}

/// Options common to all methods.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
struct RenderArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Image to write [default: SCENEFOLDER.METHOD.exr]
    #[arg(short, long, value_name = "OUT.exr")]
    output: Option<PathBuf>,
    /// Iterations 0..N, or A..B [default: the scene's sample_count; none with --time]
    #[arg(long, value_name = "N|A:B")]
    iterations: Option<IterationRange>,
    /// Stop after S seconds of render time; the running iteration is finished
    #[arg(long, value_name = "S", value_parser = seconds, allow_negative_numbers = true)]
    time: Option<f64>,
    /// Emitters do not show when seen directly
    #[arg(long)]
    hide_emitters: bool,
    /// Most path edges: 1 emitters seen directly, 2 direct light, -1 unlimited [default: the scene's]
    #[arg(long, value_name = "D", value_parser = max_depth, allow_negative_numbers = true)]
    max_depth: Option<i64>,
    /// Fewest path edges, for tests
    #[arg(long, value_name = "D", default_value_t = 1)]
    min_depth: u32,
    /// Only paths of this class: Heckbert letters L D G S E from the light, for tests
    #[arg(long, value_name = "REGEX", value_parser = path_class)]
    paths: Option<regex::Regex>,
    /// Seed of the random numbers
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Threads [default: all processors]
    #[arg(long, value_name = "T")]
    threads: Option<std::num::NonZeroUsize>,
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
    /// Refuse to need more memory than this, as in 4G
    #[arg(long, value_name = "SIZE")]
    max_memory: Option<Size>,
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
    let method_command = |method: &'static Method| {
        let command = (method.augment)(Command::new(method.name).next_help_heading("Options of the method"));
        // Adding the structs of options also sets their own descriptions, so the method's comes last.
        let command = RenderArgs::augment_args(command).about(method.about).long_about(None);
        command.after_help(format!("More in docs/{}.", method.page))
    };
    Command::new("render")
        .about("Renders one image")
        .subcommand_required(true)
        .arg_required_else_help(true)
        .subcommand_value_name("METHOD")
        .subcommand_help_heading("Methods")
        .disable_help_subcommand(true)
        .subcommands(methods.iter().map(method_command))
}

/// Runs it.
pub(super) fn run(matches: &ArgMatches, methods: &'static [Method], verbosity: Verbosity) -> Outcome {
    let Some((name, matches)) = matches.subcommand() else { return Err(Failure::new("no method given")) };
    let method = methods.iter().find(|m| m.name == name).ok_or_else(|| Failure::new(format!("there is no method {name}")))?;
    let arguments: RenderArgs = super::parsed(matches)?;
    let settings = (method.from_matches)(matches).map_err(|error| Failure::new(error.to_string()))?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads.map_or(0, usize::from)).build();
    let pool = pool.map_err(|error| Failure::new(format!("cannot start threads: {error}")))?;
    pool.install(|| render_scene(&arguments, method, settings.as_ref(), verbosity))
}

fn render_scene(arguments: &RenderArgs, method: &Method, settings: &dyn BoxedSettings, verbosity: Verbosity) -> Outcome {
    let interrupt = Interrupt::default();
    let rendering = signals::listen(&interrupt, verbosity)?;
    // What can be refused is refused before the scene is loaded, what is left before anything is rendered.
    let output = output_of(arguments, method.name)?;
    let reference = arguments.reference.as_ref().map(|path| read_picture(path).map(|picture| Reference { path: path.clone(), picture }));
    let reference = reference.transpose()?;
    let loaded = scene::open(&arguments.scene.scene, &arguments.scene.changes)?;
    if verbosity != Verbosity::Quiet && !loaded.notes.is_empty() {
        eprintln!("{} (isophote info {} lists them)", notes(loaded.notes.len()), arguments.scene.scene.display());
    }
    let size = loaded.scene.camera().resolution();
    check_memory(arguments, &loaded, size, output.layers.variance)?;
    let common = common_of(arguments, &loaded.defaults);
    let plan = Plan {
        size,
        budget: Budget::new(arguments.iterations, arguments.time, u64::from(loaded.defaults.sample_count)),
        seed: arguments.seed,
        snapshots: arguments.snapshots.unwrap_or(if reference.is_some() { Snapshots::PowersOfTwo } else { Snapshots::None }),
        checkpoint: Some(Duration::from_secs_f64(arguments.checkpoint)),
        reference,
        output,
    };
    let record = SceneRecord { path: arguments.scene.scene.display().to_string(), hash: loaded.content_hash.clone() };
    let metadata = Metadata::new(record, method.name, settings_json(settings, &common, &loaded.film, &arguments.scene.changes));
    let mut integrator = settings.build(&loaded.scene, size, &common)?;
    let mut progress = progress(verbosity);
    rendering.store(true, Ordering::SeqCst);
    let outcome = render(integrator.as_mut(), &plan, metadata, progress.as_mut(), &interrupt)?;
    report(arguments, &plan, &outcome, verbosity)
}

/// Where the image goes; refused if it cannot be written.
fn output_of(arguments: &RenderArgs, method: &str) -> Result<Output, Failure> {
    let path = match &arguments.output {
        Some(path) => path.clone(),
        None => default_output(&arguments.scene.scene, method),
    };
    check_writable(&path)?;
    let preview = arguments.preview.clone().map(|path| (path, arguments.exposure.map_or(Exposure::FromImage, Exposure::Stops)));
    if let Some((preview, _)) = &preview {
        check_writable(preview)?;
    }
    let layers = Layers { variance: arguments.aov.contains(&Aov::Variance), count: arguments.aov.contains(&Aov::Count) };
    Ok(Output { path, layers, preview })
}

/// `SCENEFOLDER.METHOD.exr` in the current directory.
fn default_output(scene: &Path, method: &str) -> PathBuf {
    let absolute = std::path::absolute(scene).unwrap_or_else(|_| scene.to_path_buf());
    // A scene in the root folder has a folder without a name; its own name is the next best.
    let folder = absolute.parent().and_then(Path::file_name).or(absolute.file_stem());
    PathBuf::from(format!("{}.{method}.exr", folder.map_or_else(|| "scene".into(), |f| f.to_string_lossy())))
}

fn notes(count: usize) -> String {
    if count == 1 { "1 note on the scene".to_string() } else { format!("{count} notes on the scene") }
}

fn check_memory(arguments: &RenderArgs, loaded: &LoadedScene, (width, height): (usize, usize), moments: bool) -> Result<(), Failure> {
    let Some(Size(limit)) = arguments.max_memory else { return Ok(()) };
    let (scene, film) = (scene::bytes(loaded), Film::bytes(width, height, moments));
    if scene + film <= limit {
        return Ok(());
    }
    let [scene, film, limit] = [scene, film, limit].map(output::bytes);
    let message = format!("the scene takes {scene} and the film {film}: more than the {limit} of --max-memory");
    Err(Failure::new(message).help("raise --max-memory, or lower --resolution"))
}

fn common_of(arguments: &RenderArgs, defaults: &RenderDefaults) -> Common {
    Common {
        seed: arguments.seed,
        max_depth: arguments.max_depth.map_or(defaults.max_depth, |depth| u32::try_from(depth).ok()),
        min_depth: arguments.min_depth,
        rr_depth: defaults.rr_depth,
        hide_emitters: arguments.hide_emitters || defaults.hide_emitters,
        paths: arguments.paths.clone(),
    }
}

/// The method's settings and all others that decide the image.
fn settings_json(settings: &dyn BoxedSettings, common: &Common, film: &FilmSize, changes: &SceneChanges) -> Value {
    let mut all = match settings.to_json() {
        Value::Object(map) => map,
        _ => Map::new(),
    };
    let define: Map<String, Value> = changes.define.iter().map(|d| (d.name.clone(), d.value.clone().into())).collect();
    let shared = json!({
        "resolution": [film.width, film.height],
        "crop": film.crop,
        "max_depth": common.max_depth.map_or(-1, i64::from),
        "min_depth": common.min_depth,
        "rr_depth": common.rr_depth,
        "hide_emitters": common.hide_emitters,
        "paths": common.paths.as_ref().map(typed_class),
        "define": define,
    });
    if let Value::Object(shared) = shared {
        all.extend(shared);
    }
    Value::Object(all)
}

fn progress(verbosity: Verbosity) -> Box<dyn Progress> {
    const LINES_APART: Duration = Duration::from_secs(5);
    if verbosity == Verbosity::Quiet {
        Box::new(Silent)
    } else if std::io::stderr().is_terminal() {
        Box::new(Bar::new())
    } else {
        Box::new(Lines::new(std::io::stderr(), LINES_APART))
    }
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
