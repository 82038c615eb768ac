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
    let expected = |i: usize| match (!i.is_multiple_of(width.max(1)), i >= width) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;
    use std::io::Read;

    /// What the page's script does, written anew: the stored half floats of each pixel.
    fn unpacked(text: &str, width: usize) -> Vec<[f32; 3]> {
        let mut bytes = Vec::new();
        let stream = STANDARD.decode(text).expect("base64");
        flate2::read::ZlibDecoder::new(&stream[..]).read_to_end(&mut bytes).expect("a zlib stream");
        let count = bytes.len() / 6;
        let plane = |p: usize| {
            let mut plane: Vec<u16> = Vec::new();
            for i in 0..count {
                let residual = u16::from_le_bytes([bytes[2 * p * count + i], bytes[(2 * p + 1) * count + i]]);
                let left = (!i.is_multiple_of(width)).then(|| plane[i - 1]);
                let above = (i >= width).then(|| plane[i - width]);
                let expected = match (left, above) {
                    (Some(a), Some(b)) => a / 2 + b / 2 + (a & b & 1),
                    (a, b) => a.or(b).unwrap_or(0),
                };
                plane.push(residual.wrapping_add(expected));
            }
            plane
        };
        let value = |code: u16| f16::from_bits(if code & 0x8000 == 0 { !code } else { code & 0x7fff }).to_f32();
        let (green, red, blue) = (plane(0), plane(1), plane(2));
        (0..count).map(|i| [red[i].wrapping_add(green[i]), green[i], blue[i].wrapping_add(green[i])].map(value)).collect()
    }

    #[test]
    fn every_half_float_comes_back() {
        let halves: Vec<f32> = (0..=u16::MAX).map(|bits| f16::from_bits(bits).to_f32()).collect();
        let pixels = (0..65_536).map(|i| Rgb::new(halves[i], halves[(i * 7919) % 65_536], halves[65_535 - i])).collect();
        let picture = Picture::new(256, 256, pixels);
        for (pixel, found) in picture.pixels.iter().zip(unpacked(&pack(&picture, 0).text, 256)) {
            for (value, found) in pixel.to_array().iter().zip(found) {
                assert!(value.to_bits() == found.to_bits() || (value.is_nan() && found.is_nan()), "{value}: {found}");
            }
        }
    }

    #[test]
    fn patterns_ascend_with_values() {
        let mut values: Vec<f16> = (0..=u16::MAX).map(f16::from_bits).filter(|v| !v.is_nan()).collect();
        values.sort_by_key(|v| ascending(*v));
        assert!(values.windows(2).all(|pair| pair[0] <= pair[1]));
    }

    #[test]
    fn what_half_floats_cannot_say_is_counted_and_kept_in_sight() {
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        let pixels = [[nan, inf, 1e9], [0.0, -inf, 1e9], [1.0, -1e9, 65_519.0], [1.0, 65_504.0, -0.0]].map(Rgb::from).to_vec();
        let packed = pack(&Picture::new(2, 2, pixels), 0);
        assert_eq!((packed.nan, packed.infinite, packed.beyond), (1, 1, 1));
        let found = unpacked(&packed.text, 2);
        assert!(found[0][0].is_nan() && found[0][1] == inf && found[0][2] == 65_504.0);
        assert_eq!(found[1..3], [[0.0, -inf, 65_504.0], [1.0, -65_504.0, 65_504.0]]);
    }

    #[test]
    fn a_power_of_two_moves_values_without_loss() {
        let pixels: Vec<Rgb> = (1..=64).map(|i| Rgb::new(i as f32, 0.37 * i as f32, 1.0 / i as f32)).collect();
        let plain = Picture::new(8, 8, pixels.clone());
        let faint = Picture::new(8, 8, pixels.iter().map(|p| *p * 2.0_f32.powi(-100)).collect());
        assert_eq!(unpacked(&pack(&faint, 100).text, 8), unpacked(&pack(&plain, 0).text, 8));
    }

    #[test]
    fn no_pixel_is_no_mistake() {
        assert_eq!(unpacked(&pack(&Picture::new(0, 0, Vec::new()), 0).text, 1), Vec::<[f32; 3]>::new());
    }
}
