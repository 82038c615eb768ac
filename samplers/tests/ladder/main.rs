//! The ladder over its public interface, on spaces whose laws and integrals are known.

mod allocation;
mod disks;
mod dispersion;
mod draws;
mod islands;
mod kit;
mod lengths;
mod speed;
mod square;
