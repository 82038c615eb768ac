//! LDR-FLIP \[ANDERSSON20\] and HDR-FLIP \[ANDERSSON21\]: what an observer sees who flips between two pictures.
//!
//! Every filter is separable or a sum of two that are: rows are filtered first, all at once, then columns, and a row of errors is made as
//! soon as its columns are there. Rows are independent, so that the number of threads changes no bit.

mod colour;
mod kernels;

use super::{Measured, Pairs};
use crate::math::Rgb;
use colour::{Lab, aces, opponent};
use kernels::Kernels;
use rayon::prelude::*;

/// Planes that the pass along rows leaves: Y, Cx, Cz by the narrow and the wide Gaussian, and Y by the feature filter's Gaussian and
/// derivatives.
const PLANES: usize = 7;
/// Planes after the pass along columns: Y, Cx, Cz, and first and second derivatives along x and y.
const OUTPUTS: usize = 7;

/// Exponents and limits of \[ANDERSSON20\]: compression of colour errors, the share of the largest that is stretched out, what it is
/// stretched to, compression of feature errors.
const COLOUR_POWER: f32 = 0.7;
const STRETCHED: f32 = 0.4;
const STRETCHED_TO: f32 = 0.95;
/// Display value of \[ANDERSSON21\] that the extremes of the exposures are made from.
const DISPLAY_TARGET: f64 = 0.85;

/// HDR-FLIP, the mean of [`flip_map`] over the pixels that are not masked.
pub(super) fn flip(pairs: &Pairs) -> Measured {
    if pairs.pixels() == 0 {
        return Measured { value: None, left_out: 0 };
    }
    let map = flip_map(pairs);
    let sum: f64 = map.iter().enumerate().filter(|(i, _)| !pairs.masked_at(*i)).map(|(_, v)| f64::from(*v)).sum();
    Measured { value: Some(sum / pairs.pixels() as f64), left_out: 0 }
}

/// Exposures that HDR-FLIP looks at, in stops, equally spaced from the first to the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposures {
    /// First: the brightest pixel comes to lie at 0.85 of the display.
    pub start: f64,
    /// Last: the median pixel does.
    pub stop: f64,
    /// How many, at least two.
    pub count: usize,
}

impl Exposures {
    /// Factors on linear values.
    fn gains(self) -> impl Iterator<Item = f64> {
        let step = (self.stop - self.start) / (self.count - 1) as f64;
        (0..self.count).map(move |i| (self.start + i as f64 * step).exp2())
    }
}

/// Exposures from the reference's largest and median luminance over the pixels that are not masked \[ANDERSSON21\].
///
/// Where the median is 0 there is no such exposure, and the median of the lit pixels is taken. A reference without any lit pixel leaves the
/// exposures to the image, by the same rule; `None` if that is black too, and there is nothing to see.
pub fn flip_exposures(pairs: &Pairs) -> Option<Exposures> {
    let unmasked = || (0..pairs.reference.pixels.len()).filter(|i| !pairs.masked_at(*i));
    exposures_of(unmasked().map(|i| pairs.reference.pixels[i])).or_else(|| exposures_of(unmasked().map(|i| pairs.image.pixels[i])))
}

fn exposures_of(pixels: impl Iterator<Item = Rgb>) -> Option<Exposures> {
    let mut luminances: Vec<f64> = pixels.map(colour::luminance).collect();
    luminances.sort_unstable_by(f64::total_cmp);
    let largest = luminances.last().copied().filter(|l| *l > 0.0)?;
    let first_lit = luminances.partition_point(|l| *l <= 0.0);
    let median = match luminances[luminances.len() / 2] {
        median if median > 0.0 => median,
        _ => luminances[(first_lit + luminances.len()) / 2],
    };
    let target = colour::aces_inverse(DISPLAY_TARGET);
    let (start, stop) = ((target / largest).log2(), (target / median).log2());
    Some(Exposures { start, stop, count: (stop - start).ceil().max(2.0) as usize })
}

/// HDR-FLIP per pixel, row by row, in `[0, 1]`: the largest LDR-FLIP over [`flip_exposures`], each picture tone mapped by ACES. Negative
/// values are shown as black. All zero if both pictures are black.
pub fn flip_map(pairs: &Pairs) -> Vec<f32> {
    let mut map = vec![0.0; pairs.reference.pixels.len()];
    if let Some(exposures) = flip_exposures(pairs) {
        let observer = Observer::new(pairs);
        for gain in exposures.gains() {
            observer.add(&|pixel| pixel.map(|v| aces(v, gain)), &mut map);
        }
    }
    map
}

/// LDR-FLIP per pixel, row by row, in `[0, 1]`: the pictures as they are, linear, clamped to `[0, 1]`.
pub fn ldr_flip_map(pairs: &Pairs) -> Vec<f32> {
    let mut map = vec![0.0; pairs.reference.pixels.len()];
    Observer::new(pairs).add(&|pixel| pixel.map(|v| v.clamp(0.0, 1.0)), &mut map);
    map
}

/// Compares two pictures at one exposure.
struct Observer<'a> {
    pairs: &'a Pairs<'a>,
    kernels: Kernels,
    from_opponent: colour::FromOpponent,
    /// Colour difference of pure green and pure blue, the largest there is.
    largest: f32,
}

