//! Light from one position: the same in every direction.

use crate::math::{Rgb, SolidAnglePdf, warp};
use glam::Vec3;
use std::f32::consts::PI;

/// A position that radiates the same intensity everywhere.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// World-space position.
    pub position: Vec3,
    /// Radiant intensity, W/sr.
    pub intensity: Rgb,
}

impl Point {
    /// Flux, W: the intensity over all directions.
    pub(super) fn power(&self) -> Rgb {
        self.intensity * (4.0 * PI)
    }

    /// Density of emitted directions.
    pub(super) fn pdf_direction(&self) -> SolidAnglePdf {
        warp::SPHERE_PDF
    }
}
