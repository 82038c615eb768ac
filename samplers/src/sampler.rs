//! What a sampler asks of a renderer, and what a renderer gets back.

use crate::stream::{Key, Purpose, Stream};
use rayon::prelude::*;

/// A space of light paths: a function from primary sample space to paths, and the target functions defined on them.
pub trait LightPathSpace: Sync {
    /// A traced light path. The sampler never looks inside. `Default` is an empty buffer that [`LightPathSpace::trace`] fills again
    /// and again, so that a hot loop allocates nothing.
    type Path: Default + Send;

    /// Traces the path that the stream's coordinates describe, replacing what `path` held.
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut Self::Path);

    /// Values of the rungs' target functions at a path, rung 0 first: the constant 1. `values` has one place a rung; a space with
    /// fewer targets than places is a caller's mistake. All are finite and not negative, and each rung's support contains the next's.
    fn targets(&self, path: &Self::Path, values: &mut [f64]);

    /// What the path adds to the relative variance of the measurements when it is drawn with density one: the sum over measurements of
    /// its squared contribution relative to the measurement, in any constant scale. The allocation of steps minimises its integral
    /// divided by the density of all rungs together. Not negative and finite.
    fn usefulness(&self, _path: &Self::Path) -> f64 {
        1.0
    }

    /// One of [`CELLS`] cells that the path contributes to, a hash of a measurement it touches; `None` if it touches none. How counts per
    /// cell scatter over ensembles tells how much a chain's correlation costs.
    fn cell(&self, _path: &Self::Path) -> Option<u32> {
        None
    }

    /// What the path cost to trace and to use, in any constant unit (rays and deposits). Positive and finite.
    fn cost(&self, _path: &Self::Path) -> f64 {
        1.0
    }
}

/// Number of cells of [`LightPathSpace::cell`]; a larger value is taken modulo this one.
pub const CELLS: usize = 1024;

/// One light path as a sampler hands it out, in one of the strata that it counts for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Number of the path within the iteration, over all strata: that of the first step it was counted in.
    pub index: u64,
    /// The rung that drew it.
    pub stratum: usize,
    /// Weight within its stratum, `repeats * w_i(u)/T_i(u)` ([`PhotonSampler`]); what only the iteration's end knows is in
    /// [`Draw::scales`].
    pub weight: f64,
    /// The same within the mixture of all strata but the last, for statistics that shape the last rung's target: they must not depend
    /// on its own paths. Equal to `weight` if there is one stratum; 0 for the last of several.
    pub pilot_weight: f64,
    /// Counted steps at the rung that this path stands for: a rejected proposal counts the state again. 1 at the uniform rung.
    pub repeats: u32,
}

/// What an iteration's draw leaves.
#[derive(Clone, Debug)]
pub struct Draw<A> {
    /// The consumer's accumulators, in an order that does not depend on threads.
    pub batches: Vec<A>,
    /// One factor a stratum, `b_i/N_i`: a sum over the stratum's paths is multiplied by it once.
    pub scales: Vec<f64>,
    /// Light paths traced, start-up and burn-in counted.
    pub traced: u64,
}

/// Draws light subpaths. An estimate of the integral of `f` over the space is
///
/// `sum_i scales[i] * sum_{u in stratum i} weight(u) f(u)`, with `weight = w_i/T_i` and `sum_i w_i = 1` for every path that `f` needs.
///
/// Consumers accumulate per stratum and scale once. Independent of the number of threads: work is cut into batches by count alone.
pub trait PhotonSampler {
    /// Strata the sampler hands out: the length of [`Draw::scales`].
    fn strata(&self) -> usize;

    /// Draws `count` paths of iteration `iteration`. `start` makes an accumulator for each batch; `emit` receives every path once, with an
    /// entry for each stratum that it counts for, ascending: chains that exchange states count the same path at several rungs.
    fn draw<P, A>(
        &mut self,
        space: &P,
        iteration: u64,
        count: u64,
        start: impl Fn() -> A + Sync,
        emit: impl Fn(&mut A, &P::Path, &[Drawn]) + Sync,
    ) -> Draw<A>
    where
        P: LightPathSpace,
        A: Send;
}

/// Independent paths with density one on primary sample space: the ladder with one rung.
#[derive(Clone, Copy, Debug)]
pub struct Uniform {
    /// Seed of the run.
    pub seed: u64,
}

/// Paths a batch: enough to amortise a buffer, few enough to keep two cores busy at a hundred thousand paths.
const BATCH: u64 = 2048;

impl PhotonSampler for Uniform {
    fn strata(&self) -> usize {
        1
    }

    fn draw<P, A>(
        &mut self,
        space: &P,
        iteration: u64,
        count: u64,
        start: impl Fn() -> A + Sync,
        emit: impl Fn(&mut A, &P::Path, &[Drawn]) + Sync,
    ) -> Draw<A>
    where
        P: LightPathSpace,
        A: Send,
    {
        let seed = self.seed;
        let batch = |b: usize| {
            let b = b as u64;
            let mut accumulator = start();
            let mut path = P::Path::default();
            for index in b * BATCH..count.min((b + 1) * BATCH) {
                let mut stream = Key { seed, iteration, index, purpose: Purpose::Light }.stream();
                space.trace(&mut stream, &mut path);
                emit(&mut accumulator, &path, &[Drawn { index, stratum: 0, weight: 1.0, pilot_weight: 1.0, repeats: 1 }]);
            }
            accumulator
        };
        // One batch a task: runs of several leave a thread idle at the end.
        let batches = (0..count.div_ceil(BATCH) as usize).into_par_iter().with_max_len(1).map(batch).collect();
        Draw { batches, scales: vec![1.0 / count.max(1) as f64], traced: count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Paths are points of the unit square.
    struct Square;
    impl LightPathSpace for Square {
        type Path = [f32; 2];
        fn trace<S: Stream>(&self, stream: &mut S, path: &mut [f32; 2]) {
            *path = stream.next_2d();
        }
        fn targets(&self, _: &[f32; 2], values: &mut [f64]) {
            values.fill(1.0);
        }
    }

    fn disk_area(count: u64, iteration: u64) -> f64 {
        let inside = |sum: &mut f64, p: &[f32; 2], drawn: &[Drawn]| {
            let r2 = (p[0] - 0.5).powi(2) + (p[1] - 0.5).powi(2);
            *sum += drawn[0].weight * f64::from(u8::from(r2 < 0.25));
        };
        let draw = Uniform { seed: 3 }.draw(&Square, iteration, count, || 0.0, inside);
        assert_eq!(draw.traced, count);
        draw.batches.iter().sum::<f64>() * draw.scales[0]
    }

    #[test]
    fn uniform_estimates_a_disk() {
        let n = 1_000_003;
        let p = std::f64::consts::FRAC_PI_4;
        let sd = (p * (1.0 - p) / n as f64).sqrt();
        assert!((disk_area(n, 0) - p).abs() < 4.5 * sd);
        assert_ne!(disk_area(n, 0), disk_area(n, 1));
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let on = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| disk_area(10_000, 7));
        assert_eq!(on(1).to_bits(), on(4).to_bits());
    }
}
