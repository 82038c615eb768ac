//! What in a report should worry its reader.
//!
//! Only the rule: what the numbers mean for an image and which option helps is for those who know images and options.

use super::LadderReport;
use std::ops::RangeInclusive;

/// R-hat up to which ensembles pass for agreeing. \[VEHTARI21\] ask for 1.01 of long runs; one draw is a short one.
pub const AGREEING_R_HAT: f64 = 1.05;

/// Rates of exchange between two chains that are neither a wall nor a waste.
pub const USEFUL_EXCHANGE_RATES: RangeInclusive<f64> = 0.1..=0.7;

/// Relative standard error of a normalisation up to which it passes for known.
pub const KNOWN_NORMALISATION: f64 = 0.05;

/// One thing that a report shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warning {
    /// No independent path of the last draw was worth anything on rung 1: every `b` above rung 0 is 0, and so is what the draw adds up to.
    NothingVisible {
        /// What `b` stays below with 95 % confidence.
        bound: f64,
        /// Chains had states all the same, from earlier draws or from the start-up.
        met_before: bool,
    },
    /// Ensembles of a chain do not agree.
    Disagreement {
        /// The chain's rung.
        rung: usize,
        /// Above [`AGREEING_R_HAT`].
        r_hat: f64,
    },
    /// Two chains exchange too seldom or too often.
    ExchangeRate {
        /// The lower one's rung.
        rung: usize,
        /// Outside [`USEFUL_EXCHANGE_RATES`].
        rate: f64,
    },
    /// A normalisation is not known well.
    Normalisation {
        /// The lowest such rung; errors add up along the ladder, so the rungs above have no smaller one.
        rung: usize,
        /// Above [`KNOWN_NORMALISATION`].
        relative_error: f64,
    },
    /// No state went from rung 0 to the last rung and back.
    NoRoundTrip,
}

impl Warning {
    /// The word for it in files.
    pub fn kind(&self) -> &'static str {
        match self {
            Warning::NothingVisible { .. } => "nothing_visible",
            Warning::Disagreement { .. } => "r_hat",
            Warning::ExchangeRate { .. } => "exchange_rate",
            Warning::Normalisation { .. } => "normalisation",
            Warning::NoRoundTrip => "no_round_trip",
        }
    }

    /// The rung it is about, if it is about one.
    pub fn rung(&self) -> Option<usize> {
        match self {
            Warning::Disagreement { rung, .. } | Warning::ExchangeRate { rung, .. } | Warning::Normalisation { rung, .. } => Some(*rung),
            Warning::NothingVisible { .. } | Warning::NoRoundTrip => None,
        }
    }

    /// The number that gave rise to it, if one did.
    pub fn value(&self) -> Option<f64> {
        match self {
            Warning::NothingVisible { bound, .. } => Some(*bound),
            Warning::Disagreement { r_hat, .. } => Some(*r_hat),
            Warning::ExchangeRate { rate, .. } => Some(*rate),
            Warning::Normalisation { relative_error, .. } => Some(*relative_error),
            Warning::NoRoundTrip => None,
        }
    }

    /// Whether an estimate is likely to be wrong, and not only noisier than it could be.
    pub fn severe(&self) -> bool {
        matches!(self, Warning::NothingVisible { .. })
    }
}

