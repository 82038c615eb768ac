//! Pictures as text that a browser unpacks without help: half floats, predicted from their neighbours, deflated, base64.

use crate::image::picture::Picture;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use half::f16;
use std::io::Write;

/// A picture as text, and what half floats cannot say of it.
pub(super) struct Packed {
    /// Base64 of the zlib stream.
    pub(super) text: String,
    /// Pixels with a NaN.
    pub(super) nan: usize,
    /// Pixels with an infinite component and no NaN.
    pub(super) infinite: usize,
    /// Pixels whose components are finite but for one that half floats cannot reach; it is stored as the largest they can.
    pub(super) beyond: usize,
}

/// Packs the components times `2^stops`.
///
/// Three planes follow each other: green, red less green, blue less green, each the low bytes of all its values and then the high bytes.
/// A value is the half float's pattern on a scale that ascends with the number ([`ascending`]), less the mean of its left and
/// upper neighbours in the same plane, all modulo 2^16.
pub(super) fn pack(picture: &Picture, stops: i32) -> Packed {
    let scale = (f64::from(stops)).exp2();
    let (mut nan, mut infinite, mut beyond) = (0, 0, 0);
    let mut planes: [Vec<u16>; 3] = std::array::from_fn(|_| Vec::with_capacity(picture.pixels.len()));
    for pixel in &picture.pixels {
        let components = pixel.to_array();
        let scaled = components.map(|v| half_of(f64::from(v) * scale));
        if components.iter().any(|v| v.is_nan()) {
            nan += 1;
        } else if components.iter().any(|v| v.is_infinite()) {
            infinite += 1;
        } else if scaled.iter().any(|(_, beyond)| *beyond) {
            beyond += 1;
        }
        let [red, green, blue] = scaled.map(|(half, _)| ascending(half));
        for (plane, value) in planes.iter_mut().zip([green, red.wrapping_sub(green), blue.wrapping_sub(green)]) {
            plane.push(value);
        }
    }
    let mut bytes = Vec::with_capacity(6 * picture.pixels.len());
    for plane in &planes {
        let left = residuals(plane, picture.width);
        bytes.extend(left.iter().map(|v| v.to_le_bytes()[0]));
        bytes.extend(left.iter().map(|v| v.to_le_bytes()[1]));
    }
    Packed { text: STANDARD.encode(deflated(&bytes)), nan, infinite, beyond }
}

/// The nearest half float, and whether a finite value had to become the largest one. There is one NaN.
fn half_of(value: f64) -> (f16, bool) {
    if value.is_nan() {
        return (f16::NAN, false);
    }
    let half = f16::from_f64(value);
    if half.is_infinite() && value.is_finite() { (f16::MAX.copysign(half), true) } else { (half, false) }
}

/// The pattern of a half float as a number that ascends with its value: neighbouring values have neighbouring patterns, also through zero.
fn ascending(half: f16) -> u16 {
    let bits = half.to_bits();
    if bits & 0x8000 == 0 { bits | 0x8000 } else { !bits }
}

/// Each value less what its left and upper neighbours let expect. Of noise the mean of two neighbours keeps less than either alone.
fn residuals(plane: &[u16], width: usize) -> Vec<u16> {
    let expected = |i: usize| match (i % width.max(1) > 0, i >= width) {
        (true, true) => ((u32::from(plane[i - 1]) + u32::from(plane[i - width])) / 2) as u16,
        (true, false) => plane[i - 1],
        (false, true) => plane[i - width],
        (false, false) => 0,
    };
    plane.iter().enumerate().map(|(i, value)| value.wrapping_sub(expected(i))).collect()
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(7));
    // Writing into memory does not fail.
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}
