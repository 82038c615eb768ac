//! Counting how often intervals hold the truth, and what count is too far off.

use isophote::math::statistics::{Interval, Sample, student_two_sided};
use isophote::samplers::{Key, Purpose};
use rayon::prelude::*;
use statrs::distribution::{Binomial, DiscreteCDF};

/// Level of the intervals.
pub(crate) const LEVEL: f64 = 0.95;
/// Level of each test that a count or a mean is what it should be.
pub(crate) const TEST: f64 = 1e-4;
/// Repetitions of a study.
pub(crate) const REPETITIONS: u64 = 1000;

/// Key of a repetition's interval.
pub(crate) fn key(repetition: u64) -> Key {
    Key { seed: repetition, iteration: 0, index: 0, purpose: Purpose::Test }
}

/// Estimates and their intervals over repetitions of a study, beside the truth.
#[derive(Clone)]
pub(crate) struct Coverage {
    pub(crate) name: String,
    pub(crate) truth: f64,
    pub(crate) found: Vec<(f64, Interval)>,
}

impl Coverage {
    /// Repeats a study. At most one repetition in two hundred may end without an interval: where a resample draws one
    /// run alone, which happens to a variance over eight runs once in a thousand studies.
    pub(crate) fn of(name: String, truth: f64, repetitions: u64, study: impl Fn(u64) -> (f64, Option<Interval>) + Sync) -> Self {
        let found = (0..repetitions).into_par_iter().filter_map(|r| {
            let (estimate, interval) = study(r);
            Some((estimate, interval?))
        });
        let coverage = Self { name, truth, found: found.collect() };
        let without = repetitions - coverage.found.len() as u64;
        assert!(200 * without <= repetitions, "{}: {without} of {repetitions} have no interval", coverage.name);
        eprintln!("{}", coverage.line());
        coverage
    }

    fn missed(&self, miss: impl Fn(&Interval) -> bool) -> u64 {
        self.found.iter().filter(|(_, i)| miss(i)).count() as u64
    }

    pub(crate) fn held(&self) -> u64 {
        self.found.len() as u64 - self.missed(|i| !i.contains(self.truth))
    }

    pub(crate) fn share(&self) -> f64 {
        self.held() as f64 / self.found.len() as f64
    }

    /// p-value that intervals hold the truth as often as `LEVEL` says or more often; small where they are too narrow.
    pub(crate) fn too_narrow(&self) -> f64 {
        Binomial::new(LEVEL, self.found.len() as u64).unwrap().cdf(self.held())
    }

    /// p-value that intervals hold the truth at most as often as `LEVEL` says; small where they are too wide.
    pub(crate) fn too_wide(&self) -> f64 {
        let held = self.held();
        if held == 0 { 1.0 } else { Binomial::new(LEVEL, self.found.len() as u64).unwrap().sf(held - 1) }
    }

    /// p-value that the estimates' mean is the truth.
    pub(crate) fn mean_is_truth(&self) -> f64 {
        let sample = Sample::of(&self.found.iter().map(|(e, _)| *e).collect::<Vec<f64>>());
        student_two_sided((sample.mean - self.truth) / sample.variance.sqrt(), sample.freedom)
    }

    pub(crate) fn width(&self) -> f64 {
        self.found.iter().map(|(_, i)| i.width()).sum::<f64>() / self.found.len() as f64
    }

    fn line(&self) -> String {
        let n = self.found.len() as f64;
        let mean = self.found.iter().map(|(e, _)| e).sum::<f64>() / n;
        let (below, above) = (self.missed(|i| i.high < self.truth), self.missed(|i| i.low > self.truth));
        format!(
            "{:<52} truth {:>8.4} mean {mean:>8.4} width {:>7.4} held {:.3} of {n} (ends below the truth {below}, above {above})",
            self.name,
            self.truth,
            self.width(),
            self.share()
        )
    }

    /// Whether the intervals hold the truth at their nominal rate.
    pub(crate) fn nominal(&self) -> Result<(), String> {
        self.at_least()?;
        if self.too_wide() > TEST { Ok(()) } else { Err(format!("too wide: {}", self.line())) }
    }

    /// Whether the intervals hold the truth as often as they say, or more often.
    pub(crate) fn at_least(&self) -> Result<(), String> {
        if self.too_narrow() > TEST { Ok(()) } else { Err(format!("too narrow: {}", self.line())) }
    }

    /// Whether the estimates are right on average.
    pub(crate) fn unbiased(&self) -> Result<(), String> {
        if self.mean_is_truth() > TEST { Ok(()) } else { Err(format!("off: {}", self.line())) }
    }

    /// The same with every interval scaled about its middle: a planted fault.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let scale = |i: &Interval| Interval::around(0.5 * (i.low + i.high), 0.5 * factor * i.width()).unwrap();
        Self { found: self.found.iter().map(|(e, i)| (*e, scale(i))).collect(), ..self.clone() }
    }

    /// The same with everything moved: a planted fault.
    pub(crate) fn moved(&self, by: f64) -> Self {
        let shift = |i: &Interval| Interval::of(i.low + by, i.high + by).unwrap();
        Self { found: self.found.iter().map(|(e, i)| (e + by, shift(i))).collect(), ..self.clone() }
    }
}
