//! Numbers for people: no more digits than are known, and the interval beside the estimate.

use crate::math::statistics::Interval;

/// Digits of a number that comes without an interval.
const DIGITS: i32 = 3;

/// Three significant digits.
pub(super) fn plain(value: f64) -> String {
    if !value.is_finite() {
        return "not finite".to_string();
    }
    if value == 0.0 {
        return "0".to_string();
    }
    let exponent = magnitude(value);
    scaled(value, shared_exponent(exponent), exponent - DIGITS + 1)
}

/// A value, or a dash.
pub(super) fn or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_string(), plain)
}

/// `1.23 [1.18, 1.31]`: as many decimals as give half the interval two significant digits, the same for all three.
pub(super) fn with_interval(value: f64, interval: Option<Interval>) -> String {
    let Some(Interval { low, high }) = interval.filter(|i| i.low.is_finite() && i.high.is_finite()) else { return plain(value) };
    let half = 0.5 * (high - low);
    let largest = [value, low, high].map(f64::abs).into_iter().fold(0.0, f64::max);
    if !value.is_finite() || largest == 0.0 {
        return plain(value);
    }
    let last = if half > 0.0 { (magnitude(half) - 1).min(magnitude(largest)) } else { magnitude(largest) - DIGITS + 1 };
    let exponent = shared_exponent(magnitude(largest));
    let [value, low, high] = [value, low, high].map(|v| mantissa(v, exponent, last));
    format!("{value} [{low}, {high}]{}", power(exponent))
}

/// A whole number with thin spaces between thousands.
pub(super) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// Seconds, minutes or hours, three digits.
pub(super) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 600.0 => format!("{} s", plain(s)),
        s if s < 36_000.0 => format!("{} min", plain(s / 60.0)),
        s => format!("{} h", plain(s / 3600.0)),
    }
}

/// A power of ten as an axis shows it: plain near one, `10⁻⁵` elsewhere.
pub(super) fn tick(value: f64) -> String {
    let exponent = magnitude(value * 1.000_001);
    if (-3..=4).contains(&exponent) {
        let decimals = usize::try_from(-exponent).unwrap_or(0);
        return format!("{value:.decimals$}");
    }
    let factor = (value / 10_f64.powi(exponent)).round() as i64;
    let ten = format!("10{}", superscript(exponent));
    if factor == 1 { ten } else { format!("{factor}·{ten}") }
}

/// Exponent of the leading digit.
fn magnitude(value: f64) -> i32 {
    value.abs().log10().floor() as i32
}

/// Powers of ten are split off where they would only be zeros.
fn shared_exponent(magnitude: i32) -> i32 {
    if (-3..6).contains(&magnitude) { 0 } else { magnitude }
}

fn scaled(value: f64, exponent: i32, last: i32) -> String {
    format!("{}{}", mantissa(value, exponent, last), power(exponent))
}

/// `value / 10^exponent`, rounded at the decimal place `last` of `value`.
fn mantissa(value: f64, exponent: i32, last: i32) -> String {
    let place = last - exponent;
    let decimals = usize::try_from(-place).unwrap_or(0);
    let unit = 10_f64.powi(place.max(0));
    let rounded = (value / 10_f64.powi(exponent) / unit).round_to(decimals) * unit;
    let text = format!("{rounded:.decimals$}");
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    if is_zero { text.trim_start_matches('-').to_string() } else { text.replace('-', "−") }
}

/// Rounding that leaves the decimals to the formatter unless whole tens are meant.
trait RoundTo {
    fn round_to(self, decimals: usize) -> f64;
}

impl RoundTo for f64 {
    fn round_to(self, decimals: usize) -> f64 {
        if decimals == 0 { self.round() } else { self }
    }
}

fn power(exponent: i32) -> String {
    if exponent == 0 { String::new() } else { format!(" × 10{}", superscript(exponent)) }
}

fn superscript(exponent: i32) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
    };
    exponent.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_follow_the_interval() {
        let interval = |low, high| Some(Interval { low, high });
        assert_eq!(with_interval(1.234_567, interval(1.2, 1.3)), "1.235 [1.200, 1.300]");
        assert_eq!(with_interval(-0.497, interval(-0.61, -0.4)), "−0.50 [−0.61, −0.40]");
        assert_eq!(with_interval(2.347e-5, interval(2.1e-5, 2.6e-5)), "2.35 [2.10, 2.60] × 10⁻⁵");
        assert_eq!(with_interval(1234.0, interval(900.0, 1500.0)), "1230 [900, 1500]");
        assert_eq!(with_interval(0.5, None), "0.500");
        assert_eq!(with_interval(0.0, interval(-0.001, 0.5)), "0.00 [0.00, 0.50]");
    }

    #[test]
    fn plain_numbers_have_three_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1.00"),
            (0.012_345, "0.0123"),
            (123_456.0, "123000"),
            (1.234e-7, "1.23 × 10⁻⁷"),
            (-2.5, "−2.50"),
            (f64::NAN, "not finite"),
        ] {
            assert_eq!(plain(value), text);
        }
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(
            (tick(0.001), tick(1e-4), tick(2e-5), tick(100.0), tick(0.5)),
            ("0.001".into(), "10⁻⁴".into(), "2·10⁻⁵".into(), "100".into(), "0.5".into())
        );
    }
}