/// One picture's planes after the pass along rows: for each row, one plane after the other.
type Rows = Vec<f32>;

impl<'a> Observer<'a> {
    fn new(pairs: &'a Pairs<'a>) -> Self {
        let [green, blue] = [Rgb::new(0.0, 1.0, 0.0), Rgb::new(0.0, 0.0, 1.0)].map(Lab::of_linear);
        let largest = green.distance(blue).powf(COLOUR_POWER);
        Self { pairs, kernels: Kernels::new(), from_opponent: colour::FromOpponent::new(), largest }
    }

    /// Raises `map` to the error of the pictures as `display` (linear, to linear in `[0, 1]`) shows them.
    fn add(&self, display: &(impl Fn(Rgb) -> Rgb + Sync), map: &mut [f32]) {
        let width = self.pairs.size().0;
        let reference = self.filter_rows(|i| display(self.pairs.shown(i).0));
        let image = self.filter_rows(|i| display(self.pairs.shown(i).1));
        let scratch = || (vec![0.0; OUTPUTS * width], vec![0.0; OUTPUTS * width]);
        map.par_chunks_mut(width.max(1)).enumerate().for_each_init(scratch, |(r, x), (y, errors)| {
            self.filter_columns(&reference, y, r);
            self.filter_columns(&image, y, x);
            for (i, error) in errors.iter_mut().enumerate() {
                *error = error.max(self.error(Seen::at(r, width, i), Seen::at(x, width, i)));
            }
        });
    }

    /// The pass along rows; pixels beyond the border repeat it.
    fn filter_rows(&self, pixel: impl Fn(usize) -> Rgb + Sync) -> Rows {
        let (width, height) = self.pairs.size();
        let reach = self.kernels.reach();
        let padded = width + 2 * reach;
        let mut rows = vec![0.0; height * PLANES * width];
        rows.par_chunks_mut((PLANES * width).max(1)).enumerate().for_each_init(
            || vec![0.0; 3 * padded],
            |colours, (y, out)| {
                for i in 0..padded {
                    let x = i.saturating_sub(reach).min(width - 1);
                    let [luma, red_green, blue_yellow] = opponent(pixel(y * width + x));
                    colours[i] = luma;
                    colours[padded + i] = red_green;
                    colours[2 * padded + i] = blue_yellow;
                }
                for (plane, (channel, kernel)) in out.chunks_mut(width).zip(self.kernels.along_rows()) {
                    let first = channel * padded + reach;
                    kernel.add(plane, |k| &colours[first.saturating_add_signed(k)..]);
                }
            },
        );
        rows
    }

    /// The pass along columns, for one row.
    fn filter_columns(&self, rows: &Rows, y: usize, out: &mut [f32]) {
        let (width, height) = self.pairs.size();
        out.fill(0.0);
        for (plane, output, kernel) in self.kernels.along_columns() {
            kernel.add(&mut out[output * width..(output + 1) * width], |k| {
                let row = y.saturating_add_signed(k).min(height - 1);
                &rows[(row * PLANES + plane) * width..]
            });
        }
    }

    /// LDR-FLIP of a pixel \[ANDERSSON20\]: the colour error, raised by a difference in edges or points.
    fn error(&self, r: Seen, x: Seen) -> f32 {
        let lab = |seen: &Seen| Lab::of_linear(self.from_opponent.linear(seen.colour).map(|v| v.clamp(0.0, 1.0)));
        let colour = self.stretch(lab(&r).distance(lab(&x)).powf(COLOUR_POWER));
        let difference = (r.edge() - x.edge()).abs().max((r.point() - x.point()).abs());
        let feature = (difference * std::f32::consts::FRAC_1_SQRT_2).sqrt();
        colour.powf(1.0 - feature)
    }

    /// Spreads small colour errors over most of `[0, 1]` \[ANDERSSON20\].
    fn stretch(&self, error: f32) -> f32 {
        let knee = STRETCHED * self.largest;
        if error < knee {
            STRETCHED_TO / knee * error
        } else {
            STRETCHED_TO + (error - knee) / (self.largest - knee) * (1.0 - STRETCHED_TO)
        }
    }
}

/// A pixel after the filters.
struct Seen {
    /// Opponent colour, as much of it as the eye resolves.
    colour: [f32; 3],
    /// First derivatives along x and y.
    first: [f32; 2],
    /// Second derivatives along x and y.
    second: [f32; 2],
}

impl Seen {
    fn at(planes: &[f32], width: usize, i: usize) -> Self {
        let [luma, red_green, blue_yellow, dx, dy, dxx, dyy]: [f32; OUTPUTS] = std::array::from_fn(|plane| planes[plane * width + i]);
        Self { colour: [luma, red_green, blue_yellow], first: [dx, dy], second: [dxx, dyy] }
    }

    fn edge(&self) -> f32 {
        norm(self.first)
    }

    fn point(&self) -> f32 {
        norm(self.second)
    }
}

fn norm([x, y]: [f32; 2]) -> f32 {
    (x * x + y * y).sqrt()
}

#[cfg(test)]
mod tests;
