//! Light sources: radiance seen, direct sampling from a point, and emission sampling of a ray.
//!
//! A surface emits from the side of its shading normal, as Mitsuba's does. The **emitting side** of a point is the side of the geometric
//! normal on which the shading normal lies; it emits into directions that are above both normals. All cosines and densities belong to
//! the geometric normal, so that every technique estimates the same integral on smooth-shaded lights too.

use super::EmitterId;
use super::hit::Endpoint;
use crate::math::{AreaPdf, Rgb, SolidAnglePdf};
use glam::Vec3;

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
    /// Cosine at the light between `-wi` and its geometric normal on the emitting side (positive); 1 where there is no surface.
    pub cos_light: f32,
    /// Radiance arriving along `-wi`, before visibility. For delta emitters the irradiance at normal incidence (`I/d^2`, or the directional
    /// emitter's irradiance), so that `f cos radiance / pdf` is the estimate for every kind.
    pub radiance: Rgb,
    /// Density of `wi` at the receiving point, the choice of emitter included; for delta emitters the choice's probability alone.
    pub pdf: SolidAnglePdf,
}

/// A point on a light, uniform by area, seen from nowhere yet.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Where it is; the geometric normal is turned to the emitting side.
    pub end: Endpoint,
    /// Shading normal.
    pub n_s: Vec3,
    /// Radiance into every direction above both normals.
    pub radiance: Rgb,
    /// Density of the point on its light.
    pub pdf: AreaPdf,
    /// Probability with which the light was chosen.
    pub pick: f32,
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
    /// Cosine at the light between `d` and its geometric normal on the emitting side (positive); 1 where there is no surface.
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
#[derive(Clone, Copy, Debug, Default)]
pub struct Emitted {
    /// Radiance towards the viewer.
    pub radiance: Rgb,
    /// Density with which direct sampling from the viewing point gives this direction, the choice of emitter included.
    pub pdf_direct: SolidAnglePdf,
}

/// Densities with which emission sampling would have drawn a position and a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EmissionPdf {
    /// As [`EmissionSample::pdf_position`].
    pub position: AreaPdf,
    /// As [`EmissionSample::pdf_direction`].
    pub direction: SolidAnglePdf,
}

/// Every light source. Adding one touches its own file, this list and one line of the loader's table.
#[derive(Clone, Debug)]
pub enum Emitter {
    /// A shape that shines; made by [`super::Scene::build`] from [`super::shape::Shape::radiance`].
    Area(Area),
    /// The same intensity in every direction from one position.
    Point(Point),
    /// A cone of light from one position.
    Spot(Spot),
    /// Parallel light.
    Directional(Directional),
    /// The same radiance from all around.
    Constant(Constant),
    /// An image of radiance from all around.
    Envmap(Envmap),
}

/// A light source that cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EmitterError {
    /// A spot's angles are out of order.
    #[error("a spot needs 0 < cutoff_angle <= 180 and 0 <= beam_width <= cutoff_angle; these are {cutoff_angle} and {beam_width} degrees")]
    SpotAngles {
        /// Half-angle of the cone, degrees.
        cutoff_angle: f32,
        /// Half-angle of full intensity, degrees.
        beam_width: f32,
    },
    /// The direction vanishes.
    #[error("the {0} emitter's direction is zero or not finite: check its direction or to_world")]
    Singular(&'static str),
    /// The image does not have the pixels it says, or too few of them.
    #[error("an envmap needs at least 2x2 pixels, {width}x{height} of them; found {found}")]
    EnvmapSize {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// Pixels given.
        found: usize,
    },
    /// The sphere of directions is stretched.
    #[error("an envmap's to_world must rotate, not stretch or shear")]
    EnvmapTransform,
    /// A pixel is negative or not finite.
    #[error("envmap pixel ({x}, {y}) is {value:?}: radiance must be finite and not negative")]
    EnvmapPixel {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// What it holds.
        value: [f32; 3],
    },
    /// Radiance, intensity or irradiance is negative or not finite.
    #[error("an emitter's {what} is {value:?}: it must be finite and not negative")]
    Value {
        /// What it is.
        what: &'static str,
        /// What it holds.
        value: [f32; 3],
    },
}

mod area;
mod distant;
mod envmap;
mod point;
mod spot;
mod table;

pub use area::Area;
pub use distant::{Constant, Directional};
pub use envmap::Envmap;
pub use point::Point;
pub use spot::Spot;
pub(super) use table::{Ball, Emitters};
