//! Draw after draw: what is carried over, what is stored, what does not depend on threads, and what happens where nothing is visible.

use crate::kit::{Square, assert_mean, everything, integrals, settings};
use isophote_samplers::{Allocation, Combine, Ladder, LadderSettings, LightPathSpace, Normaliser, Stream};

fn full(seed: u64) -> LadderSettings {
    LadderSettings { allocation: Allocation::Measured, normaliser: Normaliser::Pooled, later_burn_in: 3, ..settings(seed, 4) }
}

/// All bits of what a ladder hands out.
fn bits(ladder: &mut Ladder, iteration: u64, count: u64) -> Vec<u64> {
    let draw = everything(ladder, &Square::default(), iteration, count);
    let path = |(p, d): &([f32; 2], isophote_samplers::Drawn)| {
        let numbers = [d.index, d.stratum as u64, d.weight.to_bits(), d.pilot_weight.to_bits(), u64::from(d.repeats)];
        numbers.into_iter().chain(p.iter().map(|u| u64::from(u.to_bits()))).collect::<Vec<_>>()
    };
    let paths = draw.batches.iter().flatten().flat_map(path);
    paths.chain(draw.scales.iter().map(|scale| scale.to_bits())).chain([draw.traced]).collect()
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut ladder = Ladder::new(full(1));
            let all: Vec<Vec<u64>> = (0..3).map(|i| bits(&mut ladder, i, 5000)).collect();
            (all, ladder)
        })
    };
    let (one, four) = (on(1), on(4));
    assert!(one == four);
    assert_ne!(one.0[0], one.0[1]);
}

#[test]
fn a_stored_ladder_goes_on_with_the_same_bits() {
    let mut ladder = Ladder::new(full(2));
    bits(&mut ladder, 0, 5000);
    ladder.retargeted();
    bits(&mut ladder, 1, 5001);
    ladder.retargeted();
    let stored = serde_json::to_string(&ladder).unwrap();
    let mut again: Ladder = serde_json::from_str(&stored).unwrap();
    assert_eq!(ladder, again);
    assert_eq!(ladder.report(), again.report());
    for i in 2..4 {
        assert_eq!(bits(&mut ladder, i, 5000), bits(&mut again, i, 5000));
    }
    // What is stored matters: a new ladder does not give these bits.
    assert_ne!(bits(&mut ladder, 4, 100), bits(&mut Ladder::new(full(2)), 4, 100));
}

#[test]
fn indices_are_unique_and_every_step_is_handed_out_once() {
    for (rungs, count) in [(1, 1000), (2, 999), (3, 17), (4, 5003)] {
        let mut ladder = Ladder::new(settings(3, rungs));
        let draw = everything(&mut ladder, &Square::default(), 0, count);
        let mut indices: Vec<(u64, usize)> = draw.batches.iter().flatten().map(|(_, drawn)| (drawn.index, drawn.stratum)).collect();
        let steps: u64 = draw.batches.iter().flatten().map(|(_, drawn)| u64::from(drawn.repeats)).sum();
        assert_eq!(steps, count, "{rungs} rungs");
        indices.sort_unstable();
        assert!(indices.windows(2).all(|pair| pair[0] < pair[1]) && indices.last() < Some(&(count, 0)));
        // Entries of one index are one path.
        let mut paths: Vec<(u64, [u32; 2])> = draw.batches.iter().flatten().map(|(p, drawn)| (drawn.index, p.map(f32::to_bits))).collect();
        paths.sort_unstable();
        paths.dedup();
        assert!(paths.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(draw.batches.len(), 16);
        let reported: u64 = ladder.report().rungs.iter().map(|rung| rung.steps).sum();
        assert_eq!(reported, count);
        // Neither a burn-in nor a pool is wanted by a ladder of one rung.
        assert_eq!(draw.traced, if rungs == 1 { count } else { count + 4096 + 16 * (200 * rungs as u64 + rungs as u64 - 1) });
    }
}

#[test]
fn a_draw_of_nothing_is_nothing() {
    for rungs in 1..=4 {
        let mut ladder = Ladder::new(LadderSettings { start_up: 0, first_burn_in: 0, ..settings(3, rungs) });
        let draw = everything(&mut ladder, &Square::default(), 0, 0);
        assert!(draw.batches.iter().all(Vec::is_empty) && draw.scales == vec![0.0; rungs]);
        let draw = everything(&mut ladder, &Square::default(), 1, 5000);
        assert!(draw.scales.iter().all(|scale| scale.is_finite() && *scale > 0.0));
    }
}

/// A visible square that the draws move, or nothing visible at all.
struct Moving {
    low: Option<f32>,
}

impl LightPathSpace for Moving {
    type Path = [f32; 2];
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut [f32; 2]) {
        *path = stream.next_2d();
    }
    fn targets(&self, p: &[f32; 2], values: &mut [f64]) {
        let visible = self.low.is_some_and(|low| p.iter().all(|u| (low..low + 0.2).contains(u)));
        let v = f64::from(u8::from(visible));
        let t = f64::from(p[0]) + 0.1;
        values.copy_from_slice(&[1.0, v, v * t, v * t * t][..values.len()]);
    }
    fn usefulness(&self, p: &[f32; 2]) -> f64 {
        let mut values = [0.0; 2];
        self.targets(p, &mut values);
        values[1]
    }
    fn cell(&self, p: &[f32; 2]) -> Option<u32> {
        (self.usefulness(p) > 0.0).then_some((p[0] * 1000.0) as u32)
    }
}

