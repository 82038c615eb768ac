//! How photons are kept: the store, the grid that finds them, how dense they lie, the radius schedule.

mod cells;
pub mod density;
pub mod grid;
mod memo;
pub mod radius;
mod sort;
pub mod store;

pub use density::{DensityMap, DensitySettings};
pub use grid::{Grid, Order, Search};
pub use store::{Photon, Store};
