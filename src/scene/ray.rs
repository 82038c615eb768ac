//! Rays and what the accelerator says of them.

use glam::Vec3;

/// A half-line from `o` along `d`, cut at `t_max`. `d` need not have unit length: `t` is measured in multiples of `d`.
///
/// There is no lower cut-off: origins are moved off their surface by an error bound instead ([`crate::scene`]).
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin, world units.
    pub o: Vec3,
    /// Direction, not necessarily of unit length; never zero.
    pub d: Vec3,
    /// Hits beyond this parameter do not count; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// The ray that never ends.
    pub fn new(o: Vec3, d: Vec3) -> Self {
        Self { o, d, t_max: f32::INFINITY }
    }
}

/// Closest hit as the accelerator reports it; the surface there is worked out by the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawHit {
    /// Ray parameter, in multiples of the direction's length; `0 < t <= t_max`.
    pub t: f32,
    /// For triangles the barycentric weight of the second vertex; analytic primitives leave it 0.
    pub u: f32,
    /// For triangles the barycentric weight of the third vertex; analytic primitives leave it 0.
    pub v: f32,
    /// Index of the primitive in the list the accelerator was built from.
    pub prim: u32,
}
