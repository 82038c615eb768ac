//! Cells of space in which the camera measures: where targets are positive, and what they are worth there.
//!
//! Measurement points are new in every iteration. A target made of them is a new function in every iteration, with a support of its own, and
//! chains that have to find it anew begin with too few states where only the new points see. So targets are made of cells that hold
//! measurement points of a pilot and of some iterations; between updates they stay as they are, and chains keep their laws. A path that
//! reaches points outside all cells is not lost: rung 0 draws it, and its weight says that no other rung does.
//!
//! Cells are cubes with sides of powers of two, of a size for every size of points. A point
//! lies in the cell of its centre; a cell makes those of its neighbours positive that its points' disks may reach into.

use super::aim::Aim;
use super::light_paths::Arrival;
use super::points::{DepthRange, MeasurementPoint, kernel_size};
use crate::math::fetch;
use crate::scene::hit::Endpoint;
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use table::{Key, Probe, Table};

mod table;

/// Sizes of cells, each half as wide as the one before.
const LEVELS: i32 = 32;

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
}

/// Which light vertices of a cell count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Gate {
    /// Directions of the axes that a surface's lit side may face, a bit each: +x, -x, +y, -y, +z, -z.
    faces: u8,
    /// Fewest and most camera edges.
    depths: (u16, u16),
}

impl Gate {
    const SHUT: Self = Self { faces: 0, depths: (u16::MAX, 0) };

    fn of(m: &MeasurementPoint<'_>) -> Self {
        let depth = m.depth.min(u32::from(u16::MAX)) as u16;
        let n = m.point.end.n_g;
        let towards = if m.point.given.dot(n) < 0.0 { -n } else { n };
        let through = if m.point.bsdf.transmissive() { faces(-towards) } else { 0 };
        Self { faces: faces(towards) | through, depths: (depth, depth) }
    }

    fn join(&mut self, other: Self) {
        self.faces |= other.faces;
        self.depths = (self.depths.0.min(other.depths.0), self.depths.1.max(other.depths.1));
    }

    #[inline(always)]
    fn admits(self, face: u8, depth: u32, counted: DepthRange) -> bool {
        self.faces & face != 0 && depth + u32::from(self.depths.0) <= counted.max && depth + u32::from(self.depths.1) >= counted.min
    }
}

/// What targets ask of a measurement point: a quarter of its memory, so that a pilot of many points is small.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// Its place.
    pub p: Vec3,
    /// Radius of its density estimate, world units.
    pub radius: f32,
    /// [`MeasurementPoint::footprint`].
    pub footprint: f32,
    /// Row-major number of its pixel.
    pub pixel: u32,
    gate: Gate,
}

impl Site {
    /// Of a measurement point.
    pub fn of(m: &MeasurementPoint<'_>) -> Self {
        Self { p: m.point.end.p, radius: m.radius, footprint: m.footprint, pixel: m.pixel, gate: Gate::of(m) }
    }

    /// Kernel size `s_k = pi r_k^2`, world units squared.
    pub fn kernel_size(&self) -> f32 {
        kernel_size(self.radius)
    }
}

/// Axes within 60 degrees of a direction: normals that differ by less than that are one surface ([`accepts`](crate::transport::merge::accepts)).
fn faces(n: Vec3) -> u8 {
    let bit = |i: usize| if n[i] >= 0.5 { 1 << (2 * i) } else { u8::from(n[i] <= -0.5) << (2 * i + 1) };
    bit(0) | bit(1) | bit(2)
}

