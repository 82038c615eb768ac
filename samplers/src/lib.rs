//! Light-path samplers over primary sample space. This crate knows numbers in [0, 1): no scene, no ray, no image.
//!
//! A light path is a function of a [`Stream`]. The same function serves independent numbers, a Markov chain or a replay.

mod adapt;
mod allocation;
pub mod diagnostics;
pub mod ladder;
mod mutation;
pub mod sampler;
mod state;
pub mod stratified;
pub mod stream;

pub use diagnostics::{LadderReport, RungReport, TRACE_POINTS, Warning, warnings};
pub use ladder::{Allocation, Combine, Ladder, LadderSettings, Normaliser};
pub use sampler::{CELLS, Draw, Drawn, LightPathSpace, PhotonSampler, Uniform};
pub use stratified::StratifiedStream;
pub use stream::{Key, Purpose, Recorder, Replay, Stream, UniformStream};
