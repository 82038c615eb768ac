//! Coordinates that fill the cube evenly over iterations.
//!
//! A pixel's camera subpaths are a function of few coordinates (where in the pixel, where on the lens, reflected or refracted), and its value is their
//! mean over iterations. Independent coordinates give that mean a variance that falls as one over the iterations; a scrambled (0, 2)-sequence
//! puts one iteration in each of n strata, so that a choice of probability p falls np times, to less than one, and the variance falls faster \[OWEN97\]
//! wherever the integrand has any structure in the first coordinates, and is never much larger where it has none.

use crate::stream::{Key, Stream, UniformStream};
use sobol_burley::NUM_DIMENSION_SETS_4D;
use sobol_burley::parts::{Int4, hash, hash_int4, owen_scramble_int4_rev, owen_scramble_rev, sobol_int4_rev};
use std::sync::LazyLock;

/// Iterations of one scramble: the generator has no more. The next as many are scrambled anew.
const PERIOD: u64 = 1 << 16;

/// Coordinates of points before they are scrambled: by set, for each four of the sixteen bits of a point's number and each value of the four. A point is
/// the exclusive or of its bits' direction numbers; so four at a time are one load, where bit by bit they are a loop that nobody can foretell.
static PARTS: LazyLock<Vec<[[[u32; 4]; 16]; 4]>> = LazyLock::new(|| {
    let part = |set: u32, shift: usize, value: usize| <[u32; 4]>::from(sobol_int4_rev((value as u32) << (16 + 4 * shift), set));
    let of_set = |set: u32| std::array::from_fn(|shift| std::array::from_fn(|value| part(set, shift, value)));
    (0..NUM_DIMENSION_SETS_4D).map(of_set).collect()
});

/// What [`sobol_burley::sample_4d`] makes of a point's number, whichever coordinates it is asked for.
#[inline(always)]
fn shuffled(point: u32, scramble: u32) -> u32 {
    owen_scramble_rev(point.reverse_bits(), hash(scramble ^ 0x79c6_8e4a))
}

/// The rest of [`sobol_burley::sample_4d`], bit for bit.
#[inline(always)]
fn scrambled(point: u32, set: u32, scramble: u32) -> [f32; 4] {
    let parts = &PARTS[set as usize];
    let part = |shift: usize| Int4::from(parts[shift][(point >> (16 + 4 * shift)) as usize & 15]);
    let sobol = part(0) ^ part(1) ^ part(2) ^ part(3);
    let own = Int4::from([scramble.wrapping_mul(0x9c8f_2d3b) ^ set; 4]) ^ [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8].into();
    owen_scramble_int4_rev(sobol, hash_int4(own)).reverse_bits().to_f32_norm()
}

/// Coordinates of one iteration: a point of a Sobol' sequence with Owen's scrambling \[BURLEY20\]. The iteration of its key is the number of the point,
/// all else chooses the scramble, so that streams that differ in anything but the iteration are independent. Every point by itself is uniform. Coordinates
/// beyond the sequence's 256 are those of [`Key::stream`].
#[derive(Clone, Debug)]
pub struct StratifiedStream {
    /// Number of the point after the scramble has put them in another order, bits reversed.
    point: u32,
    scramble: u32,
    /// The four coordinates of this number.
    set: u32,
    values: [f32; 4],
    /// The next of them; 4 if they are used up.
    next: usize,
    key: Key,
    /// Where coordinates come from once the sequence has no more.
    beyond: Option<UniformStream>,
}

impl Key {
    /// The stratified stream at this address.
    #[inline]
    pub fn stratified(self) -> StratifiedStream {
        let scramble = Self { iteration: self.iteration / PERIOD, ..self }.stream().bits();
        StratifiedStream {
            point: shuffled((self.iteration % PERIOD) as u32, scramble),
            scramble,
            set: 0,
            values: [0.0; 4],
            next: 4,
            key: self,
            beyond: None,
        }
    }
}

