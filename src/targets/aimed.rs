//! Light paths with what they reach: the space that a ladder of targets samples.

use super::aim::{Aim, Rung};
use super::light_paths::{LightPath, LightPaths};
use super::points::{Points, Search, Touch};
use super::tallies::Tallies;
use crate::samplers::{CELLS, LightPathSpace, Stream};

/// A light path and the measurement points it reaches.
#[derive(Clone, Debug, Default)]
pub struct AimedPath {
    /// The path.
    pub light: LightPath,
    /// Pairs of its vertices and points that take them, in the order of vertices.
    pub touches: Vec<Touch>,
    /// Largest kernel and full target among the points; 0 where there is none.
    best: Aim,
    /// Sum of squared full targets over the pairs.
    usefulness: f64,
    search: Search,
}

/// All light subpaths of a scene, aimed at an iteration's measurement points.
#[derive(Clone, Copy)]
pub struct AimedPaths<'a> {
    /// The paths.
    pub light: LightPaths<'a>,
    /// What they should reach, with targets.
    pub points: &'a Points<'a>,
    /// The ladder, uniform first.
    pub rungs: &'a [Rung],
    /// What all traced paths cost.
    pub tallies: &'a Tallies,
}

impl LightPathSpace for AimedPaths<'_> {
    type Path = AimedPath;

    fn trace<S: Stream>(&self, stream: &mut S, path: &mut AimedPath) {
        let AimedPath { light, touches, best, usefulness, search } = path;
        self.light.trace(stream, light);
        self.tallies.add(&light.tally);
        self.points.touched(&light.vertices, search, touches);
        *best = Aim::default();
        *usefulness = 0.0;
        for touch in touches {
            let aim = self.points.aim(touch.point);
            best.kernel = best.kernel.max(aim.kernel);
            best.full = best.full.max(aim.full);
            *usefulness += f64::from(aim.full) * f64::from(aim.full);
        }
    }

    fn targets(&self, path: &AimedPath, values: &mut [f64]) {
        let visible = if path.touches.is_empty() { 0.0 } else { 1.0 };
        for (value, rung) in values.iter_mut().zip(self.rungs) {
            *value = match rung {
                Rung::Uniform => 1.0,
                Rung::Visibility => visible,
                Rung::Kernel => f64::from(path.best.kernel),
                Rung::Target => f64::from(path.best.full),
            };
        }
    }

    /// The full target is about `1/P_k`, so its square is the squared contribution over the squared mean, summed over the points reached: what
    /// a path adds to the sum of relative variances at density one ([STF (14), (15)] under the assumptions of its 3.2).
    fn usefulness(&self, path: &AimedPath) -> f64 {
        path.usefulness
    }

    fn cell(&self, path: &AimedPath) -> Option<u32> {
        // Neighbouring points go to unrelated cells.
        let touch = path.touches.first()?;
        Some(touch.point.wrapping_mul(0x9e37_79b9) >> (u32::BITS - CELLS.ilog2()))
    }

    /// Rays, and deposits at a fifth of a ray.
    fn cost(&self, path: &AimedPath) -> f64 {
        path.light.tally.rays as f64 + 0.2 * path.touches.len() as f64
    }
}
