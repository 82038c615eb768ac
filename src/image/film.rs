//! The film keeps sums and counts, never means, so that films add.

use super::layers::LayerSums;
use super::readings::Readings;
use crate::math::Rgb;
use glam::Vec2;
use std::ops::Range;

/// Sums of one colour per pixel, row-major from the top left.
pub type Sums = Vec<[f64; 3]>;

/// A contribution of a light path to one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// Row-major number of the pixel, from [`Film::pixel`].
    pub pixel: u32,
    /// Contribution, not yet divided by the number of light paths.
    pub value: Rgb,
}

/// Two films, or a film and its parts, do not go together.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum FilmError {
    /// Widths or heights differ.
    #[error("films of {left_width}x{left_height} and {right_width}x{right_height} pixels do not add")]
    Size {
        /// Width of the film added to.
        left_width: usize,
        /// Height of the film added to.
        left_height: usize,
        /// Width of the other film.
        right_width: usize,
        /// Height of the other film.
        right_height: usize,
    },
    /// One film keeps second moments, the other does not.
    #[error("one film has second moments and the other has not: render both with --aov variance, or neither")]
    Moments,
    /// The films keep images of other techniques.
    #[error(
        "one film has images of techniques that the other has not: render both with --aov pyramid and the same techniques and depths, or neither"
    )]
    Layers,
    /// The films keep readings of other kinds.
    #[error("one film has densities that the other has not: render both with --aov density, or neither")]
    Readings,
    /// A list of sums is neither empty (where it may be) nor one entry a pixel.
    #[error("the film's {part} has {found} pixels where {expected} are needed")]
    Part {
        /// Which list.
        part: &'static str,
        /// Its length.
        found: usize,
        /// The number of pixels.
        expected: usize,
    },
}

/// All a film holds between iterations, to be stored and read back.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawFilm {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Sum of the camera-side samples of each pixel.
    pub eye: Sums,
    /// Camera-side samples per pixel.
    pub eye_count: u64,
    /// Sum of the light-side splats of each pixel; empty if nothing ever splatted.
    pub splats: Sums,
    /// Light paths behind the splats.
    pub splat_count: u64,
    /// Sum over iterations of the squared estimate of the iteration; empty unless asked for.
    pub squares: Sums,
    /// Iterations behind the squares.
    pub iterations: u64,
}

/// The pixels of a tile two rows at a time, so that a few in sequence lie close together.
fn list_tile(columns: Range<usize>, rows: Range<usize>, width: usize, pixels: &mut Vec<usize>) {
    pixels.clear();
    for top in rows.clone().step_by(2) {
        for x in columns.clone() {
            pixels.extend((top..rows.end.min(top + 2)).map(|y| y * width + x));
        }
    }
}

/// Box-filtered film: every sample lands in exactly one pixel. Row 0 is the top.
///
/// The image is `eye / eye_count + splats / splat_count`. Every sum has one order of its terms, whatever the number of threads.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    sums: RawFilm,
    /// What the running iteration has added, as an estimate of the image; empty unless squares are kept.
    running: Sums,
    /// Further images, where they are asked for.
    layers: Option<LayerSums>,
    /// Numbers read beside the image, where they are asked for.
    readings: Option<Readings>,
}

impl Film {
    /// An empty film. `moments` keeps what [`Film::variance_of_mean`] needs.
    pub fn new(width: usize, height: usize, moments: bool) -> Self {
        let n = width * height;
        let blank = |wanted: bool| if wanted { vec![[0.0; 3]; n] } else { Vec::new() };
        let sums = RawFilm { width, height, eye: blank(true), squares: blank(moments), ..RawFilm::default() };
        Self { sums, running: blank(moments), layers: None, readings: None }
    }

    /// Most bytes a film of this size can hold.
    pub fn bytes(width: usize, height: usize, moments: bool) -> u64 {
        let planes = if moments { 4 } else { 2 };
        planes * size_of::<[f64; 3]>() as u64 * width as u64 * height as u64
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.sums.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.sums.height
    }

