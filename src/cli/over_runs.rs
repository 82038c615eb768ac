//! `compare --runs`: the images as runs of one method.

use super::compare::number;
use super::failure::Failure;
use super::output::table;
use crate::image::metrics::Measured;
use crate::image::picture::Picture;
use crate::image::runs::{Parts, Runs};
use serde_json::{Value, json};

/// What the runs say together.
pub(super) struct OverRuns {
    count: usize,
    masked: u64,
    noise: Measured,
    /// Averages of the parts of mse and of relmse.
    parts: Option<(Parts, Parts)>,
    reference_noise_known: bool,
}

impl OverRuns {
    /// Measures runs, two or more.
    pub(super) fn measure(runs: &Runs, reference: &Picture, reference_variance: Option<&Picture>, epsilon: f64) -> Result<Self, Failure> {
        let split = runs.split(reference, reference_variance).map_err(|e| Failure::new(format!("--runs: {e}")))?;
        Ok(Self {
            count: runs.count(),
            masked: split.masked(),
            noise: runs.noise(),
            parts: split.average().zip(split.relative(epsilon)),
            reference_noise_known: reference_variance.is_some(),
        })
    }

    /// The object `runs`; values that cannot be computed are null.
    pub(super) fn to_json(&self) -> Value {
        let parts = |parts: Option<Parts>| {
            parts.map(|p| {
                json!({"error": p.error, "mse": p.mse, "variance": p.variance, "bias2": p.bias2,
                       "reference_variance": self.reference_noise_known.then_some(p.reference_variance)})
            })
        };
        json!({
            "count": self.count,
            "nsd": self.noise.value,
            "nsd_left_out": self.noise.left_out,
            "absolute": parts(self.parts.map(|p| p.0)),
            "relative": parts(self.parts.map(|p| p.1)),
            "masked": self.masked,
        })
    }

    /// Lines for people.
    pub(super) fn to_text(&self) -> String {
        let line = |name: &str, parts: Option<Parts>| {
            let reference = parts.filter(|_| self.reference_noise_known).map(|p| p.reference_variance);
            let values = [parts.map(|p| p.mse), parts.map(|p| p.variance), parts.map(|p| p.bias2), reference];
            std::iter::once(name.to_owned()).chain(values.map(number)).collect::<Vec<_>>()
        };
        let header = ["over runs", "mean", "variance", "bias^2", "reference's variance"].map(str::to_owned).to_vec();
        let lines = [header, line("mse", self.parts.map(|p| p.0)), line("relmse", self.parts.map(|p| p.1))];
        let mut text = format!("\n{}", table(&lines));
        text += "bias^2 = (mean of runs - r)^2 - variance / runs - reference's variance; unbiased, so it may be negative\n";
        text += &format!("nsd {} over {} runs: mean of standard deviation / mean", number(self.noise.value), self.count);
        text += &match self.noise.left_out {
            0 => "\n".to_owned(),
            left_out => format!("; {left_out} values left out whose mean is not positive\n"),
        };
        if self.masked > 0 {
            text += &format!("{} pixels masked that are not finite in a run, in the reference or in its variance\n", self.masked);
        }
        text
    }
}
