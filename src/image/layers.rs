//! Further images of a render: sums beside the film's, which share its counts.

use super::film::Sums;
use crate::math::Rgb;

/// One further image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Name in the file.
    pub name: String,
    /// Row and column on a contact sheet.
    pub place: [usize; 2],
    /// Light paths add to it, not camera-side samples.
    pub splats: bool,
}

/// Sums of further images.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerSums {
    layers: Vec<Layer>,
    pixels: usize,
    /// A layer's sums, row-major from the top left; empty while nothing was added.
    sums: Vec<Sums>,
}

impl LayerSums {
    /// Black images of so many pixels each.
    pub fn new(layers: Vec<Layer>, pixels: usize) -> Self {
        let sums = vec![Sums::new(); layers.len()];
        Self { layers, pixels, sums }
    }

    /// Most bytes that so many layers of so many pixels can hold.
    pub fn bytes(layers: usize, pixels: u64) -> u64 {
        layers as u64 * pixels * size_of::<[f64; 3]>() as u64
    }

    /// What there is, in the order of their numbers.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Adds to a layer, by its number, at a pixel, by its row-major number: what a camera-side sample, or a light path, found there.
    ///
    /// # Panics
    /// If there is no such layer or pixel.
    pub fn add(&mut self, layer: usize, pixel: usize, value: Rgb) {
        let sums = &mut self.sums[layer];
        if sums.is_empty() {
            *sums = vec![[0.0; 3]; self.pixels];
        }
        let value = value.to_array().map(f64::from);
        sums[pixel].iter_mut().zip(value).for_each(|(sum, v)| *sum += v);
    }

    /// A layer's mean over `count` samples or light paths.
    pub(super) fn mean(&self, layer: usize, count: u64) -> Vec<Rgb> {
        let sums = &self.sums[layer];
        if sums.is_empty() {
            return vec![Rgb::BLACK; self.pixels];
        }
        let count = count.max(1) as f64;
        sums.iter().map(|sum| Rgb::from(sum.map(|v| (v / count) as f32))).collect()
    }

    /// Adds another's sums; `false` if they are not of the same images, and then nothing is added.
    pub(super) fn merge(&mut self, other: &LayerSums) -> bool {
        if (&self.layers, self.pixels) != (&other.layers, other.pixels) {
            return false;
        }
        for (left, right) in self.sums.iter_mut().zip(&other.sums) {
            if left.is_empty() {
                left.clone_from(right);
            } else {
                left.iter_mut().zip(right).for_each(|(l, r)| l.iter_mut().zip(r).for_each(|(l, r)| *l += r));
            }
        }
        true
    }
}
