//! The estimated dispersion is the one that independent runs show.

use crate::kit::{Square, settings, variance};
use isophote_samplers::{Combine, Drawn, Ladder, LadderSettings, PhotonSampler};

const CELLS: usize = 64;
const RUNS: usize = 100;
const COUNT: u64 = 48_000;

/// Counts per cell of whole ladders with other seeds scatter by `tau` times the binomial variance that `tau` of the ladders' own
/// ensembles says. This includes what an ensemble cannot see of itself: the start and the drift from draw to draw.
#[test]
fn dispersion_predicts_the_scatter_of_independent_runs() {
    let space = Square::default();
    let mut counts = vec![[[0.0; CELLS]; 4]; RUNS];
    let mut taus = [0.0; 4];
    for (run, counts) in counts.iter_mut().enumerate() {
        let mut ladder = Ladder::new(LadderSettings { combine: Combine::Average, ..settings(run as u64, 4) });
        ladder.draw(&space, 0, COUNT, || (), |_, _, _| {});
        let emit = |list: &mut Vec<(usize, usize, f64)>, p: &[f32; 2], drawn: &[Drawn]| {
            let cell = (p[1] * 8.0) as usize * 8 + (p[0] * 8.0) as usize;
            list.extend(drawn.iter().map(|drawn| (drawn.stratum, cell, f64::from(drawn.repeats))));
        };
        for (rung, cell, repeats) in ladder.draw(&space, 1, COUNT, Vec::new, emit).batches.into_iter().flatten() {
            counts[rung][cell] += repeats;
        }
        for (tau, rung) in taus.iter_mut().zip(ladder.report().rungs) {
            *tau += rung.dispersion / RUNS as f64;
        }
    }
    for rung in 0..4 {
        let (mut scatter, mut binomial) = (0.0, 0.0);
        for cell in 0..CELLS {
            let values: Vec<f64> = counts.iter().map(|run| run[rung][cell]).collect();
            let steps: f64 = counts[0][rung].iter().sum();
            let p = values.iter().sum::<f64>() / RUNS as f64 / steps;
            scatter += variance(&values);
            binomial += p * (1.0 - p) * steps;
        }
        let truth = scatter / binomial;
        println!("rung {rung}: dispersion {:.2}, scatter of runs {truth:.2}", taus[rung]);
        assert!((taus[rung] / truth - 1.0).abs() < 0.15, "rung {rung}: {} for {truth}", taus[rung]);
    }
    assert!(taus[3] > 2.0, "the toy is too easy to tell anything: {taus:?}");
}
