//! The mutation of one coordinate, and streams that mutate a stored state on demand.
//!
//! A coordinate is a 32-bit integer, `u = x / 2^32`; a path sees its upper 24 bits. The walk is `u' = u +- size xi^3` modulo 1, one size for
//! all coordinates of a proposal. \[HACHISUKA11\] takes `xi^(1/d + 1)` instead, whose small sizes come from the power: there hardly any proposal
//! moves all coordinates by about as little, since some go far in nearly every one and spoil it. The step is an integer that does not
//! depend on `x`, with a fair sign, added or subtracted with wrapping. That is symmetric
//! and keeps the uniform law on the 2^32 integers *exactly*: nothing is rounded, nothing can become 1, and a coordinate lives on the same
//! grid whether it was drawn afresh or mutated, so that exchanges with the uniform rung are exact as well.
//!
//! A state holds the coordinates its path used, no more. The target does not depend on the rest, whose law given the used ones is uniform;
//! so they are drawn afresh for every proposal, which is a Gibbs step and exact \[KELEMEN02\]. No bookkeeping of missed mutations is needed.

use crate::stream::{Stream, UniformStream, unit};

/// `2^32 size xi^3` to 31 bits, where `xi` is made of the upper 24 of 32 random bits; the last bit of the step is a random one. Written
/// with conversions and multiplications alone, so that a loop over it becomes vector instructions on any machine.
#[inline(always)]
fn step(bits: u32, size: f32) -> u32 {
    let xi = ((bits >> 8) as i32 as f32 + 0.5) * (1.0 / 16_777_216.0);
    // Below 2^31 even for the largest `xi`, which is less than 1.
    ((xi * xi * xi * (size * 2_147_483_520.0)) as i32 as u32) << 1 | (bits >> 1 & 1)
}

/// The coordinate after its mutation. The lowest bit gives the sign.
#[inline(always)]
fn mutate(x: u32, bits: u32, size: f32) -> u32 {
    let step = step(bits, size);
    if bits & 1 == 0 { x.wrapping_add(step) } else { x.wrapping_sub(step) }
}

/// Replaces `made` by mutations of all of `base`, of a size in (0, 1].
#[inline]
pub(crate) fn mutate_all(base: &[u32], size: f32, random: &mut UniformStream, made: &mut Vec<u32>) {
    made.clear();
    made.extend(base.iter().map(|_| random.bits()));
    for (made, x) in made.iter_mut().zip(base) {
        *made = mutate(*x, *made, size);
    }
}

/// Hands out prepared coordinates as far as they go, then fresh ones, and leaves in `made` what a path used. One type for fresh paths,
/// mutations and replays, so that tracing is compiled once.
pub(crate) struct Coordinates<'a> {
    random: &'a mut UniformStream,
    made: &'a mut Vec<u32>,
    used: usize,
}

impl<'a> Coordinates<'a> {
    /// Coordinates that begin with what `made` holds.
    #[inline(always)]
    pub(crate) fn after(random: &'a mut UniformStream, made: &'a mut Vec<u32>) -> Self {
        Self { random, made, used: 0 }
    }

    /// An independent uniform path.
    #[inline(always)]
    pub(crate) fn fresh(random: &'a mut UniformStream, made: &'a mut Vec<u32>) -> Self {
        made.clear();
        Self::after(random, made)
    }

    /// Drops what was prepared and not used.
    #[inline(always)]
    pub(crate) fn finish(self) {
        self.made.truncate(self.used);
    }
}

