//! Images as textures.

use crate::math::Rgb;
use glam::{Affine2, Vec2};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How values between texel centres are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// Bilinear between the four nearest texel centres.
    #[default]
    Bilinear,
    /// The texel the point lies in.
    Nearest,
}

/// What lies outside the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image mirrored, then again.
    Mirror,
    /// The nearest texel of the border.
    Clamp,
}

/// What the numbers in a file with 8 or 16 bits a channel mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Decoding {
    /// Colours by the sRGB transfer function.
    #[default]
    Srgb,
    /// Linear values: weights, or data that is not colour (`raw` in a scene).
    Raw,
}

/// Why a texture could not be had.
#[derive(Debug, thiserror::Error)]
pub enum TextureError {
    /// The file could not be opened or read.
    #[error("texture {}: {source}; check the path, which is relative to the scene file", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// An image's texels, shared by every texture that uses it.
#[derive(Debug)]
pub struct Texels {
    size: [usize; 2],
}

/// An image placed on the surface.
#[derive(Clone, Debug)]
pub struct Bitmap {
    /// The image.
    pub texels: Arc<Texels>,
    /// Between texel centres.
    pub filter: Filter,
    /// Outside the unit square.
    pub wrap: Wrap,
    /// Applied to the surface's coordinates before all else.
    pub to_uv: Affine2,
}

impl Texels {
    /// Reads a PNG, JPEG or OpenEXR file; `decoding` says what 8-bit and 16-bit values mean (an EXR is always linear).
    pub fn load(path: &Path, decoding: Decoding) -> Result<Self, TextureError> {
        let _ = decoding;
        Err(TextureError::Read { path: path.into(), source: std::io::ErrorKind::Unsupported.into() })
    }

    /// Width and height in texels.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Mean over all texels.
    pub fn mean(&self) -> Rgb {
        Rgb::BLACK
    }

    /// Smallest and largest component of any texel.
    pub fn range(&self) -> (f32, f32) {
        (0.0, 0.0)
    }
}

impl Bitmap {
    #[inline]
    pub(super) fn eval(&self, _uv: Vec2) -> Rgb {
        Rgb::BLACK
    }
}
