//! Commands: arguments as typed, configuration as checked, one call. Exit status 0 done, 1 a check failed, 2 usage or bad input, 130 and 143
//! interrupted with the work saved.

mod common;
mod compare;
mod diagnose;
mod failure;
mod info;
mod list;
mod options;
mod output;
mod over_runs;
pub mod processor;
mod reference;
mod render;
mod report;
mod scene;
mod signals;
mod study;

use crate::integrators::{METHODS, Method};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, value_parser};
use failure::{Failure, Outcome};
use std::ffi::OsString;
use std::process::ExitCode;

/// How much is told on standard error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verbosity {
    /// Errors.
    Quiet,
    /// Errors, warnings and progress.
    Normal,
    /// More, and more than that.
    Verbose(u8),
}

/// Runs the program with its arguments, the program's name first.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map_or_else(String::new, |l| format!(" at {}:{}", l.file(), l.line()));
        let payload = panic.payload();
        let text = payload.downcast_ref::<String>().map(String::as_str).or(payload.downcast_ref::<&str>().copied()).unwrap_or("no message");
        eprintln!("error: internal error{place}: {text}\nhelp: this is a mistake in isophote; please report it with the command");
    }));
    let matches = match command(METHODS).try_get_matches_from(arguments) {
        Ok(matches) => matches,
        Err(error) => {
            // Help and version come this way as well, with status 0. A closed standard output is no error.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let verbosity = match (matches.get_flag("quiet"), matches.get_count("verbose")) {
        (true, _) => Verbosity::Quiet,
        (false, 0) => Verbosity::Normal,
        (false, n) => Verbosity::Verbose(n),
    };
    log(verbosity);
    dispatch(&matches, METHODS, verbosity).unwrap_or_else(|failure| failure.report())
}

/// The whole command line.
fn command(methods: &'static [Method]) -> Command {
    let verbose = Arg::new("verbose").short('v').long("verbose").action(ArgAction::Count).global(true).help("Tell more; -vv even more");
    let quiet = Arg::new("quiet").short('q').long("quiet").action(ArgAction::SetTrue).global(true).conflicts_with("verbose");
    let shell = Arg::new("shell").value_name("SHELL").required(true).value_parser(value_parser!(clap_complete::Shell)).help("Shell");
    Command::new("isophote")
        .about("A research framework for Metropolis photon tracing")
        .version(env!("CARGO_PKG_VERSION"))
        .subcommand_required(true)
        .arg_required_else_help(true)
        .args([verbose, quiet.help("Tell nothing but errors")])
        .subcommand(render::command(methods))
        .subcommand(reference::command(methods))
        .subcommand(compare::CompareArgs::augment_args(Command::new("compare")).about("Metrics of images against a reference"))
        .subcommand(
            study::StudyArgs::augment_args(Command::new("study")).about("Renders scenes by methods by seeds, and goes on where it stopped"),
        )
        .subcommand(report::ReportArgs::augment_args(Command::new("report")).about("One self-contained HTML file from a study's records"))
        .subcommand(diagnose::command())
        .subcommand(info::InfoArgs::augment_args(Command::new("info")).about("What is in an EXR file or a scene"))
        .subcommand(list::ListArgs::augment_args(Command::new("list")).about("What methods, samplers, materials and metrics there are"))
        .subcommand(Command::new("completions").about("Completions of this command line for a shell").arg(shell))
}

fn dispatch(matches: &ArgMatches, methods: &'static [Method], verbosity: Verbosity) -> Outcome {
    match matches.subcommand() {
        Some(("render", matches)) => render::run(matches, methods, verbosity),
        Some(("reference", matches)) => reference::run(matches, methods, verbosity),
        Some(("compare", matches)) => compare::run(&parsed(matches)?),
        Some(("study", matches)) => study::run(&parsed(matches)?, methods, verbosity),
        Some(("report", matches)) => report::run(&parsed(matches)?, verbosity),
        Some(("diagnose", matches)) => diagnose::run(&parsed(matches)?, verbosity),
        Some(("info", matches)) => info::run(&parsed(matches)?),
        Some(("list", matches)) => list::run(&parsed(matches)?, methods),
        Some(("completions", matches)) => completions(matches, methods),
        // clap lets nothing else through.
        _ => Err(Failure::new("no command given")),
    }
}

/// A command's arguments.
fn parsed<A: FromArgMatches>(matches: &ArgMatches) -> Result<A, Failure> {
    A::from_arg_matches(matches).map_err(|error| Failure::new(error.to_string()))
}

fn completions(matches: &ArgMatches, methods: &'static [Method]) -> Outcome {
    let mut text = Vec::new();
    if let Some(shell) = matches.get_one::<clap_complete::Shell>("shell") {
        clap_complete::generate(*shell, &mut command(methods), "isophote", &mut text);
    }
    output::print(&String::from_utf8_lossy(&text))?;
    Ok(ExitCode::SUCCESS)
}

/// Sends what the library tells to standard error.
fn log(verbosity: Verbosity) {
    use tracing::level_filters::LevelFilter;
    let level = match verbosity {
        Verbosity::Quiet => LevelFilter::ERROR,
        Verbosity::Normal => LevelFilter::WARN,
        Verbosity::Verbose(1) => LevelFilter::INFO,
        Verbosity::Verbose(_) => LevelFilter::DEBUG,
    };
    let subscriber = tracing_subscriber::fmt().with_max_level(level).with_writer(std::io::stderr).without_time().with_target(false);
    // Fails only if a program that uses the library has its own.
    let _ = subscriber.try_init();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        command(METHODS).debug_assert();
    }
}
