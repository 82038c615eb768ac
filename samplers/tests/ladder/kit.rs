//! Statistics and spaces that several tests share.

use isophote_samplers::{Draw, Drawn, Ladder, LadderSettings, LightPathSpace, PhotonSampler, Stream};
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// Level of a family of tests: each of its `members` is held to `FAMILY / members`. Seeds are fixed, so a test passes always or never; the
/// level says how likely a right program would have been rejected when the seed was chosen.
pub(crate) const FAMILY: f64 = 1e-3;

/// Probability of a larger chi-squared if `counts` follow `law` (weights, any scale). Bins expected to hold fewer than 5 are joined.
pub(crate) fn chi_squared(counts: &[f64], law: &[f64]) -> f64 {
    let total: f64 = counts.iter().sum();
    let sum: f64 = law.iter().sum();
    let (mut chi2, mut bins, mut small) = (0.0, 0, (0.0, 0.0));
    for (count, p) in counts.iter().zip(law) {
        let expected = p / sum * total;
        if expected < 5.0 {
            small = (small.0 + count, small.1 + expected);
        } else {
            chi2 += (count - expected).powi(2) / expected;
            bins += 1;
        }
    }
    if small.1 >= 1.0 {
        chi2 += (small.0 - small.1).powi(2) / small.1;
        bins += 1;
    } else if small.1 == 0.0 && small.0 > 0.0 {
        return 0.0;
    }
    assert!(bins > 1, "nothing to compare: {total} counts");
    ChiSquared::new(f64::from(bins - 1)).unwrap().sf(chi2)
}

/// Mean, standard error and two-sided probability of Student's t for the hypothesis that the mean is `truth`.
pub(crate) fn t_test(values: &[f64], truth: f64) -> (f64, f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let error = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    let t = (mean - truth).abs() / error;
    (mean, error, 2.0 * StudentsT::new(0.0, 1.0, n - 1.0).unwrap().sf(t))
}

/// Fails unless the mean of independent `values` is `truth` at the level; and unless they are precise enough to tell a difference of `power`
/// relative to it, so that noise cannot pass for agreement.
pub(crate) fn assert_mean(values: &[f64], truth: f64, members: usize, power: f64, what: &str) {
    let (mean, error, p) = t_test(values, truth);
    assert!(p > FAMILY / members as f64, "{what}: {mean} +- {error} for {truth}, p = {p:.2e}");
    assert!(4.0 * error < power * truth.abs(), "{what}: {mean} +- {error} is too noisy to tell {power} of {truth}");
}

/// Sample variance.
pub(crate) fn variance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
}

