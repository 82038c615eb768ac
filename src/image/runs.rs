//! What independent runs of one method say together: their mean, their noise, and how much of an error is noise and how much is bias.
//!
//! A pixel that is not finite in one run is masked in all of them: a pixel with fewer runs than its neighbours would have another bias and
//! another variance.

use super::metrics::{Measured, SizeMismatch};
use super::picture::Picture;
use crate::math::Rgb;

/// Independent runs, accumulated one by one in f64 (\[WELFORD62\]).
#[derive(Clone, Debug)]
pub struct Runs {
    width: usize,
    height: usize,
    count: usize,
    mean: Vec<[f64; 3]>,
    /// Sums of squared deviations from the mean.
    squares: Vec<[f64; 3]>,
    masked: Vec<bool>,
}

/// Runs cannot be split into variance and bias.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum SplitError {
    /// The reference has another size.
    #[error("the runs' image {0}")]
    Reference(SizeMismatch),
    /// The reference's variance has another size.
    #[error("the runs' image {0} (its variance)")]
    Variance(SizeMismatch),
    /// One run says nothing of its variance.
    #[error("{0} run: variance and bias need two independent runs or more")]
    TooFew(usize),
}

impl Runs {
    /// No runs yet, of images of this size.
    pub fn new(width: usize, height: usize) -> Self {
        let pixels = width * height;
        Self { width, height, count: 0, mean: vec![[0.0; 3]; pixels], squares: vec![[0.0; 3]; pixels], masked: vec![false; pixels] }
    }

    /// Adds a run.
    pub fn add(&mut self, picture: &Picture) -> Result<(), SizeMismatch> {
        self.same_size(picture)?;
        self.count += 1;
        let weight = 1.0 / self.count as f64;
        for (i, x) in picture.pixels.iter().enumerate() {
            if !x.is_finite() {
                self.masked[i] = true;
            }
            if self.masked[i] {
                continue;
            }
            for c in 0..3 {
                let x = f64::from(x[c]);
                let deviation = x - self.mean[i][c];
                self.mean[i][c] += deviation * weight;
                self.squares[i][c] += deviation * (x - self.mean[i][c]);
            }
        }
        Ok(())
    }

    /// Runs added.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Pixels that were not finite in some run.
    pub fn masked(&self) -> u64 {
        self.masked.iter().filter(|masked| **masked).count() as u64
    }

    /// Mean over the runs; NaN where masked. `None` without a run.
    pub fn mean(&self) -> Option<Picture> {
        (self.count > 0).then(|| self.picture(|i, c| self.mean[i][c]))
    }

    /// Unbiased variance of one run; NaN where masked. `None` with fewer than two runs.
    pub fn variance(&self) -> Option<Picture> {
        (self.count > 1).then(|| self.picture(|i, c| self.variance_at(i, c)))
    }

    /// Variance of the mean over the runs: what belongs beside [`Runs::mean`] as a reference's variance. `None` with fewer than two runs.
    pub fn variance_of_mean(&self) -> Option<Picture> {
        (self.count > 1).then(|| self.picture(|i, c| self.variance_at(i, c) / self.count as f64))
    }

    /// Normalised standard deviation: standard deviation over runs / mean, averaged over pixels and channels. No epsilon: where the mean is
    /// not positive a value is 0 if all runs agree, else left out. `None` with fewer than two runs or if all is masked.
    pub fn nsd(&self) -> Option<f64> {
        self.noise().value
    }

    /// [`Runs::nsd`] with the number of values it left out.
    pub fn noise(&self) -> Measured {
        let (mut sum, mut used, mut left_out) = (0.0, 0_u64, 0);
        if self.count > 1 {
            for i in (0..self.mean.len()).filter(|i| !self.masked[*i]) {
                for c in 0..3 {
                    let (mean, deviation) = (self.mean[i][c], self.variance_at(i, c).sqrt());
                    match (mean > 0.0, deviation == 0.0) {
                        (true, _) => sum += deviation / mean,
                        (false, true) => {}
                        (false, false) => {
                            left_out += 1;
                            continue;
                        }
                    }
                    used += 1;
                }
            }
        }
        Measured { value: (used > 0).then(|| sum / used as f64), left_out }
    }

