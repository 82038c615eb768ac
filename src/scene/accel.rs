//! The ray accelerator: an eight-wide tree over triangles, spheres, disks and cylinders.
//!
//! [`Bvh::build`] makes it, [`Accel`] asks it. How it works, what it promises at the last bit and what was measured
//! stand in `docs/rays.md`.

mod analytic;
mod batch;
mod build;
mod node;
mod packet;
mod probe;
mod slot;
mod traverse;
mod tree;
mod triangle;

use super::ray::{RawHit, Ray};
use analytic::Analytic;
use glam::{Affine3A, Vec3};
use slot::Slot;

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

    /// [`Accel::closest`] of many rays, the same bit for bit: `hits[i]` belongs to `rays[i]`. Of two lengths the shorter counts, and what
    /// lies beyond it in `hits` stays as it is.
    fn closest_each(&self, rays: &[Ray], hits: &mut [Option<RawHit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.closest(ray);
        }
    }

    /// [`Accel::occluded`] of many rays: `blocked[i]` belongs to `rays[i]`. Lengths as with [`Accel::closest_each`].
    fn occluded_each(&self, rays: &[Ray], blocked: &mut [bool]) {
        for (ray, blocked) in rays.iter().zip(blocked) {
            *blocked = self.occluded(ray);
        }
    }
}

/// An axis-aligned box, `min <= max` in every component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest corner, world units.
    pub min: Vec3,
    /// Largest corner, world units.
    pub max: Vec3,
}

/// The eight-wide tree. Immutable, shared by all threads.
///
/// Primitives that no ray can hit are left out when it is built: those with a coordinate that is not finite, triangles
/// without area, spheres without a positive radius, disks and cylinders whose map is singular. The others keep the
/// numbers they had in the list.
pub struct Bvh {
    /// Inner nodes, each before its descendants, so that a walk goes forward in memory, and leaves of triangles beside their kin.
    slots: Vec<Slot>,
    /// Leaves of everything that is no triangle, one a leaf.
    analytic: Vec<Analytic>,
    /// How to reach the first node; `node::EMPTY` for no primitives at all.
    root: u32,
    /// Largest absolute coordinate of the bounds: what rounding errors are measured against.
    reach: f32,
    bounds: Option<Bounds>,
    primitives: usize,
    /// Larger than the cache nearest to the processor, so that a walk had better ask for memory ahead.
    large: bool,
}

/// Stack entries of a walk, a power of two: a million triangles need about 80, and `build` sees to it that no tree needs more.
const DEEP: usize = 512;

impl Bvh {
    /// Builds the tree. The same list gives the same tree, bit for bit. Up to 2^30 primitives.
    pub fn build(primitives: &[Primitive]) -> Self {
        build::build(primitives)
    }

    /// The smallest box around everything that can be hit; none if nothing can.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds
    }

    /// How many of the primitives can be hit.
    pub fn primitives(&self) -> usize {
        self.primitives
    }

    /// Bytes held, the struct itself not counted.
    pub fn memory(&self) -> usize {
        self.slots.capacity() * size_of::<Slot>() + self.analytic.capacity() * size_of::<Analytic>()
    }
}

impl Accel for Bvh {
    fn closest(&self, ray: &Ray) -> Option<RawHit> {
        self.find_closest(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.find_any(ray)
    }

    fn closest_each(&self, rays: &[Ray], hits: &mut [Option<RawHit>]) {
        self.each_closest(rays, hits);
    }

    fn occluded_each(&self, rays: &[Ray], blocked: &mut [bool]) {
        self.each_any(rays, blocked);
    }
}
