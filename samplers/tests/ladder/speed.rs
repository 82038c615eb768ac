//! What a step costs beside the tracing.

use isophote_samplers::{Ladder, LadderSettings, LightPathSpace, PhotonSampler, Stream};
use std::time::Instant;

const COORDINATES: usize = 20;

/// Twenty coordinates are read and added; targets are a few operations.
struct Trivial;
impl LightPathSpace for Trivial {
    type Path = f32;
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut f32) {
        *path = (0..COORDINATES).map(|_| stream.next_1d()).sum();
    }
    fn targets(&self, sum: &f32, values: &mut [f64]) {
        let v = f64::from(u8::from(*sum < 9.0));
        let t = f64::from(*sum);
        for (value, t) in values.iter_mut().zip([1.0, v, v * t, v * t * t]) {
            *value = t;
        }
    }
    fn cell(&self, sum: &f32) -> Option<u32> {
        Some((*sum * 50.0) as u32)
    }
}

/// Nanoseconds a step, for the record: `cargo test --release -p isophote-samplers --test ladder -- --ignored --nocapture speed`.
#[test]
#[ignore = "a measurement"]
fn speed_of_a_step() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for rungs in [1, 2, 4] {
        let settings = LadderSettings { rungs, start_up: 1000, first_burn_in: 100, ..LadderSettings::default() };
        let mut ladder = Ladder::new(settings);
        let mut best = f64::INFINITY;
        for iteration in 0..8 {
            let begin = Instant::now();
            let draw = one.install(|| {
                ladder.draw(&Trivial, iteration, 1_000_000, || 0.0f64, |sum, path, drawn| *sum += drawn[0].weight * f64::from(*path))
            });
            best = best.min(begin.elapsed().as_secs_f64() * 1e9 / draw.traced as f64);
        }
        println!("{rungs} rungs: {best:.0} ns a step of {COORDINATES} coordinates, {:.1} ns a coordinate", best / COORDINATES as f64);
    }
}
