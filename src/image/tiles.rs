//! Do independent runs agree with a reference? Welch's t-test on the means of tiles (\[WELCH47\]), the family held by Šidák (\[SIDAK67\]).
//!
//! A run is one observation: pixels that share a photon map or a chain are correlated, so nothing smaller counts as independent.

use crate::math::Rgb;
use crate::math::statistics::{Sample, sidak, student_quantile, welch};

/// A reference image: mean over independent runs, and the variance of that mean.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Mean radiance per pixel.
    pub mean: Vec<Rgb>,
    /// Variance of the mean per pixel; pixels are independent of each other.
    pub variance: Vec<Rgb>,
    /// Runs behind both.
    pub runs: usize,
}

/// How to test.
#[derive(Clone, Copy, Debug)]
pub struct TileTest {
    /// Side of a tile, pixels.
    pub block: usize,
    /// Family-wise level, such as 0.01.
    pub family: f64,
    /// Share of pixels, the brightest by the reference, left out of every tile: for references that hold some light only as fireflies.
    pub cut: f64,
}

/// One test's evidence.
#[derive(Clone, Copy, Debug)]
pub struct TileResult {
    /// Tile's column and row; `None` for the whole image.
    pub tile: Option<(usize, usize)>,
    /// Colour channel.
    pub channel: usize,
    /// The runs.
    pub runs: Sample,
    /// The reference.
    pub reference: Sample,
    /// Two-sided p-value.
    pub p: f64,
}

/// What a test found.
#[derive(Clone, Debug)]
pub struct TileReport {
    /// Every test.
    pub results: Vec<TileResult>,
    /// p-value below which one test fails.
    pub threshold: f64,
    /// Mean of the runs over mean of the reference, all channels and pixels that count.
    pub ratio: f64,
    /// Half the width of the ratio's 99 % confidence interval.
    pub ratio_half_width: f64,
}

impl TileReport {
    /// The tests that failed.
    pub fn failures(&self) -> impl Iterator<Item = &TileResult> {
        self.results.iter().filter(|r| r.p < self.threshold)
    }

    /// No test failed.
    pub fn passed(&self) -> bool {
        self.failures().next().is_none()
    }

    /// The evidence, in lines.
    pub fn describe(&self) -> String {
        let smallest = self.results.iter().map(|r| r.p).fold(1.0, f64::min);
        let mut text = format!(
            "{} of {} tests below {:.2e}, smallest p {:.2e}, mean ratio {:.5} +- {:.5}",
            self.failures().count(),
            self.results.len(),
            self.threshold,
            smallest,
            self.ratio,
            self.ratio_half_width
        );
        for r in self.failures().take(12) {
            let place = r.tile.map_or("image".to_owned(), |(x, y)| format!("tile ({x}, {y})"));
            text += &format!(
                "\n  {place} {}: {:.6} +- {:.6} against {:.6} +- {:.6}, p {:.2e}",
                ["R", "G", "B"][r.channel],
                r.runs.mean,
                r.runs.variance.sqrt(),
                r.reference.mean,
                r.reference.variance.sqrt(),
                r.p
            );
        }
        text
    }
}

impl Reference {
    /// Which pixels count: all but the brightest share.
    pub fn kept(&self, cut: f64) -> Vec<bool> {
        let mut order: Vec<usize> = (0..self.mean.len()).collect();
        order.sort_by(|&a, &b| self.mean[b].mean().total_cmp(&self.mean[a].mean()));
        let mut kept = vec![true; self.mean.len()];
        for &i in order.iter().take((cut * self.mean.len() as f64).ceil() as usize) {
            kept[i] = false;
        }
        kept
    }

    /// Mean over some pixels, with its variance and Satterthwaite's degrees of freedom.
    pub fn over(&self, pixels: &[usize], channel: usize) -> Sample {
        let n = pixels.len().max(1) as f64;
        let (mut sum, mut variance, mut squares) = (0.0, 0.0, 0.0);
        for &i in pixels {
            let v = f64::from(self.variance[i][channel]);
            sum += f64::from(self.mean[i][channel]);
            variance += v;
            squares += v * v;
        }
        let freedom_one = self.runs as f64 - 1.0;
        let freedom = if squares > 0.0 { variance * variance / squares * freedom_one } else { freedom_one };
        Sample { n: self.runs as f64, mean: sum / n, variance: variance / (n * n), freedom }
    }
}

/// Means over some pixels, one a run.
pub fn run_means(runs: &[Vec<Rgb>], pixels: &[usize], channel: usize) -> Vec<f64> {
    let mean = |run: &Vec<Rgb>| pixels.iter().map(|&i| f64::from(run[i][channel])).sum::<f64>() / pixels.len().max(1) as f64;
    runs.iter().map(mean).collect()
}

