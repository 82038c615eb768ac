//! Numbers that know nothing of light: frames, colours, warps beside their densities, distributions, statistics.

pub mod distribution;
pub mod elementary;
pub mod frame;
pub mod measure;
pub mod rgb;
pub mod statistics;
pub mod warp;

pub use frame::Frame;
pub use measure::{AreaPdf, SolidAnglePdf};
pub use rgb::Rgb;
