//! The sensor: rays through the film, importance, and connections to it.

use super::hit::Endpoint;
use super::ray::Ray;
use crate::math::SolidAnglePdf;
use glam::{Vec2, Vec3};

/// A connection from a point of the scene to the camera.
#[derive(Clone, Copy, Debug)]
pub struct CameraConnection {
    /// Film position, in pixels of the film rendered (the crop window if there is one): pixel `i` spans `[i, i+1)`.
    pub film: Vec2,
    /// The point on the lens.
    pub end: Endpoint,
    /// Unit direction from the point towards the lens.
    pub wo: Vec3,
    /// Squared distance to the lens.
    pub distance2: f32,
    /// Density per steradian of the camera's own rays through **one given pixel** in direction `-wo`: `D^2/cos^3`, `D` the image plane's
    /// distance at which a pixel has unit area ([VCM-TR], theory C.3). Also the importance of one pixel for this direction
    /// over `cos` at the lens, so a splat weighs `throughput f pdf_pixel cos_surface / distance2 / N`.
    pub pdf_pixel: SolidAnglePdf,
}

/// A camera ray.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// Starts at the near plane, ends at the far plane; unit direction.
    pub ray: Ray,
    /// The point on the lens (or the pinhole).
    pub end: Endpoint,
    /// Distance from the lens to the ray's start, along the ray: camera path lengths count from the lens.
    pub start: f32,
    /// As [`CameraConnection::pdf_pixel`], for this ray.
    pub pdf_pixel: SolidAnglePdf,
}