    /// Splits the runs' squared error into variance and squared bias; `reference_variance` is the variance of the reference's mean, 0 if it
    /// is not given.
    pub fn split<'a>(&'a self, reference: &'a Picture, reference_variance: Option<&'a Picture>) -> Result<Split<'a>, SplitError> {
        self.same_size(reference).map_err(|e| SplitError::Reference(swapped(e)))?;
        if let Some(variance) = reference_variance {
            self.same_size(variance).map_err(|e| SplitError::Variance(swapped(e)))?;
        }
        if self.count < 2 {
            return Err(SplitError::TooFew(self.count));
        }
        Ok(Split { runs: self, reference, reference_variance })
    }

    /// |mean - r| / (|r| + epsilon) per pixel and channel, NaN where masked: what is left when the noise averages out.
    pub fn relative_error_map(&self, reference: &Picture, epsilon: f64) -> Result<Picture, SizeMismatch> {
        self.same_size(reference).map_err(swapped)?;
        Ok(self.picture(|i, c| {
            let r = f64::from(reference.pixels[i][c]);
            (self.mean[i][c] - r).abs() / (r.abs() + epsilon)
        }))
    }

    /// Relative error by tiles of `side` pixels; see [`TileErrors`].
    pub fn tile_errors(&self, reference: &Picture, side: usize, epsilon: f64) -> Result<TileErrors, SizeMismatch> {
        self.same_size(reference).map_err(swapped)?;
        let side = side.max(1);
        let (columns, rows) = (self.width.div_ceil(side), self.height.div_ceil(side));
        let mut sums = vec![(0.0, 0_u64); columns * rows];
        for (i, r) in reference.pixels.iter().enumerate().filter(|(i, r)| !self.masked[*i] && r.is_finite()) {
            let (sum, values) = &mut sums[i / self.width / side * columns + i % self.width / side];
            for c in 0..3 {
                let r = f64::from(r[c]);
                *sum += self.squared_error_at(i, c, r) / (r * r + epsilon);
                *values += 1;
            }
        }
        let errors = sums.iter().map(|(sum, values)| (self.count > 0 && *values > 0).then(|| (sum / *values as f64).sqrt())).collect();
        Ok(TileErrors { columns, rows, side, errors })
    }

    fn same_size(&self, picture: &Picture) -> Result<(), SizeMismatch> {
        if picture.size() == self.size() { Ok(()) } else { Err(SizeMismatch { image: picture.size(), reference: self.size() }) }
    }

    fn variance_at(&self, i: usize, c: usize) -> f64 {
        self.squares[i][c] / (self.count - 1) as f64
    }

    /// Mean over the runs of (x - r)^2.
    fn squared_error_at(&self, i: usize, c: usize, r: f64) -> f64 {
        let error = self.mean[i][c] - r;
        error * error + self.squares[i][c] / self.count as f64
    }

    fn picture(&self, value: impl Fn(usize, usize) -> f64) -> Picture {
        let pixel = |i| if self.masked[i] { Rgb::splat(f32::NAN) } else { Rgb::from([0, 1, 2].map(|c| value(i, c) as f32)) };
        Picture::new(self.width, self.height, (0..self.mean.len()).map(pixel).collect())
    }
}

/// A size found where the runs' size was asked for, told from the runs' side.
fn swapped(SizeMismatch { image, reference }: SizeMismatch) -> SizeMismatch {
    SizeMismatch { image: reference, reference: image }
}

/// Where a squared error comes from; in one value, or averaged.
///
/// `mse` = `variance` + `bias2` + `reference_variance`, exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Mean over the runs less reference, with its sign.
    pub error: f64,
    /// Squared error, mean over the runs: what mse measures on one run.
    pub mse: f64,
    /// Unbiased variance of one run, s^2.
    pub variance: f64,
    /// Squared bias, (mean - r)^2 - s^2/K - s_r^2 with K runs. Unbiased, so it may come out negative where there is none.
    pub bias2: f64,
    /// Variance of the reference's mean, s_r^2.
    pub reference_variance: f64,
}

impl Parts {
    fn scaled(self, error: f64, squares: f64) -> Self {
        Self {
            error: self.error * error,
            mse: self.mse * squares,
            variance: self.variance * squares,
            bias2: self.bias2 * squares,
            reference_variance: self.reference_variance * squares,
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            error: self.error + other.error,
            mse: self.mse + other.mse,
            variance: self.variance + other.variance,
            bias2: self.bias2 + other.bias2,
            reference_variance: self.reference_variance + other.reference_variance,
        }
    }
}

/// The error of runs against a reference, in parts. Made by [`Runs::split`]; computes on demand, holds no image of its own.
#[derive(Clone, Copy, Debug)]
pub struct Split<'a> {
    runs: &'a Runs,
    reference: &'a Picture,
    reference_variance: Option<&'a Picture>,
}

