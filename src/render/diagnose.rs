//! Iterations for the sake of what a method tells of its chains; the image is not kept.

use super::budget::Budget;
use super::clock::{Interrupt, RenderClock};
use super::progress::{Progress, Step};
use super::run::RenderError;
use crate::image::film::Film;
use crate::integrators::chains::ChainReport;
use crate::integrators::{Integrator, IterationStats};

/// What came of it.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// Iterations done.
    pub iterations: u64,
    /// Render time, wall seconds.
    pub seconds: f64,
    /// What the iterations did.
    pub stats: IterationStats,
    /// The chains after the last iteration; `None` if the method's sampler has none.
    pub chains: Option<ChainReport>,
    /// The signal that ended it early.
    pub interrupted: Option<i32>,
}

/// Prepares and iterates; `size` is the film's width and height in pixels, of which one film is held. `name` is the method's, for errors. A
/// budget of light paths is not looked at.
///
/// # Errors
/// If the method refuses, or if the budget starts late and the method is not stateless.
pub fn diagnose(
    (name, method): (&str, &mut dyn Integrator),
    size: (usize, usize),
    budget: &Budget,
    progress: &mut dyn Progress,
    interrupt: &Interrupt,
) -> Result<Diagnosis, RenderError> {
    let start = budget.iterations.start;
    if start > 0 && !method.stateless() {
        return Err(RenderError::Stateful { method: name.to_owned(), start });
    }
    let mut film = Film::new(size.0, size.1, false);
    let mut clock = RenderClock::default();
    let step =
        |done, clock: &RenderClock| Step { done, total: budget.total(), seconds: clock.seconds(), limit: budget.time, light_paths: None };
    progress.step(step(0, &clock));
    let mut stats = clock.time(|| method.prepare())?;
    let (mut iterations, mut interrupted) = (0, None);
    for i in budget.iterations.clone() {
        if iterations > 0 && budget.time.is_some_and(|limit| clock.seconds() >= limit) {
            break;
        }
        interrupted = interrupt.signal();
        if interrupted.is_some() {
            break;
        }
        let done = clock.time(|| {
            let stats = method.iterate(i, &mut film);
            film.finish_iteration();
            stats
        });
        stats.add(&done);
        iterations += 1;
        progress.step(step(iterations, &clock));
    }
    progress.finish();
    Ok(Diagnosis { iterations, seconds: clock.seconds(), stats, chains: method.chains(), interrupted })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::MethodError;
    use crate::render::Silent;

    /// Counts what it is asked for, and interrupts itself.
    struct Counting {
        asked: Vec<u64>,
        interrupt: Interrupt,
        last: u64,
    }

    impl Integrator for Counting {
        fn prepare(&mut self) -> Result<IterationStats, MethodError> {
            Ok(IterationStats { rays: 100, ..IterationStats::default() })
        }
        fn iterate(&mut self, i: u64, _: &mut Film) -> IterationStats {
            self.asked.push(i);
            if i == self.last {
                self.interrupt.raise(2);
            }
            IterationStats { rays: 1, ..IterationStats::default() }
        }
        fn stateless(&self) -> bool {
            false
        }
    }

    fn run(iterations: std::ops::Range<u64>, last: u64) -> (Result<Diagnosis, RenderError>, Vec<u64>) {
        let interrupt = Interrupt::default();
        let mut method = Counting { asked: Vec::new(), interrupt: interrupt.clone(), last };
        let budget = Budget { iterations, time: None, light_paths: None };
        let result = diagnose(("counting", &mut method), (2, 2), &budget, &mut Silent, &interrupt);
        (result, method.asked)
    }

    #[test]
    fn it_runs_to_the_end_or_to_the_signal() {
        let (whole, asked) = run(0..3, 9);
        let whole = whole.expect("done");
        assert_eq!((asked, whole.iterations, whole.stats.rays, whole.interrupted), (vec![0, 1, 2], 3, 103, None));
        let (part, asked) = run(0..1000, 1);
        let part = part.expect("done");
        assert_eq!((asked, part.iterations, part.interrupted), (vec![0, 1], 2, Some(2)));
    }

    #[test]
    fn a_late_start_is_refused() {
        let (result, asked) = run(2..3, 9);
        assert!(matches!(result, Err(RenderError::Stateful { start: 2, .. })) && asked.is_empty());
    }
}
