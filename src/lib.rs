//! Isophote: a research framework for Metropolis photon tracing.
//!
//! Rooms, from the ground up: [`math`], [`image`], [`scene`], [`transport`], [`photons`], [`targets`], [`integrators`],
//! [`render`], [`study`], [`cli`]; each imports only from those below its own (`docs/architecture.md`).

pub mod cli;
pub mod image;
pub mod integrators;
pub mod math;
pub mod photons;
pub mod render;
pub mod scene;
pub mod study;
pub mod targets;
pub mod transport;

pub use isophote_samplers as samplers;
