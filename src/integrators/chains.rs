//! What a Metropolis sampler tells of its chains, in the words of photon methods.

use crate::samplers::diagnostics::{AGREEING_R_HAT, KNOWN_NORMALISATION, USEFUL_EXCHANGE_RATES};
use crate::samplers::{LadderReport, Warning, warnings};
use crate::targets::aim::Rung;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// A ladder's report with the names of its rungs and the regions of its target.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainReport {
    /// Names of the rungs, in the ladder's order.
    pub names: Vec<Rung>,
    /// Numbers, with the traces of the last draw.
    pub ladder: LadderReport,
    /// Where the target keeps densities; `None` for a target without.
    pub regions: Option<RegionReport>,
}

/// Regions of a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionReport {
    /// Leaves of the tree.
    pub leaves: usize,
    /// Regions that densities were read from in the last iteration.
    pub in_use: usize,
}

impl ChainReport {
    /// As it stands in metadata and records: every rung with its name, without the traces.
    pub fn to_json(&self) -> Value {
        let mut ladder = self.ladder.clone();
        ladder.rungs.iter_mut().for_each(|rung| rung.traces.clear());
        let mut document = json!(ladder);
        let rungs = ladder.rungs.iter().zip(&self.names).map(|(rung, name)| {
            let mut row = Map::from_iter([("name".to_owned(), json!(name))]);
            if let Value::Object(numbers) = json!(rung) {
                row.extend(numbers);
            }
            Value::Object(row)
        });
        document["rungs"] = rungs.collect();
        document["regions"] = json!(self.regions);
        document
    }

    /// Back from [`Self::to_json`]; `None` if that is not what it is.
    pub fn from_json(document: &Value) -> Option<Self> {
        let name = |rung: &Value| serde_json::from_value(rung.get("name")?.clone()).ok();
        let names = document.get("rungs")?.as_array()?.iter().map(name).collect::<Option<Vec<Rung>>>()?;
        let ladder = serde_json::from_value(document.clone()).ok()?;
        let regions = serde_json::from_value(document.get("regions")?.clone()).ok()?;
        Some(Self { names, ladder, regions })
    }

    /// The name of a rung as it is typed.
    pub fn name(&self, rung: usize) -> String {
        let name = self.names.get(rung).map(|name| json!(name));
        name.as_ref().and_then(Value::as_str).map_or_else(|| format!("rung {rung}"), str::to_owned)
    }

    /// What there is to warn of, the severe first.
    pub fn warnings(&self) -> Vec<Warning> {
        warnings(&self.ladder)
    }