/// Pixels of each tile that count, with the tile's column and row. Ragged edges make smaller tiles.
pub fn tiles(width: usize, height: usize, block: usize, kept: &[bool]) -> Vec<((usize, usize), Vec<usize>)> {
    let mut all = Vec::new();
    for ty in 0..height.div_ceil(block) {
        for tx in 0..width.div_ceil(block) {
            let rows = ty * block..height.min((ty + 1) * block);
            let pixels = rows.flat_map(|y| (tx * block..width.min((tx + 1) * block)).map(move |x| y * width + x));
            let pixels: Vec<usize> = pixels.filter(|&i| kept[i]).collect();
            if !pixels.is_empty() {
                all.push(((tx, ty), pixels));
            }
        }
    }
    all
}

impl TileTest {
    /// Tests runs, images of the reference's size, against it.
    pub fn run(&self, runs: &[Vec<Rgb>], reference: &Reference) -> TileReport {
        let kept = reference.kept(self.cut);
        let everything: Vec<usize> = (0..kept.len()).filter(|&i| kept[i]).collect();
        let mut places = vec![(None, everything)];
        places.extend(tiles(reference.width, reference.height, self.block, &kept).into_iter().map(|(t, p)| (Some(t), p)));
        let mut results = Vec::new();
        for (tile, pixels) in &places {
            for channel in 0..3 {
                let (sample, expected) = (Sample::of(&run_means(runs, pixels, channel)), reference.over(pixels, channel));
                let same = (sample.mean - expected.mean).abs() <= 1e-5 * expected.mean.abs();
                let constant = sample.variance + expected.variance <= 0.0;
                let p = if constant && same { 1.0 } else { welch(&sample, &expected) };
                results.push(TileResult { tile: *tile, channel, runs: sample, reference: expected, p });
            }
        }
        let threshold = sidak(self.family, results.len());
        let (ratio, ratio_half_width) = ratio(runs, reference, &places[0].1);
        TileReport { results, threshold, ratio, ratio_half_width }
    }
}

/// Ratio of the means over pixels and channels, and half its 99 % interval (errors of both sides, first order).
fn ratio(runs: &[Vec<Rgb>], reference: &Reference, pixels: &[usize]) -> (f64, f64) {
    let channels: Vec<Vec<f64>> = (0..3).map(|c| run_means(runs, pixels, c)).collect();
    let totals: Vec<f64> = (0..runs.len()).map(|k| channels.iter().map(|c| c[k]).sum()).collect();
    let sample = Sample::of(&totals);
    let expected: Vec<Sample> = (0..3).map(|c| reference.over(pixels, c)).collect();
    let mean: f64 = expected.iter().map(|s| s.mean).sum();
    // Channels of one path are strongly correlated: standard errors, not variances, add in the worst case.
    let error: f64 = expected.iter().map(|s| s.variance.sqrt()).sum();
    let ratio = sample.mean / mean;
    let relative = (sample.variance / sample.mean.powi(2) + (error / mean).powi(2)).sqrt();
    (ratio, ratio * relative * student_quantile(0.995, sample.freedom))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isophote_samplers::{Key, Purpose, Stream};

    const SIZE: usize = 64;

    /// Images whose pixels are uniform on [0, 2) times `factor` inside the first tile.
    fn runs(count: u64, factor: f32) -> Vec<Vec<Rgb>> {
        let pixel = |s: &mut dyn Stream, i: usize| {
            let inside = i % SIZE < 16 && i / SIZE < 16;
            Rgb::splat(2.0 * s.next_1d() * if inside { factor } else { 1.0 })
        };
        let image = |k: u64| {
            let mut s = Key { seed: 5, iteration: k, index: 0, purpose: Purpose::Test }.stream();
            (0..SIZE * SIZE).map(|i| pixel(&mut s, i)).collect()
        };
        (0..count).map(image).collect()
    }

    fn reference() -> Reference {
        let n = SIZE * SIZE;
        Reference { width: SIZE, height: SIZE, mean: vec![Rgb::WHITE; n], variance: vec![Rgb::splat(1e-9); n], runs: 16 }
    }

    #[test]
    fn unbiased_runs_pass_and_a_tile_ten_percent_off_is_found() {
        let test = TileTest { block: 16, family: 0.01, cut: 0.0 };
        let good = test.run(&runs(16, 1.0), &reference());
        assert!(good.passed(), "{}", good.describe());
        assert!((good.ratio - 1.0).abs() < good.ratio_half_width && good.ratio_half_width < 0.01);
        let bad = test.run(&runs(16, 1.1), &reference());
        assert!(!bad.passed());
        assert!(bad.failures().all(|r| r.tile.is_none_or(|t| t == (0, 0))), "{}", bad.describe());
    }

    #[test]
    fn the_cut_removes_the_brightest_pixels() {
        let mut r = reference();
        r.mean[77] = Rgb::splat(100.0);
        let kept = r.kept(1.0 / 4096.0);
        assert_eq!(kept.iter().filter(|k| !**k).count(), 1);
        assert!(!kept[77]);
    }
}