impl Split<'_> {
    /// Whether a pixel, counted row by row, is left out: not finite in a run, in the reference or in its variance.
    pub fn is_masked(&self, pixel: usize) -> bool {
        let finite = self.reference.pixels[pixel].is_finite() && self.reference_variance.is_none_or(|v| v.pixels[pixel].is_finite());
        self.runs.masked[pixel] || !finite
    }

    /// Pixels left out.
    pub fn masked(&self) -> u64 {
        (0..self.reference.pixels.len()).filter(|pixel| self.is_masked(*pixel)).count() as u64
    }

    /// The parts of one pixel's channel; `None` where masked.
    pub fn parts(&self, pixel: usize, channel: usize) -> Option<Parts> {
        if self.is_masked(pixel) {
            return None;
        }
        let r = f64::from(self.reference.pixels[pixel][channel]);
        let reference_variance = self.reference_variance.map_or(0.0, |v| f64::from(v.pixels[pixel][channel]));
        let error = self.runs.mean[pixel][channel] - r;
        let variance = self.runs.variance_at(pixel, channel);
        let bias2 = error * error - variance / self.runs.count as f64 - reference_variance;
        Some(Parts { error, mse: self.runs.squared_error_at(pixel, channel, r), variance, bias2, reference_variance })
    }

    /// The parts of one pixel's channel over r^2 + epsilon (`error` over its root), as in relmse.
    pub fn relative_parts(&self, pixel: usize, channel: usize, epsilon: f64) -> Option<Parts> {
        let r = f64::from(self.reference.pixels[pixel][channel]);
        let scale = 1.0 / (r * r + epsilon);
        self.parts(pixel, channel).map(|parts| parts.scaled(scale.sqrt(), scale))
    }

    /// Averages over all pixels that are not masked, and channels; `None` if there are none.
    pub fn average(&self) -> Option<Parts> {
        self.average_where(|_| true)
    }

    /// Averages over the pixels, counted row by row, that are chosen.
    pub fn average_where(&self, chosen: impl Fn(usize) -> bool) -> Option<Parts> {
        self.average_of(chosen, |pixel, channel| self.parts(pixel, channel))
    }

    /// Averages of the relative parts: `mse` is the mean of the runs' relmse.
    pub fn relative(&self, epsilon: f64) -> Option<Parts> {
        self.average_of(|_| true, |pixel, channel| self.relative_parts(pixel, channel, epsilon))
    }

    /// A map of one part, or of a function of them; NaN where masked.
    pub fn map(&self, value: impl Fn(Parts) -> f64) -> Picture {
        let at = |pixel, channel| self.parts(pixel, channel).map_or(f32::NAN, |parts| value(parts) as f32);
        let pixels = (0..self.reference.pixels.len()).map(|pixel| Rgb::from([0, 1, 2].map(|channel| at(pixel, channel)))).collect();
        Picture::new(self.reference.width, self.reference.height, pixels)
    }

    fn average_of(&self, chosen: impl Fn(usize) -> bool, parts: impl Fn(usize, usize) -> Option<Parts>) -> Option<Parts> {
        let pixels = (0..self.reference.pixels.len()).filter(|pixel| chosen(*pixel));
        let values = pixels.flat_map(|pixel| [0, 1, 2].map(|channel| parts(pixel, channel))).flatten();
        let (sum, count) = values.fold((Parts::default(), 0_u64), |(sum, count), value| (sum.plus(value), count + 1));
        let weight = 1.0 / count as f64;
        (count > 0).then(|| sum.scaled(weight, weight))
    }
}

/// How even the error is over the image. A tile's relative error is sqrt(mean (x-r)^2/(r^2+e)) over its pixels, channels and the runs; tiles
/// at the right and lower border may be smaller.
#[derive(Clone, Debug, PartialEq)]
pub struct TileErrors {
    /// Tiles across.
    pub columns: usize,
    /// Tiles down.
    pub rows: usize,
    /// Side of a tile in pixels.
    pub side: usize,
    /// `columns * rows` of them, row by row; `None` where every pixel is masked.
    pub errors: Vec<Option<f64>>,
}

impl TileErrors {
    /// Mean over the tiles.
    pub fn mean(&self) -> Option<f64> {
        let (sum, count) = self.errors.iter().flatten().fold((0.0, 0_u64), |(sum, count), e| (sum + e, count + 1));
        (count > 0).then(|| sum / count as f64)
    }

    /// Standard deviation over the tiles (of all tiles, not a sample of them) over their mean; 0 if every tile is equally wrong. `None`
    /// where there is no error to compare.
    pub fn coefficient_of_variation(&self) -> Option<f64> {
        let mean = self.mean().filter(|mean| *mean > 0.0)?;
        let (sum, count) = self.errors.iter().flatten().fold((0.0, 0_u64), |(sum, count), e| (sum + (e - mean).powi(2), count + 1));
        Some((sum / count as f64).sqrt() / mean)
    }
}

#[cfg(test)]
mod tests;
