//! Elementary functions where they are needed most: inlined, without calls, tables or branches.

use std::f32::consts::TAU;
use std::ops::{Add, Mul};

/// Sine and cosine of `u` turns, `u` in [0, 1), each within 1.2e-7 of the truth: nearer than that of the rounded angle `2 pi u`.
#[inline(always)]
pub fn sin_cos_turns(u: f32) -> (f32, f32) {
    // The nearest quarter turn; what is left of it, an eighth at most, is exact.
    let quarter = (4.0 * u + 0.5).floor();
    let (sin, cos) = sin_cos_eighth(TAU * (u - 0.25 * quarter));
    let quarter = quarter as i32 as u32;
    let (sin, cos) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    // Sines are negative from the second quarter on, cosines between the first and the third.
    let turned = |v: f32, quarter: u32| f32::from_bits(v.to_bits() ^ (quarter & 2) << 30);
    (turned(sin, quarter), turned(cos, quarter + 1))
}

/// Sine and cosine of an angle in [-pi/4, pi/4], to about one unit in the last place: their series ([AS64 4.3.65, 4.3.66]), cut where the
/// next term is below half a unit.
#[inline(always)]
pub(super) fn sin_cos_eighth<T: Copy + From<f32> + Add<Output = T> + Mul<Output = T>>(x: T) -> (T, T) {
    let c = T::from;
    let x2 = x * x;
    let sin = x + x * x2 * (c(-1.0 / 6.0) + x2 * (c(1.0 / 120.0) + x2 * (c(-1.0 / 5_040.0) + x2 * c(1.0 / 362_880.0))));
    let cos = c(1.0) + x2 * (c(-0.5) + x2 * (c(1.0 / 24.0) + x2 * (c(-1.0 / 720.0) + x2 * c(1.0 / 40_320.0))));
    (sin, cos)
}

/// `exp(x)` for `x <= 0`, to one unit in the last place; 0 below the smallest number there is.
///
/// In double precision `2^n` times the series of `exp` within half a power of two ([AS64 4.2.1]), whose rest is below 6e-9.
#[inline(always)]
pub fn exp_negative(x: f32) -> f32 {
    // Beyond, the result is 0, and the exponent below would leave the range of doubles.
    let powers = f64::from(x.max(-200.0)) * std::f64::consts::LOG2_E;
    let whole = powers.round_ties_even();
    let r = (powers - whole) * std::f64::consts::LN_2;
    let r2 = r * r;
    // Pairs of terms side by side: shorter than one after the other.
    let low = 1.0 + r + r2 * (1.0 / 2.0 + r * (1.0 / 6.0));
    let high = 1.0 / 24.0 + r * (1.0 / 120.0) + r2 * (1.0 / 720.0 + r * (1.0 / 5_040.0));
    let scale = f64::from_bits(((whole as i64 + 1023) as u64) << 52);
    ((low + r2 * r2 * high) * scale) as f32
}

/// The angle from the x axis to `(x, y)` in turns, in [-1/2, 1/2], within 1e-11; 0 at the origin.
#[inline(always)]
pub fn turns(y: f64, x: f64) -> f64 {
    let (a, b) = (x.abs(), y.abs());
    let steep = b > a;
    let (small, large) = if steep { (a, b) } else { (b, a) };
    // The angle of at most an eighth of a turn, or what it lacks of one: the tangent is below tan(pi/8).
    let wide = small > 0.414_213_562_373_095 * large;
    let (sine, cosine, start) = if wide { (small - large, small + large, 0.125) } else { (small, large, 0.0) };
    let t = if large > 0.0 { sine / cosine } else { 0.0 };
    // Its series ([AS64 4.4.42]), cut where the next term is below 1e-10.
    let t2 = t * t;
    let series = (0..11).rev().fold(0.0, |sum, n| sum * -t2 + 1.0 / f64::from(2 * n + 1));
    let angle = start + t * series * (1.0 / std::f64::consts::TAU);
    let angle = if steep { 0.25 - angle } else { angle };
    (if x < 0.0 { 0.5 - angle } else { angle }).copysign(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_cosines_are_near_the_truth() {
        let steps = 1 << 22;
        for i in 0..steps {
            let u = (i as f32 / steps as f32 + 1e-9).min(1.0 - 1.0 / 16_777_216.0);
            let (sin, cos) = (std::f64::consts::TAU * f64::from(u)).sin_cos();
            let (s, c) = sin_cos_turns(u);
            assert!((f64::from(s) - sin).abs() < 1.2e-7 && (f64::from(c) - cos).abs() < 1.2e-7, "{u}: {s} {c}");
        }
        for (i, exact) in [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)].into_iter().enumerate() {
            assert_eq!(sin_cos_turns(i as f32 / 4.0), exact);
        }
    }

    #[test]
    fn exponentials_are_right_to_one_unit() {
        assert_eq!(exp_negative(0.0), 1.0);
        assert_eq!(exp_negative(f32::NEG_INFINITY), 0.0);
        assert_eq!(exp_negative(-104.0), 0.0);
        for i in 1..2_000_000 {
            let x = -(i as f32) * 5.1e-5;
            let (found, truth) = (f64::from(exp_negative(x)), f64::from(x).exp());
            // Below the smallest normal number the unit is fixed.
            let unit = f64::from(f32::EPSILON) * truth.max(f64::from(f32::MIN_POSITIVE));
            assert!((found - truth).abs() < 0.6 * unit, "{x}: {found} {truth}");
        }
    }

    #[test]
    fn angles_are_near_the_truth() {
        for i in 0..1_000_000 {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 1e6).sin_cos();
            for scale in [1e-30, 1.0, 7e20] {
                let (found, truth) = (turns(scale * sin, scale * cos), sin.atan2(cos) / std::f64::consts::TAU);
                assert!((found - truth).abs() < 1e-11, "{i}: {found} {truth}");
            }
        }
        assert_eq!([turns(0.0, 0.0), turns(0.0, 2.0), turns(3.0, 0.0), turns(-3.0, 0.0), turns(0.0, -1.0)], [0.0, 0.0, 0.25, -0.25, 0.5]);
    }
}