    /// A warning in words: what was found, what it means, what to do.
    pub fn words(&self, warning: &Warning) -> String {
        let name = |rung: usize| self.name(rung);
        match *warning {
            Warning::NothingVisible { bound, met_before: false } => format!(
                "no light path reached a measurement point: b is 0, at most {bound:.2e} with 95 % confidence, and light that photons bring is \
                 missing from the image. If the scene should be lit, look for lamps that are closed in or outside; if the lit region is \
                 small, trace more --photons or enlarge --radius-pixels"
            ),
            Warning::NothingVisible { bound, met_before: true } => format!(
                "no independent light path of the last iteration reached a measurement point, though the chains stand on some: b is 0, at most \
                 {bound:.2e} with 95 % confidence, and the iteration adds no light of photons. Trace more --photons an iteration"
            ),
            Warning::Disagreement { rung, r_hat } => format!(
                "the {} chain's ensembles disagree (R-hat {r_hat:.3}, above {AGREEING_R_HAT}): within an iteration they do not see the same \
                 light, so noise is correlated and standard errors are too small. Trace more --photons an iteration, or give --burn-in",
                name(rung)
            ),
            Warning::ExchangeRate { rung, rate } if rate < *USEFUL_EXCHANGE_RATES.start() => format!(
                "{} and {} exchange {:.1} % of the times they try (below {:.0} %): their targets are far apart, and what one finds hardly \
                 reaches the other. Put a rung between them with --rungs, or leave the upper one out",
                name(rung),
                name(rung + 1),
                100.0 * rate,
                100.0 * USEFUL_EXCHANGE_RATES.start()
            ),
            Warning::ExchangeRate { rung, rate } => format!(
                "{} and {} exchange {:.1} % of the times they try (above {:.0} %): their targets are nearly the same, and one of the two costs \
                 steps without helping. Leave one out with --rungs",
                name(rung),
                name(rung + 1),
                100.0 * rate,
                100.0 * USEFUL_EXCHANGE_RATES.end()
            ),
            Warning::Normalisation { rung, relative_error } => format!(
                "b of {} is known to {:.1} % only (above {:.0} %), and of the rungs above it no better: the brightness of what they add \
                 wavers as much. Trace more --photons an iteration or more iterations",
                name(rung),
                100.0 * relative_error,
                100.0 * KNOWN_NORMALISATION
            ),
            Warning::NoRoundTrip => format!(
                "no state went from uniform to {} and back: the chains have found no way between islands of their target yet, and may miss \
                 some. Render more iterations or more --photons, and look at the rates of exchange",
                name(self.names.len().saturating_sub(1))
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::{Draw, Drawn, Ladder, LadderSettings, LightPathSpace, PhotonSampler, Stream};

    /// One number; the upper half is visible, the last tenth worth more.
    struct Line;

    impl LightPathSpace for Line {
        type Path = f32;
        fn trace<S: Stream>(&self, stream: &mut S, path: &mut f32) {
            *path = stream.next_1d();
        }
        fn targets(&self, path: &f32, values: &mut [f64]) {
            let visible = f64::from(u8::from(*path > 0.5));
            values.copy_from_slice(&[1.0, visible, visible * if *path > 0.9 { 5.0 } else { 1.0 }]);
        }
    }

    fn report() -> ChainReport {
        let settings = LadderSettings { rungs: 3, ensembles: 4, first_burn_in: 10, start_up: 1000, ..LadderSettings::default() };
        let mut ladder = Ladder::new(settings);
        let _: Draw<()> = ladder.draw(&Line, 0, 4000, || (), |(), _, _: &[Drawn]| ());
        let regions = Some(RegionReport { leaves: 8, in_use: 5 });
        ChainReport { names: vec![Rung::Uniform, Rung::Visibility, Rung::Target], ladder: ladder.report(), regions }
    }

    #[test]
    fn it_comes_back_from_json_but_for_the_traces() {
        let mut report = report();
        assert!(report.ladder.rungs[2].traces.iter().any(|trace| trace.len() > 10));
        let document: Value = serde_json::from_str(&report.to_json().to_string()).expect("JSON");
        assert_eq!(document["rungs"][2]["name"], "target");
        assert!(!document.to_string().contains("\"traces\""));
        report.ladder.rungs.iter_mut().for_each(|rung| rung.traces.clear());
        assert_eq!(ChainReport::from_json(&document), Some(report));
        assert_eq!(ChainReport::from_json(&json!({"rungs": 3})), None);
    }

    #[test]
    fn every_warning_says_what_to_do_and_names_its_rungs() {
        let report = report();
        let named = [
            (Warning::NothingVisible { bound: 3e-4, met_before: false }, "3.00e-4"),
            (Warning::NothingVisible { bound: 3e-4, met_before: true }, "3.00e-4"),
            (Warning::Disagreement { rung: 2, r_hat: 1.2 }, "target chain"),
            (Warning::ExchangeRate { rung: 1, rate: 0.05 }, "visibility and target exchange 5.0 %"),
            (Warning::ExchangeRate { rung: 1, rate: 0.95 }, "visibility and target exchange 95.0 %"),
            (Warning::Normalisation { rung: 1, relative_error: 0.08 }, "visibility is known to 8.0 %"),
            (Warning::NoRoundTrip, "from uniform to target"),
        ];
        for (warning, expected) in named {
            let words = report.words(&warning);
            assert!(words.contains(expected) && words.contains("--"), "{words}");
        }
    }
}
