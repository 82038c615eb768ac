//! Hypothesis tests, fits and intervals shared by tests, `compare` and studies, on `statrs`.
//!
//! The unit of observation is an independent run (a seed), not a sample: pixels of one photon map and states of one chain are correlated.
//! docs/statistics.md says which interval is used where, and how often each was measured to hold the truth.

mod bootstrap;
mod fit;
mod hypothesis;
mod multiple;
mod ratio;
mod sample;
mod slope;

pub use bootstrap::{Interval, RESAMPLES, bootstrap, bootstrap_median, bootstrap_percentile};
pub use fit::{Fit, least_squares};
pub use hypothesis::{chi_squared, student_quantile, student_two_sided, welch};
pub use multiple::{benjamini_hochberg, sidak};
pub use ratio::{Ratio, Verdict, at_most, median_interval, paired_ratio, speed_up};
pub use sample::{Sample, Split, efficiency, inefficiency, median, split, time_to_unit_variance};
pub use slope::{Slope, log_log_slope, log_log_slope_of};
