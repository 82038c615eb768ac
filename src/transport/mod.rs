//! How light travels: what happens at a surface point, and the one random walk of both directions.

pub mod class;
pub mod densities;
pub mod merge;
pub mod mis;
pub mod shading;
pub mod subpath;
pub mod survival;
pub mod walk;
