//! What the camera has seen, cell by cell, and the targets made of it.
//!
//! Cells are never forgotten, so which cell's disks reach into which is found out once: a change of densities is a sum over known pairs.

use super::super::aim::Aim;
use super::table::{Key, Table};
use super::{Cells, Gate, LEVELS, Site, Worth, inverse_side};
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// Points whose places are kept one by one: 16 MiB.
const MOST_ARRIVED: usize = 1 << 21;

/// What has been seen in one cell.
#[derive(Clone, Copy, Debug)]
struct Content {
    /// Measurement points with their centre here.
    points: f64,
    /// Sum of their kernel targets.
    kernel: f64,
    /// Box around their centres.
    low: Vec3,
    high: Vec3,
    /// Largest of their radii.
    reach: f32,
    gate: Gate,
    /// Which neighbours know of it, and of which gate.
    told: (Near, Gate),
}

impl Content {
    const EMPTY: Self = Self {
        points: 0.0,
        kernel: 0.0,
        low: Vec3::INFINITY,
        high: Vec3::NEG_INFINITY,
        reach: 0.0,
        gate: Gate::SHUT,
        told: (Near::NOTHING, Gate::SHUT),
    };

    /// The neighbours that its points' disks may reach into.
    fn near(&self, key: Key, inverse_side: f32) -> Near {
        // A radius is no wider than a cell, but for a point wider than all that came first.
        let reach = self.reach.min(inverse_side.recip());
        let [low, high] = [self.low - reach, self.high + reach].map(|p| Key::of(p, inverse_side, key.level).cell);
        Near { below: low.cmplt(key.cell).bitmask() as u8, above: high.cmpgt(key.cell).bitmask() as u8, itself: true }
    }
}

/// A box of a cell and some of its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Near {
    /// Axes along which it takes in the cell below, a bit each.
    below: u8,
    /// And the cell above.
    above: u8,
    /// It is not empty.
    itself: bool,
}

impl Near {
    const NOTHING: Self = Self { below: 0, above: 0, itself: false };

    fn contains(self, offset: IVec3) -> bool {
        let (below, above) = (offset.cmplt(IVec3::ZERO).bitmask() as u8, offset.cmpgt(IVec3::ZERO).bitmask() as u8);
        self.itself && below & !self.below == 0 && above & !self.above == 0
    }

    /// Calls `visit` with the offset of every cell of the box.
    fn each(self, mut visit: impl FnMut(IVec3)) {
        let range = |axis: u8| -i32::from(self.below >> axis & 1)..=i32::from(self.above >> axis & 1);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    visit(IVec3::new(x, y, z));
                }
            }
        }
    }
}

/// Points of one region in one cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part {
    /// Number of the cell in the high half, of the region in the low one.
    place: u64,
    points: u32,
}

impl Part {
    fn place(cell: u32, leaf: u32) -> u64 {
        u64::from(cell) << 32 | u64::from(leaf)
    }

    fn cell(self) -> usize {
        (self.place >> 32) as usize
    }

    fn leaf(self) -> u32 {
        self.place as u32
    }
}

/// A cell whose disks reach into another that has no points of its own.
#[derive(Clone, Copy, Debug)]
struct Pair {
    /// Number of the cell with points, among those seen.
    from: u32,
    /// Number of the other, among those with targets.
    to: u32,
}

/// Cells that hold measurement points, and what they hold.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Binary logarithm of the widest side; set by the first points.
    top: Option<i32>,
    known: Table<Content>,
    /// By place.
    parts: Vec<Part>,
    /// Places of points that are not among the parts yet.
    arrived: Vec<u64>,
    /// Numbers of the known cells among those with targets, as far as targets were made.
    own: Vec<u32>,
    /// By number among cells with targets: it is a known one.
    is_known: Vec<bool>,
    pairs: Vec<Pair>,
}

