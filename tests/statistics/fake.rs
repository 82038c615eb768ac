//! An integrator that renders nothing: pictures whose pixels are a truth, a planted bias and planted noise.

use isophote::image::picture::Picture;
use isophote::math::Rgb;
use isophote::samplers::{Key, Purpose, Stream};
use std::f64::consts::TAU;

/// Size of the pictures.
pub(crate) const SIZE: (usize, usize) = (4, 2);
/// Numbers of a picture.
pub(crate) const VALUES: usize = SIZE.0 * SIZE.1 * 3;
/// Snapshots: after 1, 2, 4, ... 2048 iterations.
pub(crate) const SNAPSHOTS: usize = 12;

/// What is planted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fake {
    /// Tells methods apart whose runs must not share their noise.
    pub(crate) method: u64,
    /// Relative standard deviation after one iteration.
    pub(crate) noise: f64,
    /// Exponent of the standard deviation: -1/2, or -alpha/2.
    pub(crate) noise_slope: f64,
    /// Root mean square over values of the relative bias after one iteration.
    pub(crate) bias: f64,
    /// Exponent of the bias: alpha - 1.
    pub(crate) bias_slope: f64,
    /// Standard deviation of the logarithm of a run's noise: seeds differ. The mean square over seeds stays what `noise` says.
    pub(crate) spread: f64,
    /// Correlation of that logarithm between methods of the same seed.
    pub(crate) shared: f64,
    /// Seconds an iteration takes.
    pub(crate) seconds: f64,
    /// Standard deviation of the logarithm of a run's speed.
    pub(crate) jitter: f64,
}

/// What a run leaves at a snapshot.
pub(crate) struct Snapshot {
    pub(crate) seconds: f64,
    pub(crate) values: Vec<f64>,
}

pub(crate) fn unbiased(method: u64) -> Fake {
    Fake { method, noise: 0.5, noise_slope: -0.5, bias: 0.0, bias_slope: 0.0, spread: 0.3, shared: 0.0, seconds: 0.02, jitter: 0.05 }
}

/// A progressive photon mapper: slopes -alpha/2 and alpha - 1.
pub(crate) fn progressive(method: u64, alpha: f64) -> Fake {
    Fake { noise: 0.2, noise_slope: -0.5 * alpha, bias: 0.4, bias_slope: alpha - 1.0, ..unbiased(method) }
}

/// Iterations of each snapshot.
pub(crate) fn iterations() -> Vec<f64> {
    (0..SNAPSHOTS).map(|e| f64::from(1u32 << e)).collect()
}

/// The picture that all fakes aim at: values from 0.25 to 2.
pub(crate) fn truth(value: usize) -> f64 {
    0.25 + 1.75 * value as f64 / (VALUES - 1) as f64
}

/// How a bias is spread over the values: of both signs, of mean square one.
pub(crate) fn pattern(value: usize) -> f64 {
    2f64.sqrt() * (TAU * (value as f64 + 0.25) / VALUES as f64).sin()
}

/// A number of the standard normal law.
pub(crate) fn normal(stream: &mut impl Stream) -> f64 {
    let [u, v] = stream.next_2d().map(f64::from);
    (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
}

/// Stream of a seed and a method; the numbers must be others than those an interval is drawn with.
fn stream(seed: u64, method: u64) -> impl Stream {
    Key { seed, iteration: method, index: 0, purpose: Purpose::Camera }.stream()
}

impl Fake {
    pub(crate) fn variance_after(&self, iterations: f64) -> f64 {
        (self.noise * iterations.powf(self.noise_slope)).powi(2)
    }

    pub(crate) fn bias_after(&self, iterations: f64) -> f64 {
        self.bias * iterations.powf(self.bias_slope)
    }

    /// One run. Its noise is that of a running mean: a snapshot's noise is half that of the one before and half new, scaled so that its
    /// standard deviation falls as planted.
    pub(crate) fn run(&self, seed: u64) -> Vec<Snapshot> {
        let mut own = stream(seed, self.method);
        let mut common = stream(seed, u64::MAX);
        let mut logarithm = || self.shared.sqrt() * normal(&mut common) + (1.0 - self.shared).sqrt() * normal(&mut own);
        let loud = (self.spread * logarithm() - self.spread * self.spread).exp();
        let slow = (self.jitter * logarithm()).exp();
        let mut noise: Vec<f64> = (0..VALUES).map(|_| normal(&mut own)).collect();
        let mut snapshots = Vec::with_capacity(SNAPSHOTS);
        for i in iterations() {
            let (sd, bias) = (loud * self.variance_after(i).sqrt(), self.bias_after(i));
            let values = noise.iter().enumerate().map(|(v, z)| truth(v) * (1.0 + bias * pattern(v) + sd * z)).collect();
            snapshots.push(Snapshot { seconds: slow * self.seconds * i, values });
            for z in &mut noise {
                *z = (*z + normal(&mut own)) * 0.5f64.sqrt();
            }
        }
        snapshots
    }

    /// Runs of consecutive seeds of a repetition; no seed appears in two repetitions.
    pub(crate) fn runs(&self, repetition: u64, count: usize) -> Vec<Vec<Snapshot>> {
        (0..count as u64).map(|k| self.run(repetition * 1000 + k)).collect()
    }
}

/// Relative mean squared error without an epsilon, so that its expectation is planted bias squared and planted variance, added.
pub(crate) fn relative_error(snapshot: &Snapshot) -> f64 {
    snapshot.values.iter().enumerate().map(|(v, x)| (x / truth(v) - 1.0).powi(2)).sum::<f64>() / VALUES as f64
}

/// As the renderer would hand it on.
pub(crate) fn picture(values: &[f64]) -> Picture {
    let pixels = values.chunks_exact(3).map(|p| Rgb::new(p[0] as f32, p[1] as f32, p[2] as f32)).collect();
    Picture::new(SIZE.0, SIZE.1, pixels)
}

/// What the pictures aim at.
pub(crate) fn reference() -> Picture {
    picture(&(0..VALUES).map(truth).collect::<Vec<f64>>())
}
