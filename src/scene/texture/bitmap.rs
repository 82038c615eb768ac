//! Images as textures.

use crate::math::Rgb;
use glam::{Affine2, Vec2};
use image::DynamicImage;
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

/// Texels, row by row from the top.
#[derive(Debug)]
enum Data {
    /// Eight bits a channel and what they mean: a quarter of the memory of floats, and the table stays in the cache.
    Bytes {
        texels: Vec<[u8; 3]>,
        decoded: Box<[f32; 256]>,
    },
    Floats(Vec<Rgb>),
}

/// An image's texels, shared by every texture that uses it.
#[derive(Debug)]
pub struct Texels {
    size: [usize; 2],
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
        let data = if eight_bits {
            let decoded = Box::new(std::array::from_fn(|i| decode(i as f32 / 255.0, decoding)));
            Data::Bytes { texels: image.into_rgb8().pixels().map(|p| p.0).collect(), decoded }
        } else {
            Data::Floats(image.into_rgb32f().pixels().map(|p| Rgb::from(p.0).map(|v| decode(v, decoding))).collect())
        };
        Self::checked(path, size, data)
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
        Self::checked(path, [layer.size.width(), layer.size.height()], Data::Floats(texels))
    }

    /// Linear texels, row by row from the top, that did not come from a file.
    ///
    /// # Panics
    ///
    /// If their number is not `size[0] * size[1]`, or zero.
    pub fn from_linear(size: [usize; 2], texels: Vec<Rgb>) -> Self {
        assert!(texels.len() == size[0] * size[1] && !texels.is_empty(), "{} texels for {} x {}", texels.len(), size[0], size[1]);
        Self::summarised(size, Data::Floats(texels))
    }

    fn checked(path: &Path, size: [usize; 2], data: Data) -> Result<Self, TextureError> {
        let content = |what: String| TextureError::Content { path: path.into(), what };
        let n = match &data {
            Data::Bytes { texels, .. } => texels.len(),
            Data::Floats(texels) => texels.len(),
        };
        if n == 0 || n != size[0] * size[1] {
            return Err(content(format!("has {n} texels for its size, {} x {}", size[0], size[1])));
        }
        if let Data::Floats(texels) = &data
            && let Some(i) = texels.iter().position(|c| !c.is_finite())
        {
            return Err(content(format!("the texel in column {}, row {} is not finite", i % size[0], i / size[0])));
        }
        Ok(Self::summarised(size, data))
    }

    fn summarised(size: [usize; 2], data: Data) -> Self {
        let mut texels = Self { size, data, mean: Rgb::BLACK, range: (f32::INFINITY, f32::NEG_INFINITY) };
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
            Data::Bytes { texels, .. } => size_of_val(texels.as_slice()),
            Data::Floats(texels) => size_of_val(texels.as_slice()),
        }
    }

    /// The texel in column `x` and row `y`, both within the image.
    #[inline(always)]
    fn at(&self, x: usize, y: usize) -> Rgb {
        let i = y * self.size[0] + x;
        match &self.data {
            Data::Bytes { texels, decoded } => Rgb::from(texels[i].map(|v| decoded[v as usize])),
            Data::Floats(texels) => texels[i],
        }
    }
}

impl Bitmap {
    /// The index of a texel that the wrap mode puts at `i`.
    #[inline(always)]
    fn wrapped(&self, i: i64, n: usize) -> usize {
        let count = n as i64;
        let i = match self.wrap {
            Wrap::Repeat => i.rem_euclid(count),
            Wrap::Mirror => {
                let i = i.rem_euclid(2 * count);
                i.min(2 * count - 1 - i)
            }
            Wrap::Clamp => i.clamp(0, count - 1),
        };
        i as usize
    }

    #[inline]
    pub(super) fn eval(&self, uv: Vec2) -> Rgb {
        let t = &*self.texels;
        let [width, height] = t.size;
        let p = self.to_uv.transform_point2(uv) * Vec2::new(width as f32, height as f32);
        if self.filter == Filter::Nearest {
            let i = p.floor();
            return t.at(self.wrapped(i.x as i64, width), self.wrapped(i.y as i64, height));
        }
        // Texel centres lie at half-integers.
        let p = p - 0.5;
        let (low, f) = (p.floor(), p - p.floor());
        let (x0, y0) = (low.x as i64, low.y as i64);
        let (x0, x1) = (self.wrapped(x0, width), self.wrapped(x0.saturating_add(1), width));
        let (y0, y1) = (self.wrapped(y0, height), self.wrapped(y0.saturating_add(1), height));
        t.at(x0, y0).lerp(t.at(x1, y0), f.x).lerp(t.at(x0, y1).lerp(t.at(x1, y1), f.x), f.y)
    }
}
