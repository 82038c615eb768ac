//! Target functions over measurement points.
//!
//! [STF (11), (12)]: a path's target is the largest value of the points it reaches; 0 where it reaches none, so that the supports of all rungs
//! above the uniform one are the same. Here the points are represented by the cells they lie in (module `cells`).

use super::cells::{Cells, Seen, Site};
use super::points::DepthRange;
use super::regions::{Refinement, Regions};
use clap::ValueEnum;
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A target function of a ladder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rung {
    /// The constant 1
    Uniform,
    /// 1 where the path reaches a measurement point, else 0
    Visibility,
    /// Visibility over kernel size
    Kernel,
    /// The sampler's own: over kernel size and photon density
    Target,
}

/// `epsilon` of the compressed inverse kernel size and inverse density [STF (11)].
const EPSILON: f64 = 1e-4;

/// First iterations whose points are all looked at for new cells; later ones only where targets change.
const LOOKS: u64 = 16;

/// Values of the targets at one measurement point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aim {
    /// Inverse kernel size, compressed.
    pub kernel: f32,
    /// Inverse kernel size times inverse density, both compressed.
    pub full: f32,
    /// Region, for statistics; 0 without regions.
    pub leaf: u32,
}

/// What turns kernel sizes and densities into targets, from iteration to iteration.
#[derive(Clone, Debug)]
pub struct Aimer {
    /// Largest kernel size and mean kernel target of the pilot, before the radius schedule: a fixed scale, so that a rung's
    /// normalisation means the same in every iteration. [STF (11)] takes the current maximum, which changes the target by a factor alone
    /// that no chain notices, and moves where it saturates.
    scale: Option<(f64, f64)>,
    /// Regions of a spatial or image target.
    pub regions: Option<Regions>,
    /// Over what they are built.
    place: Place,
    /// Where densities are read.
    refinement: Refinement,
    /// Compressed inverse densities by leaf, in a scale that gives the full target a mean of one when they are read; empty before.
    inverse_densities: Vec<f64>,
    /// The densities themselves, paths of the uniform sampler per world unit squared, by leaf; empty before they are read.
    densities: Vec<f64>,
    /// Regions read.
    region_count: usize,
    /// Where the camera has measured.
    seen: Seen,
    /// Where targets are positive, and what they are there.
    cells: Cells,
    /// Iterations aimed.
    iterations: u64,
}

/// Which place a measurement point has in the regions' tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Its position in space.
    Space,
    /// Its pixel.
    Image {
        /// Pixels across.
        width: u32,
    },
}

impl Place {
    fn of(self, at: &Site) -> Vec3 {
        match self {
            Place::Space => at.p,
            Place::Image { width } => Vec3::new((at.pixel % width) as f32 + 0.5, (at.pixel / width) as f32 + 0.5, 0.0),
        }
    }
}

impl Aimer {
    /// Aims at a pilot's measurement points, of the first iteration's radii. Nothing is known of densities yet.
    pub fn new(regions: Option<Regions>, place: Place, refinement: Refinement, depths: DepthRange, pilot: &[Site]) -> Self {
        let mut aimer = Self {
            scale: None,
            regions,
            place,
            refinement,
            inverse_densities: Vec::new(),
            densities: Vec::new(),
            region_count: 0,
            seen: Seen::default(),
            cells: Cells::new(depths),
            iterations: 0,
        };
        let aims = aimer.aims(pilot, 1.0);
        aimer.seen.add(pilot, &aims);
        aimer
    }

    /// Regions that the present densities come from.
    pub fn region_count(&self) -> usize {
        self.region_count
    }

    /// The density of a leaf that the present targets use: light paths under uniform sampling, per world unit squared and path; `None` before
    /// one is known.
    pub fn density(&self, leaf: u32) -> Option<f64> {
        self.densities.get(leaf as usize).copied()
    }

    /// Where the present targets are positive.
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Whether this iteration, the first or one in two that may change the targets, is one in which chains should draw even if they were not
    /// worth it before: what is known of densities grows by it.
    pub fn trial(&self) -> bool {
        self.iterations == 0 || (self.iterations.is_power_of_two() && self.iterations.trailing_zeros().is_multiple_of(2))
    }