/// Integrated autocorrelation time of several series of one law with known mean, in steps: sums up to the first window of five times itself.
pub(crate) fn autocorrelation_time(series: &[Vec<f64>], mean: f64) -> f64 {
    let covariance = |lag: usize| {
        let (mut sum, mut count) = (0.0, 0usize);
        for s in series.iter().filter(|s| s.len() > lag) {
            sum += s.iter().zip(&s[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
            count += s.len() - lag;
        }
        sum / count.max(1) as f64
    };
    let zero = covariance(0);
    let mut time = 1.0;
    let longest = series.iter().map(Vec::len).max().unwrap();
    for lag in 1..longest {
        time += 2.0 * covariance(lag) / zero;
        if lag as f64 > 5.0 * time {
            return time.max(1.0);
        }
    }
    longest as f64
}

/// Test settings: small pools, so that short draws are mostly steps.
pub(crate) fn settings(seed: u64, rungs: usize) -> LadderSettings {
    LadderSettings { seed, rungs, start_up: 4096, first_burn_in: 200, later_burn_in: 0, ..LadderSettings::default() }
}

/// Estimates of the integrals of several functions from one draw.
pub(crate) fn integrals<P: LightPathSpace, const N: usize>(
    ladder: &mut Ladder,
    space: &P,
    iteration: u64,
    count: u64,
    weight: impl Fn(&Drawn) -> f64 + Sync,
    f: impl Fn(&P::Path) -> [f64; N] + Sync,
) -> [f64; N] {
    let strata = ladder.strata();
    let emit = |sums: &mut Vec<[f64; N]>, path: &P::Path, drawn: &[Drawn]| {
        for drawn in drawn {
            let w = weight(drawn);
            for (sum, f) in sums[drawn.stratum].iter_mut().zip(f(path)) {
                *sum += w * f;
            }
        }
    };
    let draw = ladder.draw(space, iteration, count, || vec![[0.0; N]; strata], emit);
    total(&draw)
}

/// Strata of all batches, scaled and added.
pub(crate) fn total<const N: usize>(draw: &Draw<Vec<[f64; N]>>) -> [f64; N] {
    let mut all = [0.0; N];
    for batch in &draw.batches {
        for (sums, scale) in batch.iter().zip(&draw.scales) {
            for (all, sum) in all.iter_mut().zip(sums) {
                *all += scale * sum;
            }
        }
    }
    all
}

/// Everything a draw hands out, in order, with the path: once a stratum.
pub(crate) fn everything<P: LightPathSpace>(ladder: &mut Ladder, space: &P, iteration: u64, count: u64) -> Draw<Vec<(P::Path, Drawn)>>
where
    P::Path: Clone,
{
    let emit = |list: &mut Vec<_>, path: &P::Path, drawn: &[Drawn]| list.extend(drawn.iter().map(|drawn| (path.clone(), *drawn)));
    ladder.draw(space, iteration, count, Vec::new, emit)
}

/// A point of the unit square and a target of four nested functions on it: 1; a disk of radius 0.4 in the middle; a factor constant
/// on the squares of a 4 x 4 grid; a second such factor. All integrals are sums over the grid.
pub(crate) struct Square {
    pub(crate) inverse: [f64; 16],
    pub(crate) density: [f64; 16],
}

impl Default for Square {
    fn default() -> Self {
        // Fixed numbers over two and a half magnitudes each.
        let table = |a: usize, low: f64| std::array::from_fn(|i| low.powf(((i * a + 3) % 16) as f64 / 15.0));
        Self { inverse: table(5, 0.05), density: table(7, 0.01) }
    }
}

pub(crate) const RADIUS: f64 = 0.4;

impl Square {
    pub(crate) fn cell(p: [f32; 2]) -> usize {
        (p[1] * 4.0) as usize * 4 + (p[0] * 4.0) as usize
    }

    /// `integral over the disk of T_rung * f`, by strips: exact to 1e-6.
    pub(crate) fn integral(&self, rung: usize, f: impl Fn(f64, f64) -> f64) -> f64 {
        const STRIPS: usize = 2000;
        let side = 1.0 / STRIPS as f64;
        let mut sum = 0.0;
        for i in 0..STRIPS {
            let x = (i as f64 + 0.5) * side;
            let half = (RADIUS * RADIUS - (x - 0.5).powi(2)).max(0.0).sqrt();
            for row in 0..4 {
                let low = (row as f64 / 4.0).max(0.5 - half);
                let high = ((row + 1) as f64 / 4.0).min(0.5 + half);
                if high > low {
                    // Simpson's rule is exact for cubics in y.
                    let t = self.values([x as f32, ((low + high) / 2.0) as f32], true)[rung];
                    let f = f(x, low) + 4.0 * f(x, (low + high) / 2.0) + f(x, high);
                    sum += t * f / 6.0 * (high - low) * side;
                }
            }
        }
        sum
    }

    fn values(&self, p: [f32; 2], inside: bool) -> [f64; 4] {
        let cell = Self::cell(p);
        let v = f64::from(u8::from(inside));
        [1.0, v, v * self.inverse[cell], v * self.inverse[cell] * self.density[cell]]
    }
}

impl LightPathSpace for Square {
    type Path = [f32; 2];
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut [f32; 2]) {
        *path = stream.next_2d();
    }
    fn targets(&self, p: &[f32; 2], values: &mut [f64]) {
        let inside = (f64::from(p[0]) - 0.5).powi(2) + (f64::from(p[1]) - 0.5).powi(2) < RADIUS * RADIUS;
        let n = values.len();
        values.copy_from_slice(&self.values(*p, inside)[..n]);
    }
    fn cell(&self, p: &[f32; 2]) -> Option<u32> {
        Some((p[1] * 8.0) as u32 * 8 + (p[0] * 8.0) as u32)
    }
}
