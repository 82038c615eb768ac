//! Textures: colour or weight as a function of surface coordinates.

use crate::math::Rgb;
use glam::Vec2;

/// A colour that may vary over the surface.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant(Rgb),
}

impl Texture {
    /// Value at texture coordinates `uv` (any real numbers).
    pub fn eval(&self, uv: Vec2) -> Rgb {
        let _ = uv;
        match self {
            Texture::Constant(c) => *c,
        }
    }
}
