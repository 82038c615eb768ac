//! How far an image is from a reference. One table; the command line, `list` and the error record walk it.
//!
//! All but `ssim` and `flip` run over linear values, per channel, and are averaged over pixels and channels; `x` is the image tested, `r`
//! the reference. Those two look at a window around every pixel; what they do with masked pixels stands at [`Pairs::masked_at`].

mod filter;
mod flip;
mod ssim;

use super::picture::Picture;
use crate::math::Rgb;

pub use flip::{Exposures, flip_exposures, flip_map, ldr_flip_map};

/// Which way a metric improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Zero is perfect.
    Lower,
    /// More is better.
    Higher,
}

/// What a metric measures: values, and the number of them that had to be left out.
type Measure = fn(&Pairs, f64) -> Measured;

/// A line of the table of metrics.
pub struct Metric {
    /// Key in JSON, in files and in tables.
    pub name: &'static str,
    /// Formula, `e` the epsilon.
    pub formula: &'static str,
    /// Whether the epsilon matters.
    pub uses_epsilon: bool,
    /// Direction.
    pub better: Better,
    measure: Measure,
}

/// Every metric.
pub const METRICS: &[Metric] = &[
    lower("mse", "mean (x-r)^2", false, |pairs, _| pairs.mean(|x, r| (x - r) * (x - r))),
    lower("rmse", "sqrt(mean (x-r)^2)", false, |pairs, _| pairs.mean(|x, r| (x - r) * (x - r)).map(f64::sqrt)),
    lower("relmse", "mean (x-r)^2/(r^2+e), r = 0 included", true, |pairs, e| pairs.mean(|x, r| relative_square(x, r, e))),
    lower("relmse_trimmed", "relmse without its largest floor(0.001*3*pixels) values", true, relmse_trimmed),
    lower("mape", "mean |x-r|/(|r|+e)", true, |pairs, e| pairs.mean(|x, r| (x - r).abs() / (r.abs() + e))),
    lower("smape", "mean 2|x-r|/(|x|+|r|+2e)", true, |pairs, e| pairs.mean(|x, r| 2.0 * (x - r).abs() / (x.abs() + r.abs() + 2.0 * e))),
    lower("srrmse", "sqrt(mean ((x-r)/((x+r)/2))^2); where x+r <= 0: 0 if x = r, else left out", false, srrmse),
    Metric {
        name: "ssim",
        formula: "mean over full 11x11 Gaussian windows, sigma 1.5, K1 0.01, K2 0.03, of the sRGB curve of luminance clamped to [0, 1]",
        uses_epsilon: false,
        better: Better::Higher,
        measure: |pairs, _| ssim::ssim(pairs),
    },
    lower("flip", "HDR-FLIP: mean over pixels of the largest LDR-FLIP over exposures, ACES, 67.02 pixels per degree", false, |pairs, _| {
        flip::flip(pairs)
    }),
];

/// The metric that no single image has: its name, formula and direction. [`super::runs::Runs::nsd`] measures it.
pub const NSD: (&str, &str, Better) = (
    "nsd",
    "over runs: mean of standard deviation / mean; where the mean is <= 0: 0 if all runs agree, else left out (compare --runs)",
    Better::Lower,
);

/// Name, formula and direction of every metric, those over runs included.
pub fn definitions() -> impl Iterator<Item = (&'static str, &'static str, Better)> {
    METRICS.iter().map(|m| (m.name, m.formula, m.better)).chain([NSD])
}

/// The epsilon of relmse, mape and smape unless another is asked for.
pub const EPSILON: f64 = 0.01;

/// Share of the values that relmse_trimmed leaves out.
const TRIMMED: f64 = 0.001;

const fn lower(name: &'static str, formula: &'static str, uses_epsilon: bool, measure: Measure) -> Metric {
    Metric { name, formula, uses_epsilon, better: Better::Lower, measure }
}

/// A metric's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The value; `None` if every value had to be left out.
    pub value: Option<f64>,
    /// Values (one per pixel and channel) this metric left out, beside the pixels masked for all metrics.
    pub left_out: u64,
}

impl Measured {
    fn map(self, f: impl FnOnce(f64) -> f64) -> Self {
        Self { value: self.value.map(f), ..self }
    }
}

