//! Maps of errors as colours: a ramp for how much, red and green for which way.

use super::picture::Picture;

/// The colour of a pixel without a value (NaN); on neither ramp.
pub const MASKED: [u8; 3] = [0, 128, 255];

/// matplotlib's `inferno` (CC0) at every 15th of its 256 places; between them, linear interpolation is off by at most 6 of 255.
const INFERNO: [[u8; 3]; 18] = [
    [0, 0, 4],
    [10, 7, 34],
    [30, 12, 69],
    [56, 9, 98],
    [81, 14, 108],
    [105, 22, 110],
    [128, 31, 108],
    [152, 39, 102],
    [176, 49, 91],
    [198, 61, 77],
    [217, 77, 61],
    [233, 97, 43],
    [244, 121, 24],
    [250, 148, 7],
    [252, 176, 20],
    [248, 205, 55],
    [242, 234, 105],
    [252, 255, 164],
];

/// Full strength of too dark and of too bright.
const TOO_DARK: [f32; 3] = [255.0, 64.0, 48.0];
const TOO_BRIGHT: [f32; 3] = [40.0, 230.0, 90.0];

/// Black over violet and orange to pale yellow as `t` goes from 0 to 1; ends for what is outside, [`MASKED`] for NaN.
pub fn inferno(t: f32) -> [u8; 3] {
    if t.is_nan() {
        return MASKED;
    }
    let place = t.clamp(0.0, 1.0) * (INFERNO.len() - 1) as f32;
    let below = (place as usize).min(INFERNO.len() - 2);
    let part = place - below as f32;
    std::array::from_fn(|c| {
        let (low, high) = (f32::from(INFERNO[below][c]), f32::from(INFERNO[below + 1][c]));
        (low + part * (high - low) + 0.5) as u8
    })
}

/// Red for `t` in [-1, 0) (darker than the reference), black for 0, green for (0, 1]; stronger by the root of |t|, so that small errors
/// show. Ends for what is outside, [`MASKED`] for NaN.
pub fn red_green(t: f32) -> [u8; 3] {
    if t.is_nan() {
        return MASKED;
    }
    let full = if t < 0.0 { TOO_DARK } else { TOO_BRIGHT };
    full.map(|v| (v * t.abs().min(1.0).sqrt() + 0.5) as u8)
}

/// Mean over channels per pixel; NaN where a channel is.
pub fn channel_means(picture: &Picture) -> Vec<f32> {
    picture.pixels.iter().map(|p| p.mean()).collect()
}

/// A PNG file in memory: each value over `full`, which is positive, coloured by `colour`; `values` row by row, `width` of them in a row.
pub fn png(width: usize, values: &[f32], full: f32, colour: impl Fn(f32) -> [u8; 3]) -> Result<Vec<u8>, ::image::ImageError> {
    use ::image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
    let bytes: Vec<u8> = values.iter().flat_map(|v| colour(v / full)).collect();
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let mut file = Vec::new();
    let height = values.len().checked_div(width).unwrap_or(0);
    PngEncoder::new(&mut file).write_image(&bytes, size(width), size(height), ExtendedColorType::Rgb8)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;

    #[test]
    fn ramps_meet_their_table_and_their_ends() {
        for (i, colour) in INFERNO.iter().enumerate() {
            assert_eq!(inferno(i as f32 / 17.0), *colour, "{i}");
        }
        assert_eq!((inferno(-1.0), inferno(7.0), inferno(f32::NAN)), (INFERNO[0], INFERNO[17], MASKED));
        assert_eq!((red_green(0.0), red_green(-1.0), red_green(9.0)), ([0, 0, 0], [255, 64, 48], [40, 230, 90]));
        assert_eq!((red_green(0.25), red_green(f32::NAN)), ([20, 115, 45], MASKED));
    }

    /// Luminance grows along the ramp: a map can be read without colours.
    #[test]
    fn the_ramp_only_gets_brighter() {
        let luminance = |t: f32| Rgb::from(inferno(t).map(|v| (f32::from(v) / 255.0).powf(2.2))).luminance();
        assert!((0..100).all(|i| luminance(i as f32 / 100.0) < luminance((i + 1) as f32 / 100.0)));
    }

    #[test]
    fn the_file_holds_the_colours() {
        let picture = Picture::new(2, 2, [0.0, 1.0, 4.0, f32::NAN].map(Rgb::splat).to_vec());
        let file = png(2, &channel_means(&picture), 4.0, inferno).expect("a PNG");
        let read = ::image::load_from_memory(&file).expect("a PNG").to_rgb8();
        assert_eq!(read.dimensions(), (2, 2));
        let expected = [inferno(0.0), inferno(0.25), inferno(1.0), MASKED].concat();
        assert_eq!(read.into_raw(), expected);
    }
}
