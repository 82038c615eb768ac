//! Interrupts from the keyboard and from a batch system.

use super::Verbosity;
use super::failure::Failure;
use crate::render::Interrupt;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

/// From now on SIGINT and SIGTERM ask the render to end instead of ending the program; further ones change nothing, so that a save under way is
/// never cut short.
pub(crate) fn listen(interrupt: &Interrupt, verbosity: Verbosity) -> Result<(), Failure> {
    let mut signals = Signals::new([SIGINT, SIGTERM]).map_err(|e| Failure::new(format!("cannot listen for signals: {e}")))?;
    let interrupt = interrupt.clone();
    let wait = move || {
        for signal in signals.forever() {
            if verbosity != Verbosity::Quiet && interrupt.signal().is_none() {
                eprintln!("\n{}: ending after the running iteration and saving", name(signal));
            }
            interrupt.raise(signal);
        }
    };
    let thread = std::thread::Builder::new().name("signals".to_string()).spawn(wait);
    thread.map(drop).map_err(|e| Failure::new(format!("cannot listen for signals: {e}")))
}

/// What a signal is called.
pub(crate) fn name(signal: i32) -> &'static str {
    match signal {
        SIGINT => "SIGINT",
        SIGTERM => "SIGTERM",
        _ => "signal",
    }
}