impl Stream for Coordinates<'_> {
    #[inline(always)]
    fn next_1d(&mut self) -> f32 {
        let x = match self.made.get(self.used) {
            Some(&x) => x,
            None => {
                let x = self.random.bits();
                self.made.push(x);
                x
            }
        };
        self.used += 1;
        unit(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Key, Purpose};
    use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF};

    fn random(index: u64) -> UniformStream {
        Key { seed: 8, iteration: 1, index, purpose: Purpose::Test }.stream()
    }

    /// For every pattern of random bits the one with the other sign undoes the step, from any coordinate, wrapped or not: the kernel is
    /// symmetric bit by bit, so no rounding is hidden.
    #[test]
    fn every_step_has_its_inverse() {
        let mut random = random(0);
        for x in [0, 1, 255, 1 << 31, u32::MAX - 1, u32::MAX] {
            for size in [1.0, 0.3, 1e-2, 1e-8] {
                for _ in 0..20_000 {
                    let bits = random.bits();
                    assert_eq!(mutate(mutate(x, bits, size), bits ^ 1, size), x);
                }
                // The largest step there is, which is as good as exactly 1.0, and the smallest.
                for bits in [0, 1, u32::MAX, u32::MAX - 1] {
                    let y = mutate(x, bits, size);
                    assert_eq!(mutate(y, bits ^ 1, size), x);
                    assert!((0.0..1.0).contains(&unit(y)));
                }
            }
        }
    }

    /// A histogram of `u' - u` as a path sees it (24 bits, as `f32`) is symmetric: of the steps in a bin and its mirror, half are positive.
    #[test]
    fn steps_to_both_sides_are_as_likely() {
        const BINS: usize = 32;
        for (k, size) in [1.0f32, 0.2, 1e-4].into_iter().enumerate() {
            let mut random = random(10 + k as u64);
            let mut counts = [[0u64; 2]; BINS];
            for _ in 0..1_000_000 {
                let x = random.bits();
                let mut step = unit(mutate(x, random.bits(), size)) - unit(x);
                step -= step.round();
                if step != 0.0 {
                    let bin = ((-step.abs().log2()) * 1.3) as usize;
                    counts[bin.min(BINS - 1)][usize::from(step > 0.0)] += 1;
                }
            }
            for (bin, [left, right]) in counts.into_iter().enumerate().filter(|(_, [a, b])| a + b > 0) {
                let p = Binomial::new(0.5, left + right).unwrap().cdf(left.min(right));
                assert!(2.0 * p > 1e-3 / (3 * BINS) as f64, "size {size}, bin {bin}: {left} left, {right} right");
            }
        }
    }

    /// Uniform coordinates stay uniform after a million mutations, near the borders as well (bins are finest there).
    #[test]
    fn the_uniform_law_is_kept() {
        for (k, size) in [1.0f32, 0.2, 1e-3].into_iter().enumerate() {
            let mut random = random(20 + k as u64);
            let mut x = vec![0u32; 1000];
            x.iter_mut().for_each(|x| *x = random.bits());
            let mut counts = [0u64; 66];
            let edges = [2e-4f32, 1.0 - 2e-4];
            for round in 0..1000 {
                for x in &mut x {
                    *x = mutate(*x, random.bits(), size);
                }
                // Thinned: neighbouring rounds are not independent, and large steps forget in ten to a hundred.
                if round % 100 == 99 && size > 0.01 || round == 999 {
                    for u in x.iter().map(|x| unit(*x)) {
                        counts[if u < edges[0] {
                            64
                        } else if u >= edges[1] {
                            65
                        } else {
                            (u * 64.0) as usize
                        }] += 1;
                    }
                }
            }
            let n = counts.iter().sum::<u64>() as f64;
            let expected = |bin: usize| n * if bin >= 64 { 2e-4 } else { 1.0 / 64.0 - if bin == 0 || bin == 63 { 2e-4 } else { 0.0 } };
            // The two finest bins are joined: their expectation is small.
            let mut terms: Vec<(f64, f64)> = (0..64).map(|bin| (counts[bin] as f64, expected(bin))).collect();
            terms.push(((counts[64] + counts[65]) as f64, 2.0 * expected(64)));
            let chi2: f64 = terms.iter().map(|(c, e)| (c - e).powi(2) / e).sum();
            let p = ChiSquared::new(64.0).unwrap().sf(chi2);
            assert!(p > 1e-3 / 3.0, "size {size}: chi2 {chi2}, p {p}");
        }
    }

    /// The integer step is `size xi^3` to the digits of a float, or of the integer where it has fewer, and never wraps.
    #[test]
    fn the_step_is_what_it_stands_for() {
        for size in [1.0f32, 0.37, 1e-3, 1e-7] {
            for bits in (0..u32::MAX).step_by(65_537).chain([u32::MAX]) {
                let xi = (f64::from(bits >> 8) + 0.5) / 16_777_216.0;
                let exact = xi.powi(3) * f64::from(size) * 4_294_967_296.0;
                let made = f64::from(step(bits, size));
                assert!((made - exact).abs() <= 1e-6 * exact + 2.0, "{bits}, size {size}: {made} for {exact}");
            }
        }
    }

    #[test]
    fn prepared_coordinates_are_handed_out_then_fresh_ones_and_the_used_ones_kept() {
        let mut random = random(30);
        let base: Vec<u32> = (0..5).map(|_| random.bits()).collect();
        for asked in [3, 5, 7] {
            let mut made = base.clone();
            let mut stream = Coordinates::after(&mut random, &mut made);
            let played: Vec<f32> = (0..asked).map(|_| stream.next_1d()).collect();
            stream.finish();
            assert_eq!(made[..asked.min(5)], base[..asked.min(5)]);
            assert_eq!(played, made.iter().map(|x| unit(*x)).collect::<Vec<f32>>());
        }
    }
}
