//! What tracing cost, counted where no accumulator is at hand: a sampler hands out the paths it counts, and traces more.

use crate::transport::walk::Tally;
use std::sync::atomic::{AtomicU64, Ordering};

/// Shards; threads share one only where there are more of them.
const SHARDS: usize = 16;

/// Sums of [`Tally`] over threads. Sums of integers do not depend on their order.
#[derive(Debug, Default)]
pub struct Tallies {
    shards: [Shard; SHARDS],
}

/// A cache line, so that threads do not wait for each other.
#[derive(Debug, Default)]
#[repr(align(64))]
struct Shard {
    rays: AtomicU64,
    non_finite: AtomicU64,
    sides_disagree: AtomicU64,
}

impl Tallies {
    /// Adds a path's.
    #[inline]
    pub fn add(&self, tally: &Tally) {
        let shard = &self.shards[rayon::current_thread_index().unwrap_or(0) % SHARDS];
        shard.rays.fetch_add(tally.rays, Ordering::Relaxed);
        // Both are rare.
        if tally.non_finite + tally.sides_disagree > 0 {
            shard.non_finite.fetch_add(tally.non_finite, Ordering::Relaxed);
            shard.sides_disagree.fetch_add(tally.sides_disagree, Ordering::Relaxed);
        }
    }

    /// The sum of all.
    pub fn total(&self) -> Tally {
        let sum = |count: fn(&Shard) -> &AtomicU64| self.shards.iter().map(|shard| count(shard).load(Ordering::Relaxed)).sum();
        Tally { rays: sum(|s| &s.rays), non_finite: sum(|s| &s.non_finite), sides_disagree: sum(|s| &s.sides_disagree) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn sums_over_threads_are_whole() {
        let tallies = Tallies::default();
        (0..1000u64).into_par_iter().for_each(|i| tallies.add(&Tally { rays: i, non_finite: i % 2, sides_disagree: i % 5 }));
        assert_eq!(tallies.total(), Tally { rays: 499_500, non_finite: 500, sides_disagree: 2000 });
    }
}
