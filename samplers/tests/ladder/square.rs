//! The unit square with exact integrals: estimates are unbiased for every ladder, every way to join rungs and any assumed normalisation.

use crate::kit::{RADIUS, Square, assert_mean, integrals, settings, t_test, variance};
use isophote_samplers::{Allocation, Combine, Ladder, LadderSettings, Normaliser, PhotonSampler};

const COUNT: u64 = 12_000;
const RUNS: u64 = 60;

fn f(x: f64, y: f64) -> f64 {
    1.0 + x + 2.0 * y * y
}

fn inside(p: &[f32; 2]) -> bool {
    (f64::from(p[0]) - 0.5).powi(2) + (f64::from(p[1]) - 0.5).powi(2) < RADIUS * RADIUS
}

fn on_disk(p: &[f32; 2]) -> [f64; 1] {
    [if inside(p) { f(f64::from(p[0]), f64::from(p[1])) } else { 0.0 }]
}

/// Estimates of the integral of `f` over the disk: one draw of each of many ladders.
fn estimates(base: &LadderSettings, assumed: Option<&[f64]>) -> Vec<f64> {
    let space = Square::default();
    (0..RUNS)
        .map(|seed| {
            let mut ladder = Ladder::new(LadderSettings { seed, ..base.clone() });
            if let Some(b) = assumed {
                assert!(ladder.assume_normalisations(b));
            }
            integrals(&mut ladder, &space, 0, COUNT, |drawn| drawn.weight, on_disk)[0]
        })
        .collect()
}

#[test]
fn all_ladders_and_all_ways_to_join_rungs_are_unbiased() {
    let truth = Square::default().integral(1, f);
    for rungs in 1..=4 {
        for combine in [Combine::Mis, Combine::Average, Combine::Last] {
            let base = LadderSettings { combine, ..settings(0, rungs) };
            let what = format!("{rungs} rungs, {combine:?}");
            // The last rung alone hardly visits where its target is a hundred thousandth.
            let power = if combine == Combine::Mis || rungs < 4 { 0.06 } else { 0.3 };
            assert_mean(&estimates(&base, None), truth, 12, power, &what);
        }
    }
}

#[test]
fn wrong_assumed_normalisations_cost_variance_alone() {
    let space = Square::default();
    let truth = space.integral(1, f);
    let b: Vec<f64> = std::iter::once(1.0).chain((1..4).map(|rung| space.integral(rung, |_, _| 1.0))).collect();
    for (k, factors) in [[1.0, 2.0, 0.5, 2.0], [1.0, 0.5, 2.0, 2.0], [1.0, 2.0, 2.0, 2.0]].into_iter().enumerate() {
        let wrong: Vec<f64> = b.iter().zip(factors).map(|(b, f)| b * f).collect();
        let values = estimates(&settings(1000, 4), Some(&wrong));
        assert_mean(&values, truth, 3, 0.06, &format!("factors {k}"));
    }
    // The same weights with the assumed normalisations outside as well are wrong, and these tests would see it.
    let strata = |seed| {
        let mut ladder = Ladder::new(settings(seed, 4));
        let doubled = [1.0, 2.0 * b[1], 2.0 * b[2], 2.0 * b[3]];
        assert!(ladder.assume_normalisations(&doubled));
        let emit = |sums: &mut [f64; 4], p: &[f32; 2], drawn: &[isophote_samplers::Drawn]| {
            drawn.iter().for_each(|drawn| sums[drawn.stratum] += drawn.weight * on_disk(p)[0]);
        };
        let draw = ladder.draw(&space, 0, COUNT, || [0.0; 4], emit);
        let report = ladder.report();
        let sum = |c: usize| draw.batches.iter().map(|batch| batch[c]).sum::<f64>() * draw.scales[c];
        (0..4).map(|c| sum(c) * doubled[c] / report.rungs[c].normalisation).sum::<f64>()
    };
    let (mean, _, p) = t_test(&(0..20).map(strata).collect::<Vec<_>>(), truth);
    assert!(p < 1e-6 && mean > 1.2 * truth, "{mean} for {truth}, p = {p}");
}

#[test]
fn a_list_that_is_no_list_of_normalisations_changes_nothing() {
    let mut ladder = Ladder::new(settings(0, 3));
    for wrong in [&[1.0, 1.0][..], &[1.0, 0.0, 1.0], &[1.0, f64::NAN, 1.0], &[1.0, f64::INFINITY, 1.0]] {
        let before = ladder.clone();
        assert!(!ladder.assume_normalisations(wrong));
        assert_eq!(ladder, before);
    }
}

/// The standard error that is reported is the scatter of independent runs.
#[test]
fn normalisations_are_right_and_so_are_their_errors() {
    let space = Square::default();
    let reports: Vec<_> = (0..150)
        .map(|seed| {
            let mut ladder = Ladder::new(settings(seed + 300, 4));
            ladder.draw(&space, 0, COUNT, || (), |_, _, _| {});
            ladder.report()
        })
        .collect();
    for rung in 1..4 {
        let truth = space.integral(rung, |_, _| 1.0);
        let values: Vec<f64> = reports.iter().map(|report| report.rungs[rung].normalisation).collect();
        assert_mean(&values, truth, 3, 0.03, &format!("b_{rung}"));
        let claimed = reports.iter().map(|report| report.rungs[rung].normalisation_error.powi(2)).sum::<f64>() / 150.0;
        let ratio = variance(&values) / claimed;
        // 150 runs know a variance to 12 %. The errors add ratios' variances as if independent; exchanges make them not quite.
        assert!((0.6..1.5).contains(&ratio), "b_{rung}: the runs' variance is {ratio} times the claimed one");
    }
}

#[test]
fn pooled_normalisations_get_better_with_every_draw() {
    let space = Square::default();
    let mut ladder = Ladder::new(LadderSettings { normaliser: Normaliser::Pooled, ..settings(5, 4) });
    let mut errors = Vec::new();
    for iteration in 0..16 {
        ladder.draw(&space, iteration, COUNT, || (), |_, _, _| {});
        let report = ladder.report();
        errors.push([1, 2, 3].map(|c| report.rungs[c].normalisation_error));
        for c in 1..4 {
            let (rung, truth) = (&report.rungs[c], space.integral(c, |_, _| 1.0));
            assert!((rung.normalisation - truth).abs() < 5.0 * rung.normalisation_error, "draw {iteration}, b_{c}");
        }
    }
    for c in [0, 1, 2] {
        let gain = errors[1][c] / errors[15][c];
        assert!((2.0..4.2).contains(&gain), "b_{}: after eight times the steps the error is {gain} times smaller", c + 1);
    }
    // Other targets: what was known of the old ones is forgotten.
    ladder.retargeted();
    ladder.draw(&space, 16, COUNT, || (), |_, _, _| {});
    let error = ladder.report().rungs[3].normalisation_error;
    assert!(error > 2.0 * errors[15][2], "the error of b_3 is still {error} of {}", errors[15][2]);
}

#[test]
fn measured_shares_leave_estimates_unbiased() {
    let space = Square::default();
    let truth = space.integral(1, f);
    let values: Vec<f64> = (0..40)
        .map(|seed| {
            let mut ladder = Ladder::new(LadderSettings { allocation: Allocation::Measured, ..settings(seed + 70, 4) });
            (0..3).map(|i| integrals(&mut ladder, &space, i, COUNT, |drawn| drawn.weight, on_disk)[0]).sum::<f64>() / 3.0
        })
        .collect();
    assert_mean(&values, truth, 1, 0.03, "measured shares");
}
