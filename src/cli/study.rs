//! `isophote study STUDY.toml`.

use super::common::on_threads;
use super::failure::{Failure, Outcome};
use super::output::{print, print_json};
use super::report::REPORT;
use super::{Verbosity, signals};
use crate::integrators::Method;
use crate::render::{Interrupt, Step};
use crate::study::plan::StudyPlan;
use crate::study::records::{CellRecord, Status};
use crate::study::run::{Options, Standing, Study, Summary, Watch};
use clap::Args;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Arguments of `study`.
#[derive(Args, Clone, Debug)]
pub(super) struct StudyArgs {
    /// Study, a TOML file
    #[arg(value_name = "STUDY.toml")]
    study: PathBuf,
    /// Folder of the study; one that holds part of it goes on [default: STUDY.study]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Threads of a cell [default: the study's, else all processors]
    #[arg(long, value_name = "T")]
    threads: Option<std::num::NonZeroUsize>,
    /// List the cells that would be rendered, and render none
    #[arg(long)]
    dry_run: bool,
    /// Render the cells again that failed before
    #[arg(long)]
    retry: bool,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub(super) fn run(arguments: &StudyArgs, methods: &'static [Method], verbosity: Verbosity) -> Outcome {
    let plan = StudyPlan::read(&arguments.study, methods).map_err(|error| Failure::from(crate::study::error::StudyError::from(error)))?;
    let folder = arguments.output.clone().unwrap_or_else(|| default_folder(&arguments.study));
    let threads = arguments.threads.or(plan.threads.and_then(std::num::NonZeroUsize::new));
    on_threads(threads, || {
        let interrupt = Interrupt::default();
        let rendering = signals::listen(&interrupt, verbosity, "ending after the running iteration; every cell done is kept")?;
        let study = Study::open(plan)?;
        if arguments.dry_run {
            return dry_run(arguments, &study, &folder);
        }
        rendering.store(true, Ordering::SeqCst);
        let options = Options {
            command: std::env::args_os().map(|argument| argument.to_string_lossy().into_owned()).collect(),
            retry: arguments.retry,
        };
        let start = Instant::now();
        let summary = study.run(&folder, &options, watch(verbosity).as_mut(), &interrupt)?;
        let report = if summary.interrupted.is_none() { write_report(&folder, &summary)? } else { None };
        told(arguments, &study, &folder, &summary, report.as_deref(), start.elapsed(), verbosity)
    })
}

/// `NAME.study` in the current directory.
fn default_folder(file: &Path) -> PathBuf {
    let stem = file.file_stem().map_or_else(|| "study".into(), |stem| stem.to_string_lossy());
    PathBuf::from(format!("{stem}.study"))
}

/// Writes the page that shows the study, unless nothing is done that it could show.
fn write_report(folder: &Path, summary: &Summary) -> Result<Option<PathBuf>, Failure> {
    if summary.done == 0 {
        return Ok(None);
    }
    let page = folder.join(REPORT);
    super::report::write_page(folder, &page)?;
    Ok(Some(page))
}

/// What a run would render.
fn dry_run(arguments: &StudyArgs, study: &Study, folder: &Path) -> Outcome {
    let (left, all) = (study.left(folder)?, study.cells().len());
    let (scene, method) = (|i: usize| study.plan.scenes[i].name.as_str(), |i: usize| study.plan.methods[i].label.as_str());
    if arguments.json {
        let cells =
            left.iter().map(|c| json!({"scene": scene(c.scene), "method": method(c.method), "seed": c.seed})).collect::<Vec<Value>>();
        print_json(&json!({"study": study.plan.name, "folder": folder.display().to_string(), "cells": all, "left": cells}))?;
    } else {
        let lines: String = left.iter().map(|c| format!("{}  {}  seed {}\n", scene(c.scene), method(c.method), c.seed)).collect();
        print(&format!("{lines}{} of {all} cells to render into {}\n", left.len(), folder.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Says what came of it; the exit status.
fn told(
    arguments: &StudyArgs,
    study: &Study,
    folder: &Path,
    summary: &Summary,
    report: Option<&Path>,
    wall: Duration,
    verbosity: Verbosity,
) -> Outcome {
    for cell in &summary.failed {
        tracing::error!("{}, {}, seed {}: {}", cell.scene, cell.method, cell.seed, cell.error.as_deref().unwrap_or("no reason on record"));
    }
    if verbosity != Verbosity::Quiet {
        let failed = if summary.failed.is_empty() { String::new() } else { format!(", {} failed", summary.failed.len()) };
        eprintln!("{}: {} of {} cells done{failed}, in {}", folder.display(), summary.done, summary.cells, HumanDuration(wall));
        if let Some(report) = report {
            eprintln!("open {} to see it", report.display());
        }
    }
    if arguments.json {
        let failure = |cell: &CellRecord| json!({"scene": cell.scene, "method": cell.method, "seed": cell.seed, "error": cell.error});
        print_json(&json!({
            "study": study.plan.name,
            "folder": folder.display().to_string(),
            "report": report.map(|path| path.display().to_string()),
            "cells": summary.cells,
            "rendered": summary.rendered,
            "done": summary.done,
            "failed": summary.failed.iter().map(failure).collect::<Vec<_>>(),
            "interrupted": summary.interrupted.map(signals::name),
            "seconds": wall.as_secs_f64(),
        }))?;
    }
    Ok(match summary.interrupted {
        Some(signal) => ExitCode::from(signals::status(signal)),
        None if summary.failed.is_empty() => ExitCode::SUCCESS,
        None => ExitCode::FAILURE,
    })
}

/// A bar on a terminal, lines elsewhere, nothing if quiet.
fn watch(verbosity: Verbosity) -> Box<dyn Watch> {
    if verbosity == Verbosity::Quiet {
        Box::new(Nobody)
    } else if std::io::stderr().is_terminal() {
        Box::new(Terminal::new())
    } else {
        Box::new(Log)
    }
}

/// `7/30  glass-box, sppm, seed 2; 24 left, about 2 minutes`.
fn describe(standing: &Standing) -> String {
    let Standing { scene, method, seed, number, cells, left, remaining } = standing;
    let time = remaining.map_or_else(String::new, |s| format!(", about {}", HumanDuration(Duration::from_secs_f64(s))));
    format!("{number}/{cells}  {scene}, {method}, seed {seed}; {left} left{time}")
}

struct Nobody;

impl Watch for Nobody {
    fn reference(&mut self, _: &str, _: u64, _: u64) {}
    fn begin(&mut self, _: &Standing) {}
    fn step(&mut self, _: Step) {}
    fn end(&mut self, _: &CellRecord) {}
}

/// One line a cell.
struct Log;

impl Watch for Log {
    fn reference(&mut self, scene: &str, run: u64, runs: u64) {
        eprintln!("reference of {scene}, run {} of {runs}", run + 1);
    }
    fn begin(&mut self, standing: &Standing) {
        eprintln!("{}", describe(standing));
    }
    fn step(&mut self, _: Step) {}
    fn end(&mut self, record: &CellRecord) {
        if record.status == Status::Failed {
            eprintln!("failed: {}", record.error.as_deref().unwrap_or("no reason on record"));
        }
    }
}

/// A bar over the cells.
struct Terminal {
    bar: ProgressBar,
    /// Cells done before the one under way, and of how many.
    place: (usize, usize),
}

impl Terminal {
    /// Steps of the bar; a cell under way moves it as well.
    const RESOLUTION: u64 = 10_000;

    fn new() -> Self {
        let bar = ProgressBar::with_draw_target(Some(Self::RESOLUTION), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3}%  {msg}") {
            bar.set_style(style);
        }
        Self { bar, place: (0, 1) }
    }
}

impl Watch for Terminal {
    fn reference(&mut self, scene: &str, run: u64, runs: u64) {
        self.place = (0, usize::MAX);
        self.bar.set_message(format!("reference of {scene}, run {} of {runs}", run + 1));
    }
    fn begin(&mut self, standing: &Standing) {
        self.place = (standing.cells - standing.left, standing.cells);
        self.bar.set_message(describe(standing));
    }
    fn step(&mut self, step: Step) {
        let share = (self.place.0 as f64 + step.share()) / self.place.1 as f64;
        self.bar.set_position((share * Self::RESOLUTION as f64) as u64);
    }
    fn end(&mut self, record: &CellRecord) {
        if record.status == Status::Failed {
            let error = record.error.as_deref().unwrap_or("no reason on record");
            self.bar.println(format!("failed: {}, {}, seed {}: {error}", record.scene, record.method, record.seed));
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
