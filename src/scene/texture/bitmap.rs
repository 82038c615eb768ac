//! Images as textures.

use super::tiles::Tiles;
use crate::math::Rgb;
use glam::{Affine2, Vec2};
use image::DynamicImage;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use wide::f32x4;

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

/// What the numbers in a PNG or JPEG file mean.
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
    /// The file is not an image of the kind its name says, or is damaged.
    #[error("texture {}: {source}; PNG, JPEG and OpenEXR files can be used", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        source: image::ImageError,
    },
    /// The EXR file is damaged or lacks colour channels.
    #[error("texture {}: {source}; an OpenEXR texture needs a layer with channels R, G, B or Y", path.display())]
    Exr {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        source: exr::error::Error,
    },
    /// The image has no texels, or a number that is not finite.
    #[error("texture {}: {what}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

#[derive(Debug)]
enum Data {
    /// Eight bits a channel and what they mean: a quarter of the memory of floats, and the table stays in the cache.
    Bytes {
        texels: Tiles<[u8; 3]>,
        decoded: Box<[f32; 256]>,
    },
    Floats(Tiles<Rgb>),
}

/// Most texels a side: up to here single precision counts them, and what is next to them, exactly.
const MOST: usize = 1 << 22;

/// An image's texels, shared by every texture that uses it.
#[derive(Debug)]
pub struct Texels {
    size: [usize; 2],
    /// The size again, as coordinates are multiplied by it.
    extent: Vec2,
    data: Data,
    mean: Rgb,
    range: (f32, f32),
}

/// An image placed on the surface: `u` runs along its rows, `v` down its columns, and (0, 0) is the corner of its first texel.
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

