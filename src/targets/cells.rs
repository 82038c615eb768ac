//! Cells of space in which the camera measures: where targets are positive, and what they are worth there.
//!
//! Measurement points are new in every iteration. A target made of them is a new function in every iteration, with a support of its own, and
//! chains that have to find it anew begin with too few states where only the new points see. So targets are made of cells that hold
//! measurement points of a pilot and of some iterations; between updates they stay as they are, and chains keep their laws. A path that
//! reaches points outside all cells is not lost: rung 0 draws it, and its weight says that no other rung does.
//!
//! Cells are cubes with sides of powers of two, of a size for every size of points. A point
//! lies in the cell of its centre; a cell makes those of its neighbours positive that its points' disks may reach into. `seen` gathers points and
//! makes the targets; this module finds what a path's vertices are worth.

use super::light_paths::Arrival;
use super::points::{DepthRange, MeasurementPoint, kernel_size};
use crate::math::fetch;
use crate::scene::hit::Endpoint;
use glam::{IVec3, Vec3};
use table::{Key, Probe, SHARDS, Sharded};

mod seen;
mod table;

pub use seen::Seen;

/// Sizes of cells, each half as wide as the one before.
const LEVELS: i32 = 32;

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

/// What light vertices of a cell are worth.
#[derive(Clone, Copy, Debug)]
struct Worth {
    kernel: f32,
    full: f32,
    gate: Gate,
}

impl Worth {
    const NOTHING: Self = Self { kernel: 0.0, full: 0.0, gate: Gate::SHUT };
}

/// Targets in the cells that hold measurement points, and in those that their disks reach into.
#[derive(Clone, Debug)]
pub struct Cells {
    depths: DepthRange,
    /// Sides' reciprocals, widest first.
    inverse_sides: Vec<f32>,
    /// Levels present in each bucket of the widest cells; a power of two of them.
    present: Vec<u32>,
    /// Cells of each table that `present` tells of.
    told: [usize; SHARDS],
    worths: Sharded<Worth>,
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
        Self { depths, inverse_sides: Vec::new(), present: vec![0], told: [0; SHARDS], worths: Sharded::default() }
    }

    /// Tells of the levels of cells that are new. `top` is the widest side's binary logarithm.
    fn tell(&mut self, top: i32) {
        let wanted = (2 * self.worths.len()).next_power_of_two();
        if self.present.len() < wanted {
            self.present = vec![0; wanted];
            self.told = [0; SHARDS];
        }
        for shard in 0..SHARDS {
            for number in self.told[shard]..self.worths.0[shard].len() {
                let key = self.worths.0[shard].key(number);
                let bucket = self.bucket(key.cell >> key.level);
                self.present[bucket as usize] |= 1 << key.level;
                let next = self.inverse_sides.len() as i32;
                self.inverse_sides.extend((next..=key.level).map(|level| inverse_side(top, level)));
            }
            self.told[shard] = self.worths.0[shard].len();
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

/// Cells of level 0 have sides of `2^top`, each level halves them.
fn inverse_side(top: i32, level: i32) -> f32 {
    (level as f32 - top as f32).exp2()
}