    /// The pixel that a film position (pixel `i` spans `[i, i+1)`) falls into; `None` outside the film.
    #[inline]
    pub fn pixel(&self, position: Vec2) -> Option<u32> {
        let inside = position.x >= 0.0 && position.y >= 0.0 && position.x < self.sums.width as f32 && position.y < self.sums.height as f32;
        inside.then(|| (position.y as usize * self.sums.width + position.x as usize) as u32)
    }

    /// Adds one camera-side sample to every pixel: `sample(x, y)` is called once a pixel, rows in parallel. What it returns beside the
    /// colour is folded per row in index order, rows in index order.
    pub fn add_eye_samples<A: Send>(
        &mut self,
        start: impl Fn() -> A + Sync,
        sample: impl Fn(&mut A, usize, usize) -> Rgb + Sync,
        finish_row: impl FnMut(A),
    ) {
        let width = self.sums.width;
        let row = |(): &mut (), pixels: &[usize], values: &mut [Rgb]| {
            let mut state = start();
            for (pixel, value) in pixels.iter().zip(values) {
                *value = sample(&mut state, pixel % width, pixel / width);
            }
            state
        };
        self.add_eye_tiles([width, 1], || (), row, finish_row);
    }

    /// Adds one camera-side sample to every pixel, tile by tile, rows of tiles in parallel. `sample` is given the row-major numbers of a
    /// tile's pixels, neighbours near each other, and writes one value for each; what was there before means nothing. What it returns
    /// goes to `finish_tile`, in the tiles' order. `tile` is width and height.
    ///
    /// `memory` is called once a row of tiles; the values must not depend on what an earlier tile left there.
    pub fn add_eye_tiles<M, A: Send>(
        &mut self,
        tile: [usize; 2],
        memory: impl Fn() -> M + Sync,
        sample: impl Fn(&mut M, &[usize], &mut [Rgb]) -> A + Sync,
        finish_tile: impl FnMut(A),
    ) {
        use rayon::prelude::*;
        let [across, down] = tile.map(|side| side.max(1));
        let width = self.sums.width;
        let start = || (memory(), Vec::with_capacity(across * down), vec![Rgb::BLACK; across * down]);
        let fill = |own: &mut (M, Vec<usize>, Vec<Rgb>), index: usize, sums: &mut [[f64; 3]], running: &mut [[f64; 3]]| {
            let (memory, pixels, values) = own;
            let first = index * down * width;
            let one = |left: usize| {
                list_tile(left..width.min(left + across), first / width..(first + sums.len()) / width, width, pixels);
                let values = &mut values[..pixels.len()];
                let result = sample(memory, pixels, values);
                for (pixel, value) in pixels.iter().zip(values) {
                    let value = value.to_array().map(f64::from);
                    add(&mut sums[pixel - first], value);
                    if let Some(running) = running.get_mut(pixel - first) {
                        add(running, value);
                    }
                }
                result
            };
            (0..width).step_by(across).map(one).collect::<Vec<A>>()
        };
        let rows = (down * width).max(1);
        // One row of tiles a task: pieces that rayon sizes by itself are an eighth of the film, and a thread idles for half of one at the end.
        let results: Vec<Vec<A>> = if self.running.is_empty() {
            let bands = self.sums.eye.par_chunks_mut(rows).enumerate().with_max_len(1);
            bands.map_init(start, |own, (index, sums)| fill(own, index, sums, &mut [])).collect()
        } else {
            let pairs = self.sums.eye.par_chunks_mut(rows).zip(self.running.par_chunks_mut(rows)).enumerate().with_max_len(1);
            pairs.map_init(start, |own, (index, (sums, running))| fill(own, index, sums, running)).collect()
        };
        self.sums.eye_count += 1;
        results.into_iter().flatten().for_each(finish_tile);
    }

