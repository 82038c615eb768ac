//! Textures: colour or weight as a function of surface coordinates.

use crate::math::Rgb;
use glam::{Affine2, Vec2};

pub mod bitmap;

pub use bitmap::{Bitmap, Decoding, Filter, Texels, TextureError, Wrap};

/// A colour that may vary over the surface.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant(Rgb),
    /// An image.
    Bitmap(Box<Bitmap>),
    /// Two colours in squares.
    Checkerboard(Box<Checkerboard>),
}

/// Squares of side 1/2 in `to_uv uv`: `color0` in the one at the origin and along the diagonals, `color1` in between.
#[derive(Clone, Debug)]
pub struct Checkerboard {
    /// Colour of the square at the origin.
    pub color0: Rgb,
    /// The other colour.
    pub color1: Rgb,
    /// Applied to the surface's coordinates before all else.
    pub to_uv: Affine2,
}

impl Texture {
    /// The same grey everywhere.
    pub fn grey(value: f32) -> Self {
        Texture::Constant(Rgb::splat(value))
    }

    /// Value at texture coordinates `uv` (any real numbers).
    #[inline]
    pub fn eval(&self, uv: Vec2) -> Rgb {
        match self {
            Texture::Constant(c) => *c,
            Texture::Bitmap(b) => b.eval(uv),
            Texture::Checkerboard(c) => c.eval(uv),
        }
    }

    /// Value as one number: the luminance, which for a grey is the grey.
    #[inline]
    pub fn eval_1(&self, uv: Vec2) -> f32 {
        self.eval(uv).luminance()
    }

    /// Mean over the unit square of the texture's own coordinates (for a bitmap, over its texels).
    pub fn mean(&self) -> Rgb {
        match self {
            Texture::Constant(c) => *c,
            Texture::Bitmap(b) => b.texels.mean(),
            Texture::Checkerboard(c) => c.color0.lerp(c.color1, 0.5),
        }
    }

    /// Smallest and largest component anywhere.
    pub fn range(&self) -> (f32, f32) {
        let of = |c: Rgb| (c.r().min(c.g()).min(c.b()), c.max_component());
        match self {
            Texture::Constant(c) => of(*c),
            Texture::Bitmap(b) => b.texels.range(),
            Texture::Checkerboard(c) => {
                let ((a, b), (c, d)) = (of(c.color0), of(c.color1));
                (a.min(c), b.max(d))
            }
        }
    }
}

impl Checkerboard {
    #[inline]
    fn eval(&self, uv: Vec2) -> Rgb {
        let p = self.to_uv.transform_point2(uv);
        let far = (p - p.floor()).cmpgt(Vec2::splat(0.5));
        if far.x == far.y { self.color0 } else { self.color1 }
    }
}