    /// An iteration goes by without targets.
    pub fn skip(&mut self) {
        self.iterations += 1;
    }

    /// Targets at an iteration's measurement points, and whether those of light paths are new ones. `shrink` is the radius schedule's factor on
    /// the first iteration's radii.
    ///
    /// The targets of light paths change before iterations 1, 2, 4, 8, ... (without regions only while new cells come) and stay in between: densities
    /// are read, and the cells of
    /// points so far are used. \[STF\] does so before every iteration, which has two biases: where chains have lingered the density is
    /// found too high and the target made low, while the chains still stand there and bring more than the new target grants; and places that
    /// only the new points see have no states to begin with. Chains that are burnt in again forget both; at doubling intervals it costs little.
    pub fn aim(&mut self, points: &[Site], shrink: f64) -> (Vec<Aim>, bool) {
        let mut aims = self.aims(points, shrink);
        let due = self.iterations == 0 || self.iterations.is_power_of_two();
        if due || self.iterations < LOOKS {
            self.seen.add(points, &aims);
        }
        let new = self.iterations == 0 || (due && (self.regions.is_some() || self.seen.grown()));
        if new {
            if self.read_densities(&aims) {
                self.fill(&mut aims);
            }
            let inverse = &self.inverse_densities;
            self.seen.set(&mut self.cells, |leaf| inverse.get(leaf as usize).copied().unwrap_or(1.0));
        }
        self.iterations += 1;
        (aims, new)
    }

    fn aims(&mut self, points: &[Site], shrink: f64) -> Vec<Aim> {
        let sizes: Vec<f64> = points.par_iter().map(|m| f64::from(m.kernel_size()) / (shrink * shrink)).collect();
        if sizes.is_empty() {
            return Vec::new();
        }
        let (largest, mean) = *self.scale.get_or_insert_with(|| {
            let largest = sizes.iter().copied().fold(0.0, f64::max);
            let mean = sizes.iter().map(|s| inverse(s / largest)).sum::<f64>() / sizes.len() as f64;
            (largest, mean)
        });
        let leaf = |m| self.regions.as_ref().map_or(0, |regions| regions.leaf(self.place.of(m)));
        let aim = |(m, size): (_, &f64)| Aim { kernel: (inverse(size / largest) / mean) as f32, full: 0.0, leaf: leaf(m) };
        let mut aims = points.par_iter().zip(&sizes).map(aim).collect();
        self.fill(&mut aims);
        aims
    }

    /// Sets full targets; the kernel's while nothing is known of densities.
    fn fill(&self, aims: &mut Vec<Aim>) {
        for aim in aims {
            aim.full = self.inverse_densities.get(aim.leaf as usize).map_or(aim.kernel, |inverse| (f64::from(aim.kernel) * inverse) as f32);
        }
    }

    /// Whether there were any.
    fn read_densities(&mut self, aims: &[Aim]) -> bool {
        let Some(regions) = &mut self.regions else { return false };
        let (densities, count) = regions.densities(self.refinement);
        // The largest of the regions that hold measurement points.
        let densest = aims.iter().filter_map(|aim| densities.get(aim.leaf as usize)).copied().fold(0.0, f64::max);
        if densest <= 0.0 {
            return false;
        }
        self.region_count = count;
        let mut inverses: Vec<f64> = densities.iter().map(|density| inverse((density / densest).min(1.0))).collect();
        let mean = aims.iter().map(|aim| f64::from(aim.kernel) * inverses[aim.leaf as usize]).sum::<f64>() / aims.len() as f64;
        inverses.iter_mut().for_each(|value| *value /= mean);
        self.inverse_densities = inverses;
        self.densities = densities;
        true
    }
}

/// `1/(x + epsilon)`, `x` in [0, 1]: a factor of [STF (11)] up to its constant.
fn inverse(x: f64) -> f64 {
    1.0 / (x + EPSILON)
}
