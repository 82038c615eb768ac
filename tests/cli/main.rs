//! The program from outside: commands, files, exit statuses and what mistakes are told. Every method of the table is run.

mod bench;
mod commands;
mod mistakes;
mod renders;
#[cfg(unix)]
mod signals;
