use super::*;
use crate::image::metrics::{Pairs, metric};
use isophote_samplers::{Key, Purpose, Stream};

/// A normal number, nearly: the sum of twelve uniform ones.
fn normal(run: u64, index: u64) -> f64 {
    let mut stream = Key { seed: run, iteration: 0, index, purpose: Purpose::Test }.stream();
    (0..12).map(|_| f64::from(stream.next_1d())).sum::<f64>() - 6.0
}

fn picture(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Picture {
    Picture::new(width, height, (0..width * height).map(|i| Rgb::from([0, 1, 2].map(|c| value(i, c)))).collect())
}

fn flat(value: f32) -> Picture {
    picture(1, 1, |_, _| value)
}

fn runs_of(pictures: &[Picture]) -> Runs {
    let mut runs = Runs::new(pictures[0].width, pictures[0].height);
    for picture in pictures {
        runs.add(picture).expect("one size");
    }
    runs
}

#[test]
fn three_values_by_hand() {
    // 1, 2, 6: mean 3, s^2 = (4 + 1 + 9) / 2 = 7.
    let runs = runs_of(&[flat(1.0), flat(2.0), flat(6.0)]);
    assert_eq!((runs.count(), runs.mean().expect("runs").pixels[0]), (3, Rgb::splat(3.0)));
    assert_eq!(runs.variance().expect("runs").pixels[0], Rgb::splat(7.0));
    assert_eq!(runs.variance_of_mean().expect("runs").pixels[0], Rgb::splat((7.0 / 3.0) as f32));
    assert!((runs.nsd().expect("a value") - 7.0_f64.sqrt() / 3.0).abs() < 1e-15);
    // Against 2 +- 0.5: mse (1 + 0 + 16) / 3, bias^2 = 1 - 7/3 - 1/4.
    let (reference, variance) = (flat(2.0), flat(0.25));
    let parts = runs.split(&reference, Some(&variance)).expect("one size").average().expect("values");
    let expected = Parts { error: 1.0, mse: 17.0 / 3.0, variance: 7.0, bias2: 1.0 - 7.0 / 3.0 - 0.25, reference_variance: 0.25 };
    for (found, expected) in [
        (parts.error, expected.error),
        (parts.mse, expected.mse),
        (parts.variance, expected.variance),
        (parts.bias2, expected.bias2),
        (parts.reference_variance, expected.reference_variance),
        (parts.variance + parts.bias2 + parts.reference_variance, parts.mse),
    ] {
        assert!((found - expected).abs() < 1e-14, "{parts:?}");
    }
    assert!((f64::from(runs.relative_error_map(&reference, 0.5).expect("one size").pixels[0].r()) - 0.4).abs() < 1e-7);
    let one = runs_of(&[flat(1.0)]);
    assert_eq!((one.variance(), one.nsd()), (None, None));
    assert_eq!(one.split(&reference, None).err(), Some(SplitError::TooFew(1)));
}

#[test]
fn means_of_the_runs_metrics_are_those_of_the_split() {
    let reference = picture(9, 7, |i, c| ((i * 5 + c * 3) % 11) as f32 * 0.25);
    let pictures: Vec<Picture> =
        (0..4).map(|k| picture(9, 7, |i, c| reference.pixels[i][c] + normal(k, (3 * i + c) as u64) as f32)).collect();
    let runs = runs_of(&pictures);
    let split = runs.split(&reference, None).expect("one size");
    for (name, found) in [("mse", split.average()), ("relmse", split.relative(0.01))] {
        let values = pictures.iter().map(|p| metric(name).expect("known").measure(&Pairs::new(&reference, p).expect("one size"), 0.01));
        let expected = values.map(|m| m.value.expect("a value")).sum::<f64>() / 4.0;
        let found = found.expect("values").mse;
        assert!((found / expected - 1.0).abs() < 1e-12, "{name}: {found} against {expected}");
    }
}

/// 6,400 pixels of 6 runs with bias 0.3 and deviation 2 against a reference of deviation 0.5: each part is found within five standard errors.
#[test]
fn planted_variance_and_bias_are_found() {
    const RUNS: f64 = 6.0;
    let (width, height) = (80, 80);
    let noisy = |run: u64, deviation: f64, bias: f64| {
        picture(width, height, |i, c| (10.0 + bias + deviation * normal(run, (3 * i + c) as u64)) as f32)
    };
    let runs = runs_of(&(0..RUNS as u64).map(|k| noisy(k, 2.0, 0.3)).collect::<Vec<_>>());
    let (reference, variance) = (noisy(77, 0.5, 0.0), picture(width, height, |_, _| 0.25));
    let parts = runs.split(&reference, Some(&variance)).expect("one size").average().expect("values");
    let values = (3 * width * height) as f64;
    // Of the mean error: d = 4/K + 1/4; of d's square less its mean: sqrt(2 d^2 + 4 d b^2 + 2 (4/K)^2 / (K-1)) at most.
    let d: f64 = 4.0 / RUNS + 0.25;
    let bias_error = ((2.0 * d * d + 4.0 * d * 0.09 + 2.0 * (4.0 / RUNS).powi(2) / (RUNS - 1.0)) / values).sqrt();
    let variance_error = 4.0 * (2.0 / (RUNS - 1.0) / values).sqrt();
    assert!((parts.bias2 - 0.09).abs() < 5.0 * bias_error, "{} +- {bias_error}", parts.bias2);
    assert!((parts.variance - 4.0).abs() < 5.0 * variance_error, "{} +- {variance_error}", parts.variance);
    assert!((parts.error - 0.3).abs() < 5.0 * (d / values).sqrt(), "{}", parts.error);
    // Left in, the two variances would show as bias: 0.09 + 0.67 + 0.25.
    assert!(10.0 * bias_error < 0.25);
}

#[test]
fn pixels_that_are_not_finite_are_masked_in_all_runs() {
    let bad = |at: usize, value: f32| picture(3, 1, move |i, c| if i == at && c == 1 { value } else { i as f32 + 1.0 });
    let runs = runs_of(&[bad(0, f32::NAN), bad(9, 0.0), bad(9, 0.0)]);
    assert_eq!(runs.masked(), 1);
    assert!(runs.mean().expect("runs").pixels[0].r().is_nan());
    assert_eq!(runs.nsd(), Some(0.0));
    let (reference, variance) = (bad(1, f32::INFINITY), bad(2, f32::NAN));
    let split = runs.split(&reference, None).expect("one size");
    assert_eq!((split.masked(), split.average().expect("one pixel").mse), (2, 0.0));
    let split = runs.split(&reference, Some(&variance)).expect("one size");
    assert_eq!((split.masked(), split.average()), (3, None));
    assert_eq!(runs.tile_errors(&reference, 1, 0.01).expect("one size").errors, [None, None, Some(0.0)]);
}

#[test]
fn noise_without_a_positive_mean_is_counted() {
    let runs = runs_of(&[picture(3, 1, |i, _| [1.0, 0.0, -1.0][i]), picture(3, 1, |i, _| [1.0, 0.0, 1.0][i])]);
    assert_eq!(runs.noise(), Measured { value: Some(0.0), left_out: 3 });
}

#[test]
fn tiles_know_how_even_the_error_is() {
    // 5x4 pixels in tiles of two: 3x2 tiles, the last column one pixel wide. Relative errors 1 on the left half, 3 on the right.
    let reference = picture(5, 4, |_, _| 2.0);
    let runs = runs_of(&[picture(5, 4, |i, _| if i % 5 < 2 { 4.0 } else { 8.0 })]);
    let tiles = runs.tile_errors(&reference, 2, 0.0).expect("one size");
    assert_eq!((tiles.columns, tiles.rows, tiles.side), (3, 2, 2));
    assert_eq!(tiles.errors, [1.0, 3.0, 3.0, 1.0, 3.0, 3.0].map(Some));
    // Mean 7/3, standard deviation sqrt(8)/3.
    assert!((tiles.coefficient_of_variation().expect("errors") - 8.0_f64.sqrt() / 7.0).abs() < 1e-15);
    let even = runs_of(&[picture(5, 4, |_, _| 4.0)]).tile_errors(&reference, 2, 0.0).expect("one size");
    assert_eq!(even.coefficient_of_variation(), Some(0.0));
}

#[test]
fn sizes_must_agree() {
    let mut runs = runs_of(&[flat(1.0), flat(1.0)]);
    let wide = picture(2, 1, |_, _| 1.0);
    assert_eq!(runs.add(&wide).expect_err("refused").to_string(), "is 2x1 pixels, the reference 1x1");
    assert_eq!(runs.split(&wide, None).expect_err("refused").to_string(), "the runs' image is 1x1 pixels, the reference 2x1");
    assert!(runs.relative_error_map(&wide, 0.01).is_err() && runs.tile_errors(&wide, 8, 0.01).is_err());
    assert_eq!(runs.count(), 2);
}