impl Stream for StratifiedStream {
    #[inline(always)]
    fn next_1d(&mut self) -> f32 {
        if self.next == self.values.len() {
            if self.set == NUM_DIMENSION_SETS_4D {
                return self.beyond.get_or_insert_with(|| self.key.stream()).next_1d();
            }
            self.values = scrambled(self.point, self.set, self.scramble);
            self.set += 1;
            self.next = 0;
        }
        let value = self.values[self.next];
        self.next += 1;
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::Purpose;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    fn key(iteration: u64, index: u64) -> Key {
        Key { seed: 4, iteration, index, purpose: Purpose::Test }
    }

    fn point(key: Key, dimensions: usize) -> Vec<f32> {
        let mut stream = key.stratified();
        (0..dimensions).map(|_| stream.next_1d()).collect()
    }

    /// Of the first 2^m iterations, and of every later block of as many, one lies in each of 2^m equal intervals of a coordinate; the first two coordinates
    /// put one in each of 2^m rectangles of every shape. Independent coordinates do neither.
    #[test]
    fn blocks_of_iterations_fill_strata() {
        const DIMENSIONS: usize = 40;
        for block in [0, 3] {
            for m in [1u32, 3, 6] {
                let n = 1u64 << m;
                let points: Vec<Vec<f32>> = (block * n..(block + 1) * n).map(|i| point(key(i, 7), DIMENSIONS)).collect();
                let filled = |cell: &dyn Fn(&[f32]) -> usize| {
                    let mut cells: Vec<usize> = points.iter().map(|p| cell(p)).collect();
                    cells.sort_unstable();
                    cells.into_iter().eq(0..n as usize)
                };
                for d in 0..DIMENSIONS {
                    assert!(filled(&|p| (p[d] * n as f32) as usize), "coordinate {d}, {n} iterations");
                }
                for across in 0..=m {
                    let (columns, rows) = (1usize << across, n as usize >> across);
                    let cell = |p: &[f32]| (p[0] * columns as f32) as usize * rows + (p[1] * rows as f32) as usize;
                    assert!(filled(&cell), "{columns} x {rows}");
                }
            }
        }
    }

    /// A choice of probability p falls np times in n iterations, to less than one where n is a power of two.
    #[test]
    fn a_choice_falls_as_often_as_it_should() {
        for p in [0.02f32, 0.1, 0.5, 0.77] {
            for index in 0..50 {
                let falls = (0..64).filter(|i| point(key(*i, index), 5)[4] < p).count() as f32;
                assert!((falls - 64.0 * p).abs() < 1.0, "{falls} of 64 at {p}");
            }
        }
    }

    /// Over scrambles a point is uniform in the square, whichever of its coordinates and whichever iteration it is, and so is what two pixels
    /// have at the same iteration.
    #[test]
    fn every_point_is_uniform() {
        const SIDE: usize = 16;
        const N: u64 = 1 << 16;
        let chi2 = |cells: &mut dyn Iterator<Item = [f32; 2]>| {
            let mut counts = [0u32; SIDE * SIDE];
            for [x, y] in cells {
                assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
                counts[(x * SIDE as f32) as usize * SIDE + (y * SIDE as f32) as usize] += 1;
            }
            let expected = counts.iter().map(|c| f64::from(*c)).sum::<f64>() / counts.len() as f64;
            counts.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum::<f64>()
        };
        let law = ChiSquared::new((SIDE * SIDE - 1) as f64).unwrap();
        let mut tests = Vec::new();
        for iteration in [0, 1, 17, 1000] {
            for (a, b) in [(0, 1), (2, 4), (1, 9), (30, 31)] {
                let mut own = (0..N).map(|index| point(key(iteration, index), 32)).map(|p| [p[a], p[b]]);
                tests.push((iteration, a, b, chi2(&mut own)));
                let mut neighbours = (0..N).map(|index| [point(key(iteration, index), 32)[a], point(key(iteration, index + 1), 32)[a]]);
                tests.push((iteration, a, a, chi2(&mut neighbours)));
            }
        }
        let level = 1e-3 / tests.len() as f64;
        for (iteration, a, b, chi2) in tests {
            assert!(law.sf(chi2) > level, "iteration {iteration}, coordinates {a} and {b}: chi2 {chi2}");
        }
    }

    #[test]
    fn points_are_those_of_the_library() {
        let mut s = key(0, 0).stream();
        for point in (0..64).chain((64..PERIOD as u32).step_by(997)) {
            let scramble = s.bits();
            for set in 0..NUM_DIMENSION_SETS_4D {
                let expected = sobol_burley::sample_4d(point, set, scramble);
                assert_eq!(scrambled(shuffled(point, scramble), set, scramble), expected, "point {point}, set {set}");
            }
        }
    }

    #[test]
    fn streams_have_an_address_a_period_and_an_end() {
        assert_eq!(point(key(5, 1), 20), point(key(5, 1), 20));
        for other in [key(6, 1), key(5, 2), key(5 + PERIOD, 1), Key { seed: 5, ..key(5, 1) }, Key { purpose: Purpose::Camera, ..key(5, 1) }]
        {
            let (a, b) = (point(key(5, 1), 20), point(other, 20));
            assert!(a.iter().zip(&b).all(|(a, b)| a != b), "{other:?}");
        }
        let beyond = point(key(5, 1), 260).split_off(256);
        let mut stream = key(5, 1).stream();
        assert_eq!(beyond, (0..4).map(|_| stream.next_1d()).collect::<Vec<f32>>());
    }
}
