//! What the camera has seen, cell by cell, and the targets made of it.
//!
//! Cells are never forgotten, so which cell's disks reach into which is found out once: a change of densities is a sum over known pairs.

use super::super::aim::Aim;
use super::table::{Key, SHARDS, Table, shard};
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

/// A cell with points, by its table and its number there.
#[derive(Clone, Copy, Debug)]
struct Place {
    shard: u32,
    number: u32,
}

/// A cell whose disks reach into another.
#[derive(Clone, Copy, Debug)]
struct Reaching {
    into: Key,
    from: Place,
    gate: Gate,
    /// The other has not known of it.
    new: bool,
}

/// Cells of one table that hold measurement points, what they hold, and what is reached into.
#[derive(Clone, Debug, Default)]
struct Shard {
    known: Table<Content>,
    /// By place.
    parts: Vec<Part>,
    /// Places of points that are not among the parts yet.
    arrived: Vec<u64>,
    /// Numbers of the known cells among those with targets, as far as targets were made.
    own: Vec<u32>,
    /// By number among cells with targets: it is a known one.
    is_known: Vec<bool>,
    /// Cells whose disks reach into one without points of its own, and its number among those with targets.
    pairs: Vec<(Place, u32)>,
}

/// Cells that hold measurement points.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Binary logarithm of the widest side; set by the first points.
    top: Option<i32>,
    shards: Vec<Shard>,
}

impl Default for Seen {
    fn default() -> Self {
        Self { top: None, shards: vec![Shard::default(); SHARDS] }
    }
}

impl Seen {
    /// Adds measurement points with their kernel targets and regions. Cells are as wide as the larger of radius and footprint, to twice
    /// that: narrow, because what lies in a cell and is not seen takes paths away, and wide enough that few points a pixel find most cells.
    pub fn add(&mut self, sites: &[Site], aims: &[Aim]) {
        let exponent = |m: &Site| m.radius.max(m.footprint).log2().ceil() as i32;
        let Some(widest) = sites.par_iter().map(exponent).max() else { return };
        let top = *self.top.get_or_insert(widest);
        let key = |m: &Site| {
            let level = (top - exponent(m)).clamp(0, LEVELS - 1);
            let key = Key::of(m.p, inverse_side(top, level), level);
            (key, shard(key.hash()) as u8)
        };
        let (keys, shards): (Vec<Key>, Vec<u8>) = sites.par_iter().map(key).unzip();
        self.shards.par_iter_mut().enumerate().with_max_len(1).for_each(|(mine, shard)| {
            for (i, _) in shards.iter().enumerate().filter(|(_, of)| usize::from(**of) == mine) {
                shard.add(keys[i], &sites[i], &aims[i]);
            }
        });
    }

    /// Cells with points, and those among them with targets.
    fn counts(&self) -> (usize, usize) {
        self.shards.iter().fold((0, 0), |(known, made), shard| (known + shard.known.len(), made + shard.own.len()))
    }

    /// Whether the points seen since targets were last made lie in new cells, more than one in a hundred.
    pub fn grown(&self) -> bool {
        let (known, made) = self.counts();
        100 * known > 101 * made
    }

    /// Makes the targets: a cell is worth the mean of its points' targets, and a cell without points that a neighbour's disks may reach the mean
    /// over these neighbours. `inverse_density` is the factor of the full target in a region.
    pub fn set(&mut self, cells: &mut Cells, inverse_density: impl Fn(u32) -> f64 + Sync) {
        let Some(top) = self.top else { return };
        let Self { shards, .. } = self;
        let worths = &mut cells.worths.0;
        // Cells with points before all others: these ask which they are.
        shards.par_iter_mut().zip(&mut *worths).with_max_len(1).for_each(|(shard, worths)| {
            shard.sort_in();
            shard.own(worths);
        });
        let reaching: Vec<_> = shards.par_iter_mut().enumerate().with_max_len(1).map(|(i, shard)| shard.reach(i, top)).collect();
        shards.par_iter_mut().zip(&mut *worths).enumerate().with_max_len(1).for_each(|(into, (shard, worths))| {
            reaching.iter().flat_map(|of_shard| &of_shard[into]).for_each(|reaching| shard.link(reaching, worths));
            shard.is_known.resize(worths.len(), false);
        });
        let of_known: Vec<Vec<[f64; 2]>> = shards.par_iter().with_max_len(1).map(|shard| shard.worths(&inverse_density)).collect();
        shards.par_iter().zip(worths).enumerate().with_max_len(1).for_each(|(i, (shard, worths))| shard.set(&of_known, i, worths));
        cells.tell(top);
    }
}

