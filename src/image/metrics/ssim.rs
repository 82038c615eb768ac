//! Structural similarity \[WANG04\].

use super::filter::add_scaled;
use super::{Measured, Pairs};
use crate::image::tonemap::srgb;
use rayon::prelude::*;

/// Side of the window.
const WINDOW: usize = 11;
/// Standard deviation of its Gaussian weights, pixels.
const SIGMA: f64 = 1.5;
/// Pixels between a picture's border and the first centre of a full window.
const BORDER: usize = WINDOW / 2;
/// (K1 L)^2 and (K2 L)^2 with K1 = 0.01, K2 = 0.03 and the range L = 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Planes that are smoothed: x, y, x^2, y^2, xy.
const PLANES: usize = 5;

/// SSIM [WANG04 (13)] of the sRGB-encoded luminance, clamped to `[0, 1]`, with Gaussian weights that sum to one and population (co)variances
/// [WANG04 (14)-(16)]: mean over the windows that lie inside the picture and have no masked centre. The five pixels along each border are
/// no centre. A picture less than 11 pixels wide or high has no value, and all its pixels are counted as left out.
pub(super) fn ssim(pairs: &Pairs) -> Measured {
    let (width, height) = pairs.size();
    if width < WINDOW || height < WINDOW {
        return Measured { value: None, left_out: pairs.pixels() };
    }
    let weights = gaussian();
    // Each row smoothed along x: its full windows' sums of the planes, one plane after the other.
    let columns = width - 2 * BORDER;
    let mut rows = vec![0.0; height * PLANES * columns];
    rows.par_chunks_mut(PLANES * columns).enumerate().for_each_init(
        || vec![0.0; PLANES * width],
        |planes, (y, row)| {
            load(pairs, y, planes);
            for (plane, out) in planes.chunks(width).zip(row.chunks_mut(columns)) {
                for (i, weight) in weights.iter().enumerate() {
                    add_scaled(out, &plane[i..], *weight);
                }
            }
        },
    );
    let sums: Vec<(f64, u64)> = (0..height - 2 * BORDER)
        .into_par_iter()
        .map_init(
            || vec![0.0; PLANES * columns],
            |smoothed, top| {
                smoothed.fill(0.0);
                for (row, weight) in rows.chunks(PLANES * columns).skip(top).zip(&weights) {
                    add_scaled(smoothed, row, *weight);
                }
                sum_row(smoothed, columns, |x| pairs.masked_at((top + BORDER) * width + x + BORDER))
            },
        )
        .collect();
    // Rows are joined in order: the same bits at any thread count.
    let (sum, count) = sums.into_iter().fold((0.0, 0), |(sum, count), (s, c)| (sum + s, count + c));
    Measured { value: (count > 0).then(|| sum / count as f64), left_out: 0 }
}

fn gaussian() -> [f64; WINDOW] {
    let weights: [f64; WINDOW] = std::array::from_fn(|i| {
        let x = i as f64 - BORDER as f64;
        (-x * x / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

/// The planes of a row.
fn load(pairs: &Pairs, y: usize, planes: &mut [f64]) {
    let width = pairs.size().0;
    for i in 0..width {
        let (r, x) = pairs.shown(y * width + i);
        let (r, x) = (f64::from(srgb(r.luminance())), f64::from(srgb(x.luminance())));
        for (plane, value) in [x, r, x * x, r * r, x * r].into_iter().enumerate() {
            planes[plane * width + i] = value;
        }
    }
}

/// Sum of the index over a row's centres, and their number.
fn sum_row(smoothed: &[f64], columns: usize, masked: impl Fn(usize) -> bool) -> (f64, u64) {
    let (mut sum, mut count) = (0.0, 0);
    for i in (0..columns).filter(|i| !masked(*i)) {
        let [x, y, xx, yy, xy] = std::array::from_fn(|plane| smoothed[plane * columns + i]);
        let (variances, covariance) = ((xx - x * x) + (yy - y * y), xy - x * y);
        sum += (2.0 * x * y + C1) * (2.0 * covariance + C2) / ((x * x + y * y + C1) * (variances + C2));
        count += 1;
    }
    (sum, count)
}
