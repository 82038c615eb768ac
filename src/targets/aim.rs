//! Target functions over measurement points.
//!
//! [STF (11), (12)]: a path's target is the largest value of the points it reaches; 0 where it reaches none, so that the supports of all rungs
//! above the uniform one are the same.

use super::points::Points;
use super::regions::{Refinement, Regions};
use clap::ValueEnum;
use glam::Vec3;
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
    /// Largest kernel size and mean kernel target of the first iteration, before the radius schedule: a fixed scale, so that a rung's
    /// normalisation means the same in every iteration. [STF (11)] takes the current maximum, which changes the target by a factor alone
    /// that no chain notices, and moves where it saturates.
    scale: Option<(f64, f64)>,
    /// Regions of a spatial or image target.
    pub regions: Option<Regions>,
    /// Where densities are read.
    refinement: Refinement,
    /// Compressed inverse densities by leaf, in a scale that gives the full target a mean of one when they are read; empty before.
    inverse_densities: Vec<f64>,
    /// Regions read.
    region_count: usize,
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
    fn of(self, points: &Points<'_>, index: usize) -> Vec3 {
        let at = &points.all()[index];
        match self {
            Place::Space => at.point.end.p,
            Place::Image { width } => Vec3::new((at.pixel % width) as f32 + 0.5, (at.pixel / width) as f32 + 0.5, 0.0),
        }
    }
}

impl Aimer {
    /// Nothing known yet.
    pub fn new(regions: Option<Regions>, refinement: Refinement) -> Self {
        Self { scale: None, regions, refinement, inverse_densities: Vec::new(), region_count: 0, iterations: 0 }
    }

    /// Regions that the present densities come from.
    pub fn region_count(&self) -> usize {
        self.region_count
    }

    /// Targets at every point, and whether the full target is a new one. `shrink` is the radius schedule's factor on the first iteration's
    /// radii.
    ///
    /// Densities are read before iterations 1, 2, 4, 8, ... and stay in between. \[STF\] reads them before every iteration, which has a bias: where
    /// chains have lingered the density is found too high and the target made low, while the chains still stand there and bring
    /// more than the new target grants. Chains that are burnt in again at a new target forget that; at doubling intervals it costs little.
    pub fn aim(&mut self, points: &Points<'_>, place: Place, shrink: f64) -> (Vec<Aim>, bool) {
        let sizes: Vec<f64> = points.all().iter().map(|m| f64::from(m.kernel_size()) / (shrink * shrink)).collect();
        if sizes.is_empty() {
            return (Vec::new(), false);
        }
        let (largest, mean) = *self.scale.get_or_insert_with(|| {
            let largest = sizes.iter().copied().fold(0.0, f64::max);
            let mean = sizes.iter().map(|s| inverse(s / largest)).sum::<f64>() / sizes.len() as f64;
            (largest, mean)
        });
        let mut aims: Vec<Aim> = sizes.iter().map(|s| Aim { kernel: (inverse(s / largest) / mean) as f32, ..Aim::default() }).collect();
        if let Some(regions) = &self.regions {
            aims.iter_mut().enumerate().for_each(|(i, aim)| aim.leaf = regions.leaf(place.of(points, i)));
        }
        let new = self.iterations.is_power_of_two() && self.read_densities(&aims);
        self.iterations += 1;
        // Nothing known: the full target starts as the kernel's.
        for aim in &mut aims {
            aim.full = self.inverse_densities.get(aim.leaf as usize).map_or(aim.kernel, |inverse| (f64::from(aim.kernel) * inverse) as f32);
        }
        (aims, new)
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
        let mut inverses: Vec<f64> = densities.into_iter().map(|density| inverse((density / densest).min(1.0))).collect();
        let mean = aims.iter().map(|aim| f64::from(aim.kernel) * inverses[aim.leaf as usize]).sum::<f64>() / aims.len() as f64;
        inverses.iter_mut().for_each(|value| *value /= mean);
        self.inverse_densities = inverses;
        true
    }
}

/// `1/(x + epsilon)`, `x` in [0, 1]: a factor of [STF (11)] up to its constant.
fn inverse(x: f64) -> f64 {
    1.0 / (x + EPSILON)
}
