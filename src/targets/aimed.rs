//! Light paths with what they reach: the space that a ladder of targets samples.

use super::aim::Rung;
use super::cells::{CellSearch, Cells, Reached};
use super::light_paths::Arrivals;
use super::points::{Points, Search};
use super::tallies::Tallies;
use crate::samplers::{CELLS, LightPathSpace, Stream};
use crate::scene::hit::Endpoint;

/// How densely light paths lie, over as many independent ones, by the place of a vertex: what a ladder makes of the cells.
#[derive(Clone, Copy, Debug)]
pub struct Gain<'a> {
    cells: &'a Cells,
    /// Of a path that no target likes.
    unseen: f32,
    /// Of one that reaches a cell: a constant, and factors of the cell's kernel and full targets.
    seen: f32,
    kernel: f32,
    full: f32,
}

impl<'a> Gain<'a> {
    /// `densities` are the factors of the rungs' targets.
    pub fn new(cells: &'a Cells, rungs: &[Rung], densities: &[f64]) -> Self {
        let of = |wanted: Rung| rungs.iter().zip(densities).find(|(rung, _)| **rung == wanted).map_or(0.0, |(_, density)| *density as f32);
        let unseen = of(Rung::Uniform);
        let seen = unseen + of(Rung::Visibility);
        Self { cells, unseen, seen, kernel: of(Rung::Kernel), full: of(Rung::Target) }
    }

    /// At a vertex: that of paths whose best vertex is this one.
    #[inline]
    pub fn at(&self, end: &Endpoint) -> f32 {
        let worth = |[kernel, full]: [f32; 2]| self.seen + self.kernel * kernel + self.full * full;
        self.cells.worth(end).map_or(self.unseen, worth)
    }
}

/// A light path and what its vertices are worth.
#[derive(Clone, Debug, Default)]
pub struct AimedPath<P> {
    /// The path.
    pub light: P,
    reached: Reached,
    search: CellSearch,
}

/// A space of light subpaths, aimed at cells that hold measurement points.
#[derive(Clone, Copy)]
pub struct AimedPaths<'a, L> {
    /// The paths, without targets.
    pub light: L,
    /// Where they should go.
    pub cells: &'a Cells,
    /// The iteration's measurement points, with targets.
    pub points: &'a Points<'a>,
    /// The ladder, uniform first.
    pub rungs: &'a [Rung],
    /// What all traced paths cost.
    pub tallies: &'a Tallies,
}

impl<L: LightPathSpace<Path: Arrivals>> LightPathSpace for AimedPaths<'_, L> {
    type Path = AimedPath<L::Path>;

    fn trace<S: Stream>(&self, stream: &mut S, path: &mut AimedPath<L::Path>) {
        self.light.trace(stream, &mut path.light);
        self.tallies.add(path.light.tally());
        path.reached = self.cells.reached(path.light.vertices(), &mut path.search);
    }

    fn targets(&self, path: &AimedPath<L::Path>, values: &mut [f64]) {
        let visible = if path.reached.vertices > 0 { 1.0 } else { 0.0 };
        for (value, rung) in values.iter_mut().zip(self.rungs) {
            *value = match rung {
                Rung::Uniform => 1.0,
                Rung::Visibility => visible,
                Rung::Kernel => f64::from(path.reached.kernel),
                Rung::Target => f64::from(path.reached.full),
            };
        }
    }

    /// The full target is about `1/P_k`, so its square is the squared contribution over the squared mean, summed over the points reached: what
    /// a path adds to the sum of relative variances at density one ([STF (14), (15)] under the assumptions of its 3.2). Asked for a few
    /// paths only.
    fn usefulness(&self, path: &AimedPath<L::Path>) -> f64 {
        let mut touches = Vec::new();
        self.points.touched(path.light.vertices(), &mut Search::default(), &mut touches);
        touches.iter().map(|touch| f64::from(self.points.aim(touch.point).full).powi(2)).sum()
    }

    fn cell(&self, path: &AimedPath<L::Path>) -> Option<u32> {
        // Neighbours go to unrelated cells.
        let number = path.reached.cell.wrapping_mul(0x9e37_79b9) >> (u32::BITS - CELLS.ilog2());
        (path.reached.vertices > 0).then_some(number)
    }

    /// Rays, and what is done at points: half a ray for a vertex that counts.
    fn cost(&self, path: &AimedPath<L::Path>) -> f64 {
        path.light.tally().rays as f64 + 0.5 * f64::from(path.reached.vertices)
    }
}
