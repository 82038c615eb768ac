//! Two islands of 32 cells each in six dimensions, with a law on the 64 cells that is known for every rung: occupancy, normalisations and what
//! the exchange is for.

use crate::kit::{FAMILY, autocorrelation_time, chi_squared, everything, settings};
use isophote_samplers::{Ladder, LadderSettings, LightPathSpace, PhotonSampler, Stream};

const DIMENSIONS: i32 = 6;
const SIDE: f64 = 0.45;

/// Cell 0..64 of a path on an island, `None` elsewhere. A mutation must move six coordinates by half a unit to change the island.
struct Islands {
    law: [[f64; 64]; 4],
}

impl Islands {
    fn new() -> Self {
        let third: [f64; 64] = std::array::from_fn(|cell| 0.05 + ((cell * 37 + 11) % 64) as f64 / 64.0);
        // The second island is four times as dark to the last rung, so that its own target tells the islands apart.
        let island = |cell| if cell < 32 { 1.0 } else { 0.25 };
        let last = std::array::from_fn(|cell| third[cell] * island(cell) * (0.02 + ((cell * 23 + 5) % 64) as f64 / 64.0));
        let law = [[1.0; 64], [1.0; 64], third, last];
        Self { law }
    }

    /// Normalisation of a rung.
    fn b(&self, rung: usize) -> f64 {
        if rung == 0 { 1.0 } else { 2.0 * SIDE.powi(DIMENSIONS) * self.law[rung].iter().sum::<f64>() / 64.0 }
    }
}

impl LightPathSpace for Islands {
    type Path = Option<u8>;
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut Option<u8>) {
        let mut inside = [true; 2];
        let mut first = 0.0;
        for i in 0..DIMENSIONS {
            let u = f64::from(stream.next_1d());
            inside[0] &= u < SIDE;
            inside[1] &= (0.5..0.5 + SIDE).contains(&u);
            first = if i == 0 { u } else { first };
        }
        let island = usize::from(inside[1]);
        let cell = ((first - 0.5 * island as f64) / SIDE * 32.0) as u8;
        *path = (inside[0] || inside[1]).then_some(cell.min(31) + 32 * island as u8);
    }
    fn targets(&self, path: &Option<u8>, values: &mut [f64]) {
        values[0] = 1.0;
        for (value, law) in values[1..].iter_mut().zip(&self.law[1..]) {
            *value = path.map_or(0.0, |cell| law[usize::from(cell)]);
        }
    }
}

/// The cells that each chain of a rung was counted in, step by step.
fn series(islands: &Islands, ladder: &mut Ladder, count: u64) -> Vec<Vec<Vec<u8>>> {
    let draw = everything(ladder, islands, 0, count);
    let mut series = vec![Vec::new(); 4];
    for batch in draw.batches {
        let mut chains = vec![Vec::new(); 4];
        for (path, drawn) in batch {
            if let Some(cell) = path {
                chains[drawn.stratum].extend(std::iter::repeat_n(cell, drawn.repeats as usize));
            }
        }
        for (rung, chain) in chains.into_iter().enumerate() {
            series[rung].push(chain);
        }
    }
    series
}

/// Probability of the occupancy of a rung's cells under its law, thinned by the autocorrelation time of the slowest of three functions.
fn occupancy(islands: &Islands, rung: usize, chains: &[Vec<u8>]) -> f64 {
    let law = &islands.law[rung];
    let sum: f64 = law.iter().sum();
    let functions: [&dyn Fn(usize) -> f64; 3] = [&|c| f64::from(u8::from(c < 32)), &|c| islands.law[3][c], &|c| (c % 32) as f64];
    let mut slowest: f64 = 1.0;
    for f in functions {
        let mean = (0..64).map(|c| law[c] * f(c)).sum::<f64>() / sum;
        let values: Vec<Vec<f64>> = chains.iter().map(|chain| chain.iter().map(|c| f(usize::from(*c))).collect()).collect();
        slowest = slowest.max(autocorrelation_time(&values, mean));
    }
    let mut counts = [0.0; 64];
    for chain in chains {
        for cell in chain.iter().step_by((2.0 * slowest).ceil() as usize) {
            counts[usize::from(*cell)] += 1.0;
        }
    }
    assert!(counts.iter().sum::<f64>() > 500.0, "rung {rung} is too slow for this test: time {slowest}");
    chi_squared(&counts, law)
}

#[test]
fn every_rung_visits_cells_by_its_law_and_normalisations_are_right() {
    let islands = Islands::new();
    let mut ladder = Ladder::new(settings(1, 4));
    let series = series(&islands, &mut ladder, 6_000_000);
    for (rung, chains) in series.iter().enumerate().skip(1) {
        let p = occupancy(&islands, rung, chains);
        assert!(p > FAMILY / 3.0, "rung {rung}: p = {p:.2e}");
    }
    let report = ladder.report();
    for (c, rung) in report.rungs.iter().enumerate().skip(1) {
        let off = (rung.normalisation - islands.b(c)).abs();
        assert!(
            off < 4.0 * rung.normalisation_error,
            "b_{c} = {} +- {} for {}",
            rung.normalisation,
            rung.normalisation_error,
            islands.b(c)
        );
        assert!(rung.normalisation_error < 0.02 * islands.b(c), "b_{c} is known to {}", rung.normalisation_error);
        let below = &report.rungs[c - 1];
        let (ratio, truth) = (rung.normalisation / below.normalisation, islands.b(c) / islands.b(c - 1));
        assert!(c == 1 || (ratio / truth - 1.0).abs() < 0.01, "b_{c}/b_{}: {ratio} for {truth}", c - 1);
        assert!(rung.r_hat.unwrap() < 1.05);
    }
    assert!(report.round_trips > 1000, "{} round trips", report.round_trips);
}

/// What the exchange is for: without it the last rung stays on the island it began on.
#[test]
fn without_exchanges_the_last_rung_is_stuck() {
    let islands = Islands::new();
    // Small steps alone, and small ones: a redrawn path may land anywhere, and so may a step of half the unit interval.
    let one = LadderSettings { ensembles: 1, redraw: 0.0, acceptance: 0.8, ..settings(2, 4) };
    let share_of_first = |ladder: Ladder| {
        let mut ladder = ladder;
        let chain = series(&islands, &mut ladder, 300_000).swap_remove(3).swap_remove(0);
        chain.iter().filter(|cell| **cell < 32).count() as f64 / chain.len() as f64
    };
    let truth = islands.law[3][..32].iter().sum::<f64>() / islands.law[3].iter().sum::<f64>();
    let with = share_of_first(Ladder::new(one.clone()));
    let without = share_of_first(Ladder::new(one.clone()).without_exchanges());
    assert!((with - truth).abs() < 0.1, "{with} for {truth}");
    assert!((without - truth).abs() > 0.15 && (without == 0.0 || without == 1.0), "{without}: a chain alone crosses to the other island");
    // With several ensembles the report tells.
    let mut alone = Ladder::new(LadderSettings { ensembles: 16, ..one }).without_exchanges();
    alone.draw(&islands, 0, 300_000, || (), |_, _, _| {});
    assert!(alone.report().rungs[3].r_hat.unwrap() > 1.05, "R-hat {:?}", alone.report().rungs[3].r_hat);
}