/// The sRGB transfer function, from encoded to linear (\[SRGB\]).
fn srgb_to_linear(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn decode(v: f32, decoding: Decoding) -> f32 {
    match decoding {
        Decoding::Srgb => srgb_to_linear(v),
        Decoding::Raw => v,
    }
}

impl Texels {
    /// Reads a PNG, JPEG or OpenEXR file, grey or colour; alpha is left out. `decoding` says what the numbers of the first two mean
    /// (an EXR is always linear).
    pub fn load(path: &Path, decoding: Decoding) -> Result<Self, TextureError> {
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
            return Self::load_exr(path);
        }
        let reader = image::ImageReader::open(path)
            .and_then(image::ImageReader::with_guessed_format)
            .map_err(|source| TextureError::Read { path: path.into(), source })?;
        let image = reader.decode().map_err(|source| TextureError::Decode { path: path.into(), source })?;
        let size = [image.width() as usize, image.height() as usize];
        let eight_bits = matches!(
            image,
            DynamicImage::ImageLuma8(_) | DynamicImage::ImageLumaA8(_) | DynamicImage::ImageRgb8(_) | DynamicImage::ImageRgba8(_)
        );
        if eight_bits {
            let decoded = Box::new(std::array::from_fn(|i| decode(i as f32 / 255.0, decoding)));
            let texels: Vec<[u8; 3]> = image.into_rgb8().pixels().map(|p| p.0).collect();
            check_size(path, size, texels.len())?;
            return Ok(Self::summarised(size, Data::Bytes { texels: Tiles::new(size, &texels), decoded }));
        }
        Self::from_floats(path, size, image.into_rgb32f().pixels().map(|p| Rgb::from(p.0).map(|v| decode(v, decoding))).collect())
    }

    fn load_exr(path: &Path) -> Result<Self, TextureError> {
        use exr::prelude::*;
        let failed = |source| match source {
            Error::Io(source) => TextureError::Read { path: path.into(), source },
            source => TextureError::Exr { path: path.into(), source },
        };
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(path)
            .map_err(failed)?;
        let layer = &image.layer_data;
        let channel = |names: &[&str]| layer.channel_data.list.iter().find(|c| names.iter().any(|n| c.name.eq_case_insensitive(n)));
        let grey = channel(&["Y", "L"]);
        let (Some(r), Some(g), Some(b)) = (channel(&["R"]).or(grey), channel(&["G"]).or(grey), channel(&["B"]).or(grey)) else {
            let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
            let what = format!("has channels {}, but a texture needs R, G, B or Y", names.join(", "));
            return Err(TextureError::Content { path: path.into(), what });
        };
        let values = |c: &AnyChannel<FlatSamples>| c.sample_data.values_as_f32().collect::<Vec<f32>>();
        let (r, g, b) = (values(r), values(g), values(b));
        let texels = r.into_iter().zip(g).zip(b).map(|((r, g), b)| Rgb::new(r, g, b)).collect();
        Self::from_floats(path, [layer.size.width(), layer.size.height()], texels)
    }

    /// Linear texels, row by row from the top, that did not come from a file.
    ///
    /// # Panics
    ///
    /// If their number is not `size[0] * size[1]`, or zero, or a side is longer than 2^22.
    pub fn from_linear(size: [usize; 2], texels: Vec<Rgb>) -> Self {
        assert!(texels.len() == size[0] * size[1] && !texels.is_empty(), "{} texels for {} x {}", texels.len(), size[0], size[1]);
        assert!(size[0].max(size[1]) <= MOST, "{} x {} texels", size[0], size[1]);
        Self::summarised(size, Data::Floats(Tiles::new(size, &texels)))
    }

    fn from_floats(path: &Path, size: [usize; 2], texels: Vec<Rgb>) -> Result<Self, TextureError> {
        check_size(path, size, texels.len())?;
        if let Some(i) = texels.iter().position(|c| !c.is_finite()) {
            let what = format!("the texel in column {}, row {} is not finite", i % size[0], i / size[0]);
            return Err(TextureError::Content { path: path.into(), what });
        }
        Ok(Self::summarised(size, Data::Floats(Tiles::new(size, &texels))))
    }

    fn summarised(size: [usize; 2], data: Data) -> Self {
        let extent = Vec2::new(size[0] as f32, size[1] as f32);
        let mut texels = Self { size, extent, data, mean: Rgb::BLACK, range: (f32::INFINITY, f32::NEG_INFINITY) };
        let mut sum = [0.0f64; 3];
        for y in 0..size[1] {
            for x in 0..size[0] {
                for (sum, v) in sum.iter_mut().zip(texels.at(x, y).to_array()) {
                    *sum += f64::from(v);
                    texels.range = (texels.range.0.min(v), texels.range.1.max(v));
                }
            }
        }
        let n = (size[0] * size[1]) as f64;
        texels.mean = Rgb::from(sum.map(|s| (s / n) as f32));
        texels
    }

    /// Width and height in texels.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Mean over all texels.
    pub fn mean(&self) -> Rgb {
        self.mean
    }

    /// Smallest and largest component of any texel.
    pub fn range(&self) -> (f32, f32) {
        self.range
    }

    /// Bytes of texels held.
    pub fn memory(&self) -> usize {
        match &self.data {
            Data::Bytes { texels, .. } => texels.memory(),
            Data::Floats(texels) => texels.memory(),
        }
    }

    /// The texel in column `x` and row `y`, both within the image.
    fn at(&self, x: usize, y: usize) -> Rgb {
        match &self.data {
            Data::Bytes { texels, decoded } => linear(texels.at(x, y), decoded),
            Data::Floats(texels) => texels.at(x, y),
        }
    }
}

#[inline(always)]
fn linear(texel: [u8; 3], decoded: &[f32; 256]) -> Rgb {
    let [r, g, b] = texel;
    Rgb::new(decoded[usize::from(r)], decoded[usize::from(g)], decoded[usize::from(b)])
}

fn check_size(path: &Path, size: [usize; 2], count: usize) -> Result<(), TextureError> {
    let what = if count == 0 || count != size[0] * size[1] {
        format!("has {count} texels for its size, {} x {}", size[0], size[1])
    } else if size[0].max(size[1]) > MOST {
        format!("is {} x {} texels; a side may have {MOST} at most", size[0], size[1])
    } else {
        return Ok(());
    };
    Err(TextureError::Content { path: path.into(), what })
}

