//! What the tests of this room share: scenes of few parts, random numbers, hypothesis tests.

use crate::math::Rgb;
use crate::samplers::{Key, Purpose, Stream, UniformStream};
use crate::scene::bsdf::Bsdf;
use crate::scene::bsdf::diffuse::Diffuse;
use crate::scene::camera::{Camera, CameraDescription, FilmSpec};
use crate::scene::emitter::Emitter;
use crate::scene::shape::{Geometry, Shape};
use crate::scene::texture::Texture;
use crate::scene::{BsdfId, Scene, SceneParts};
use glam::{Vec2, Vec3};

/// Numbers of a test; `index` tells its cases apart.
pub(super) fn stream(index: u64) -> UniformStream {
    Key { seed: 0x150f, iteration: 0, index, purpose: Purpose::Test }.stream()
}

/// Two numbers as a vector.
pub(super) fn pair(stream: &mut UniformStream) -> Vec2 {
    Vec2::from(stream.next_2d())
}

/// A scene of these shapes, shining or not, and emitters.
pub(super) fn scene(shapes: Vec<(Geometry, Option<Rgb>)>, emitters: Vec<Emitter>) -> Scene {
    scene_with_lights(shapes.into_iter().map(|(geometry, radiance)| (geometry, radiance.map(Texture::Constant))).collect(), emitters)
}

/// [`scene`] of shapes whose radiance may vary.
pub(super) fn scene_with_lights(shapes: Vec<(Geometry, Option<Texture>)>, emitters: Vec<Emitter>) -> Scene {
    let shape = |(i, (geometry, radiance)): (usize, (Geometry, Option<Texture>))| Shape {
        name: format!("shape {i}"),
        geometry,
        bsdf: BsdfId(0),
        radiance,
    };
    Scene::build(SceneParts {
        shapes: shapes.into_iter().enumerate().map(shape).collect(),
        bsdfs: vec![Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::splat(0.5)) })],
        emitters,
        camera: Camera::new(CameraDescription::default(), FilmSpec::new(4, 3)).unwrap(),
    })
    .unwrap()
}

/// Level of one of `tests` tests for a family-wise level of one in a thousand (\[SIDAK67\]).
fn level(tests: usize) -> f64 {
    1.0 - 0.999f64.powf(1.0 / tests as f64)
}

/// Mean and variance of the mean, kept running.
#[derive(Default, Clone, Debug)]
pub(super) struct Mean {
    n: f64,
    sum: f64,
    squares: f64,
}

impl Mean {
    pub(super) fn add(&mut self, x: f64) {
        self.n += 1.0;
        self.sum += x;
        self.squares += x * x;
    }

    pub(super) fn value(&self) -> f64 {
        self.sum / self.n
    }

    pub(super) fn variance(&self) -> f64 {
        (self.squares / self.n - self.value().powi(2)).max(0.0) / self.n
    }
}

/// Rejects where a mean is not `expected`, one of `tests` tests. `slack` is a relative error that f32 alone explains.
pub(super) fn expect_mean(what: &str, mean: &Mean, expected: f64, slack: f64, tests: usize) {
    let deviation = ((mean.value() - expected).abs() - slack * expected.abs()).max(0.0);
    let z = if deviation == 0.0 { 0.0 } else { deviation / mean.variance().sqrt() };
    let limit = normal_quantile(level(tests) / 2.0);
    assert!(z < limit, "{what}: mean {} +- {}, expected {expected}: z = {z:.2}, limit {limit:.2}", mean.value(), mean.variance().sqrt());
}

/// Rejects where two means differ.
pub(super) fn expect_same(what: &str, a: &Mean, b: &Mean, tests: usize) {
    let error = (a.variance() + b.variance()).sqrt();
    let z = (a.value() - b.value()).abs() / error;
    let limit = normal_quantile(level(tests) / 2.0);
    assert!(z < limit, "{what}: {} against {} +- {error}: z = {z:.2}, limit {limit:.2}", a.value(), b.value());
}

/// Pearson's test of counts against expected counts; cells that expect fewer than five are joined.
pub(super) fn expect_counts(what: &str, counts: &[u64], expected: &[f64], tests: usize) {
    let (mut statistic, mut cells) = (0.0, 0);
    let (mut few_counts, mut few_expected) = (0.0, 0.0);
    let mut worst = (0.0, 0, 0.0, 0.0);
    let mut term = |i: usize, count: f64, expected: f64| {
        let t = (count - expected).powi(2) / expected;
        statistic += t;
        cells += 1;
        if t > worst.0 {
            worst = (t, i, count, expected);
        }
    };
    for (i, (&count, &expected)) in counts.iter().zip(expected).enumerate() {
        if expected < 5.0 {
            few_counts += count as f64;
            few_expected += expected;
        } else {
            term(i, count as f64, expected);
        }
    }
    if few_expected >= 5.0 {
        term(usize::MAX, few_counts, few_expected);
    } else {
        assert!(few_counts <= 25.0, "{what}: {few_counts} samples where {few_expected} are expected");
    }
    assert!(cells > 8, "{what}: only {cells} cells");
    // Wilson and Hilferty's cube root makes the statistic normal.
    let k = f64::from(cells - 1);
    let z = ((statistic / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt();
    let limit = normal_quantile(level(tests));
    assert!(z < limit, "{what}: chi2 = {statistic:.1} in {cells} cells, z = {z:.2}, limit {limit:.2}; worst cell {worst:?}");
}

/// The value that a standard normal variable exceeds with probability `p`.
fn normal_quantile(p: f64) -> f64 {
    use statrs::distribution::{ContinuousCDF, Normal};
    -Normal::standard().inverse_cdf(p)
}

/// Largest difference of coordinates.
pub(super) fn apart(a: Vec3, b: Vec3) -> f32 {
    (a - b).abs().max_element()
}