/// What there is to warn of, the severe first. Nothing before the first draw, and nothing for a ladder without a chain.
pub fn warnings(report: &LadderReport) -> Vec<Warning> {
    let rungs = &report.rungs;
    let Some(first) = rungs.get(1).filter(|_| report.draws > 0) else { return Vec::new() };
    let mut found = Vec::new();
    if first.normalisation <= 0.0 {
        let met_before = rungs[1..].iter().any(|rung| rung.steps > 0);
        found.push(Warning::NothingVisible { bound: first.normalisation_error, met_before });
    }
    let chains = || rungs.iter().enumerate().skip(1);
    let r_hats = chains().filter_map(|(rung, report)| report.r_hat.map(|r_hat| Warning::Disagreement { rung, r_hat }));
    found.extend(r_hats.filter(|warning| warning.value().is_some_and(|r_hat| r_hat > AGREEING_R_HAT)));
    // Rung 0 is no chain: its rate is the fraction of paths that rung 1 sees, for which no chain is to blame.
    let rates = chains().filter_map(|(rung, report)| report.exchange_rate.map(|rate| Warning::ExchangeRate { rung, rate }));
    found.extend(rates.filter(|warning| warning.value().is_some_and(|rate| !USEFUL_EXCHANGE_RATES.contains(&rate))));
    let errors = chains()
        .filter_map(|(rung, report)| report.normalisation_relative_error.map(|e| Warning::Normalisation { rung, relative_error: e }));
    found.extend(errors.filter(|warning| warning.value().is_some_and(|error| error > KNOWN_NORMALISATION)).take(1));
    if report.round_trips == 0 && rungs.last().is_some_and(|last| last.steps > 0) {
        found.push(Warning::NoRoundTrip);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostics::RungReport;

    fn rung(b: f64) -> RungReport {
        RungReport {
            share: 0.25,
            next_share: 0.25,
            steps: 1000,
            uncounted: 0,
            redraw_acceptance: None,
            acceptance: Some(0.234),
            step_size: Some(0.1),
            dispersion: 2.0,
            normalisation: b,
            normalisation_error: 0.01 * b,
            normalisation_relative_error: Some(0.01),
            exchange_attempts: 500,
            exchange_rate: Some(0.4),
            dead_states: 0,
            target_time: Some(4.0),
            target_effective: Some(250.0),
            ratio_time: Some(4.0),
            ratio_effective: Some(250.0),
            r_hat: Some(1.01),
            traces: Vec::new(),
            trace_stride: 1,
        }
    }

    /// A ladder of four rungs with nothing to complain of.
    fn healthy() -> LadderReport {
        let mut rungs: Vec<RungReport> = [1.0, 0.1, 0.08, 0.05].map(rung).to_vec();
        rungs[0].r_hat = None;
        // Few paths are visible, which is the scene's doing.
        rungs[0].exchange_rate = Some(0.01);
        rungs[3].exchange_rate = None;
        LadderReport { draws: 3, rested: 0, traced: 5000, ensembles: 16, round_trips: 7, rungs }
    }

    fn after(change: impl FnOnce(&mut LadderReport)) -> Vec<Warning> {
        let mut report = healthy();
        change(&mut report);
        warnings(&report)
    }

    #[test]
    fn a_healthy_ladder_gives_no_warning() {
        assert_eq!(after(|_| ()), []);
    }

    #[test]
    fn ensembles_that_disagree_are_told_rung_by_rung() {
        let found = after(|report| {
            report.rungs[1].r_hat = Some(1.05);
            report.rungs[2].r_hat = Some(1.051);
            report.rungs[3].r_hat = Some(2.0);
        });
        assert_eq!(found, [Warning::Disagreement { rung: 2, r_hat: 1.051 }, Warning::Disagreement { rung: 3, r_hat: 2.0 }]);
    }

    #[test]
    fn rates_of_exchange_between_chains_are_judged_from_both_sides() {
        let found = after(|report| {
            report.rungs[0].exchange_rate = Some(0.9);
            report.rungs[1].exchange_rate = Some(0.09);
            report.rungs[2].exchange_rate = Some(0.71);
        });
        assert_eq!(found, [Warning::ExchangeRate { rung: 1, rate: 0.09 }, Warning::ExchangeRate { rung: 2, rate: 0.71 }]);
        assert_eq!(after(|report| report.rungs[1].exchange_rate = Some(0.1)), []);
        assert_eq!(after(|report| report.rungs[1].exchange_rate = Some(0.7)), []);
    }

    #[test]
    fn the_first_normalisation_that_is_not_known_is_told() {
        let found = after(|report| {
            report.rungs[2].normalisation_relative_error = Some(0.06);
            report.rungs[3].normalisation_relative_error = Some(0.2);
        });
        assert_eq!(found, [Warning::Normalisation { rung: 2, relative_error: 0.06 }]);
    }

    #[test]
    fn without_a_round_trip_there_is_a_warning_that_is_not_severe() {
        let found = after(|report| report.round_trips = 0);
        assert_eq!(found, [Warning::NoRoundTrip]);
        assert!(!found[0].severe());
    }

    #[test]
    fn nothing_visible_is_severe_and_speaks_for_all_that_follows_from_it() {
        let blind = |report: &mut LadderReport| {
            report.round_trips = 0;
            for rung in &mut report.rungs[1..] {
                *rung = RungReport {
                    steps: 0,
                    normalisation: 0.0,
                    normalisation_error: 3e-4,
                    normalisation_relative_error: None,
                    exchange_attempts: 0,
                    exchange_rate: None,
                    r_hat: None,
                    ..rung.clone()
                };
            }
        };
        let found = after(blind);
        assert_eq!(found, [Warning::NothingVisible { bound: 3e-4, met_before: false }]);
        assert!(found[0].severe());
        let met = after(|report| {
            blind(report);
            (report.rungs[1].steps, report.round_trips) = (5, 1);
        });
        assert_eq!(met, [Warning::NothingVisible { bound: 3e-4, met_before: true }]);
    }

    #[test]
    fn before_the_first_draw_and_without_a_chain_there_is_nothing_to_say() {
        let blind = |report: &mut LadderReport| report.rungs[1].normalisation = 0.0;
        assert_eq!(after(blind).len(), 1);
        assert_eq!(after(|report| (blind(report), report.draws = 0).1), []);
        assert_eq!(after(|report| (blind(report), report.rungs.truncate(1)).1), []);
    }
}
