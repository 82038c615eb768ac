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

use crate::math::{Rgb, SolidAnglePdf};
use accel::Accel;
use bsdf::Bsdf;
use camera::{Camera, CameraError, FilmSpec};
use emitter::{Area, Ball, DirectSample, EmissionPdf, EmissionSample, Emitted, Emitter, EmitterKind, Emitters, LightPoint};
use glam::{Vec2, Vec3};
use hit::{Endpoint, Hit};
use ray::{RawHit, Ray};
use shape::surface::{self, Asked, Owner, Surfaces};
use shape::{Geometry, Shape};
use texture::Texture;

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

/// The ray accelerator in use.
type Tree = accel::Bvh;

/// Everything light can meet. Built by [`mitsuba`] or by hand; immutable.
pub struct Scene {
    tree: Tree,
    surfaces: Surfaces,
    emitters: Emitters,
    bsdfs: Vec<Bsdf>,
    camera: Camera,
    shapes: Vec<ShapeInfo>,
    ball: Ball,
}

/// A shape as the built scene remembers it.
#[derive(Clone, Debug)]
pub struct ShapeInfo {
    /// As the description has it.
    pub name: String,
    /// What kind of surface: `mesh`, `sphere`, `disk` or `cylinder`.
    pub kind: &'static str,
    /// Its primitives, as the accelerator counts them.
    pub primitives: std::ops::Range<u32>,
    /// Its material.
    pub bsdf: BsdfId,
    /// Its emitter, if it shines.
    pub emitter: Option<EmitterId>,
}

/// What a scene holds, by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneCounts {
    /// Shapes.
    pub shapes: usize,
    /// Triangles of all meshes.
    pub triangles: usize,
    /// Spheres, disks and cylinders.
    pub quadrics: usize,
    /// Materials.
    pub bsdfs: usize,
    /// Emitters.
    pub emitters: usize,
}

/// Bytes a scene holds, by part; textures and materials are not in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneMemory {
    /// The ray accelerator.
    pub accelerator: usize,
    /// Surfaces as hits need them.
    pub surfaces: usize,
    /// Emitters with their tables and images.
    pub emitters: usize,
}

impl Scene {
    /// Checks the parts, builds the accelerator and the tables of the emitters.
    pub fn build(parts: SceneParts) -> Result<Self, SceneError> {
        let SceneParts { shapes, bsdfs, emitters, camera } = parts;
        check(&shapes, &bsdfs, &emitters)?;
        // --- surfaces, and which of them shine
        let mut surfaces = Surfaces::default();
        let mut primitives = Vec::new();
        let mut list: Vec<Emitter> = Vec::new();
        let mut infos = Vec::with_capacity(shapes.len());
        for (number, shape) in shapes.into_iter().enumerate() {
            let Shape { name, geometry, bsdf, radiance } = shape;
            let first = surfaces.len();
            let id = radiance.is_some().then_some(EmitterId(list.len() as u32));
            let material = &bsdfs[bsdf.0 as usize];
            let asked = Asked { tangents: material.anisotropic(), uv: material.varies() || radiance.as_ref().is_some_and(Texture::varies) };
            surfaces.push(&geometry, Owner { bsdf, emitter: id, asked }, &mut primitives);
            list.extend(radiance.map(|r| Emitter::Area(Area::new(ShapeId(number as u32), r, first..surfaces.len(), &surfaces))));
            let primitives = first as u32..surfaces.len() as u32;
            infos.push(ShapeInfo { name, kind: geometry.kind(), primitives, bsdf, emitter: id });
        }
        list.extend(emitters);
        // --- the tree, and the ball around what it holds
        let tree = Tree::build(&primitives);
        let ball = tree.bounds().map(|b| Ball::around(b.min, b.max)).unwrap_or_default();
        let emitters = Emitters::new(list, ball, &surfaces).map_err(|(number, source)| SceneError::Emitter { number, source })?;
        Ok(Self { tree, surfaces, emitters, bsdfs, camera, shapes: infos, ball })
    }

