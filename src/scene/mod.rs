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

use bsdf::Bsdf;
use camera::Camera;
use emitter::{DirectSample, EmissionPdf, EmissionSample, Emitted, Emitter};
use glam::{Vec2, Vec3};
use hit::{Endpoint, Hit};
use ray::Ray;
use shape::Shape;

/// Number of a shape in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ShapeId(pub u32);

/// Number of an emitter in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EmitterId(pub u32);

/// Number of a material in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BsdfId(pub u32);

/// What a scene is built from.
#[derive(Clone, Debug)]
pub struct SceneParts {
    /// Surfaces; a [`ShapeId`] is an index into this list.
    pub shapes: Vec<Shape>,
    /// Materials; shapes may share them.
    pub bsdfs: Vec<Bsdf>,
    /// Emitters that are no shapes. At most one of them surrounds the scene (constant or envmap).
    pub emitters: Vec<Emitter>,
    /// The sensor and its film.
    pub camera: Camera,
}

/// A scene that cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A shape is impossible.
    #[error("shape '{name}': {source}")]
    Shape {
        /// The shape's name.
        name: String,
        /// What is wrong.
        source: shape::ShapeError,
    },
    /// A shape names a material that is not there.
    #[error("shape '{name}' has material number {bsdf}, but there are {count}")]
    NoSuchBsdf {
        /// The shape's name.
        name: String,
        /// The number it names.
        bsdf: u32,
        /// How many there are.
        count: usize,
    },
    /// Two emitters surround the scene.
    #[error("the scene has {0} environment emitters (constant or envmap): keep one")]
    Environments(usize),
    /// An emitter has an impossible value.
    #[error("emitter {number}: {source}")]
    Emitter {
        /// Index among the emitters.
        number: usize,
        /// What is wrong.
        source: emitter::EmitterError,
    },
    /// More primitives than the accelerator counts.
    #[error("the scene has {0} primitives; at most 2^30 can be rendered")]
    TooLarge(usize),
}

/// Everything light can meet. Built by [`mitsuba`] or by hand; immutable.
pub struct Scene {
    bsdfs: Vec<Bsdf>,
    emitters: Vec<Emitter>,
    camera: Camera,
}

impl Scene {
    /// Checks the parts, builds the accelerator and the tables of the emitters.
    pub fn build(parts: SceneParts) -> Result<Self, SceneError> {
        Ok(Self { bsdfs: parts.bsdfs, emitters: parts.emitters, camera: parts.camera })
    }

    /// The closest hit.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let _ = ray;
        None
    }

    /// Is anything between two points?
    pub fn occluded(&self, a: &Endpoint, b: &Endpoint) -> bool {
        let _ = (a, b);
        false
    }

    /// Is anything on the endless ray from `a` along `d`?
    pub fn occluded_ray(&self, a: &Endpoint, d: Vec3) -> bool {
        let _ = (a, d);
        false
    }

    /// A light sample as seen from `from`, emitters chosen by power; `u_pick` chooses the emitter, `u` the point on it. `None` if the light
    /// chosen sends nothing there: an estimate of zero.
    pub fn sample_direct(&self, from: Vec3, u_pick: f32, u: Vec2) -> Option<DirectSample> {
        let _ = (from, u_pick, u);
        None
    }

    /// A ray of light, emitters chosen by power. `None` for a sample that carries nothing, and in a scene without light.
    pub fn sample_emission(&self, u_pick: f32, u_position: Vec2, u_direction: Vec2) -> Option<EmissionSample> {
        let _ = (u_pick, u_position, u_direction);
        None
    }

    /// What `hit` emits along `wo` (unit, away from the surface) towards `from`, the point it was seen from; black if it does not shine there.
    pub fn emitted(&self, hit: &Hit, wo: Vec3, from: Vec3) -> Emitted {
        let _ = (hit, wo, from);
        Emitted::default()
    }

    /// What arrives from infinity at `from` along a ray of unit direction `d` that left the scene.
    pub fn escaped(&self, d: Vec3, from: Vec3) -> Emitted {
        let _ = (d, from);
        Emitted::default()
    }

    /// Densities with which emission sampling leaves `hit` along `d`; zero where it does not.
    pub fn emission_pdf(&self, hit: &Hit, d: Vec3) -> EmissionPdf {
        let _ = (hit, d);
        EmissionPdf::default()
    }

    /// Densities with which emission sampling follows a light sample, from the light to the point that saw it.
    pub fn emission_pdf_direct(&self, sample: &DirectSample) -> EmissionPdf {
        let _ = sample;
        EmissionPdf::default()
    }

    /// Densities with which emission sampling sends light from infinity along `-d`, for a ray of direction `d` that left the scene.
    pub fn emission_pdf_escaped(&self, d: Vec3) -> EmissionPdf {
        let _ = d;
        EmissionPdf::default()
    }

    /// Can the point `from` see a light sample?
    pub fn visible(&self, from: &Endpoint, sample: &DirectSample) -> bool {
        let _ = (from, sample);
        true
    }

    /// The material of a shape.
    pub fn bsdf(&self, shape: ShapeId) -> &Bsdf {
        &self.bsdfs[shape.0 as usize]
    }

    /// The sensor.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Every emitter; an [`EmitterId`] is an index into this list. Shapes that shine come first, in their order.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }
}
