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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::{Ladder, LadderSettings, LightPathSpace, PhotonSampler, Stream};

    /// Paths are points of the unit square; the first target likes a disk, the second its right side.
    struct Disk;

    fn inside(p: &[f32; 2]) -> bool {
        (p[0] - 0.3).hypot(p[1] - 0.4) < 0.15
    }

    impl LightPathSpace for Disk {
        type Path = [f32; 2];
        fn trace<S: Stream>(&self, stream: &mut S, path: &mut [f32; 2]) {
            *path = stream.next_2d();
        }
        fn targets(&self, path: &[f32; 2], values: &mut [f64]) {
            values[0] = 1.0;
            values[1] = f64::from(u8::from(inside(path)));
            values[2] = values[1] * f64::from(path[0]).powi(4);
        }
    }

    /// What paths count for adds up to the measure of the space, and to that of the disk within it: the sum is over a path's strata, and no
    /// stratum alone has it.
    #[test]
    fn factors_add_up_to_the_space() {
        let mut ladder = Ladder::new(LadderSettings { seed: 5, rungs: 3, ensembles: 8, ..LadderSettings::default() });
        let (draws, mut sums) = (24, Vec::new());
        for draw in 0..draws {
            let keep = |(shares, places): &mut (Shares, Vec<bool>), path: &[f32; 2], drawn: &[Drawn]| {
                shares.add(drawn);
                places.push(inside(path));
            };
            let drawn = ladder.draw(&Disk, draw, 20_000, <(Shares, Vec<bool>)>::default, keep);
            let mut sum = [0.0; 2];
            for (shares, places) in &drawn.batches {
                assert_eq!(shares.paths() as usize, places.len());
                for ([factor, _], inside) in shares.factors(&drawn.scales).iter().zip(places) {
                    sum[0] += factor;
                    sum[1] += if *inside { *factor } else { 0.0 };
                }
            }
            sums.push(sum);
        }
        for (k, expected) in [1.0, std::f64::consts::PI * 0.15 * 0.15].into_iter().enumerate() {
            let mean = sums.iter().map(|sum| sum[k]).sum::<f64>() / draws as f64;
            let variance = sums.iter().map(|sum| (sum[k] - mean).powi(2)).sum::<f64>() / (draws - 1) as f64;
            let error = (variance / draws as f64).sqrt();
            assert!((mean - expected).abs() < 4.0 * error + 1e-9 && error < 0.02 * expected, "{k}: {mean} +- {error}, not {expected}");
        }
    }
}