/// Two pictures of different sizes cannot be compared.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("is {}x{} pixels, the reference {}x{}", image.0, image.1, reference.0, reference.1)]
pub struct SizeMismatch {
    /// Width and height of the image.
    pub image: (usize, usize),
    /// Width and height of the reference.
    pub reference: (usize, usize),
}

/// The values of two pictures that can be compared: `x` of the image, `r` of the reference.
pub struct Pairs<'a> {
    reference: &'a Picture,
    image: &'a Picture,
    values: Vec<(f64, f64)>,
    masked: u64,
}

impl<'a> Pairs<'a> {
    /// Pairs the values of two pictures. Pixels where either has an infinite component or a NaN are masked, with all their components.
    pub fn new(reference: &'a Picture, image: &'a Picture) -> Result<Self, SizeMismatch> {
        if reference.size() != image.size() {
            return Err(SizeMismatch { image: image.size(), reference: reference.size() });
        }
        let mut values = Vec::with_capacity(3 * image.pixels.len());
        let mut masked = 0;
        for (x, r) in image.pixels.iter().zip(&reference.pixels) {
            if x.is_finite() && r.is_finite() {
                values.extend((0..3).map(|c| (f64::from(x[c]), f64::from(r[c]))));
            } else {
                masked += 1;
            }
        }
        Ok(Self { reference, image, values, masked })
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.reference.size()
    }

    /// Whether a pixel, counted row by row, is masked. Metrics with a window average nothing there, and see no difference there from
    /// windows around: both pictures show the reference's pixel, or black where that is not finite.
    pub fn masked_at(&self, pixel: usize) -> bool {
        !(self.reference.pixels[pixel].is_finite() && self.image.pixels[pixel].is_finite())
    }

    /// A pixel of the reference and of the image as metrics with a window see them.
    fn shown(&self, pixel: usize) -> (Rgb, Rgb) {
        let (r, x) = (self.reference.pixels[pixel], self.image.pixels[pixel]);
        match (r.is_finite(), x.is_finite()) {
            (true, true) => (r, x),
            (true, false) => (r, r),
            (false, _) => (Rgb::BLACK, Rgb::BLACK),
        }
    }

    /// Pixels masked because a component is not finite.
    pub fn masked(&self) -> u64 {
        self.masked
    }

    /// Pixels compared.
    pub fn pixels(&self) -> u64 {
        self.values.len() as u64 / 3
    }

    /// Mean of a function of `x` and `r`.
    pub fn mean(&self, value: impl Fn(f64, f64) -> f64) -> Measured {
        mean_of(self.values.iter().map(|(x, r)| value(*x, *r)), 0)
    }
}

impl Metric {
    /// Measures.
    pub fn measure(&self, pairs: &Pairs, epsilon: f64) -> Measured {
        (self.measure)(pairs, epsilon)
    }
}

/// The metric of a name.
pub fn metric(name: &str) -> Option<&'static Metric> {
    METRICS.iter().find(|m| m.name == name)
}

fn mean_of(values: impl Iterator<Item = f64>, left_out: u64) -> Measured {
    let (sum, count) = values.fold((0.0, 0_u64), |(sum, count), v| (sum + v, count + 1));
    Measured { value: (count > 0).then(|| sum / count as f64), left_out }
}

fn relative_square(x: f64, r: f64, epsilon: f64) -> f64 {
    (x - r) * (x - r) / (r * r + epsilon)
}

fn relmse_trimmed(pairs: &Pairs, epsilon: f64) -> Measured {
    let mut errors: Vec<f64> = pairs.values.iter().map(|(x, r)| relative_square(*x, *r, epsilon)).collect();
    errors.sort_unstable_by(f64::total_cmp);
    let trimmed = (TRIMMED * errors.len() as f64).floor() as usize;
    mean_of(errors[..errors.len() - trimmed].iter().copied(), 0)
}

fn srrmse(pairs: &Pairs, _: f64) -> Measured {
    let square = |&(x, r): &(f64, f64)| {
        if x + r > 0.0 {
            let relative = (x - r) / (0.5 * (x + r));
            Some(relative * relative)
        } else {
            (x == r).then_some(0.0)
        }
    };
    let left_out = pairs.values.iter().filter(|pair| square(pair).is_none()).count() as u64;
    mean_of(pairs.values.iter().filter_map(square), left_out).map(f64::sqrt)
}

#[cfg(test)]
mod tests;