    /// The closest hit.
    #[inline(always)]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.tree.closest(ray).map(|raw| self.hit(ray, &raw))
    }

    /// The closest hits of many rays, without their surfaces: `hits[i]` belongs to `rays[i]`, bit for bit what one ray alone would get. Of two
    /// lengths the shorter counts.
    #[inline]
    pub fn trace_each(&self, rays: &[Ray], hits: &mut [Option<RawHit>]) {
        self.tree.closest_each(rays, hits);
    }

    /// The surface at a hit of `ray`: [`Scene::intersect`] is the closest hit and this.
    #[inline(always)]
    pub fn hit(&self, ray: &Ray, raw: &RawHit) -> Hit {
        self.surfaces.hit(ray, raw)
    }

    /// Does the shape that was hit shine? Cheaper than [`Scene::hit`], which says so too.
    #[inline(always)]
    pub fn shines(&self, raw: &RawHit) -> bool {
        self.surfaces.shines(raw)
    }

    /// Whether anything is on each of many rays: `blocked[i]` belongs to `rays[i]`. Of two lengths the shorter counts.
    #[inline]
    pub fn occluded_each(&self, rays: &[Ray], blocked: &mut [bool]) {
        self.tree.occluded_each(rays, blocked);
    }

    /// Is anything between two points?
    #[inline(always)]
    pub fn occluded(&self, a: &Endpoint, b: &Endpoint) -> bool {
        let segment = a.segment(b);
        segment.d != Vec3::ZERO && self.tree.occluded(&segment)
    }

    /// Is anything on the endless ray from `a` along `d`?
    #[inline]
    pub fn occluded_ray(&self, a: &Endpoint, d: Vec3) -> bool {
        self.tree.occluded(&a.ray(d))
    }

    /// Can the point `from` see a light sample?
    #[inline(always)]
    pub fn visible(&self, from: &Endpoint, sample: &DirectSample) -> bool {
        self.shadow_ray(from, sample).is_none_or(|ray| !self.tree.occluded(&ray))
    }

    /// The ray that is free if and only if the point `from` sees a light sample. `None` where the two coincide and nothing can be between.
    #[inline(always)]
    pub fn shadow_ray(&self, from: &Endpoint, sample: &DirectSample) -> Option<Ray> {
        match sample.kind {
            EmitterKind::Surface | EmitterKind::DeltaPosition => Some(from.segment(&sample.end)).filter(|segment| segment.d != Vec3::ZERO),
            EmitterKind::DeltaDirection | EmitterKind::Infinite => Some(from.ray(sample.wi)),
        }
    }

    /// A light sample as seen from `from`, emitters chosen by power; `u_pick` chooses the emitter, `u` the point on it. `None` if the light
    /// chosen sends nothing there: an estimate of zero.
    #[inline(always)]
    pub fn sample_direct(&self, from: Vec3, u_pick: f32, u: Vec2) -> Option<DirectSample> {
        self.emitters.sample_direct(&self.surfaces, from, u_pick, u)
    }

    /// Is every light sample a point uniform by area, so that [`Scene::sample_light_point`] may stand for [`Scene::sample_direct`]?
    #[inline]
    pub fn lights_by_area(&self) -> bool {
        self.emitters.by_area()
    }

    /// The point that [`Scene::sample_direct`] with the same numbers aims at, wherever it is asked from. `None` where
    /// [`Scene::lights_by_area`] says no.
    #[inline(always)]
    pub fn sample_light_point(&self, u_pick: f32, u: Vec2) -> Option<LightPoint> {
        self.emitters.sample_point(&self.surfaces, u_pick, u)
    }

    /// A ray of light, emitters chosen by power. `None` for a sample that carries nothing, and in a scene without light.
    #[inline]
    pub fn sample_emission(&self, u_pick: f32, u_position: Vec2, u_direction: Vec2) -> Option<EmissionSample> {
        self.emitters.sample_emission(&self.surfaces, u_pick, u_position, u_direction)
    }

    /// What `hit` emits along `wo` (unit, away from the surface) towards `from`, the point it was seen from; black if it does not shine there.
    #[inline]
    pub fn emitted(&self, hit: &Hit, wo: Vec3, from: Vec3) -> Emitted {
        self.emitters.emitted(hit, wo, from)
    }

    /// What arrives from infinity along a ray of unit direction `d` that left the scene.
    #[inline]
    pub fn escaped(&self, d: Vec3) -> Emitted {
        self.emitters.escaped(d)
    }

    /// Densities with which emission sampling leaves `hit` along `d` (unit, away from the surface); zero where it does not.
    #[inline]
    pub fn emission_pdf(&self, hit: &Hit, d: Vec3) -> EmissionPdf {
        self.emitters.emission_pdf(hit, d)
    }

    /// Densities with which emission sampling follows a light sample, from the light to the point that saw it.
    #[inline]
    pub fn emission_pdf_direct(&self, sample: &DirectSample) -> EmissionPdf {
        self.emitters.emission_pdf_direct(sample)
    }

    /// Densities with which emission sampling sends light from infinity along `-d`, for a ray of unit direction `d` that left the scene.
    #[inline]
    pub fn emission_pdf_escaped(&self, d: Vec3) -> EmissionPdf {
        self.emitters.emission_pdf_escaped(d)
    }

    /// Density with which direct sampling at `from`, a point on a ray of light, gives the direction back to where the ray started: what
    /// [`DirectSample::pdf`] would have been.
    #[inline]
    pub fn direct_pdf(&self, sample: &EmissionSample, from: Vec3) -> SolidAnglePdf {
        self.emitters.direct_pdf(sample, from)
    }

    /// Probability with which an emitter is chosen, by direct and by emission sampling.
    #[inline]
    pub fn pick_probability(&self, emitter: EmitterId) -> f32 {
        self.emitters.pick_probability(emitter)
    }

    /// Flux that an emitter sends into the scene, W; that of one at infinity is what passes the scene's bounding sphere.
    pub fn power(&self, emitter: EmitterId) -> Rgb {
        self.emitters.power(emitter)
    }

    /// Every emitter; an [`EmitterId`] is an index into this list. Shapes that shine come first, in their order.
    pub fn emitters(&self) -> &[Emitter] {
        self.emitters.list()
    }

    /// The emitter that surrounds the scene, if there is one.
    pub fn environment(&self) -> Option<EmitterId> {
        self.emitters.environment()
    }

    /// The material of a shape.
    #[inline(always)]
    pub fn bsdf(&self, shape: ShapeId) -> &Bsdf {
        &self.bsdfs[self.surfaces.bsdf(shape).0 as usize]
    }

    /// Every material; a [`BsdfId`] is an index into this list.
    pub fn bsdfs(&self) -> &[Bsdf] {
        &self.bsdfs
    }

    /// Every shape; a [`ShapeId`] is an index into this list.
    pub fn shapes(&self) -> &[ShapeInfo] {
        &self.shapes
    }

    /// The sensor.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Gives the camera another film: another resolution, another window.
    pub fn set_film(&mut self, film: FilmSpec) -> Result<(), CameraError> {
        self.camera = self.camera.with_film(film)?;
        Ok(())
    }

    /// The smallest box around all surfaces; `None` without any.
    pub fn bounds(&self) -> Option<accel::Bounds> {
        self.tree.bounds()
    }

    /// Centre and radius of a sphere around all surfaces; radius 0 without any.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        (self.ball.center, self.ball.radius)
    }

    /// What the scene holds.
    pub fn counts(&self) -> SceneCounts {
        let quadrics = self.surfaces.quadrics();
        SceneCounts {
            shapes: self.shapes.len(),
            triangles: self.surfaces.len() - quadrics,
            quadrics,
            bsdfs: self.bsdfs.len(),
            emitters: self.emitters.list().len(),
        }
    }

    /// What that takes.
    pub fn memory(&self) -> SceneMemory {
        SceneMemory { accelerator: self.tree.memory(), surfaces: self.surfaces.memory(), emitters: self.emitters.memory() }
    }
}

/// Everything that can be wrong with the parts together.
fn check(shapes: &[Shape], bsdfs: &[Bsdf], emitters: &[Emitter]) -> Result<(), SceneError> {
    let mut primitives = 0;
    for shape in shapes {
        let name = || shape.name.clone();
        if shape.bsdf.0 as usize >= bsdfs.len() {
            return Err(SceneError::NoSuchBsdf { name: name(), bsdf: shape.bsdf.0, count: bsdfs.len() });
        }
        if let Geometry::Mesh(mesh) = &shape.geometry {
            mesh.check().map_err(|source| SceneError::Shape { name: name(), source })?;
            primitives += mesh.triangles.len();
        } else {
            primitives += 1;
        }
    }
    if primitives > surface::MOST {
        return Err(SceneError::TooLarge(primitives));
    }
    let environments = emitters.iter().filter(|e| e.kind() == EmitterKind::Infinite).count();
    if environments > 1 {
        return Err(SceneError::Environments(environments));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
