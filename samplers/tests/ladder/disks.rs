//! Disks in the unit square, whose areas are known: pilot weights, effective counts and measured shares.

use crate::kit::{assert_mean, integrals, settings, variance};
use isophote_samplers::{Allocation, Ladder, LadderSettings, LightPathSpace, Stream};

/// Disks that do not overlap: the probability of a path to meet one is its area.
struct Disks {
    /// Whether the space tells the cells of its paths.
    cells: bool,
}
const DISKS: [([f64; 2], f64); 4] = [([0.2, 0.2], 0.05), ([0.8, 0.3], 0.1), ([0.4, 0.7], 0.15), ([0.85, 0.85], 0.05)];

impl LightPathSpace for Disks {
    type Path = [f32; 2];
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut [f32; 2]) {
        *path = stream.next_2d();
    }
    fn targets(&self, p: &[f32; 2], values: &mut [f64]) {
        let k = in_disks(p).iter().position(|inside| *inside > 0.0);
        let inverse = k.map_or(0.0, |k| 0.05 / DISKS[k].1);
        let all = [1.0, f64::from(u8::from(k.is_some())), inverse, inverse * inverse.powi(2)];
        values.copy_from_slice(&all[..values.len()]);
    }
    fn cell(&self, p: &[f32; 2]) -> Option<u32> {
        let disk = in_disks(p).iter().position(|inside| *inside > 0.0);
        disk.filter(|_| self.cells).map(|k| k as u32)
    }
}

fn in_disks(p: &[f32; 2]) -> [f64; 4] {
    DISKS.map(|(c, r)| f64::from(u8::from((f64::from(p[0]) - c[0]).powi(2) + (f64::from(p[1]) - c[1]).powi(2) < r * r)))
}

const COUNT: u64 = 12_000;
const RUNS: u64 = 100;

/// Areas from all rungs, from the pilot weights, and from the uniform rung alone agree with pi r^2.
#[test]
fn areas_of_disks_from_all_rungs_from_pilots_and_from_the_uniform_rung() {
    let space = Disks { cells: true };
    let mut runs: Vec<[[f64; 4]; 3]> = Vec::new();
    for seed in 0..RUNS {
        let all = integrals(&mut Ladder::new(settings(seed, 4)), &space, 0, COUNT, |drawn| drawn.weight, in_disks);
        let pilots = integrals(&mut Ladder::new(settings(seed + 500, 4)), &space, 0, COUNT, |drawn| drawn.pilot_weight, in_disks);
        let uniform = integrals(&mut Ladder::new(settings(seed + 900, 1)), &space, 0, COUNT, |drawn| drawn.weight, in_disks);
        runs.push([all, pilots, uniform]);
    }
    for (way, name) in ["all rungs", "pilots", "uniform"].into_iter().enumerate() {
        for (k, (_, r)) in DISKS.iter().enumerate() {
            let values: Vec<f64> = runs.iter().map(|run| run[way][k]).collect();
            assert_mean(&values, std::f64::consts::PI * r * r, 12, 0.1, &format!("disk {k}, {name}"));
        }
    }
}

/// Sum over disks of the variance of second draws relative to that of as many independent paths.
fn inflation(space: &Disks, base: &LadderSettings) -> f64 {
    let runs: Vec<[f64; 4]> = (0..150)
        .map(|seed| {
            let mut ladder = Ladder::new(LadderSettings { seed, ..base.clone() });
            integrals(&mut ladder, space, 0, COUNT, |drawn| drawn.weight, in_disks);
            integrals(&mut ladder, space, 1, COUNT, |drawn| drawn.weight, in_disks)
        })
        .collect();
    let one = |k: usize| {
        let area = std::f64::consts::PI * DISKS[k].1.powi(2);
        variance(&runs.iter().map(|run| run[k]).collect::<Vec<_>>()) * COUNT as f64 / (area * (1.0 - area))
    };
    (0..4).map(one).sum::<f64>() / 4.0
}

/// An eighth of the space is visible, so that uniform paths do well. Weights that take chain states for independent ones trust them too
/// much; effective counts mend part of that, measured shares nearly all.
#[test]
fn effective_counts_and_measured_shares_lower_the_variance() {
    let fixed = settings(0, 4);
    let measured = LadderSettings { allocation: Allocation::Measured, ..fixed.clone() };
    let blind = inflation(&Disks { cells: false }, &fixed);
    let counted = inflation(&Disks { cells: true }, &fixed);
    let shared = inflation(&Disks { cells: true }, &measured);
    println!("variance over that of independent paths: {blind:.2} blind, {counted:.2} with effective counts, {shared:.2} measured");
    assert!(counted < 0.95 * blind, "{counted} with effective counts, {blind} without");
    assert!(shared < 1.6 && shared < 0.7 * counted, "{shared} with measured shares");
}
