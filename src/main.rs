//! The command line's entry.

use std::process::ExitCode;

fn main() -> ExitCode {
    match isophote::cli::processor::missing() {
        None => isophote::cli::run(std::env::args_os()),
        Some(features) => isophote::cli::processor::refuse(features),
    }
}
