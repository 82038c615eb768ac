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
        if total <= 0.0 || pixels == 0 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::{Key, Purpose};
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    const SCORES: [f32; 6] = [0.5, 0.0, 3.0, 1.25, 0.01, 7.0];

    fn pairing(scores: &[f32], pixels: usize, iteration: u64) -> Pairing {
        let mut stream = Key { seed: 3, iteration, index: 0, purpose: Purpose::Pair }.stream();
        Pairing::new(scores, pixels, 10, &mut stream)
    }

    /// Every pixel takes every path as often as its score says, and its factor is one over the number of paths and that probability.
    #[test]
    fn a_pixel_takes_paths_in_proportion_to_their_scores() {
        let (pixels, draws) = (7, 40_000);
        let total: f32 = SCORES.iter().sum();
        let mut counts = vec![[0u32; SCORES.len()]; pixels];
        for iteration in 0..draws {
            let pairing = pairing(&SCORES, pixels, iteration);
            for (pixel, counts) in counts.iter_mut().enumerate() {
                let (path, factor) = pairing.partner(pixel).unwrap();
                counts[path] += 1;
                assert!((factor * 10.0 * SCORES[path] / total - 1.0).abs() < 1e-5);
            }
        }
        for counts in counts {
            let expected = SCORES.map(|score| f64::from(score / total) * draws as f64);
            let terms = counts.iter().zip(expected).filter(|(_, expected)| *expected > 0.0);
            let chi2: f64 = terms.map(|(count, expected)| (f64::from(*count) - expected).powi(2) / expected).sum();
            let p = 1.0 - ChiSquared::new(4.0).unwrap().cdf(chi2);
            assert!(counts[1] == 0 && p > 1e-4, "{counts:?} {expected:?} p {p}");
        }
    }

    /// With equal scores and as many paths as pixels it is a permutation, another one in every iteration; a path serves as many pixels as
    /// expected, rounded.
    #[test]
    fn equal_scores_make_a_permutation() {
        let of = |iteration| {
            let pairing = pairing(&[0.3; 1000], 1000, iteration);
            (0..1000).map(|pixel| pairing.partner(pixel).unwrap().0).collect::<Vec<_>>()
        };
        let (first, second) = (of(0), of(1));
        let mut sorted = first.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..1000).collect::<Vec<_>>());
        assert!(first != second && first != sorted);
        let paths: Vec<usize> = (0..1000).map(|pixel| pairing(&SCORES, 1000, 0).partner(pixel).unwrap().0).collect();
        for (path, score) in SCORES.iter().enumerate() {
            let expected = 1000.0 * score / SCORES.iter().sum::<f32>();
            let count = paths.iter().filter(|p| **p == path).count() as f32;
            assert!((count - expected).abs() <= 1.0, "{path}: {count} for {expected}");
        }
    }

    #[test]
    fn where_no_path_counts_there_is_no_partner() {
        for scores in [&[] as &[f32], &[0.0, 0.0]] {
            assert_eq!(pairing(scores, 4, 0).partner(2), None);
        }
    }
}
