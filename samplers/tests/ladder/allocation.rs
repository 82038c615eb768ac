//! Where measured shares go.

use crate::kit::{assert_mean, integrals, settings};
use isophote_samplers::{Allocation, Ladder, LadderSettings, LightPathSpace, Stream};

fn measured(seed: u64) -> LadderSettings {
    LadderSettings { allocation: Allocation::Measured, ..settings(seed, 4) }
}

/// Everything is visible and targets hardly vary: independent paths are as good as it gets.
struct Easy;
impl LightPathSpace for Easy {
    type Path = [f32; 2];
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut [f32; 2]) {
        *path = stream.next_2d();
    }
    fn targets(&self, p: &[f32; 2], values: &mut [f64]) {
        let t = 1.0 + 0.1 * f64::from(p[0] - 0.5);
        values.copy_from_slice(&[1.0, 1.0, t, t * t]);
    }
    fn usefulness(&self, p: &[f32; 2]) -> f64 {
        1.0 + f64::from(p[1])
    }
    fn cell(&self, p: &[f32; 2]) -> Option<u32> {
        Some((p[1] * 16.0) as u32 * 16 + (p[0] * 16.0) as u32)
    }
}

/// A thousandth of the space is visible, and there the measurements' contributions fall by `e^-8` along either axis: the last target follows
/// them, the one before with a quarter of the exponent.
struct Hard {
    /// What a path that misses costs, against 1 for one that hits.
    miss: f64,
}
const SIDE: f64 = 0.0316;
const FALL: f64 = 8.0;

/// Contribution of a path; 0 where it is not visible.
fn contribution(p: &[f32; 2]) -> f64 {
    let [x, y] = p.map(|u| f64::from(u) / SIDE);
    if x < 1.0 && y < 1.0 { (-FALL * (x + y)).exp() } else { 0.0 }
}

/// Integral of the contribution.
fn hard_truth() -> f64 {
    (SIDE * (1.0 - (-FALL).exp()) / FALL).powi(2)
}

impl LightPathSpace for Hard {
    type Path = [f32; 2];
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut [f32; 2]) {
        *path = stream.next_2d();
    }
    fn targets(&self, p: &[f32; 2], values: &mut [f64]) {
        let f = contribution(p);
        let v = f64::from(u8::from(f > 0.0));
        values.copy_from_slice(&[1.0, v, v * f.powf(0.25), f]);
    }
    fn usefulness(&self, p: &[f32; 2]) -> f64 {
        contribution(p).powi(2)
    }
    fn cell(&self, p: &[f32; 2]) -> Option<u32> {
        let [x, y] = p.map(|u| (f64::from(u) / SIDE * 32.0) as u32);
        (x < 32 && y < 32).then_some(y * 32 + x)
    }
    fn cost(&self, p: &[f32; 2]) -> f64 {
        if contribution(p) > 0.0 { 1.0 } else { self.miss }
    }
}

#[test]
fn an_easy_space_is_left_to_independent_paths() {
    let mut ladder = Ladder::new(measured(1));
    for i in 0..4 {
        integrals(&mut ladder, &Easy, i, 50_000, |drawn| drawn.weight, |_| [1.0]);
        let shares: Vec<f64> = ladder.report().rungs.iter().map(|rung| rung.share).collect();
        assert!(shares[0] > 0.8, "draw {i}: {shares:?}");
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12 && shares.iter().all(|s| *s > 0.01));
    }
}

#[test]
fn a_hard_space_is_left_to_the_last_rung() {
    let space = Hard { miss: 1.0 };
    let mut ladder = Ladder::new(measured(2));
    for i in 0..4 {
        integrals(&mut ladder, &space, i, 50_000, |drawn| drawn.weight, |_| [1.0]);
        let report = ladder.report();
        let shares: Vec<f64> = report.rungs.iter().map(|rung| rung.next_share).collect();
        println!("{shares:.3?}, tau {:.1?}", report.rungs.iter().map(|rung| rung.dispersion).collect::<Vec<_>>());
        assert!(shares[3] > shares[0] + shares[1] + shares[2], "after draw {i}: {shares:?}");
    }
}

/// Floors are shares of the cost: uniform paths that cost a tenth get more steps.
#[test]
fn cheap_paths_get_more_steps() {
    let share = |miss| {
        let mut ladder = Ladder::new(measured(3));
        integrals(&mut ladder, &Hard { miss }, 0, 50_000, |drawn| drawn.weight, |_| [1.0]);
        ladder.report().rungs[0].next_share
    };
    let (cheap, dear) = (share(0.1), share(1.0));
    assert!(cheap > 2.0 * dear, "{cheap} against {dear}");
}

#[test]
fn estimates_with_measured_shares_are_unbiased() {
    let hard = Hard { miss: 1.0 };
    let mut runs = (Vec::new(), Vec::new());
    for seed in 0..40 {
        let (mut easy_ladder, mut hard_ladder) = (Ladder::new(measured(seed)), Ladder::new(measured(seed + 1000)));
        let (mut easy_sum, mut hard_sum) = (0.0, 0.0);
        for i in 0..3 {
            easy_sum += integrals(&mut easy_ladder, &Easy, i, 20_000, |drawn| drawn.weight, |p| [f64::from(p[0] * p[1])])[0] / 3.0;
            hard_sum += integrals(&mut hard_ladder, &hard, i, 100_000, |drawn| drawn.weight, |p| [contribution(p)])[0] / 3.0;
        }
        runs.0.push(easy_sum);
        runs.1.push(hard_sum);
    }
    assert_mean(&runs.0, 0.25, 2, 0.02, "easy");
    assert_mean(&runs.1, hard_truth(), 2, 0.25, "hard");
}
