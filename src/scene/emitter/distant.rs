//! Light from infinity without an image: one direction, or the same radiance all around.

use super::EmitterError;
use crate::math::{Frame, Rgb};
use glam::Vec3;

/// Parallel light that fills all space.
#[derive(Clone, Copy, Debug)]
pub struct Directional {
    /// `n` is the unit direction in which light travels.
    pub(super) frame: Frame,
    /// Irradiance on a surface facing the light, W/m^2.
    pub(super) irradiance: Rgb,
}

impl Directional {
    /// Light travelling along `direction` (world space, any length but zero).
    pub fn new(direction: Vec3, irradiance: Rgb) -> Result<Self, EmitterError> {
        let direction = direction.try_normalize().ok_or(EmitterError::Singular("directional"))?;
        Ok(Self { frame: Frame::from_normal(direction), irradiance })
    }

    /// Unit direction in which light travels.
    pub fn direction(&self) -> Vec3 {
        self.frame.n
    }
}

/// The same radiance from every direction.
#[derive(Clone, Copy, Debug)]
pub struct Constant {
    /// Radiance, W/(m^2 sr).
    pub radiance: Rgb,
}