impl Seen {
    /// Adds measurement points with their kernel targets and regions. Cells are as wide as the larger of radius and footprint, to twice
    /// that: narrow, because what lies in a cell and is not seen takes paths away, and wide enough that few points a pixel find most cells.
    pub fn add(&mut self, sites: &[Site], aims: &[Aim]) {
        let exponent = |m: &Site| m.radius.max(m.footprint).log2().ceil() as i32;
        let Some(widest) = sites.iter().map(exponent).max() else { return };
        let top = *self.top.get_or_insert(widest);
        for (m, aim) in sites.iter().zip(aims) {
            let level = (top - exponent(m)).clamp(0, LEVELS - 1);
            let p = m.p;
            let (cell, content) = self.known.entry(Key::of(p, inverse_side(top, level), level), Content::EMPTY);
            content.points += 1.0;
            content.kernel += f64::from(aim.kernel);
            (content.low, content.high) = (content.low.min(p), content.high.max(p));
            content.reach = content.reach.max(m.radius);
            content.gate.join(m.gate);
            self.arrived.push(Part::place(cell, aim.leaf));
        }
        if self.arrived.len() > MOST_ARRIVED {
            self.sort_in();
        }
    }

    /// Counts the points that have arrived among the parts.
    fn sort_in(&mut self) {
        self.arrived.par_sort_unstable();
        self.parts.extend(self.arrived.drain(..).map(|place| Part { place, points: 1 }));
        // Two sorted runs: a stable sort merges them.
        self.parts.sort_by_key(|part| part.place);
        self.parts.dedup_by(|next, kept| {
            let same = next.place == kept.place;
            kept.points += if same { next.points } else { 0 };
            same
        });
    }

    /// Whether the points seen since targets were last made lie in new cells, more than one in a hundred.
    pub fn grown(&self) -> bool {
        100 * self.known.len() > 101 * self.own.len()
    }

    /// Makes the targets: a cell is worth the mean of its points' targets, and a cell without points that a neighbour's disks may reach the mean
    /// over these neighbours. `inverse_density` is the factor of the full target in a region.
    pub fn set(&mut self, cells: &mut Cells, inverse_density: impl Fn(u32) -> f64) {
        let Some(top) = self.top else { return };
        self.sort_in();
        self.link(top, &mut cells.worths);
        cells.tell(top);
        let mut worths: Vec<[f64; 2]> = vec![[0.0; 2]; self.known.len()];
        for part in &self.parts {
            worths[part.cell()][1] += f64::from(part.points) * inverse_density(part.leaf());
        }
        for (worth, (_, content)) in worths.iter_mut().zip(self.known.iter()) {
            let kernel = content.kernel / content.points;
            *worth = [kernel, kernel * worth[1] / content.points];
        }
        let mut sums = vec![[0.0; 3]; cells.worths.len()];
        for Pair { from, to } in &self.pairs {
            let ([kernel, full], sum) = (worths[*from as usize], &mut sums[*to as usize]);
            *sum = [sum[0] + kernel, sum[1] + full, sum[2] + 1.0];
        }
        for (own, [kernel, full]) in self.own.iter().zip(worths) {
            sums[*own as usize] = [kernel, full, 1.0];
        }
        for ((_, worth), [kernel, full, count]) in cells.worths.iter_mut().zip(sums) {
            (worth.kernel, worth.full) = ((kernel / count) as f32, (full / count) as f32);
        }
    }

