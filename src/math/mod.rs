//! Numbers that know nothing of light: frames, colours, warps beside their densities, distributions, statistics.

pub mod distribution;
pub mod eight;
pub mod elementary;
pub mod frame;
pub mod measure;
mod memory;
pub mod rgb;
pub mod statistics;
pub mod warp;

pub use frame::Frame;
pub use measure::{AreaPdf, SolidAnglePdf};
pub use memory::fetch;
pub use rgb::Rgb;
