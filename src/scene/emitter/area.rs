//! A shape that shines.

use crate::scene::ShapeId;
use crate::scene::texture::Texture;

/// Radiance leaving a shape's emitting side, the same in all directions.
#[derive(Clone, Debug)]
pub struct Area {
    pub(in crate::scene) shape: ShapeId,
    pub(in crate::scene) radiance: Texture,
}

impl Area {
    /// The shape that shines.
    pub fn shape(&self) -> ShapeId {
        self.shape
    }

    /// Its radiance, W/(m^2 sr).
    pub fn radiance(&self) -> &Texture {
        &self.radiance
    }
}
