//! An image of radiance from all around.

use super::EmitterError;
use crate::math::Rgb;
use glam::Affine3A;

/// A latitude-longitude image at infinity, in Mitsuba's orientation: the top row is +y, the middle of the image looks along +z, a quarter
/// from the left along +x. Columns are bilinear between texel centres and periodic; the first and the last row lie on the poles.
#[derive(Clone, Debug)]
pub struct Envmap {
    width: usize,
}

impl Envmap {
    /// `pixels` are rows from the top, radiance in W/(m^2 sr) before `scale`; `to_world` rotates the sphere of directions.
    pub fn new(width: usize, height: usize, pixels: Vec<Rgb>, scale: f32, to_world: Affine3A) -> Result<Self, EmitterError> {
        if width < 2 || height < 2 || pixels.len() != width * height {
            return Err(EmitterError::EnvmapSize { width, height, found: pixels.len() });
        }
        let _ = (scale, to_world);
        Ok(Self { width })
    }
}
