//! When a render stops.

use std::ops::Range;
use std::str::FromStr;

/// A half-open range of iterations, as typed: `N` is `0..N`, `A:B` is `A..B`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IterationRange {
    /// First iteration.
    pub start: u64,
    /// One past the last.
    pub end: u64,
}

impl FromStr for IterationRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |digits: &str| digits.parse::<u64>().map_err(|_| format!("{digits:?} is no whole number: write N, or A:B for A..B"));
        let (start, end) = match text.split_once(':') {
            Some((start, end)) => (number(start)?, number(end)?),
            None => (0, number(text)?),
        };
        if start >= end {
            return Err(format!("{text} holds no iteration: the end must be larger than {start}"));
        }
        Ok(Self { start, end })
    }
}

/// Iterations, seconds and light paths; whichever ends first.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget {
    /// Iterations to render; an end of `u64::MAX` is none.
    pub iterations: Range<u64>,
    /// Seconds of render time, positive.
    pub time: Option<f64>,
    /// Light subpaths, start-up counted; the iteration that reaches the number is the last.
    pub light_paths: Option<u64>,
}

impl Budget {
    /// From what was asked for. Time alone has no last iteration; nothing at all is `default` iterations.
    pub fn new(iterations: Option<IterationRange>, time: Option<f64>, default: u64) -> Self {
        let iterations = match (iterations, time) {
            (Some(range), _) => range.start..range.end,
            (None, Some(_)) => 0..u64::MAX,
            (None, None) => 0..default.max(1),
        };
        Self { iterations, time, light_paths: None }
    }

    /// Until so many light subpaths were traced.
    pub fn of_light_paths(count: u64) -> Self {
        Self { iterations: 0..u64::MAX, time: None, light_paths: Some(count) }
    }

    /// Number of iterations, if there is a last one.
    pub fn total(&self) -> Option<u64> {
        (self.iterations.end != u64::MAX).then(|| self.iterations.end - self.iterations.start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_as_typed() {
        assert_eq!("64".parse(), Ok(IterationRange { start: 0, end: 64 }));
        assert_eq!("16:64".parse(), Ok(IterationRange { start: 16, end: 64 }));
        for wrong in ["0", "5:5", "9:3", "", "a", "-3", "1:", "1:2:3", "1.5"] {
            assert!(wrong.parse::<IterationRange>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn time_alone_has_no_last_iteration() {
        assert_eq!(Budget::new(None, Some(3.0), 16).total(), None);
        assert_eq!(Budget::new(None, None, 16).iterations, 0..16);
        let both = Budget::new("4:9".parse().ok(), Some(3.0), 16);
        assert_eq!((both.iterations.clone(), both.total()), (4..9, Some(5)));
    }
}
