//! Render time, and the wish to stop.

use cpu_time::ProcessTime;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::{Duration, Instant};

/// Time spent preparing and iterating; nothing else counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct RenderClock {
    wall: Duration,
    cpu: Duration,
}

impl RenderClock {
    /// Runs something on the clock.
    pub fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (wall, cpu) = (Instant::now(), ProcessTime::try_now());
        let result = work();
        self.wall += wall.elapsed();
        if let (Ok(start), Ok(end)) = (cpu, ProcessTime::try_now()) {
            self.cpu += end.duration_since(start);
        }
        result
    }

    /// Wall seconds.
    pub fn seconds(&self) -> f64 {
        self.wall.as_secs_f64()
    }

    /// Seconds of processor time, over all threads of the process.
    pub fn cpu_seconds(&self) -> f64 {
        self.cpu.as_secs_f64()
    }
}

/// Set from outside (a signal), read between iterations.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicI32>);

impl Interrupt {
    /// Asks to stop; `signal` is the number of the signal that asked. The first one counts.
    pub fn raise(&self, signal: i32) {
        // The exchange fails if another signal came first; that one stays.
        let _ = self.0.compare_exchange(0, signal, Ordering::SeqCst, Ordering::SeqCst);
    }

    /// The signal that asked to stop.
    pub fn signal(&self) -> Option<i32> {
        Some(self.0.load(Ordering::SeqCst)).filter(|signal| *signal != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_on_the_clock_counts() {
        let mut clock = RenderClock::default();
        clock.time(|| std::thread::sleep(Duration::from_millis(30)));
        std::thread::sleep(Duration::from_millis(60));
        clock.time(|| ());
        assert!(clock.seconds() >= 0.03 && clock.seconds() < 0.06, "{}", clock.seconds());
    }

    #[test]
    fn the_first_signal_counts() {
        let interrupt = Interrupt::default();
        assert_eq!(interrupt.signal(), None);
        interrupt.raise(2);
        interrupt.clone().raise(15);
        assert_eq!(interrupt.signal(), Some(2));
    }
}
