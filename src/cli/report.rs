//! `isophote report DIR [-o report.html]`.

use super::Verbosity;
use super::failure::{Failure, Outcome};
use super::output::bytes;
use crate::study::report::{ReportError, Summary, write};
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `report`.
#[derive(Args, Clone, Debug)]
pub(super) struct ReportArgs {
    /// Folder of a study, with records.jsonl
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Page to write [default: DIR/report.html]
    #[arg(short, long, value_name = "F.html")]
    output: Option<PathBuf>,
}

/// The page's name in a study's folder.
pub(super) const REPORT: &str = "report.html";

/// Runs it.
pub(super) fn run(arguments: &ReportArgs, verbosity: Verbosity) -> Outcome {
    let output = arguments.output.clone().unwrap_or_else(|| arguments.folder.join(REPORT));
    let summary = write_page(&arguments.folder, &output)?;
    if verbosity != Verbosity::Quiet {
        eprintln!("{}: {}", output.display(), told(&summary));
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the page of a study's folder; what it could not show is a warning.
pub(super) fn write_page(folder: &Path, output: &Path) -> Result<Summary, Failure> {
    let summary = write(folder, output)?;
    for problem in &summary.problems {
        tracing::warn!("{problem}");
    }
    Ok(summary)
}

/// What the page holds, in one line.
fn told(summary: &Summary) -> String {
    let ended = summary.done + summary.failed;
    let missing = summary.planned.map_or(0, |planned| planned.saturating_sub(ended));
    let mut text = format!("{} scenes, {} methods, {} cells done", summary.scenes, summary.methods, summary.done);
    if summary.failed > 0 {
        text += &format!(", {} failed", summary.failed);
    }
    if missing > 0 {
        text += &format!(", {missing} not on record yet");
    }
    text + &format!("; {}", bytes(summary.bytes as u64))
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        let help = match &error {
            ReportError::Records(_) => Some("name the folder a study wrote its records.jsonl to (`isophote study STUDY.toml -o DIR`)"),
            ReportError::Empty { .. } => Some("run the study first: isophote study STUDY.toml -o DIR"),
            _ => None,
        };
        let failure = match error {
            ReportError::Write(error) => Self::from(error),
            other => Self::new(other.to_string()),
        };
        match help {
            Some(help) => failure.help(help),
            None => failure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_told() {
        let summary = Summary { scenes: 2, methods: 3, done: 10, failed: 1, planned: Some(12), bytes: 2048, problems: Vec::new() };
        assert_eq!(told(&summary), "2 scenes, 3 methods, 10 cells done, 1 failed, 1 not on record yet; 2.00 KiB");
    }
}