/// `a` modulo `period`, in [0, period), exactly; all are integers, and the period is at most 2^23.
#[inline(always)]
fn modulo(a: f32x4, period: f32x4) -> f32x4 {
    // Up to here no rounding lifts a quotient to the next integer, and the product is exact. Few coordinates lie farther out.
    let near = a.abs().simd_le(f32x4::splat((1 << 23) as f32)).all();
    let a = if near { a } else { remainder(a, period) };
    a - period * (a / period).floor()
}

#[cold]
fn remainder(a: f32x4, period: f32x4) -> f32x4 {
    let (a, period) = (a.to_array(), period.to_array());
    f32x4::new(std::array::from_fn(|i| a[i] % period[i]))
}

impl Bitmap {
    /// The columns (first, third) and rows (second, fourth) of texels that the wrap mode puts at these integers.
    #[inline(always)]
    fn wrapped(&self, i: [f32; 4]) -> [usize; 4] {
        let (i, n) = (f32x4::new(i), self.texels.extent);
        let n = f32x4::new([n.x, n.y, n.x, n.y]);
        let last = n - 1.0;
        let i = match self.wrap {
            Wrap::Repeat => modulo(i, n),
            Wrap::Mirror => {
                let i = modulo(i, n + n);
                i.fast_min(n + last - i)
            }
            Wrap::Clamp => i.fast_max(f32x4::ZERO),
        };
        // What is not a number becomes the last texel too; its weights are not numbers either.
        i.fast_min(last).fast_trunc_int().to_array().map(|i| i as usize)
    }

    /// Columns and rows `[x0, y0, x1, y1]` of the texels around a point, and how far it lies from the first to the last of each.
    #[inline(always)]
    fn around(&self, uv: Vec2) -> ([usize; 4], Vec2) {
        let p = self.to_uv.transform_point2(uv) * self.texels.extent;
        if self.filter == Filter::Nearest {
            let i = p.floor();
            return (self.wrapped([i.x, i.y, i.x, i.y]), Vec2::ZERO);
        }
        // Texel centres lie at half-integers.
        let p = p - 0.5;
        let low = p.floor();
        (self.wrapped([low.x, low.y, low.x + 1.0, low.y + 1.0]), p - low)
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2) -> Rgb {
        let (corners, f) = self.around(uv);
        match &self.texels.data {
            Data::Bytes { texels, decoded } => bilinear(corners, f, |x, y| linear(texels.at(x, y), decoded)),
            Data::Floats(texels) => bilinear(corners, f, |x, y| texels.at(x, y)),
        }
    }

    #[inline]
    pub(super) fn prefetch(&self, uv: Vec2) {
        let (corners, _) = self.around(uv);
        match &self.texels.data {
            Data::Bytes { texels, .. } => texels.prefetch(corners),
            Data::Floats(texels) => texels.prefetch(corners),
        }
    }
}

#[inline(always)]
fn bilinear([x0, y0, x1, y1]: [usize; 4], f: Vec2, texel: impl Fn(usize, usize) -> Rgb) -> Rgb {
    texel(x0, y0).lerp(texel(x1, y0), f.x).lerp(texel(x0, y1).lerp(texel(x1, y1), f.x), f.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against whole numbers, at the places where a rounded quotient would slip first: around multiples of the period.
    #[test]
    fn moduli_are_exact() {
        for period in [1i64, 2, 3, 5, 7, 512, 894, 1200, 1599, 1600, 65_537, 4_194_303, 8_388_607, 8_388_608] {
            let multiples = (-40..40).chain((-(1i64 << 23) / period - 2..).take(5)).chain(((1i64 << 23) / period - 2..).take(5));
            for i in multiples.flat_map(|m| (-2..3).map(move |d| m * period + d)).filter(|i| (*i as f32) as i64 == *i) {
                let found = modulo(f32x4::splat(i as f32), f32x4::splat(period as f32));
                assert_eq!(found, f32x4::splat(i.rem_euclid(period) as f32), "{i} modulo {period}");
            }
        }
        let far = [1e30, -1e30, 3e9, f32::MIN];
        let exact = far.map(|a| f64::from(a).rem_euclid(894.0) as f32);
        assert_eq!(modulo(f32x4::new(far), f32x4::splat(894.0)).to_array(), exact);
    }
}
