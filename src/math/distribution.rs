//! Discrete and piecewise-bilinear distributions.
//!
//! Cumulative weights are kept as integers: a difference of two of them is exact, so the probability that a choice is given is the
//! probability with which it is drawn, and a choice of positive weight never loses it to rounding.

use glam::Vec2;

/// A choice among finitely many, in proportion to weights that are not negative.
#[derive(Clone, Debug)]
pub struct Discrete {
    /// `cumulative[i]` is the share of choices before `i`; one more entry than choices.
    cumulative: Vec<u32>,
    /// What a draw asks of each choice.
    shares: Vec<Share>,
    /// For each run of `2^guide_shift` shares, the choice that holds the first of them: where the search begins.
    guide: Vec<u32>,
    guide_shift: u32,
}

/// What a draw asks of a choice.
#[derive(Clone, Copy, Debug)]
struct Share {
    /// Reciprocal of its width in shares; never asked where that is zero.
    inverse_width: f64,
    /// As [`Choice::probability`].
    probability: f32,
}

/// Entries of the guide for each choice: the more, the rarer a draw that has to step on from where the guide points.
const GUIDE_ENTRIES: usize = 4;
/// Most bits of the guide's index.
const GUIDE_BITS: u32 = 20;

/// A choice made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// What was chosen.
    pub index: usize,
    /// With what probability.
    pub probability: f32,
    /// What is left of the random number: uniform in [0, 1) given the choice, as fine as the number's digits allow.
    pub rest: f32,
}

impl Discrete {
    /// `None` if no weight is positive. Weights must be finite and not negative, and fewer than 2^31.
    pub fn new(weights: impl Iterator<Item = f64> + Clone) -> Option<Self> {
        let mut cumulative = Vec::new();
        append(&mut cumulative, weights)?;
        let count = cumulative.len() - 1;
        let total = cumulative[count];
        let share = |index: usize| Share {
            inverse_width: 1.0 / f64::from(cumulative[index + 1] - cumulative[index]),
            probability: probability(&cumulative, index),
        };
        let shares = (0..count).map(share).collect();
        let guide_bits = (count * GUIDE_ENTRIES).next_power_of_two().ilog2().min(GUIDE_BITS);
        let guide_shift = u32::BITS - guide_bits;
        let guide = (0..1u32 << guide_bits).map(|entry| find(&cumulative, (entry << guide_shift).min(total - 1)) as u32).collect();
        Some(Self { cumulative, shares, guide, guide_shift })
    }

    /// Number of choices.
    pub fn len(&self) -> usize {
        self.shares.len()
    }

    /// Never: there is at least one choice.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Draws; `u` in [0, 1).
    #[inline(always)]
    pub fn sample(&self, u: f32) -> Choice {
        if self.shares.len() == 1 {
            return Choice { index: 0, probability: 1.0, rest: u };
        }
        let (x, whole) = place(self.cumulative[self.shares.len()], u);
        let mut index = self.guide[(whole >> self.guide_shift) as usize] as usize;
        while self.cumulative[index + 1] <= whole {
            index += 1;
        }
        let Share { inverse_width, probability } = self.shares[index];
        let rest = ((x - f64::from(self.cumulative[index])) * inverse_width) as f32;
        Choice { index, probability, rest: rest.clamp(0.0, ONE_BELOW) }
    }

    /// Probability of `index`.
    #[inline]
    pub fn probability(&self, index: usize) -> f32 {
        self.shares[index].probability
    }

    /// Bytes on the heap.
    pub fn memory(&self) -> usize {
        (self.cumulative.capacity() + self.guide.capacity()) * size_of::<u32>() + self.shares.capacity() * size_of::<Share>()
    }
}

/// Appends the cumulative weights of one distribution: at least 1 for a positive weight, at most `u32::MAX` in all.
fn append(cumulative: &mut Vec<u32>, weights: impl Iterator<Item = f64> + Clone) -> Option<f64> {
    let (count, total) = weights.clone().fold((0u32, 0.0), |(n, sum), w| (n + 1, sum + w));
    debug_assert!(weights.clone().all(|w| w >= 0.0) && total.is_finite());
    if total <= 0.0 {
        return None;
    }
    // One each for rounding up, the rest by weight. Rounded-down shares add to no more than the whole, but for the rounding of `total`
    // itself: a part in 2^20 is kept back for that.
    let scale = f64::from(u32::MAX - count) * (1.0 - 1.0 / f64::from(1 << 20)) / total;
    let mut sum = 0u32;
    cumulative.push(0);
    for w in weights {
        sum += if w > 0.0 { 1 + (w * scale) as u32 } else { 0 };
        cumulative.push(sum);
    }
    Some(total)
}

/// Where among `total` shares a random number falls, and the number of the share it falls into.
#[inline(always)]
fn place(total: u32, u: f32) -> (f64, u32) {
    let x = f64::from(u) * f64::from(total);
    (x, (x as u32).min(total - 1))
}

