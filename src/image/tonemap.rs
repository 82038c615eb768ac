//! Pictures to look at: exposure, the sRGB curve, eight bits. Numbers are never taken from these.

use super::file::replace;
use super::picture::{ImageError, Picture};
use std::path::Path;

/// How scene units become display units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// The logarithmic mean of the lit pixels' luminance becomes 0.18 ([REINHARD02 (1), (2)], black pixels left out).
    FromImage,
    /// A factor of two to this power.
    Stops(f32),
}

impl Exposure {
    /// The factor for a picture.
    pub fn scale(self, picture: &Picture) -> f32 {
        match self {
            Exposure::Stops(stops) => stops.exp2(),
            Exposure::FromImage => {
                let lit = picture.pixels.iter().map(|p| p.luminance()).filter(|l| l.is_finite() && *l > 0.0);
                let (sum, count) = lit.fold((0.0_f64, 0_u64), |(sum, count), l| (sum + f64::from(l).ln(), count + 1));
                if count == 0 { 1.0 } else { (0.18 / (sum / count as f64).exp()) as f32 }
            }
        }
    }
}

/// The sRGB transfer curve \[IEC61966-2-1\], from linear `[0, 1]`; values outside are clamped, NaN is 0.
pub fn srgb(linear: f32) -> f32 {
    let v = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Writes a picture as an eight-bit PNG, replacing the file atomically.
pub fn write_png(path: &Path, picture: &Picture, exposure: Exposure) -> Result<(), ImageError> {
    use ::image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
    let scale = exposure.scale(picture);
    let byte = |v: f32| (srgb(v * scale) * 255.0 + 0.5) as u8;
    let bytes: Vec<u8> = picture.pixels.iter().flat_map(|p| p.to_array().map(byte)).collect();
    let too_big = |_| ImageError::content(path, "the picture is too large for PNG");
    let (width, height) = (u32::try_from(picture.width).map_err(too_big)?, u32::try_from(picture.height).map_err(too_big)?);
    replace(path, |w| {
        PngEncoder::new(w).write_image(&bytes, width, height, ExtendedColorType::Rgb8).map_err(|e| ImageError::content(path, e.to_string()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;

    #[test]
    fn srgb_meets_published_values() {
        for (linear, encoded) in
            [(0.0, 0.0), (0.0031308, 0.04045), (0.18, 0.461_356), (0.5, 0.735_357), (1.0, 1.0), (7.0, 1.0), (-1.0, 0.0)]
        {
            assert!((srgb(linear) - encoded).abs() < 1e-5, "{linear}: {}", srgb(linear));
        }
        assert_eq!(srgb(f32::NAN), 0.0);
    }

    #[test]
    fn exposure_comes_from_lit_pixels() {
        let picture = Picture::new(4, 1, vec![Rgb::splat(0.1), Rgb::splat(10.0), Rgb::BLACK, Rgb::splat(f32::NAN)]);
        assert!((Exposure::FromImage.scale(&picture) - 0.18).abs() < 1e-6);
        assert_eq!(Exposure::Stops(3.0).scale(&picture), 8.0);
        assert_eq!(Exposure::FromImage.scale(&Picture::new(1, 1, vec![Rgb::BLACK])), 1.0);
    }

    #[test]
    fn png_holds_the_encoded_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let picture = Picture::new(2, 1, vec![Rgb::new(0.5, 0.0, 2.0), Rgb::new(0.18, f32::NAN, 1.0)]);
        write_png(&path, &picture, Exposure::Stops(0.0)).expect("written");
        let read = ::image::open(&path).expect("a PNG").to_rgb8();
        assert_eq!(read.dimensions(), (2, 1));
        assert_eq!(read.into_raw(), [188, 0, 255, 118, 0, 255]);
    }
}