    /// Gives targets' cells to what is new, and finds the pairs.
    fn link(&mut self, top: i32, worths: &mut Table<Worth>) {
        let first = self.own.len();
        for number in first..self.known.len() {
            let own = worths.entry(self.known.key(number), Worth::NOTHING).0;
            self.own.push(own);
            self.is_known.resize(worths.len(), false);
            self.is_known[own as usize] = true;
        }
        if first < self.own.len() {
            let is_known = &self.is_known;
            self.pairs.retain(|pair| !is_known[pair.to as usize]);
        }
        for (from, (key, content)) in (0..).zip(self.known.iter_mut()) {
            let near = content.near(key, inverse_side(top, key.level));
            let (before, gate) = content.told;
            if (near, content.gate) == (before, gate) {
                continue;
            }
            near.each(|offset| {
                let (to, worth) = worths.entry(Key { cell: key.cell + offset, level: key.level }, Worth::NOTHING);
                worth.gate.join(content.gate);
                let known = self.is_known.get(to as usize).is_some_and(|known| *known);
                if !known && !before.contains(offset) {
                    self.pairs.push(Pair { from, to });
                }
            });
            content.told = (near, content.gate);
        }
        self.is_known.resize(worths.len(), false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::{Key as StreamKey, Purpose, Stream};
    use crate::targets::points::DepthRange;

    const DEPTHS: DepthRange = DepthRange { min: 1, max: 20 };
    const LEAVES: u32 = 8;

    /// Points on two walls and in the air, with radii over four octaves, for one of several looks.
    fn look(number: u64) -> (Vec<Site>, Vec<Aim>) {
        let mut s = StreamKey { seed: 8, iteration: number, index: 0, purpose: Purpose::Test }.stream();
        let mut next = || s.next_1d();
        let point = |i: u32| {
            let p = Vec3::new(4.0 * next(), 4.0 * next(), [0.0, 4.0 * next()][usize::from(i.is_multiple_of(5))]);
            let radius = 0.02 * (4.0 * next()).exp2();
            let gate = Gate { faces: 1 << (i % 6), depths: (1 + (i % 3) as u16, 1 + (i % 3) as u16) };
            let site = Site { p, radius, footprint: radius * (0.5 + next()), pixel: i, gate };
            (site, Aim { kernel: 1.0 + next(), full: 0.0, leaf: i % LEAVES })
        };
        (0..3000).map(point).unzip()
    }

    fn inverse_density(leaf: u32) -> f64 {
        1.0 + f64::from(leaf)
    }

    /// By definition, from all points at once and one cell after the other.
    fn worth(seen: &Seen, at: Key) -> [f64; 2] {
        let mut of_known = vec![[0.0; 2]; seen.known.len()];
        for part in &seen.parts {
            of_known[part.cell()][1] += f64::from(part.points) * inverse_density(part.leaf());
        }
        let (mut sum, mut count) = ([0.0; 2], 0.0);
        for ((key, content), [_, densities]) in seen.known.iter().zip(of_known) {
            let kernel = content.kernel / content.points;
            let value = [kernel, kernel * densities / content.points];
            if key == at {
                return value;
            }
            let near = content.near(key, inverse_side(seen.top.unwrap(), key.level));
            if key.level == at.level && (at.cell - key.cell).abs().max_element() <= 1 && near.contains(at.cell - key.cell) {
                sum = [sum[0] + value[0], sum[1] + value[1]];
                count += 1.0;
            }
        }
        sum.map(|sum| sum / count)
    }

    /// Targets made again and again while points come are those that all points make at once.
    #[test]
    fn targets_forget_nothing_and_count_nothing_twice() {
        let (mut at_once, mut by_and_by) = (Seen::default(), Seen::default());
        let (mut whole, mut parts) = (Cells::new(DEPTHS), Cells::new(DEPTHS));
        for number in 0..4 {
            let (sites, aims) = look(number);
            at_once.add(&sites, &aims);
            by_and_by.add(&sites, &aims);
            by_and_by.set(&mut parts, |leaf| f64::from(leaf) + number as f64);
        }
        at_once.set(&mut whole, inverse_density);
        by_and_by.set(&mut parts, inverse_density);
        assert_eq!(whole.worths.len(), parts.worths.len());
        assert!(whole.worths.len() > at_once.known.len() + 1000 && at_once.known.len() > 1000);
        for (number, (key, expected)) in whole.worths.iter().enumerate() {
            let (_, found) = parts.worths.at(&parts.worths.probe(key)).unwrap();
            assert_eq!(found.gate, expected.gate, "{key:?}");
            let close = |a: f32, b: f32| (a - b).abs() <= 1e-6 * b.abs();
            assert!(close(found.kernel, expected.kernel) && close(found.full, expected.full), "{key:?}: {found:?} for {expected:?}");
            if number.is_multiple_of(7) {
                let [kernel, full] = worth(&at_once, key).map(|v| v as f32);
                assert!(close(found.kernel, kernel) && close(found.full, full), "{key:?}: {found:?} for {kernel}, {full}");
            }
        }
        assert_eq!(whole.inverse_sides, parts.inverse_sides);
    }
}