/// The axis nearest to a direction.
#[inline(always)]
fn face(n: Vec3) -> u8 {
    let a = n.abs();
    let axis = if a.x >= a.y && a.x >= a.z { 0 } else { 2 - usize::from(a.y >= a.z) };
    1 << (2 * axis + usize::from(n[axis] < 0.0))
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

/// What light vertices of a cell are worth.
#[derive(Clone, Copy, Debug)]
struct Worth {
    kernel: f32,
    full: f32,
    gate: Gate,
}

/// Cells that hold measurement points, and targets at them.
#[derive(Clone, Debug)]
pub struct Cells {
    depths: DepthRange,
    /// Binary logarithm of the widest side; set by the first points.
    top: Option<i32>,
    known: Table<Content>,
    /// By place.
    parts: Vec<Part>,
    /// Places of points that are not among the parts yet.
    arrived: Vec<u64>,
    /// Cells with points when targets were last made.
    made_of: usize,
    /// Sides' reciprocals, widest first.
    inverse_sides: Vec<f32>,
    /// Levels present in each bucket of the widest cells.
    present: Vec<u32>,
    worths: Table<Worth>,
}

/// What the cells around a path's vertices are worth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reached {
    /// Largest kernel target; 0 where no vertex counts.
    pub kernel: f32,
    /// Largest full target; 0 where no vertex counts.
    pub full: f32,
    /// Vertices that count.
    pub vertices: u32,
    /// A number of the first of their cells; any if there is none.
    pub cell: u32,
}

/// Memory of a look-up, used again and again.
#[derive(Clone, Debug, Default)]
pub struct CellSearch {
    buckets: Vec<u32>,
    probes: Vec<(u32, Probe)>,
}

