//! The program from outside: commands, files, exit statuses and what mistakes are told. Every method of the table is run.

// Helpers outside test functions; what fails there fails the test.
#![allow(clippy::unwrap_used, clippy::panic)]

mod bench;
mod commands;
mod diagnose;
mod mistakes;
mod renders;
#[cfg(unix)]
mod signals;