    /// Adds one iteration's splats of `light_paths` light paths: batch after batch, each in its own order, whoever made them. The
    /// batches must not depend on the number of threads.
    ///
    /// # Panics
    /// If a pixel's number did not come from a film of this size.
    pub fn add_splats<B: AsRef<[Splat]> + Sync>(&mut self, batches: &[B], light_paths: u64) {
        use rayon::prelude::*;
        let width = self.sums.width;
        if self.sums.splats.is_empty() {
            self.sums.splats = vec![[0.0; 3]; self.sums.eye.len()];
        }
        let count = batches.iter().flat_map(|b| b.as_ref()).map(|s| s.pixel as usize).max();
        assert!(count.is_none_or(|largest| largest < self.sums.eye.len()), "splat outside the film");
        // Bands of rows go in parallel; within one, a pixel's splats are added in the batches' order. So the bands' height is free.
        let rows = self.sums.height.div_ceil(rayon::current_num_threads().max(1)).max(1);
        let band = rows * width;
        let scale = 1.0 / light_paths.max(1) as f64;
        let fill = |index: usize, sums: &mut [[f64; 3]], running: &mut [[f64; 3]]| {
            let first = index * band;
            for splat in batches.iter().flat_map(|b| b.as_ref()) {
                let Some(sum) = (splat.pixel as usize).checked_sub(first).and_then(|i| sums.get_mut(i)) else { continue };
                let value = splat.value.to_array().map(f64::from);
                add(sum, value);
                if let Some(running) = running.get_mut(splat.pixel as usize - first) {
                    add(running, value.map(|v| v * scale));
                }
            }
        };
        if self.running.is_empty() {
            self.sums.splats.par_chunks_mut(band).enumerate().for_each(|(i, sums)| fill(i, sums, &mut []));
        } else {
            let pairs = self.sums.splats.par_chunks_mut(band).zip(self.running.par_chunks_mut(band)).enumerate();
            pairs.for_each(|(i, (sums, running))| fill(i, sums, running));
        }
        self.sums.splat_count += light_paths;
    }

    /// Closes an iteration: what it estimated goes into the second moments. The render loop calls this, methods do not.
    pub fn finish_iteration(&mut self) {
        self.sums.iterations += 1;
        for (square, running) in self.sums.squares.iter_mut().zip(&mut self.running) {
            add(square, running.map(|v| v * v));
            *running = [0.0; 3];
        }
    }

    /// Further images, if the film keeps any.
    pub fn layers(&self) -> Option<&LayerSums> {
        self.layers.as_ref()
    }

    /// From now on the film keeps these images.
    pub fn keep_layers(&mut self, layers: LayerSums) {
        self.layers = Some(layers);
    }

    /// The further images, for a method to add to: it gives them back by [`Film::keep_layers`].
    pub fn take_layers(&mut self) -> Option<LayerSums> {
        self.layers.take()
    }

    /// Numbers read beside the image, if the film keeps any.
    pub fn readings(&self) -> Option<&Readings> {
        self.readings.as_ref()
    }

    /// From now on the film keeps these.
    pub fn keep_readings(&mut self, readings: Readings) {
        self.readings = Some(readings);
    }

    /// The readings, for a method to add to: it gives them back by [`Film::keep_readings`].
    pub fn take_readings(&mut self) -> Option<Readings> {
        self.readings.take()
    }

    /// Means of the further images, in the order of their numbers: over camera-side samples or over light paths.
    pub fn layer_means(&self) -> Vec<Vec<Rgb>> {
        let mean = |layers: &LayerSums, i: usize| {
            let count = if layers.layers()[i].splats { self.sums.splat_count } else { self.sums.eye_count };
            layers.mean(i, count)
        };
        self.layers.iter().flat_map(|layers| (0..layers.layers().len()).map(move |i| mean(layers, i))).collect()
    }

    /// Iterations finished.
    pub fn iterations(&self) -> u64 {
        self.sums.iterations
    }

    /// Camera-side samples per pixel.
    pub fn eye_count(&self) -> u64 {
        self.sums.eye_count
    }

    /// Light paths behind the splats.
    pub fn splat_count(&self) -> u64 {
        self.sums.splat_count
    }

    /// Whether second moments are kept.
    pub fn has_moments(&self) -> bool {
        !self.sums.squares.is_empty()
    }

    /// Everything the film holds.
    pub fn raw(&self) -> &RawFilm {
        &self.sums
    }

