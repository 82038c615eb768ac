//! Isophote: a research framework for Metropolis photon tracing.
//!
//! Rooms, from the ground up: [`math`], [`scene`]; each imports only from those below its own (`docs/architecture.md`).

pub mod math;
pub mod scene;
