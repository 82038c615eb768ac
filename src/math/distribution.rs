//! Discrete and piecewise-constant distributions.