/// Integral of `x` over the square.
fn truth(low: f32) -> f64 {
    let low = f64::from(low);
    0.2 * ((low + 0.2).powi(2) - low.powi(2)) / 2.0
}

/// The square jumps so far that every state is dead at once; estimates are right all the same.
#[test]
fn states_carried_over_to_other_targets_leave_estimates_unbiased() {
    let places = [0.1f32, 0.15, 0.6, 0.1];
    for (k, combine) in [Combine::Mis, Combine::Last].into_iter().enumerate() {
        let mut values = vec![Vec::new(); places.len()];
        for seed in 0..60 {
            let mut ladder = Ladder::new(LadderSettings { combine, ..settings(seed + 100 * k as u64, 4) });
            for (i, low) in places.into_iter().enumerate() {
                let space = Moving { low: Some(low) };
                ladder.retargeted();
                let mean = |p: &[f32; 2]| [if space.usefulness(p) > 0.0 { f64::from(p[0]) } else { 0.0 }];
                values[i].push(integrals(&mut ladder, &space, i as u64, 20_000, |drawn| drawn.weight, mean)[0]);
            }
            let report = ladder.report();
            assert!(report.rungs[3].dead_states >= 32, "{} dead states", report.rungs[3].dead_states);
            let (counted, lost) = (report.rungs[3].steps, report.rungs[3].uncounted);
            assert!(lost > 0 && lost < counted / 5, "{lost} steps of {counted} went to waking up");
        }
        for (i, low) in places.into_iter().enumerate() {
            assert_mean(&values[i], truth(low), 8, 0.1, &format!("{combine:?}, place {i}"));
        }
    }
}

/// Nothing is visible at first: no number is wrong or missing, and the ladder comes to life when something appears and survives when it goes.
#[test]
fn where_nothing_is_visible_everything_stays_finite() {
    for rungs in 1..=4 {
        for combine in [Combine::Mis, Combine::Average, Combine::Last] {
            for allocation in [Allocation::Fixed, Allocation::Measured] {
                let mut ladder = Ladder::new(LadderSettings { combine, allocation, ..settings(9, rungs) });
                for (iteration, low) in [None, None, Some(0.3), None, Some(0.5)].into_iter().enumerate() {
                    ladder.retargeted();
                    let draw = everything(&mut ladder, &Moving { low }, iteration as u64, 4000);
                    assert!(draw.scales.iter().all(|scale| scale.is_finite() && *scale >= 0.0));
                    for (_, drawn) in draw.batches.iter().flatten() {
                        assert!(drawn.weight.is_finite() && drawn.pilot_weight.is_finite() && drawn.weight >= 0.0);
                    }
                    let report = ladder.report();
                    for (c, rung) in report.rungs.iter().enumerate() {
                        assert!(rung.normalisation.is_finite() && rung.normalisation_error.is_finite());
                        assert!(rung.dispersion.is_finite() && rung.share.is_finite() && rung.next_share > 0.0);
                        assert!(c == 0 || (rung.normalisation > 0.0) == low.is_some(), "draw {iteration}, b_{c} = {}", rung.normalisation);
                        // A target that is not met in n paths: the reported error is the bound 3/n.
                        let n = draw.batches.iter().flatten().filter(|(_, drawn)| drawn.stratum == 0).count();
                        assert!(c == 0 || low.is_some() || rung.normalisation_error == 3.0 / n as f64);
                    }
                    assert!(!serde_json::to_string(&ladder).unwrap().contains("null,null,null"));
                }
                assert!(rungs == 1 || ladder.report().rungs[rungs - 1].steps > 0);
            }
        }
    }
}
