//! Images: the film's sums and counts, EXR files with metadata, metrics, tone mapping.

pub mod exr;
pub mod file;
pub mod film;
pub mod metrics;
pub mod picture;
pub mod tiles;
pub mod tonemap;
