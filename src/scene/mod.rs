//! What light meets: shapes, the ray accelerator, materials, emitters, the camera, and the files they come from.
//!
//! A `Scene` is immutable and holds no render setting.

pub mod accel;
pub mod bsdf;
pub mod camera;
pub mod emitter;
pub mod hit;
pub mod mitsuba;
pub mod obj;
pub mod ray;
pub mod shape;
pub mod texture;

/// Number of a shape in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ShapeId(pub u32);

/// Number of an emitter in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EmitterId(pub u32);

/// Everything light can meet. Built by [`mitsuba`] or by hand; immutable.
pub struct Scene {}