/// The choice that holds a share.
#[inline(always)]
fn find(cumulative: &[u32], share: u32) -> usize {
    cumulative.partition_point(|&c| c <= share) - 1
}

#[inline(always)]
fn sample(cumulative: &[u32], u: f32) -> Choice {
    let last = cumulative.len() - 1;
    if last == 1 {
        return Choice { index: 0, probability: 1.0, rest: u };
    }
    let total = cumulative[last];
    let (x, whole) = place(total, u);
    let index = find(cumulative, whole);
    let (before, width) = (cumulative[index], cumulative[index + 1] - cumulative[index]);
    let rest = ((x - f64::from(before)) / f64::from(width)) as f32;
    Choice { index, probability: (f64::from(width) / f64::from(total)) as f32, rest: rest.clamp(0.0, ONE_BELOW) }
}

#[inline]
fn probability(cumulative: &[u32], index: usize) -> f32 {
    let total = cumulative[cumulative.len() - 1];
    (f64::from(cumulative[index + 1] - cumulative[index]) / f64::from(total)) as f32
}

/// The largest number below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

/// Points of the unit square with a density that is bilinear over each cell of a grid: between the columns' values, periodic, from `i` to
/// `i + 1` of `width`; between the rows' from `j` to `j + 1` of `height - 1`.
#[derive(Clone, Debug)]
pub struct BilinearGrid {
    width: usize,
    /// Choice of a row of cells.
    rows: Discrete,
    /// Choice of a cell within each row, `width + 1` entries a row; rows without weight hold zeros.
    cells: Vec<u32>,
}

/// Where in the grid a point fell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridPoint {
    /// Column and row of the cell.
    pub cell: [usize; 2],
    /// Position within the cell, each coordinate in [0, 1).
    pub within: Vec2,
}

impl BilinearGrid {
    /// From the mean weight of each cell: `weight(column, row)`; `None` if none is positive.
    pub fn new(width: usize, rows: usize, weight: impl Fn(usize, usize) -> f64) -> Option<Self> {
        let mut cells = Vec::with_capacity((width + 1) * rows);
        let mut totals = Vec::with_capacity(rows);
        for row in 0..rows {
            match append(&mut cells, (0..width).map(|column| weight(column, row))) {
                Some(total) => totals.push(total),
                None => {
                    cells.extend(std::iter::repeat_n(0, width + 1));
                    totals.push(0.0);
                }
            }
        }
        Some(Self { width, rows: Discrete::new(totals.iter().copied())?, cells })
    }

    /// A cell, with what is left of `u`; the position within the cell is the caller's to warp.
    #[inline]
    pub fn sample(&self, u: Vec2) -> (GridPoint, f32) {
        let row = self.rows.sample(u.y);
        let cell = sample(self.row(row.index), u.x);
        (GridPoint { cell: [cell.index, row.index], within: Vec2::new(cell.rest, row.rest) }, row.probability * cell.probability)
    }

    /// Probability of a cell.
    #[inline]
    pub fn probability(&self, [column, row]: [usize; 2]) -> f32 {
        let share = self.rows.probability(row);
        if share > 0.0 { share * probability(self.row(row), column) } else { 0.0 }
    }

    fn row(&self, row: usize) -> &[u32] {
        &self.cells[row * (self.width + 1)..(row + 1) * (self.width + 1)]
    }

    /// Bytes on the heap.
    pub fn memory(&self) -> usize {
        self.rows.memory() + self.cells.capacity() * size_of::<u32>()
    }
}

/// Warps `u` in [0, 1) to the density `(1 - x) a + x b`, up to scale, on [0, 1); both not negative, one of them positive.
#[inline]
pub fn linear(u: f32, a: f32, b: f32) -> f32 {
    // The root of a x + (b - a) x^2/2 = u (a + b)/2 in the form that does not cancel.
    let root = (a * a + u * (b - a) * (b + a)).max(0.0).sqrt();
    let x = u * (a + b) / (a + root);
    if x.is_finite() { x.clamp(0.0, ONE_BELOW) } else { u }
}

/// Warps `u` to the bilinear density between corner values `[at 00, at 10, at 01, at 11]`, and its density there.
#[inline]
pub fn bilinear(u: Vec2, corners: [f32; 4]) -> (Vec2, f32) {
    let [c00, c10, c01, c11] = corners;
    let y = linear(u.y, c00 + c10, c01 + c11);
    let x = linear(u.x, c00 + y * (c01 - c00), c10 + y * (c11 - c10));
    let p = Vec2::new(x, y);
    (p, bilinear_pdf(p, corners))
}

