//! The film keeps sums and counts, never means, so that films add.

use crate::math::Rgb;

/// Box-filtered film: every sample lands in exactly one pixel. Row 0 is the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: usize,
    height: usize,
    /// Per pixel, sum of camera-side samples.
    eye: Vec<[f64; 3]>,
    /// Per pixel, sum of squares of the camera-side samples; empty unless asked for.
    eye_squares: Vec<[f64; 3]>,
    /// Camera-side samples per pixel (the same for every pixel).
    eye_count: u64,
    /// Per pixel, sum of light-side splats; empty until a method splats.
    splats: Vec<[f64; 3]>,
    /// Light paths behind the splats.
    splat_count: u64,
}

impl Film {
    /// An empty film. `squares` keeps second moments of the camera-side samples.
    pub fn new(width: usize, height: usize, squares: bool) -> Self {
        let n = width * height;
        Self {
            width,
            height,
            eye: vec![[0.0; 3]; n],
            eye_squares: if squares { vec![[0.0; 3]; n] } else { Vec::new() },
            eye_count: 0,
            splats: Vec::new(),
            splat_count: 0,
        }
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Adds one camera-side sample to every pixel: `sample(x, y)` is called once a pixel, rows in parallel. What it returns beside the
    /// colour is folded per row in index order, rows in index order.
    pub fn add_eye_samples<A: Send>(
        &mut self,
        start: impl Fn() -> A + Sync,
        sample: impl Fn(&mut A, usize, usize) -> Rgb + Sync,
        mut finish_row: impl FnMut(A),
    ) {
        use rayon::prelude::*;
        let width = self.width;
        let mut empty: Vec<[f64; 3]> = Vec::new();
        let squares = if self.eye_squares.is_empty() { &mut empty } else { &mut self.eye_squares };
        let keep_squares = !squares.is_empty();
        let row = |y: usize, sums: &mut [[f64; 3]], squares: &mut [[f64; 3]]| {
            let mut state = start();
            for x in 0..width {
                let value = sample(&mut state, x, y).to_array().map(f64::from);
                for c in 0..3 {
                    sums[x][c] += value[c];
                    if keep_squares {
                        squares[x][c] += value[c] * value[c];
                    }
                }
            }
            state
        };
        let rows: Vec<A> = if keep_squares {
            let pairs = self.eye.par_chunks_mut(width).zip(squares.par_chunks_mut(width)).enumerate();
            pairs.map(|(y, (sums, squares))| row(y, sums, squares)).collect()
        } else {
            self.eye.par_chunks_mut(width).enumerate().map(|(y, sums)| row(y, sums, &mut [])).collect()
        };
        self.eye_count += 1;
        rows.into_iter().for_each(&mut finish_row);
    }

    /// Mean image, row-major from the top left.
    pub fn mean(&self) -> Vec<Rgb> {
        let eye = 1.0 / self.eye_count.max(1) as f64;
        let splat = 1.0 / self.splat_count.max(1) as f64;
        (0..self.eye.len())
            .map(|i| {
                let s = self.splats.get(i).copied().unwrap_or_default();
                let value = |c: usize| (self.eye[i][c] * eye + s[c] * splat) as f32;
                Rgb::new(value(0), value(1), value(2))
            })
            .collect()
    }
}
