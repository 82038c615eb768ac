//! The statistics of a study against a fake integrator whose noise, bias and speed are planted: what is fitted must come back, and a 95 %
//! interval must hold the truth 95 % of the time. docs/statistics.md has the numbers.
//!
//! The long part: `cargo test --test statistics -- --ignored --nocapture --test-threads 1`
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod coverage;
mod fake;
mod pictures;
mod ratios;
mod slopes;
mod splits;
