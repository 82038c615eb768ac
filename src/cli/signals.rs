//! Interrupts from the keyboard and from a batch system.

use super::Verbosity;
use super::failure::Failure;
use crate::render::Interrupt;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set once there is something to lose.
pub(crate) type Rendering = Arc<AtomicBool>;

/// From now on SIGINT and SIGTERM ask the render to end instead of ending the program; further ones change nothing, so that a save under way is
/// never cut short; `what` says what comes then. Until the flag returned is set there is nothing to save, and the program ends at once.
pub(crate) fn listen(interrupt: &Interrupt, verbosity: Verbosity, what: &'static str) -> Result<Rendering, Failure> {
    let mut signals = Signals::new([SIGINT, SIGTERM]).map_err(|e| Failure::new(format!("cannot listen for signals: {e}")))?;
    let interrupt = interrupt.clone();
    let rendering = Rendering::default();
    let started = rendering.clone();
    let wait = move || {
        for signal in signals.forever() {
            if !started.load(Ordering::SeqCst) {
                std::process::exit(status(signal).into());
            }
            if verbosity != Verbosity::Quiet && interrupt.signal().is_none() {
                eprintln!("\n{}: {what}", name(signal));
            }
            interrupt.raise(signal);
        }
    };
    let thread = std::thread::Builder::new().name("signals".to_string()).spawn(wait);
    thread.map(|_| rendering).map_err(|e| Failure::new(format!("cannot listen for signals: {e}")))
}

/// Exit status of a program that a signal ended, as a shell reports it.
pub(crate) fn status(signal: i32) -> u8 {
    u8::try_from(128 + signal).unwrap_or(1)
}

/// What a signal is called.
pub(crate) fn name(signal: i32) -> &'static str {
    match signal {
        SIGINT => "SIGINT",
        SIGTERM => "SIGTERM",
        _ => "signal",
    }
}
