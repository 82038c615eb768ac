//! Values of options, read from text.

use std::str::FromStr;

/// `NAME=VALUE`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Define {
    /// Name, not empty.
    pub(crate) name: String,
    /// Value, perhaps empty.
    pub(crate) value: String,
}

impl FromStr for Define {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((name, value)) if !name.is_empty() => Ok(Self { name: name.to_string(), value: value.to_string() }),
            _ => Err("expected NAME=VALUE".to_string()),
        }
    }
}

/// A number of bytes: digits, perhaps with K, M, G or T for powers of 1024.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size(pub(crate) u64);

impl FromStr for Size {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let unit = |letter: char| "KMGT".find(letter.to_ascii_uppercase()).map(|i| 1_u64 << (10 * (i + 1)));
        let bare = text.trim_end_matches(['B', 'b']).trim_end_matches('i');
        let (digits, unit) = match bare.chars().last().and_then(unit) {
            Some(unit) => (&bare[..bare.len() - 1], unit),
            None => (bare, 1),
        };
        let size = digits.trim().parse::<f64>().ok().filter(|n| n.is_finite() && *n > 0.0).map(|n| n * unit as f64);
        size.filter(|n| *n < u64::MAX as f64)
            .map(|n| Self(n as u64))
            .ok_or_else(|| "expected a size such as 500M, 4G or 1.5GiB".to_string())
    }
}

/// Path edges: `-1` is unlimited.
pub(crate) fn max_depth(text: &str) -> Result<i64, String> {
    match text.parse::<i64>() {
        Ok(depth) if depth == -1 || (1..=i64::from(u32::MAX)).contains(&depth) => Ok(depth),
        _ => Err("expected a number of path edges from 1 (emitters seen directly), or -1 for unlimited".to_string()),
    }
}

/// A positive number of seconds.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    // Durations of the standard library end at 2^64 seconds; a century is enough.
    text.parse::<f64>().ok().filter(|s| *s > 0.0 && *s < 4e9).ok_or_else(|| "expected a positive number of seconds".to_string())
}

/// A positive number.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    text.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0).ok_or_else(|| "expected a positive number".to_string())
}

/// A finite number.
pub(crate) fn finite(text: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|v| v.is_finite()).ok_or_else(|| "expected a number".to_string())
}

/// A pattern that has to match the whole class of a path.
pub(crate) fn path_class(text: &str) -> Result<regex::Regex, String> {
    crate::transport::class::pattern(text).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_and_mistakes_refused() {
        assert_eq!("a=b=c".parse(), Ok(Define { name: "a".into(), value: "b=c".into() }));
        let sizes = [("4G", 4 << 30), ("500M", 500 << 20), ("1.5GiB", 3 << 29), ("12kb", 12 << 10), ("77", 77)];
        for (text, bytes) in sizes {
            assert_eq!(text.parse(), Ok(Size(bytes)), "{text}");
        }
        for text in ["", "G", "-1G", "1e40G", "nan", "é", "4é"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
        assert!("=1".parse::<Define>().is_err() && "a".parse::<Define>().is_err());
        for text in ["0", "-2", "1.5", "4294967296"] {
            assert!(max_depth(text).is_err(), "{text}");
        }
        for text in ["0", "-1", "inf", "nan", "1e300"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn patterns_match_whole_classes() {
        let class = path_class("LD|LS+DE").expect("a pattern");
        assert!(class.is_match("LSSDE") && class.is_match("LD"));
        assert!(!class.is_match("LDE") && !class.is_match("ELD"));
        assert!(path_class("L(").is_err());
    }
}
