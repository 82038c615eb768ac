//! The ladder over its public interface, on spaces whose laws and integrals are known.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod allocation;
mod disks;
mod dispersion;
mod draws;
mod islands;
mod kit;
mod lengths;
mod speed;
mod square;
