//! Pictures for the page: small ones to look at, crops pixel by pixel, maps in false colour.

use super::ReportError;
use crate::image::picture::Picture;
use crate::image::tonemap::srgb;
use crate::math::Rgb;
use crate::study::viewer::Rectangle;
use base64::Engine;
use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};

/// Longest side of an overview and of a map, pixels.
const OVERVIEW: usize = 384;
const MAP: usize = 256;

/// Steps of colour in a map.
const STEPS: u8 = 48;

/// What a page asks of a window.
impl Rectangle {
    /// Whether it lies inside a picture.
    pub(super) fn fits(&self, (width, height): (usize, usize)) -> bool {
        let ends = self.x.checked_add(self.width).zip(self.y.checked_add(self.height));
        self.width > 0 && self.height > 0 && ends.is_some_and(|(x, y)| x <= width && y <= height)
    }

    fn meets(&self, other: &Rectangle) -> bool {
        self.x < other.x + other.width && other.x < self.x + self.width && self.y < other.y + other.height && other.y < self.y + self.height
    }

    /// Indices of its pixels, row by row.
    fn pixels(&self, width: usize) -> impl Iterator<Item = usize> + use<> {
        let Rectangle { x, y, width: w, height: h } = *self;
        (y..y + h).flat_map(move |row| (x..x + w).map(move |column| row * width + column))
    }
}

/// The part of a picture inside a window that fits.
pub(super) fn crop(picture: &Picture, window: &Rectangle) -> Picture {
    Picture::new(window.width, window.height, window.pixels(picture.width).map(|i| picture.pixels[i]).collect())
}

/// Means over squares of `factor` x `factor` pixels; ragged edges make smaller ones.
pub(super) fn shrink(picture: &Picture, factor: usize) -> Picture {
    let (width, height) = (picture.width.div_ceil(factor), picture.height.div_ceil(factor));
    let mean = |i: usize| {
        let (x, y) = (i % width * factor, i / width * factor);
        let window = Rectangle { x, y, width: factor.min(picture.width - x), height: factor.min(picture.height - y) };
        let sum: Rgb = window.pixels(picture.width).map(|p| picture.pixels[p]).sum();
        sum / (window.width * window.height) as f32
    };
    Picture::new(width, height, (0..width * height).map(mean).collect())
}

/// Eight-bit values at an exposure.
fn bytes(picture: &Picture, scale: f32) -> Vec<u8> {
    picture.pixels.iter().flat_map(|p| p.to_array().map(|v| (srgb(v * scale) * 255.0 + 0.5) as u8)).collect()
}

/// An overview as a data URI, at most [`OVERVIEW`] pixels wide or high.
pub(super) fn overview(picture: &Picture, scale: f32) -> Result<String, ReportError> {
    let small = shrink(picture, picture.width.max(picture.height).div_ceil(OVERVIEW).max(1));
    let mut file = Vec::new();
    encode(JpegEncoder::new_with_quality(&mut file, 90), &bytes(&small, scale), small.size())?;
    Ok(uri("image/jpeg", &file))
}

/// A crop as a data URI, without loss.
pub(super) fn exact(picture: &Picture, scale: f32) -> Result<String, ReportError> {
    png(&bytes(picture, scale), picture.size())
}

fn png(bytes: &[u8], size: (usize, usize)) -> Result<String, ReportError> {
    let mut file = Vec::new();
    encode(PngEncoder::new(&mut file), bytes, size)?;
    Ok(uri("image/png", &file))
}

fn encode(encoder: impl ImageEncoder, bytes: &[u8], (width, height): (usize, usize)) -> Result<(), ReportError> {
    let (width, height) = sides(width, height)?;
    encoder
        .write_image(bytes, width, height, ExtendedColorType::Rgb8)
        .map_err(|error| ReportError::Picture { message: format!("a picture cannot be encoded: {error}") })
}

fn sides(width: usize, height: usize) -> Result<(u32, u32), ReportError> {
    let too_large = |_| ReportError::Picture { message: format!("{width}x{height} pixels are too many for a web page") };
    Ok((u32::try_from(width).map_err(too_large)?, u32::try_from(height).map_err(too_large)?))
}

fn uri(kind: &str, file: &[u8]) -> String {
    format!("data:{kind};base64,{}", base64::engine::general_purpose::STANDARD.encode(file))
}

