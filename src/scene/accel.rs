//! The ray accelerator. The only file that names obvhs.

use super::ray::{RawHit, Ray};
use glam::{Affine3A, Vec3};

/// What the accelerator can intersect. The index in the list is the primitive's number.
#[derive(Clone, Copy, Debug)]
pub enum Primitive {
    /// Three corners; the geometric normal is `(b - a) x (c - a)`.
    Triangle([Vec3; 3]),
    /// All points at distance `radius` from `center`, hit from both sides.
    Sphere {
        /// Centre, world units.
        center: Vec3,
        /// Radius, world units, positive.
        radius: f32,
    },
    /// The unit disk `x^2 + y^2 <= 1, z = 0` under `to_world` (any invertible affine map).
    Disk {
        /// Object to world.
        to_world: Affine3A,
    },
    /// The open cylinder `x^2 + y^2 = 1, 0 <= z <= 1` under `to_world` (any invertible affine map).
    Cylinder {
        /// Object to world.
        to_world: Affine3A,
    },
}

/// The two questions a renderer asks of a set of primitives.
pub trait Accel {
    /// The first hit with `0 < t <= ray.t_max`, if any.
    fn closest(&self, ray: &Ray) -> Option<RawHit>;
    /// Is there any hit with `0 < t <= ray.t_max`?
    fn occluded(&self, ray: &Ray) -> bool;
}
