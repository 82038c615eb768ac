//! Telling how far a render is: a bar on a terminal, lines now and then elsewhere.

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::{Duration, Instant};

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Iterations done.
    pub done: u64,
    /// Iterations asked for, if there is a last one.
    pub total: Option<u64>,
    /// Render time so far, seconds.
    pub seconds: f64,
    /// Render time allowed, seconds.
    pub limit: Option<f64>,
    /// Share of the light paths asked for, if a number of them ends the render.
    pub light_paths: Option<f64>,
}

impl Step {
    /// Share of the work done, by iterations, time or light paths, whichever is furthest.
    pub fn share(&self) -> f64 {
        let by_count = self.total.map_or(0.0, |total| self.done as f64 / total as f64);
        let by_time = self.limit.map_or(0.0, |limit| self.seconds / limit);
        by_count.max(by_time).max(self.light_paths.unwrap_or(0.0)).min(1.0)
    }

    /// Seconds left, from the mean time of an iteration; `None` before the first.
    pub fn remaining(&self) -> Option<f64> {
        if self.done == 0 {
            return None;
        }
        let by_count = self.total.map(|total| total.saturating_sub(self.done) as f64 * self.seconds / self.done as f64);
        let by_time = self.limit.map(|limit| (limit - self.seconds).max(0.0));
        let by_paths = self.light_paths.filter(|share| *share > 0.0).map(|share| (self.seconds / share - self.seconds).max(0.0));
        [by_count, by_time, by_paths].into_iter().flatten().reduce(f64::min)
    }

    /// `12/64 iterations, 3.4 it/s, 15 seconds left`.
    fn describe(&self) -> String {
        let total = self.total.map_or_else(String::new, |total| format!("/{total}"));
        let rate = if self.seconds > 0.0 { self.done as f64 / self.seconds } else { 0.0 };
        let rate = if rate >= 1.0 || rate == 0.0 { format!("{rate:.1} it/s") } else { format!("{:.1} s/it", 1.0 / rate) };
        let left = self.remaining().map_or_else(String::new, |s| format!(", {} left", HumanDuration(Duration::from_secs_f64(s))));
        format!("{}{total} iterations, {rate}{left}", self.done)
    }
}

/// Somewhere to tell progress.
pub trait Progress: Send {
    /// The render prepares, iterates, or has just finished an iteration.
    fn step(&mut self, step: Step);
    /// Nothing more comes.
    fn finish(&mut self);
}

/// Tells nothing.
pub struct Silent;

impl Progress for Silent {
    fn step(&mut self, _: Step) {}
    fn finish(&mut self) {}
}

/// A bar on the terminal behind standard error.
pub struct Bar(ProgressBar);

impl Bar {
    /// Draws an empty bar.
    pub fn new() -> Self {
        const RESOLUTION: u64 = 1000;
        let bar = ProgressBar::with_draw_target(Some(RESOLUTION), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3}%  {msg}") {
            bar.set_style(style);
        }
        Self(bar)
    }
}

impl Default for Bar {
    fn default() -> Self {
        Self::new()
    }
}

impl Progress for Bar {
    fn step(&mut self, step: Step) {
        self.0.set_position((step.share() * self.0.length().unwrap_or(0) as f64) as u64);
        self.0.set_message(step.describe());
    }
    fn finish(&mut self) {
        self.0.finish_and_clear();
    }
}

/// A line at the first and the last iteration and every few seconds between, for logs.
pub struct Lines<W> {
    out: W,
    interval: Duration,
    last: Option<(Instant, u64)>,
    latest: Option<Step>,
}

impl<W: std::io::Write + Send> Lines<W> {
    /// Lines at least `interval` apart.
    pub fn new(out: W, interval: Duration) -> Self {
        Self { out, interval, last: None, latest: None }
    }

    fn print(&mut self, step: Step) {
        self.last = Some((Instant::now(), step.done));
        // A log that cannot be written is no reason to lose a render.
        let _ = writeln!(self.out, "{}", step.describe());
    }
}

impl<W: std::io::Write + Send> Progress for Lines<W> {
    fn step(&mut self, step: Step) {
        self.latest = Some(step);
        let due = self.last.is_none_or(|(time, _)| time.elapsed() >= self.interval);
        if step.done > 0 && due {
            self.print(step);
        }
    }
    fn finish(&mut self) {
        if let Some(step) = self.latest.filter(|s| s.done > 0 && self.last.is_none_or(|(_, done)| done != s.done)) {
            self.print(step);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearer_end_counts() {
        let step = Step { done: 10, total: Some(100), seconds: 5.0, limit: Some(20.0), light_paths: None };
        assert_eq!((step.share(), step.remaining()), (0.25, Some(15.0)));
        let step = Step { done: 50, ..step };
        assert_eq!((step.share(), step.remaining()), (0.5, Some(5.0)));
        assert_eq!(step.describe(), "50/100 iterations, 10.0 it/s, 5 seconds left");
        let endless = Step { done: 2, total: None, seconds: 5.0, limit: None, light_paths: None };
        assert_eq!((endless.share(), endless.remaining()), (0.0, None));
        assert_eq!(endless.describe(), "2 iterations, 2.5 s/it");
    }

    #[test]
    fn lines_come_first_last_and_never_twice() {
        let mut out = Vec::new();
        let mut lines = Lines::new(&mut out, Duration::from_secs(3600));
        for done in 0..=9 {
            lines.step(Step { done, total: Some(9), seconds: done as f64, limit: None, light_paths: None });
        }
        lines.finish();
        lines.finish();
        let text = String::from_utf8(out).expect("text");
        let starts: Vec<&str> = text.lines().map(|l| l.split(' ').next().unwrap_or("")).collect();
        assert_eq!(starts, ["1/9", "9/9"], "{text}");
    }
}