/// Density of [`bilinear`] at `p`.
#[inline]
pub fn bilinear_pdf(p: Vec2, [c00, c10, c01, c11]: [f32; 4]) -> f32 {
    let value = (1.0 - p.y) * ((1.0 - p.x) * c00 + p.x * c10) + p.y * ((1.0 - p.x) * c01 + p.x * c11);
    value / (0.25 * (c00 + c10 + c01 + c11))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_those_of_the_draws() {
        let weights = [0.0, 3.0, 1e-30, 0.0, 5.0, 2.0, 0.0];
        let d = Discrete::new(weights.iter().copied()).unwrap();
        assert_eq!(d.len(), 7);
        let mut counts = [0u32; 7];
        let n = 1 << 16;
        for i in 0..n {
            let c = d.sample((i as f32 + 0.5) / n as f32);
            counts[c.index] += 1;
            assert_eq!(c.probability, d.probability(c.index));
            assert!((0.0..1.0).contains(&c.rest));
        }
        for (i, w) in weights.iter().enumerate() {
            assert!((counts[i] as f64 / n as f64 - w / 10.0).abs() < 2e-5, "choice {i}: {} of {n}", counts[i]);
            assert_eq!(d.probability(i) > 0.0, *w > 0.0, "choice {i}");
        }
        assert!(((0..7).map(|i| f64::from(d.probability(i))).sum::<f64>() - 1.0).abs() < 1e-6);
    }

    /// The guide only says where to begin: choices of any number and of the most uneven weights are those of the plain search.
    #[test]
    fn guided_draws_are_those_of_a_search() {
        let uneven = |i: usize| if i % 7 == 3 { 0.0 } else { 1.0 / (1.0 + (i * i) as f64) };
        for n in [1usize, 2, 3, 26, 1000] {
            let d = Discrete::new((0..n).map(uneven)).unwrap();
            for i in 0..10_000 {
                let u = (i as f32 + 0.5) / 10_000.0;
                let (guided, searched) = (d.sample(u), sample(&d.cumulative, u));
                assert_eq!((guided.index, guided.probability), (searched.index, searched.probability), "{n} choices, {u}");
                assert!((guided.rest - searched.rest).abs() <= f32::EPSILON, "{n} choices, {u}");
            }
        }
    }

    #[test]
    fn ends_of_the_unit_interval_choose_positive_weights() {
        let d = Discrete::new([0.0, 1.0, 0.0].into_iter()).unwrap();
        assert_eq!(d.sample(0.0).index, 1);
        assert_eq!(d.sample(ONE_BELOW).index, 1);
        assert!(Discrete::new([0.0, 0.0].into_iter()).is_none());
        assert!(Discrete::new(std::iter::empty()).is_none());
        // The sum must not overflow, however the rounding falls.
        for n in [1usize, 2, 3, 1000, 65_537] {
            let d = Discrete::new((0..n).map(|i| if i % 3 == 0 { 1.0 } else { 1e-12 })).unwrap();
            assert_eq!(d.sample(ONE_BELOW).index / 3, (n - 1) / 3);
        }
    }

    #[test]
    fn the_rest_is_uniform() {
        let d = Discrete::new([1.0, 2.0, 1.0].into_iter()).unwrap();
        let n = 4096;
        let mean = (0..n).map(|i| f64::from(d.sample((i as f32 + 0.5) / n as f32).rest)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 1e-3, "{mean}");
    }

    #[test]
    fn linear_and_bilinear_warps_invert_their_densities() {
        // d(warp)/du is 1/density: compare on a fine grid.
        for (a, b) in [(1.0, 0.0), (0.0, 1.0), (0.2, 3.0), (1.0, 1.0), (5.0, 4.999)] {
            for i in 5..95 {
                let u = i as f32 / 100.0;
                let h = 5e-3;
                let slope = (linear(u + h, a, b) - linear(u - h, a, b)) / (2.0 * h);
                let density = 2.0 * (a + (b - a) * linear(u, a, b)) / (a + b);
                assert!((slope * density - 1.0).abs() < 5e-3, "{a} {b} {u}: {slope} {density}");
            }
            assert_eq!(linear(0.0, a, b), 0.0);
        }
        let corners = [0.0, 1.0, 2.0, 0.5];
        let n = 400;
        let mut mean = glam::DVec2::ZERO;
        let mut volume = 0.0;
        for i in 0..n * n {
            let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
            let (p, pdf) = bilinear(u, corners);
            mean += p.as_dvec2() / (n * n) as f64;
            volume += 1.0 / f64::from(pdf) / (n * n) as f64;
        }
        // First moments of the bilinear density, and the area where it is positive.
        let total = 3.5 / 4.0;
        let expected = glam::DVec2::new((2.0 / 6.0 + 1.5 / 3.0) / 2.0, (1.0 / 6.0 + 2.5 / 3.0) / 2.0) / total;
        assert!((mean - expected).length() < 1e-3, "{mean} {expected}");
        assert!((volume - 1.0).abs() < 1e-2, "{volume}");
    }
}
