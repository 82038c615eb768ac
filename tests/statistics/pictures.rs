//! The planted truth as pictures: splits averaged over pixels and channels.

use crate::fake::{Fake, VALUES, iterations, pattern, picture, progressive, reference, truth, unbiased};
use isophote::image::picture::Picture;
use isophote::math::statistics::{Sample, split, student_two_sided};

fn numbers(picture: &Picture) -> Vec<f64> {
    picture.pixels.iter().flat_map(|p| [p.r(), p.g(), p.b()]).map(f64::from).collect()
}

/// Variance of one run, squared bias, and mean squared error, each averaged over pixels and channels.
fn image_split(pictures: &[Picture], against: &Picture) -> [f64; 3] {
    let runs: Vec<Vec<f64>> = pictures.iter().map(numbers).collect();
    let expected = numbers(against);
    let mut sums = [0.0; 3];
    for v in 0..VALUES {
        let values: Vec<f64> = runs.iter().map(|run| run[v]).collect();
        let s = split(&values, expected[v], 0.0).unwrap();
        for (sum, part) in sums.iter_mut().zip([s.variance, s.squared_bias, s.mse]) {
            *sum += part / VALUES as f64;
        }
    }
    sums
}

#[test]
fn planted_splits_come_back_from_pictures() {
    for fake in [progressive(6, 2.0 / 3.0), unbiased(7)] {
        for point in [0, 6, 11] {
            let i = iterations()[point];
            let average = |of: &dyn Fn(usize) -> f64| (0..VALUES).map(of).sum::<f64>() / VALUES as f64;
            let variance = average(&|v| truth(v).powi(2)) * fake.variance_after(i);
            let bias2 = average(&|v| (truth(v) * pattern(v)).powi(2)) * fake.bias_after(i).powi(2);
            let found: Vec<[f64; 3]> = (0..300).map(|repetition| image_split(&at(&fake, repetition, point), &reference())).collect();
            for (part, planted) in [variance, bias2, variance + bias2].into_iter().enumerate() {
                let sample = Sample::of(&found.iter().map(|f| f[part]).collect::<Vec<f64>>());
                let p = student_two_sided((sample.mean - planted) / sample.variance.sqrt(), sample.freedom);
                assert!(p > crate::coverage::TEST, "part {part} after {i}: {} found, {planted} planted, p {p}", sample.mean);
                assert!(sample.variance.sqrt() < 0.05 * (variance + bias2), "too noisy to tell");
            }
        }
    }
}

fn at(fake: &Fake, repetition: u64, point: usize) -> Vec<Picture> {
    fake.runs(repetition, 8).iter().map(|run| picture(&run[point].values)).collect()
}

/// Whatever the numbers: noise and bias add up to the error measured, run by run.
#[test]
fn the_parts_add_up_to_the_measured_error() {
    let pictures = at(&progressive(6, 0.75), 3, 5);
    let [variance, bias2, mse] = image_split(&pictures, &reference());
    let expected = numbers(&reference());
    let squares = |p: &Picture| numbers(p).iter().zip(&expected).map(|(x, r)| (x - r).powi(2)).sum::<f64>() / VALUES as f64;
    let measured = pictures.iter().map(squares).sum::<f64>() / pictures.len() as f64;
    assert!((variance + bias2 - measured).abs() < 1e-12 && (mse - measured).abs() < 1e-12);
}
