use super::super::{EPSILON, metric};
use super::*;
use crate::image::picture::Picture;

fn picture(width: usize, height: usize, value: impl Fn(usize) -> f32) -> Picture {
    Picture::new(width, height, (0..width * height).map(|i| Rgb::splat(value(i))).collect())
}

fn flip_of(reference: &Picture, image: &Picture) -> Option<f64> {
    metric("flip").expect("known").measure(&Pairs::new(reference, image).expect("one size"), EPSILON).value
}

#[test]
fn the_curve_and_its_inverse_agree() {
    for target in [0.01, 0.5, 0.85, 0.99] {
        let exposed = colour::aces_inverse(target);
        assert!((f64::from(aces(exposed as f32, 1.0)) - target).abs() < 1e-6, "{target}");
    }
    assert_eq!((aces(0.0, 4.0), aces(-3.0, 4.0), aces(f32::MAX, 1e40)), (0.0, 0.0, 1.0));
    assert!(aces(50.0, 1.0) == 1.0 && colour::aces_inverse(0.999) < SATURATED_BY);
}

/// Far below the value from which exposed values are treated alike.
const SATURATED_BY: f64 = 20.0;

#[test]
fn black_and_white_are_as_far_apart_as_can_be() {
    let (black, white) = (picture(40, 40, |_| 0.0), picture(40, 40, |_| 1.0));
    let map = ldr_flip_map(&Pairs::new(&black, &white).expect("one size"));
    assert!(map.iter().all(|v| *v > 0.95 && *v <= 1.0), "{}", map[0]);
}

/// A lit object on black: the median of all luminances is 0, that of the lit pixels is not.
#[test]
fn a_median_of_zero_is_taken_over_lit_pixels() {
    let reference = picture(30, 30, |i| if i % 30 < 8 { [0.5, 2.0][i % 2] } else { 0.0 });
    let image = picture(30, 30, |i| if i % 30 < 8 { 1.0 } else { 0.0 });
    let pairs = Pairs::new(&reference, &image).expect("one size");
    let exposures = flip_exposures(&pairs).expect("lit");
    let target = colour::aces_inverse(0.85);
    assert!((exposures.start - (target / 2.0).log2()).abs() < 1e-9 && (exposures.stop - (target / 2.0).log2()).abs() < 1e-9);
    let error = flip_of(&reference, &image).expect("a value");
    assert!(error > 0.05 && error < 1.0, "{error}");
    assert_eq!(flip_of(&reference, &reference), Some(0.0));
}

#[test]
fn black_references_take_the_exposures_of_the_image() {
    let black = picture(20, 20, |_| 0.0);
    let lit = picture(20, 20, |i| i as f32 / 64.0);
    assert_eq!(flip_of(&black, &black), Some(0.0));
    let error = flip_of(&black, &lit).expect("a value");
    assert!(error > 0.8, "{error}");
    // Scene units do not matter.
    let dim = picture(20, 20, |i| i as f32 / 65536.0);
    assert!((flip_of(&black, &dim).expect("a value") - error).abs() < 1e-5);
}

#[test]
fn extreme_values_stay_in_range() {
    let reference = picture(16, 16, |i| [f32::from_bits(1), 1.0, f32::MAX][i % 3]);
    let image = picture(16, 16, |i| [f32::MAX, f32::MIN, f32::from_bits(1)][i % 3]);
    let map = flip_map(&Pairs::new(&reference, &image).expect("one size"));
    assert!(map.iter().all(|v| (0.0..=1.0).contains(v)));
}
