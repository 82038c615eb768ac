//! Images: the film's sums and counts, EXR files with metadata, metrics, what several runs say together, tone mapping.

pub mod exr;
pub mod file;
pub mod film;
pub mod layers;
pub mod metrics;
pub mod picture;
pub mod ramp;
pub mod readings;
pub mod runs;
pub mod sheet;
pub mod tiles;
pub mod tonemap;