    /// A film from what [`Film::raw`] gave.
    pub fn from_raw(raw: RawFilm) -> Result<Self, FilmError> {
        let expected = raw.width * raw.height;
        for (part, sums, optional) in [("eye sums", &raw.eye, false), ("splats", &raw.splats, true), ("squares", &raw.squares, true)] {
            if sums.len() != expected && !(optional && sums.is_empty()) {
                return Err(FilmError::Part { part, found: sums.len(), expected });
            }
        }
        let running = vec![[0.0; 3]; raw.squares.len()];
        Ok(Self { sums: raw, running, layers: None, readings: None })
    }

    /// Adds another film's sums and counts.
    pub fn merge(&mut self, other: &Film) -> Result<(), FilmError> {
        let (left, right) = (&mut self.sums, &other.sums);
        if (left.width, left.height) != (right.width, right.height) {
            let (left_width, left_height, right_width, right_height) = (left.width, left.height, right.width, right.height);
            return Err(FilmError::Size { left_width, left_height, right_width, right_height });
        }
        if left.squares.is_empty() != right.squares.is_empty() {
            return Err(FilmError::Moments);
        }
        let same = match (&mut self.layers, &other.layers) {
            (Some(left), Some(right)) => left.merge(right),
            (left, right) => left.is_none() && right.is_none(),
        };
        if !same {
            return Err(FilmError::Layers);
        }
        let same = match (&mut self.readings, &other.readings) {
            (Some(left), Some(right)) => left.merge(right),
            (left, right) => left.is_none() && right.is_none(),
        };
        if !same {
            return Err(FilmError::Readings);
        }
        add_all(&mut left.eye, &right.eye);
        add_all(&mut left.splats, &right.splats);
        add_all(&mut left.squares, &right.squares);
        left.eye_count += right.eye_count;
        left.splat_count += right.splat_count;
        left.iterations += right.iterations;
        Ok(())
    }

    /// Mean image, row-major from the top left.
    pub fn mean(&self) -> Vec<Rgb> {
        (0..self.sums.eye.len()).map(|i| Rgb::from(self.mean_of(i).map(|v| v as f32))).collect()
    }

    /// Variance of the mean image, `(sum e^2 / n - mean^2) / (n - 1)` over the estimates `e` of `n` iterations; `None` without moments or
    /// with fewer than two iterations.
    ///
    /// Right for independent iterations. Where later ones depend on earlier ones (Markov chains) it is what they would have if they did not.
    pub fn variance_of_mean(&self) -> Option<Vec<Rgb>> {
        let n = self.sums.iterations as f64;
        if self.sums.squares.is_empty() || n < 2.0 {
            return None;
        }
        let variance = |i: usize| {
            let mean = self.mean_of(i);
            let square = self.sums.squares[i];
            // Rounding can take a vanishing variance below zero.
            let value = |c: usize| (((square[c] / n - mean[c] * mean[c]) / (n - 1.0)).max(0.0)) as f32;
            Rgb::new(value(0), value(1), value(2))
        };
        Some((0..self.sums.eye.len()).map(variance).collect())
    }

    /// Mean of one pixel.
    fn mean_of(&self, pixel: usize) -> [f64; 3] {
        let eye = self.sums.eye[pixel];
        let splat = self.sums.splats.get(pixel).copied().unwrap_or_default();
        let (eye_count, splat_count) = (self.sums.eye_count.max(1) as f64, self.sums.splat_count.max(1) as f64);
        [0, 1, 2].map(|c| eye[c] / eye_count + splat[c] / splat_count)
    }
}

/// Adds a colour to a sum.
#[inline]
fn add(sum: &mut [f64; 3], value: [f64; 3]) {
    for c in 0..3 {
        sum[c] += value[c];
    }
}

