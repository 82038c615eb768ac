//! What the paths of a draw count for, path by path: known when the draw has ended.

use crate::samplers::Drawn;

/// What a path counts for in one stratum.
#[derive(Clone, Copy, Debug)]
struct Share {
    path: u32,
    stratum: u32,
    weight: f64,
    pilot_weight: f64,
}

/// The strata of the paths that a batch keeps, numbered in the order in which they came: at most 2^30 of them.
#[derive(Clone, Debug, Default)]
pub struct Shares {
    paths: u32,
    list: Vec<Share>,
}

impl Shares {
    /// Keeps a path as the sampler hands it out.
    pub fn add(&mut self, drawn: &[Drawn]) {
        let share = |d: &Drawn| Share { path: self.paths, stratum: d.stratum as u32, weight: d.weight, pilot_weight: d.pilot_weight };
        self.list.extend(drawn.iter().map(share));
        self.paths += 1;
    }

    /// Paths kept: the number of the next one.
    pub fn paths(&self) -> u32 {
        self.paths
    }

    /// Of every path: its factors on what it brings and on statistics that shape the last rung's target, strata scaled. The estimate of the
    /// integral of `f` is the sum of the first times `f`.
    pub fn factors(&self, scales: &[f64]) -> Vec<[f64; 2]> {
        let mut factors = vec![[0.0; 2]; self.paths as usize];
        for share in &self.list {
            let scale = scales[share.stratum as usize];
            let [weight, pilot] = &mut factors[share.path as usize];
            *weight += scale * share.weight;
            *pilot += scale * share.pilot_weight;
        }
        factors
    }
}
