//! What a photon sampler should aim at, and the space of light paths that joins scene and samplers.

pub mod light_paths;

pub use light_paths::{LightPath, LightPaths, LightVertex};