/// Adds sums pixel by pixel; an empty list is all zeros.
fn add_all(left: &mut Sums, right: &Sums) {
    if left.is_empty() {
        left.clone_from(right);
    } else {
        left.iter_mut().zip(right).for_each(|(l, r)| add(l, *r));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isophote_samplers::{Key, Purpose, Stream};

    /// Twenty iterations of noise: eye samples, and splats in batches.
    fn noise(range: std::ops::Range<u64>, moments: bool) -> Film {
        let mut film = Film::new(7, 5, moments);
        for i in range {
            let value = |index: u64| {
                let mut stream = Key { seed: 3, iteration: i, index, purpose: Purpose::Test }.stream();
                Rgb::new(stream.next_1d(), 1e3 * stream.next_1d(), 1e-3 * stream.next_1d())
            };
            film.add_eye_samples(|| (), |_, x, y| value((y * 7 + x) as u64), |()| ());
            let batch = |b: u64| -> Vec<Splat> {
                (0..40).map(|k| Splat { pixel: ((b * 11 + k * k + i) % 35) as u32, value: value(1000 + b * 64 + k) }).collect()
            };
            film.add_splats(&[batch(0), batch(1), batch(2)], 120);
            film.finish_iteration();
        }
        film
    }

    #[test]
    fn any_thread_count_gives_the_same_bits() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| noise(0..20, true))
        };
        let one = on(1);
        for threads in [2, 3, 8] {
            assert!(on(threads) == one, "{threads} threads");
        }
    }

    #[test]
    fn merged_parts_are_the_whole_within_one_ulp() {
        let whole = noise(0..20, true);
        let mut merged = noise(0..7, true);
        merged.merge(&noise(7..20, true)).expect("one size");
        assert_eq!(merged.iterations(), 20);
        for (a, b) in merged.mean().into_iter().zip(whole.mean()) {
            for c in 0..3 {
                assert!(a[c].to_bits().abs_diff(b[c].to_bits()) <= 1, "{} and {}", a[c], b[c]);
            }
        }
    }

    #[test]
    fn merging_refuses_other_sizes_and_other_moments() {
        let mut film = Film::new(2, 3, false);
        assert!(matches!(film.merge(&Film::new(3, 2, false)), Err(FilmError::Size { .. })));
        assert_eq!(film.merge(&Film::new(2, 3, true)), Err(FilmError::Moments));
    }

    #[test]
    fn raw_parts_give_the_film_back() {
        let film = noise(0..3, true);
        assert!(Film::from_raw(film.raw().clone()) == Ok(film.clone()));
        let mut raw = film.raw().clone();
        raw.splats.pop();
        assert!(matches!(Film::from_raw(raw), Err(FilmError::Part { part: "splats", found: 34, expected: 35 })));
    }

    #[test]
    fn variance_is_that_of_the_mean_over_iterations() {
        // Estimates of one pixel over three iterations: 1 + 2, 3 + 4, 2 + 0 by hand. Mean 4, sample variance 7, over 3.
        let mut film = Film::new(1, 1, true);
        assert!(film.variance_of_mean().is_none());
        for (eye, splat) in [(1.0, 2.0), (3.0, 4.0), (2.0, 0.0)] {
            film.add_eye_samples(|| (), |_, _, _| Rgb::splat(eye), |()| ());
            film.add_splats(
                &[[Splat { pixel: 0, value: Rgb::splat(splat * 4.0) }], [Splat { pixel: 0, value: Rgb::splat(splat * 6.0) }]],
                10,
            );
            film.finish_iteration();
        }
        assert_eq!(film.mean()[0], Rgb::splat(4.0));
        let variance = film.variance_of_mean().expect("three iterations")[0].r();
        assert!((variance - 7.0 / 3.0).abs() < 1e-6, "{variance}");
    }

    #[test]
    fn positions_fall_into_pixels() {
        let film = Film::new(4, 3, false);
        assert_eq!(film.pixel(Vec2::new(0.0, 0.0)), Some(0));
        assert_eq!(film.pixel(Vec2::new(3.999, 2.5)), Some(11));
        assert_eq!(film.pixel(Vec2::new(1.0, 1.0)), Some(5));
        for (x, y) in [(4.0, 0.0), (0.0, 3.0), (-0.001, 0.0), (f32::NAN, 1.0)] {
            assert_eq!(film.pixel(Vec2::new(x, y)), None);
        }
    }
}
