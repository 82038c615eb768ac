//! Hypothesis tests and summaries shared by tests, `compare` and `study`, on `statrs`.
