//! What a photon sampler should aim at, and the space of light paths that joins scene and samplers.

pub mod aim;
pub mod aimed;
pub mod cells;
pub mod deposits;
pub mod light_paths;
pub mod points;
pub mod regions;
pub mod shares;
pub mod tallies;

pub use light_paths::{Arrival, Arrivals, LightPath, LightPaths, LightVertex};