/// Positive values in false colour, `low` to `high` on a logarithmic scale; what is not finite is magenta, zero is the lowest colour.
pub(super) fn false_colour(values: &[f32], (width, height): (usize, usize), low: f64, high: f64) -> Result<String, ReportError> {
    let factor = width.max(height).div_ceil(MAP).max(1);
    let small = shrink(&Picture::new(width, height, values.iter().map(|v| Rgb::splat(*v)).collect()), factor);
    let index = |p: &Rgb| {
        let v = f64::from(p.r());
        if v.is_finite() { step((v.max(low) / low).ln() / (high / low).ln()) } else { STEPS }
    };
    indexed(&small.pixels.iter().map(index).collect::<Vec<u8>>(), small.size())
}

/// Step of the scale at a place of it, 0 to 1.
fn step(place: f64) -> u8 {
    (place.clamp(0.0, 1.0) * f64::from(STEPS - 1)).round() as u8
}

/// Colours of the steps; the last, beyond them, is for what is not finite.
fn palette() -> Vec<u8> {
    let colour = |i: u8| ViridisRGB.get_color(f32::from(i) / f32::from(STEPS - 1));
    let steps = (0..STEPS).map(colour).flat_map(|c| [c.0, c.1, c.2]);
    steps.chain([255, 0, 255]).collect()
}

/// Indices of the palette as a data URI.
fn indexed(indices: &[u8], (width, height): (usize, usize)) -> Result<String, ReportError> {
    let failed = |error: png::EncodingError| ReportError::Picture { message: format!("a map cannot be encoded: {error}") };
    let (width, height) = sides(width, height)?;
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette());
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::NoFilter);
    encoder.write_header().and_then(|mut writer| writer.write_image_data(indices)).map_err(failed)?;
    Ok(uri("image/png", &file))
}

/// The scale as a data URI.
pub(super) fn scale_bar() -> Result<String, ReportError> {
    indexed(&(0..STEPS).collect::<Vec<u8>>(), (usize::from(STEPS), 1))
}

/// The two windows, a fifth of the picture wide, where a map is largest on average, the second apart from the first.
pub(super) fn worst_windows(map: &[f32], (width, height): (usize, usize)) -> Vec<Rectangle> {
    let side = (width.min(height) / 4).max(1);
    let step = (side / 2).max(1);
    let places = |extent: usize| (0..=extent.saturating_sub(side)).step_by(step);
    let mut windows: Vec<(f64, Rectangle)> = Vec::new();
    for y in places(height) {
        for x in places(width) {
            let window = Rectangle { x, y, width: side, height: side };
            // A root damps fireflies, so that one pixel does not choose the window.
            let sum: f64 = window.pixels(width).map(|i| f64::from(map[i])).filter(|v| v.is_finite()).map(f64::sqrt).sum();
            windows.push((sum, window));
        }
    }
    windows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<Rectangle> = Vec::new();
    for (_, window) in windows {
        if chosen.len() < 2 && chosen.iter().all(|c| !c.meets(&window)) {
            chosen.push(window);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_find_the_error_and_stay_apart() {
        let mut map = vec![0.0; 64 * 64];
        for (x, y) in [(10, 12), (50, 50)] {
            for i in 0..64 {
                map[(y + i / 8) * 64 + x + i % 8] = 1.0;
            }
        }
        let windows = worst_windows(&map, (64, 64));
        assert_eq!(windows.len(), 2);
        assert!(!windows[0].meets(&windows[1]));
        let holds = |x: usize, y: usize| windows.iter().any(|w| w.x <= x && x < w.x + w.width && w.y <= y && y < w.y + w.height);
        assert!(holds(14, 15) && holds(54, 54), "{windows:?}");
    }

    #[test]
    fn shrinking_keeps_the_mean() {
        let picture = Picture::new(5, 3, (0..15).map(|i| Rgb::splat(i as f32)).collect());
        let small = shrink(&picture, 2);
        assert_eq!(small.size(), (3, 2));
        assert_eq!(small.pixels[0], Rgb::splat(3.0));
        assert_eq!(small.pixels[5], Rgb::splat(14.0));
    }

    #[test]
    fn pictures_become_files_in_the_page() {
        let picture = Picture::new(2, 2, vec![Rgb::splat(0.5), Rgb::splat(f32::NAN), Rgb::BLACK, Rgb::WHITE]);
        assert!(exact(&picture, 1.0).expect("encoded").starts_with("data:image/png;base64,iVBOR"));
        assert!(overview(&picture, 1.0).expect("encoded").starts_with("data:image/jpeg;base64,/9j/"));
        assert!(false_colour(&[0.0, 1.0, f32::NAN, f32::INFINITY], (2, 2), 0.01, 10.0).is_ok());
        assert_eq!((step(-1.0), step(0.0), step(1.0), step(7.0)), (0, 0, STEPS - 1, STEPS - 1));
        assert_eq!(palette().len(), 3 * (usize::from(STEPS) + 1));
    }
}
