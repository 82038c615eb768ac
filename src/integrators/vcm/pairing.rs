//! Which light subpath a camera subpath is connected to where light subpaths count for different amounts.
//!
//! A pixel takes light subpath `p` with a probability `q_p` and divides by it. With `q_p` in proportion to what the path counts for, the pixels'
//! partners are spread as independent light subpaths would be, which is the law that the techniques' weights assume, and every
//! connection has the same factor.

use crate::samplers::{Stream, UniformStream};

/// A light subpath for every pixel.
#[derive(Clone, Debug)]
pub(super) struct Pairing {
    /// Path and factor by pixel; empty where no path counts.
    partners: Vec<(u32, f32)>,
}

impl Pairing {
    /// Pairs `pixels` camera subpaths with light subpaths in proportion to `scores`: systematic sampling, so that a path serves as many pixels
    /// as expected, rounded up or down; the pixels are those of a random permutation. `paths` is the number of light subpaths that the
    /// weights of techniques know: a path's factor is one over it and its probability.
    pub(super) fn new(scores: &[f32], pixels: usize, paths: u64, stream: &mut UniformStream) -> Self {
        let total: f64 = scores.iter().map(|score| f64::from(*score)).sum();
        if !(total > 0.0) || pixels == 0 {
            return Self { partners: Vec::new() };
        }
        let mut partners = Vec::with_capacity(pixels);
        // Path p takes the slots j with a_{p-1} <= j + offset < a_p, a the sums of scores in slots.
        let offset = f64::from(stream.next_1d());
        let slots = pixels as f64 / total;
        let mut sum = 0.0;
        for (path, score) in scores.iter().enumerate().filter(|(_, score)| **score > 0.0) {
            let factor = (total / (f64::from(*score) * paths as f64)) as f32;
            sum += f64::from(*score);
            while partners.len() < pixels && partners.len() as f64 + offset < sum * slots {
                partners.push((path as u32, factor));
            }
        }
        // The last slot where rounding has left it behind the last sum.
        if let Some(last) = partners.last().copied() {
            partners.resize(pixels, last);
        }
        for place in (1..partners.len()).rev() {
            partners.swap(place, stream.below(place + 1));
        }
        Self { partners }
    }

    /// The path of a pixel, and the factor on what its connections bring; `None` where no path counts.
    #[inline(always)]
    pub(super) fn partner(&self, pixel: usize) -> Option<(usize, f32)> {
        self.partners.get(pixel).map(|&(path, factor)| (path as usize, factor))
    }
}
