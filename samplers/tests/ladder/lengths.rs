//! Paths that use as many coordinates as their coordinates say: states hold the used ones, the rest is drawn afresh.

use crate::kit::{FAMILY, chi_squared, everything, settings};
use isophote_samplers::{Key, Ladder, LadderSettings, LightPathSpace, Purpose, Stream};

const LONGEST: usize = 8;
const GO_ON: f64 = 0.7;

/// A path reads a value and a decision a vertex. Its first target is `g(length) (0.2 + first value)`, the second that times
/// `(0.1 + last value)^2`, with `g` falling and rising: lengths must grow and shrink often.
struct Lengths;

#[derive(Clone, Copy, Default)]
struct Walk {
    length: usize,
    values: [f64; LONGEST],
}

const G: [f64; LONGEST + 1] = [0.0, 1.0, 0.2, 0.6, 0.1, 1.5, 0.3, 4.0, 2.0];

fn last_factor(value: f64) -> f64 {
    (0.1 + value).powi(2)
}

impl LightPathSpace for Lengths {
    type Path = Walk;
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut Walk) {
        path.length = 0;
        loop {
            path.values[path.length] = f64::from(stream.next_1d());
            path.length += 1;
            if path.length == LONGEST || f64::from(stream.next_1d()) >= GO_ON {
                return;
            }
        }
    }
    fn targets(&self, path: &Walk, values: &mut [f64]) {
        let first = G[path.length] * (0.2 + path.values[0]);
        values.copy_from_slice(&[1.0, first, first * last_factor(path.values[path.length - 1])]);
    }
}

/// Probability of a length for uniform coordinates.
fn prior(length: usize) -> f64 {
    GO_ON.powi(length as i32 - 1) * if length == LONGEST { 1.0 } else { 1.0 - GO_ON }
}

/// Integral over a bin of `(0.2 + x)^first (0.1 + x)^(2 last)`, by the midpoint rule.
fn law_of_value(bin: usize, first: bool, last: bool) -> f64 {
    const POINTS: usize = 200;
    let x = |i: usize| (bin as f64 + (i as f64 + 0.5) / POINTS as f64) / 8.0;
    let density = |x: f64| (if first { 0.2 + x } else { 1.0 }) * (if last { last_factor(x) } else { 1.0 });
    (0..POINTS).map(|i| density(x(i))).sum::<f64>() / (8 * POINTS) as f64
}

fn whole(first: bool, last: bool) -> f64 {
    (0..8).map(|bin| law_of_value(bin, first, last)).sum()
}

/// Law of the length under a rung's target.
fn law_of_length(rung: usize) -> Vec<f64> {
    let mass = |l: usize| {
        let last = rung == 2;
        prior(l) * G[l] * if l == 1 { whole(true, last) } else { whole(true, false) * whole(false, last) }
    };
    (0..=LONGEST).map(|l| if l == 0 { 0.0 } else { mass(l) }).collect()
}

/// One step in so many is looked at: several autocorrelation times of this toy. Which one is random: paths are handed out when they are left,
/// for all their steps at once, and when they are left goes by turns of exchange, so a fixed stride favours some of them.
const THINNING: usize = 60;

#[test]
fn lengths_and_coordinates_keep_their_laws() {
    let draw = everything(&mut Ladder::new(LadderSettings { ensembles: 32, ..settings(4, 3) }), &Lengths, 0, 3_000_000);
    let mut lengths = [[0.0; LONGEST + 1]; 3];
    // By rung, length, vertex and bin.
    let mut values = vec![[[[0.0; 8]; LONGEST]; LONGEST + 1]; 3];
    let mut random = Key { seed: 5, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
    for batch in draw.batches {
        let mut step = [0usize; 3];
        let mut taken = [0usize; 3];
        for (walk, drawn) in batch {
            let c = drawn.stratum;
            for _ in 0..drawn.repeats {
                step[c] += 1;
                if (step[c] - 1) % THINNING == 0 {
                    taken[c] = step[c] + (f64::from(random.next_1d()) * THINNING as f64) as usize;
                }
                if c > 0 && step[c] == taken[c] {
                    lengths[c][walk.length] += 1.0;
                    for (vertex, value) in walk.values[..walk.length].iter().enumerate() {
                        values[c][walk.length][vertex][(value * 8.0) as usize] += 1.0;
                    }
                }
            }
        }
    }
    let members = 2.0 * (1 + LONGEST * (LONGEST + 1) / 2) as f64;
    for rung in [1, 2] {
        let p = chi_squared(&lengths[rung], &law_of_length(rung));
        assert!(p > FAMILY / members, "rung {rung}: lengths have p = {p:.2e}");
        for (length, vertices) in values[rung].iter().enumerate().skip(1) {
            for (vertex, bins) in vertices[..length].iter().enumerate() {
                let (first, last) = (vertex == 0, vertex + 1 == length && rung == 2);
                let law: Vec<f64> = (0..8).map(|bin| law_of_value(bin, first, last)).collect();
                let p = chi_squared(bins, &law);
                assert!(p > FAMILY / members, "rung {rung}, length {length}, vertex {vertex}: p = {p:.2e}");
            }
        }
    }
}
