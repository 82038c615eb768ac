//! Beckmann's distribution with roughness 1: shadowing and visible slopes.

use crate::math::elementary::exp_negative;

/// `G1/cos` by the rational fit [WALTER07 (27)]; `stretched / cos` is `alpha tan`.
#[inline(always)]
pub(super) fn fitted_g1_over_cos(cos: f32, stretched: f32) -> f32 {
    // a = cos / stretched >= 1.6, without the division.
    if cos >= 1.6 * stretched {
        return 1.0 / cos;
    }
    let a = cos / stretched;
    (3.535 + 2.181 * a) / (stretched * (1.0 + (2.276 + 2.577 * a) * a))
}

/// `G1/cos` exactly: `1 / (cos (1 + Lambda))`, `Lambda = (erf a - 1)/2 + exp(-a^2)/(2 a sqrt(pi))` (\[HEITZ14U\]).
#[inline(always)]
pub(super) fn exact_g1_over_cos(cos: f32, stretched: f32) -> f32 {
    // Beyond a = 4 the sum differs from the cosine by less than a rounding.
    if cos >= 4.0 * stretched {
        return 1.0 / cos;
    }
    let a = cos / stretched;
    let tail = 0.5 * exp_negative(-a * a) * (stretched * FRAC_1_SQRT_PI - cos * scaled_erfc(a));
    1.0 / (cos + tail)
}

const FRAC_1_SQRT_PI: f32 = 0.564_189_6;

/// `exp(x^2) erfc(x)` for `x >= 0`; the error times `exp(-x^2)` is below 1.5e-7 ([AS64 7.1.26]).
#[inline(always)]
fn scaled_erfc(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    t * (0.254_829_6 + t * (-0.284_496_74 + t * (1.421_413_7 + t * (-1.453_152 + t * 1.061_405_4))))
}

/// Inverse error function in (-1, 1), to about 1e-6 relative (\[GILES10\], single precision).
#[inline]
fn erf_inv(x: f32) -> f32 {
    const CENTRE: [f32; 9] = [
        2.810_226_4e-8,
        3.432_739_4e-7,
        -3.523_387_7e-6,
        -4.391_506_7e-6,
        2.185_808_7e-4,
        -1.253_725e-3,
        -4.177_681_6e-3,
        0.246_640_73,
        1.501_409_4,
    ];
    const TAIL: [f32; 9] = [
        -2.002_142_6e-4,
        1.009_505_6e-4,
        1.349_343_2e-3,
        -3.673_428_4e-3,
        5.739_507_7e-3,
        -7.622_461_3e-3,
        9.438_870_5e-3,
        1.001_674,
        2.832_976_8,
    ];
    let w = -((1.0 - x) * (1.0 + x)).ln();
    let (c, w) = if w < 5.0 { (&CENTRE, w - 2.5) } else { (&TAIL, w.sqrt() - 3.0) };
    x * c.iter().fold(0.0, |sum, c| sum * w + c)
}

/// A slope of the unit Gaussian `exp(-x^2)/sqrt(pi)`, for `u` in [0, 1).
#[inline]
pub(super) fn gaussian_slope(u: f32) -> f32 {
    erf_inv(2.0 * u.clamp(HALF_STEP, 1.0 - 2.0 * HALF_STEP) - 1.0)
}

/// Half the spacing of the numbers that a stream gives: no draw may land on an infinite slope.
const HALF_STEP: f32 = 0.5 / 16_777_216.0;

/// A slope `x` along the direction `(sin, cos)`, with density in proportion to `exp(-x^2) max(0, cos - x sin)`: what the direction
/// sees of a Gaussian surface.
///
/// The distribution function is `cos (1 + b)/2 + sin exp(-x^2)/(2 sqrt(pi))` with `b = erf(x)` (\[HEITZ14V\], \[JAKOB14\]). It is concave
/// in `b`, so that Newton's method, kept between bounds, needs few steps.
#[inline]
pub(super) fn visible_slope(cos: f32, sin: f32, u: f32) -> f32 {
    let u = u.max(HALF_STEP);
    // ## The whole: x up to the slope that is seen edge on
    let (b_max, whole) = if cos >= 4.0 * sin {
        (1.0, cos)
    } else {
        let a = cos / sin;
        let e = exp_negative(-a * a);
        let b = 1.0 - scaled_erfc(a) * e;
        (b, 0.5 * cos * (1.0 + b) + 0.5 * FRAC_1_SQRT_PI * sin * e)
    };
    let target = u * whole;
    // ## Newton from the chord's root, which lies above the true one
    let (mut low, mut high) = (-1.0, u * (1.0 + b_max) - 1.0);
    let mut b: f32 = f32::clamp(high, -1.0 + 2.0 * HALF_STEP, 1.0 - 2.0 * HALF_STEP);
    let mut x = erf_inv(b);
    for _ in 0..16 {
        let value = 0.5 * cos * (1.0 + b) + 0.5 * FRAC_1_SQRT_PI * sin * exp_negative(-x * x) - target;
        if value > 0.0 {
            high = b
        } else {
            low = b
        }
        let slope = 0.5 * (cos - x * sin);
        let newton = b - value / slope;
        let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
        let step = (next - b).abs();
        b = f32::clamp(next, -1.0 + 2.0 * HALF_STEP, 1.0 - 2.0 * HALF_STEP);
        x = erf_inv(b);
        // The error is the square of the step's, relative to the distance from the ends.
        if step < 1e-4 * (1.0 + b) {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    fn erf(x: f64) -> f64 {
        statrs::function::erf::erf(x)
    }

    #[test]
    fn inverse_error_function_inverts() {
        for i in -999..1000 {
            let y = i as f32 / 1000.0;
            assert!((erf(f64::from(erf_inv(y))) - f64::from(y)).abs() < 1e-6, "{y}");
        }
    }

    #[test]
    fn shadowing_fit_and_truth_agree_within_the_published_error() {
        let stretched = 0.3f32;
        for i in 1..400 {
            let a = i as f32 / 80.0;
            let cos = a * stretched;
            let (a, e) = (f64::from(a), (-f64::from(a * a)).exp());
            let truth = 1.0 / (0.5 * (1.0 + erf(a)) + e / (2.0 * a * f64::from(PI).sqrt()));
            let exact = f64::from(exact_g1_over_cos(cos, stretched) * cos);
            assert!((exact / truth - 1.0).abs() < 2e-6, "a {a}: {exact} {truth}");
            let fit = f64::from(fitted_g1_over_cos(cos, stretched) * cos);
            assert!((fit / truth - 1.0).abs() < 3.6e-3, "a {a}: {fit} {truth}");
        }
    }

    #[test]
    fn visible_slopes_invert_their_distribution_function() {
        for degrees in [0.0f64, 5.0, 14.0, 30.0, 60.0, 80.0, 89.0, 89.99, 90.0] {
            let (sin, cos) = (degrees.to_radians().sin(), degrees.to_radians().cos().max(0.0));
            let cdf = |x: f64| 0.5 * cos * (1.0 + erf(x)) + 0.5 * sin * (-x * x).exp() / f64::from(PI).sqrt();
            let whole = if sin > 0.0 { cdf(cos / sin) } else { 1.0 };
            for i in 0..=1000 {
                let u = f64::from((i as f32 / 1000.0).min(1.0 - 1.0 / 16_777_216.0));
                let x = f64::from(visible_slope(cos as f32, sin as f32, u as f32));
                assert!((cdf(x) / whole - u).abs() < 1e-5, "{degrees} degrees, u {u}: x {x} has {}", cdf(x) / whole);
            }
        }
    }
}
