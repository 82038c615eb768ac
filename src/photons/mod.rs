//! How photons are kept: the store, the grid that finds them, the radius schedule.

pub mod grid;
pub mod radius;

pub use grid::PhotonGrid;
