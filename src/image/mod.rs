//! Images: the film's sums and counts, EXR files with metadata, metrics, tone mapping.

pub mod film;
pub mod tiles;