impl Shard {
    fn add(&mut self, key: Key, m: &Site, aim: &Aim) {
        let (cell, content) = self.known.entry(key, Content::EMPTY);
        content.points += 1.0;
        content.kernel += f64::from(aim.kernel);
        (content.low, content.high) = (content.low.min(m.p), content.high.max(m.p));
        content.reach = content.reach.max(m.radius);
        content.gate.join(m.gate);
        self.arrived.push(Part::place(cell, aim.leaf));
        if self.arrived.len() > MOST_ARRIVED / SHARDS {
            self.sort_in();
        }
    }

    /// Counts the points that have arrived among the parts.
    fn sort_in(&mut self) {
        self.arrived.sort_unstable();
        self.parts.extend(self.arrived.drain(..).map(|place| Part { place, points: 1 }));
        // Two sorted runs: a stable sort merges them.
        self.parts.sort_by_key(|part| part.place);
        self.parts.dedup_by(|next, kept| {
            let same = next.place == kept.place;
            kept.points += if same { next.points } else { 0 };
            same
        });
    }

    /// Gives new cells with points their targets' cells.
    fn own(&mut self, worths: &mut Table<Worth>) {
        let first = self.own.len();
        for number in first..self.known.len() {
            let own = worths.entry(self.known.key(number), Worth::NOTHING).0;
            self.own.push(own);
            self.is_known.resize(worths.len(), false);
            self.is_known[own as usize] = true;
        }
        if first < self.own.len() {
            let is_known = &self.is_known;
            self.pairs.retain(|(_, to)| !is_known[*to as usize]);
        }
    }

    /// What this shard's cells reach into and have not told, or not of their present gates, by shard.
    fn reach(&mut self, shard_number: usize, top: i32) -> [Vec<Reaching>; SHARDS] {
        let mut reaching: [Vec<Reaching>; SHARDS] = Default::default();
        for (number, (key, content)) in (0..).zip(self.known.iter_mut()) {
            let near = content.near(key, inverse_side(top, key.level));
            let (before, gate) = content.told;
            if (near, content.gate) == (before, gate) {
                continue;
            }
            let from = Place { shard: shard_number as u32, number };
            near.each(|offset| {
                let into = Key { cell: key.cell + offset, level: key.level };
                let new = !before.contains(offset);
                reaching[shard(into.hash())].push(Reaching { into, from, gate: content.gate, new });
            });
            content.told = (near, content.gate);
        }
        reaching
    }

    /// Takes note of a cell that reaches into one of this shard.
    fn link(&mut self, reaching: &Reaching, worths: &mut Table<Worth>) {
        let (to, worth) = worths.entry(reaching.into, Worth::NOTHING);
        worth.gate.join(reaching.gate);
        let known = self.is_known.get(to as usize).is_some_and(|known| *known);
        if !known && reaching.new {
            self.pairs.push((reaching.from, to));
        }
    }

    /// Kernel and full targets of the cells with points.
    fn worths(&self, inverse_density: impl Fn(u32) -> f64) -> Vec<[f64; 2]> {
        let mut worths = vec![[0.0; 2]; self.known.len()];
        for part in &self.parts {
            worths[part.cell()][1] += f64::from(part.points) * inverse_density(part.leaf());
        }
        for (worth, (_, content)) in worths.iter_mut().zip(self.known.iter()) {
            let kernel = content.kernel / content.points;
            *worth = [kernel, kernel * worth[1] / content.points];
        }
        worths
    }

    /// Sets this shard's targets, of number `shard_number`, from those of all cells with points.
    fn set(&self, of_known: &[Vec<[f64; 2]>], shard_number: usize, worths: &mut Table<Worth>) {
        let mut sums = vec![[0.0; 3]; worths.len()];
        for (from, to) in &self.pairs {
            let ([kernel, full], sum) = (of_known[from.shard as usize][from.number as usize], &mut sums[*to as usize]);
            *sum = [sum[0] + kernel, sum[1] + full, sum[2] + 1.0];
        }
        for (own, [kernel, full]) in self.own.iter().zip(&of_known[shard_number]) {
            sums[*own as usize] = [*kernel, *full, 1.0];
        }
        for ((_, worth), [kernel, full, count]) in worths.iter_mut().zip(sums) {
            (worth.kernel, worth.full) = ((kernel / count) as f32, (full / count) as f32);
        }
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
        let (mut sum, mut count) = ([0.0; 2], 0.0);
        for shard in &seen.shards {
            for ((key, content), value) in shard.known.iter().zip(shard.worths(inverse_density)) {
                if key == at {
                    return value;
                }
                let near = content.near(key, inverse_side(seen.top.unwrap(), key.level));
                if key.level == at.level && (at.cell - key.cell).abs().max_element() <= 1 && near.contains(at.cell - key.cell) {
                    sum = [sum[0] + value[0], sum[1] + value[1]];
                    count += 1.0;
                }
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
        assert!(whole.worths.len() > at_once.counts().0 + 1000 && at_once.counts().0 > 1000);
        for (number, (key, expected)) in whole.worths.0.iter().flat_map(Table::iter).enumerate() {
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
