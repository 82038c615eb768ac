//! Noise and bias of one number.

use crate::coverage::{Coverage, LEVEL, REPETITIONS};
use crate::fake::{Fake, SNAPSHOTS, iterations, normal, pattern, progressive, truth};
use isophote::math::statistics::{Sample, Split, split, student_two_sided};
use isophote::samplers::{Key, Purpose};

/// Which of the picture's values is watched, and when.
const VALUE: usize = 5;
const POINT: usize = 4;

/// Standard deviation of the reference, planted too.
const REFERENCE_NOISE: f64 = 0.004;

fn study(fake: &Fake, repetition: u64, runs: usize) -> Split {
    let values: Vec<f64> = fake.runs(repetition, runs).iter().map(|run| run[POINT].values[VALUE]).collect();
    let mut stream = Key { seed: repetition, iteration: 77, index: 0, purpose: Purpose::Camera }.stream();
    split(&values, truth(VALUE) + REFERENCE_NOISE * normal(&mut stream), REFERENCE_NOISE.powi(2)).unwrap()
}

fn planted(fake: &Fake) -> (f64, f64) {
    let i = iterations()[POINT];
    (truth(VALUE).powi(2) * fake.variance_after(i), truth(VALUE) * pattern(VALUE) * fake.bias_after(i))
}

fn is_mean(name: &str, values: impl Iterator<Item = f64>, planted: f64) {
    let sample = Sample::of(&values.collect::<Vec<f64>>());
    let p = student_two_sided((sample.mean - planted) / sample.variance.sqrt(), sample.freedom);
    eprintln!("{name}: {:.6} found, {planted:.6} planted, p {p:.3}", sample.mean);
    assert!(p > crate::coverage::TEST, "{name}: {} found, {planted} planted", sample.mean);
}

#[test]
fn variance_and_squared_bias_are_recovered() {
    let biased = Fake { bias: 0.1, ..progressive(4, 0.75) };
    for fake in [biased, Fake { bias: 0.0, ..biased }] {
        let (variance, bias) = planted(&fake);
        for runs in [4, 8] {
            let found: Vec<Split> = (0..2 * REPETITIONS).map(|r| study(&fake, r, runs)).collect();
            is_mean("variance", found.iter().map(|s| s.variance), variance);
            is_mean("squared bias", found.iter().map(|s| s.squared_bias), bias * bias);
            is_mean("mse", found.iter().map(|s| s.mse), variance + bias * bias);
            // Without the reference's variance and the runs' own taken out, the bias would not come back.
            let naive = found.iter().map(|s| s.bias * s.bias).sum::<f64>() / found.len() as f64;
            assert!(fake.bias > 0.0 || naive > 0.2 * variance / runs as f64);
        }
    }
}

#[test]
fn bias_and_variance_are_covered() {
    for runs in [4, 8, 16] {
        let normal = Fake { spread: 0.0, ..progressive(4, 0.75) };
        let (variance, bias) = planted(&normal);
        let of_bias = |fake: Fake| {
            move |r| {
                let s = study(&fake, r, runs);
                (s.bias, s.bias_interval(LEVEL))
            }
        };
        let found = Coverage::of(format!("bias, normal runs, {runs} runs"), bias, REPETITIONS, of_bias(normal));
        found.nominal().unwrap();
        found.unbiased().unwrap();
        let loud = Fake { spread: 0.3, ..normal };
        Coverage::of(format!("bias, spread 0.3, {runs} runs"), bias, REPETITIONS, of_bias(loud)).nominal().unwrap();
        let of_variance = |fake: Fake| {
            move |r| {
                let s = study(&fake, r, runs);
                (s.variance, s.variance_interval(LEVEL))
            }
        };
        let found = Coverage::of(format!("variance, normal runs, {runs} runs"), variance, REPETITIONS, of_variance(normal));
        found.nominal().unwrap();
        found.unbiased().unwrap();
        // Heavier tails than the law knows of: short, and docs/statistics.md says so.
        let found = Coverage::of(format!("variance, spread 0.3, {runs} runs"), variance, REPETITIONS, of_variance(loud));
        assert!(found.share() > 0.85 && found.share() < 0.95);
    }
}

const _: () = assert!(POINT < SNAPSHOTS);
