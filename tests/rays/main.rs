//! The ray accelerator against brute force.
mod shapes;