impl Cells {
    /// No cells. `depths` are the path lengths that count, in edges from light to camera.
    pub fn new(depths: DepthRange) -> Self {
        Self {
            depths,
            top: None,
            known: Table::default(),
            parts: Vec::new(),
            arrived: Vec::new(),
            made_of: 0,
            inverse_sides: Vec::new(),
            present: vec![0],
            worths: Table::default(),
        }
    }

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
        100 * self.known.len() > 101 * self.made_of
    }

    /// Makes the targets: a cell is worth the mean of its points' targets, and a cell without points that a neighbour's disks may reach the mean
    /// over these neighbours. `inverse_density` is the factor of the full target in a region.
    pub fn set(&mut self, inverse_density: impl Fn(u32) -> f64) {
        let Some(top) = self.top else { return };
        self.sort_in();
        self.made_of = self.known.len();
        let mut densities = vec![0.0; self.known.len()];
        for part in &self.parts {
            densities[part.cell()] += f64::from(part.points) * inverse_density(part.leaf());
        }
        let own = |cell: usize, content: &Content| {
            let kernel = content.kernel / content.points;
            (kernel, kernel * densities[cell] / content.points)
        };
        let mut sums: Table<Sum> = Table::with_capacity(2 * self.known.len());
        for (cell, (key, content)) in self.known.iter().enumerate() {
            let sum = sums.entry(key, Sum::NOTHING).1;
            sum.gate.join(content.gate);
            (sum.kernel, sum.full) = own(cell, content);
            sum.count = f64::INFINITY;
        }
        for (cell, (key, content)) in self.known.iter().enumerate() {
            let inverse = inverse_side(top, key.level);
            // A radius is no wider than a cell, but for a point wider than all that came first.
            let reach = content.reach.min(inverse.recip());
            let [low, high] = [content.low - reach, content.high + reach].map(|p| Key::of(p, inverse, key.level).cell);
            let (kernel, full) = own(cell, content);
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        let sum = sums.entry(Key { cell: IVec3::new(x, y, z), level: key.level }, Sum::NOTHING).1;
                        sum.gate.join(content.gate);
                        if sum.count.is_finite() {
                            (sum.kernel, sum.full, sum.count) = (sum.kernel + kernel, sum.full + full, sum.count + 1.0);
                        }
                    }
                }
            }
        }
        self.worths = Table::with_capacity(sums.len());
        self.present = vec![0; (2 * sums.len()).next_power_of_two()];
        let deepest = sums.iter().map(|(key, _)| key.level).max().unwrap_or(0);
        self.inverse_sides = (0..=deepest).map(|level| inverse_side(top, level)).collect();
        for (key, sum) in sums.iter() {
            let count = if sum.count.is_finite() { sum.count } else { 1.0 };
            let worth = Worth { kernel: (sum.kernel / count) as f32, full: (sum.full / count) as f32, gate: sum.gate };
            self.worths.entry(key, worth);
            let bucket = self.bucket(key.cell >> key.level);
            self.present[bucket as usize] |= 1 << key.level;
        }
    }

    #[inline(always)]
    fn bucket(&self, widest: IVec3) -> u32 {
        Key { cell: widest, level: 0 }.hash() & (self.present.len() as u32 - 1)
    }

    /// Kernel and full target at a place of a surface, whichever of its sides light comes from; `None` outside.
    #[inline]
    pub fn worth(&self, end: &Endpoint) -> Option<[f32; 2]> {
        let bucket = self.bucket(Key::of(end.p, *self.inverse_sides.first()?, 0).cell);
        let mut levels = self.present[bucket as usize];
        let faces = face(end.n_g) | face(-end.n_g);
        let mut found: Option<[f32; 2]> = None;
        while levels != 0 {
            let level = levels.trailing_zeros() as usize;
            levels &= levels - 1;
            let probe = self.worths.probe(Key::of(end.p, self.inverse_sides[level], level as i32));
            if let Some((_, worth)) = self.worths.at(&probe).filter(|(_, worth)| worth.gate.faces & faces != 0) {
                let [kernel, full] = found.unwrap_or_default();
                found = Some([kernel.max(worth.kernel), full.max(worth.full)]);
            }
        }
        found
    }

    /// What a path's vertices are worth: the largest target of the cells that they lie in [STF (11), (12)].
    #[inline]
    pub fn reached<V: Arrival>(&self, vertices: &[V], search: &mut CellSearch) -> Reached {
        let mut reached = Reached::default();
        let Some(inverse) = self.inverse_sides.first() else { return reached };
        let CellSearch { buckets, probes } = search;
        // Step by step for all vertices together: each look-up waits for memory twice.
        buckets.clear();
        for vertex in vertices {
            let bucket = self.bucket(Key::of(vertex.end().p, *inverse, 0).cell);
            fetch(&self.present[bucket as usize]);
            buckets.push(bucket);
        }
        probes.clear();
        for (i, bucket) in (0u32..).zip(&*buckets) {
            let mut levels = self.present[*bucket as usize];
            while levels != 0 {
                let level = levels.trailing_zeros() as usize;
                levels &= levels - 1;
                let probe = self.worths.probe(Key::of(vertices[i as usize].end().p, self.inverse_sides[level], level as i32));
                probes.push((i, probe));
            }
        }
        let mut last = u32::MAX;
        for (i, probe) in &*probes {
            let Some((cell, worth)) = self.worths.at(probe) else { continue };
            let vertex = &vertices[*i as usize];
            let n = vertex.end().n_g;
            let towards = if vertex.wi().dot(n) < 0.0 { -n } else { n };
            if worth.gate.admits(face(towards), vertex.depth(), self.depths) {
                if last == u32::MAX {
                    reached.cell = cell;
                }
                reached.vertices += u32::from(last != *i);
                last = *i;
                reached.kernel = reached.kernel.max(worth.kernel);
                reached.full = reached.full.max(worth.full);
            }
        }
        reached
    }
}

impl Content {
    const EMPTY: Self = Self { points: 0.0, kernel: 0.0, low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, reach: 0.0, gate: Gate::SHUT };
}

/// Targets of a cell while they are gathered; `count` is infinite for a cell with points of its own.
#[derive(Clone, Copy, Debug)]
struct Sum {
    kernel: f64,
    full: f64,
    count: f64,
    gate: Gate,
}

impl Sum {
    const NOTHING: Self = Self { kernel: 0.0, full: 0.0, count: 0.0, gate: Gate::SHUT };
}

/// Cells of level 0 have sides of `2^top`, each level halves them.
fn inverse_side(top: i32, level: i32) -> f32 {
    (level as f32 - top as f32).exp2()
}
