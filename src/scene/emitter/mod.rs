//! Light sources: radiance seen, direct sampling from a point, and emission sampling of a ray.

use super::EmitterId;
use super::hit::{Endpoint, Hit};
use crate::math::{AreaPdf, Rgb, SolidAnglePdf};
use glam::{Vec2, Vec3};

/// What kind of technique can reach an emitter, for MIS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmitterKind {
    /// On a surface: can be hit and connected to.
    Surface,
    /// A position in space with no area (point, spot): can be connected to only.
    DeltaPosition,
    /// A single direction from infinity (directional): can be connected to only.
    DeltaDirection,
    /// All around the scene (constant, envmap): can be reached by escaping rays and by connection.
    Infinite,
}

/// A light sample as seen from a point.
#[derive(Clone, Copy, Debug)]
pub struct DirectSample {
    /// The emitter chosen.
    pub emitter: EmitterId,
    /// Its kind.
    pub kind: EmitterKind,
    /// Unit direction towards the light, world space.
    pub wi: Vec3,
    /// Where it is; for emitters at infinity a point outside the scene along `wi` that a shadow ray may aim at.
    pub end: Endpoint,
    /// Distance to it; infinite for emitters at infinity.
    pub distance: f32,
    /// Cosine at the light between its shading normal and `-wi` (positive: the emitting side); 1 where there is no surface.
    pub cos_light: f32,
    /// Radiance arriving along `-wi`, before visibility. For delta emitters the irradiance at normal incidence (`I/d^2`, or the directional
    /// emitter's irradiance), so that `f cos radiance / pdf` is the estimate for every kind.
    pub radiance: Rgb,
    /// Density of `wi` at the receiving point, the choice of emitter included; for delta emitters the choice's probability alone.
    pub pdf: SolidAnglePdf,
}

/// A ray of light leaving an emitter.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// The emitter chosen.
    pub emitter: EmitterId,
    /// Its kind.
    pub kind: EmitterKind,
    /// Where the ray starts: on the light, or for emitters at infinity on a disk outside the scene.
    pub end: Endpoint,
    /// Unit direction of travel.
    pub d: Vec3,
    /// Cosine at the light between its shading normal and `d`; 1 where there is no surface.
    pub cos_light: f32,
    /// Flux of this sample: `Le cos / (pdf_position pdf_direction)`, the choice of emitter included. Its mean over samples is the
    /// power of all emitters.
    pub flux: Rgb,
    /// Density of the position, the choice of emitter included: per area (for infinite emitters on the disk); for delta positions the
    /// choice's probability alone.
    pub pdf_position: AreaPdf,
    /// Density of the direction given the position; 1 for a delta direction.
    pub pdf_direction: SolidAnglePdf,
}

/// Radiance of an emitter seen along a ray, with the densities other techniques would have had.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    /// Radiance towards the viewer.
    pub radiance: Rgb,
    /// Density with which direct sampling from the viewing point gives this direction, the choice of emitter included.
    pub pdf_direct: SolidAnglePdf,
}

// To be written here: enum Emitter, its files, and the `Emitters` table with a power-weighted choice.
const _: fn(&Hit, Vec2) = |_, _| ();
