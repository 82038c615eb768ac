//! What rendering one image and rendering a reference have in common: options, methods as subcommands, memory, progress.

use super::Verbosity;
use super::failure::{Failure, Outcome};
use super::options::{Size, max_depth, path_class, seconds};
use super::output;
use super::scene::{self, SceneArgs};
use crate::image::film::Film;
use crate::image::layers::LayerSums;
use crate::image::readings::Readings;
use crate::integrators::{BoxedSettings, Method};
use crate::render::{Bar, Changes, IterationRange, Lines, Progress, Silent};
use crate::scene::mitsuba::LoadedScene;
use clap::{ArgMatches, Args, Command};
use std::io::IsTerminal;
use std::time::Duration;

/// Options common to all methods and to both commands.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
pub(super) struct CommonArgs {
    #[command(flatten)]
    pub(super) scene: SceneArgs,
    /// Iterations 0..N, or A..B [default: the scene's sample_count; none with --time]
    #[arg(long, value_name = "N|A:B")]
    pub(super) iterations: Option<IterationRange>,
    /// Stop after S seconds of render time; the running iteration is finished
    #[arg(long, value_name = "S", value_parser = seconds, allow_negative_numbers = true)]
    pub(super) time: Option<f64>,
    /// Emitters do not show when seen directly
    #[arg(long)]
    pub(super) hide_emitters: bool,
    /// Most path edges: 1 emitters seen directly, 2 direct light, -1 unlimited [default: the scene's]
    #[arg(long, value_name = "D", value_parser = max_depth, allow_negative_numbers = true)]
    pub(super) max_depth: Option<i64>,
    /// Fewest path edges, for tests
    #[arg(long, value_name = "D", default_value_t = 1)]
    pub(super) min_depth: u32,
    /// Only paths of this class: Heckbert letters L D G S E from the light, for tests
    #[arg(long, value_name = "REGEX", value_parser = path_class)]
    pub(super) paths: Option<regex::Regex>,
    /// Threads [default: all processors]
    #[arg(long, value_name = "T")]
    pub(super) threads: Option<std::num::NonZeroUsize>,
    /// Refuse to need more memory than this, as in 4G
    #[arg(long, value_name = "SIZE")]
    pub(super) max_memory: Option<Size>,
}

impl CommonArgs {
    /// As checked.
    pub(super) fn changes(&self) -> Changes {
        Changes {
            max_depth: self.max_depth,
            min_depth: self.min_depth,
            hide_emitters: self.hide_emitters,
            paths: self.paths.clone(),
            ..self.scene.changes.changes()
        }
    }

    /// Loads the scene and says how much there is to note about it.
    pub(super) fn open(&self, verbosity: Verbosity) -> Result<LoadedScene, Failure> {
        let loaded = scene::open(&self.scene.scene, &self.changes())?;
        if verbosity != Verbosity::Quiet && !loaded.notes.is_empty() {
            eprintln!("{} (isophote info {} lists them)", notes(loaded.notes.len()), self.scene.scene.display());
        }
        Ok(loaded)
    }

    /// Refuses what takes more memory than allowed. `moments`: the film keeps squares as well; `images`: so many
    /// further images, of techniques and of readings.
    pub(super) fn check_memory(&self, loaded: &LoadedScene, moments: bool, images: [usize; 2]) -> Result<(), Failure> {
        let Some(Size(limit)) = self.max_memory else { return Ok(()) };
        let (width, height) = loaded.scene.camera().resolution();
        let pixels = width as u64 * height as u64;
        let further = LayerSums::bytes(images[0], pixels) + Readings::bytes(images[1], pixels);
        let (scene, film) = (scene::bytes(loaded), Film::bytes(width, height, moments) + further);
        if scene + film <= limit {
            return Ok(());
        }
        let [scene, film, limit] = [scene, film, limit].map(output::bytes);
        let message = format!("the scene takes {scene} and the film {film}: more than the {limit} of --max-memory");
        Err(Failure::new(message).help("raise --max-memory, or lower --resolution"))
    }
}

/// Runs on so many threads, or on all processors.
pub(super) fn on_threads(threads: Option<std::num::NonZeroUsize>, work: impl FnOnce() -> Outcome + Send) -> Outcome {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.map_or(0, usize::from)).build();
    pool.map_err(|error| Failure::new(format!("cannot start threads: {error}")))?.install(work)
}

/// A command with one subcommand a method, which takes the options of the method and those of `A`.
pub(super) fn with_methods<A: Args>(command: Command, methods: &'static [Method]) -> Command {
    let method_command = |method: &'static Method| {
        let command = (method.augment)(Command::new(method.name).next_help_heading("Options of the method"));
        // Adding the structs of options also sets their own descriptions, so the method's comes last.
        let command = A::augment_args(command).about(method.about).long_about(None);
        command.after_help(format!("More in docs/{}.", method.page))
    };
    command
        .subcommand_required(true)
        .arg_required_else_help(true)
        .subcommand_value_name("METHOD")
        .subcommand_help_heading("Methods")
        .disable_help_subcommand(true)
        .subcommands(methods.iter().map(method_command))
}

/// The method chosen, its settings, and the other arguments.
pub(super) fn chosen<A: Args>(
    matches: &ArgMatches,
    methods: &'static [Method],
) -> Result<(&'static Method, Box<dyn BoxedSettings>, A), Failure> {
    let Some((name, matches)) = matches.subcommand() else { return Err(Failure::new("no method given")) };
    let method = methods.iter().find(|m| m.name == name).ok_or_else(|| Failure::new(format!("there is no method {name}")))?;
    let settings = (method.from_matches)(matches).map_err(|error| Failure::new(error.to_string()))?;
    Ok((method, settings, super::parsed(matches)?))
}

fn notes(count: usize) -> String {
    if count == 1 { "1 note on the scene".to_string() } else { format!("{count} notes on the scene") }
}

/// A bar on a terminal, lines elsewhere, nothing if quiet.
pub(super) fn progress(verbosity: Verbosity) -> Box<dyn Progress> {
    const LINES_APART: Duration = Duration::from_secs(5);
    if verbosity == Verbosity::Quiet {
        Box::new(Silent)
    } else if std::io::stderr().is_terminal() {
        Box::new(Bar::new())
    } else {
        Box::new(Lines::new(std::io::stderr(), LINES_APART))
    }
}
