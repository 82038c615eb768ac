//! The filters of LDR-FLIP: the eye's contrast sensitivity, and detectors of edges and points \[ANDERSSON20\].

use crate::image::metrics::filter::add_scaled;
use std::f64::consts::PI;

/// Pixels per degree: a screen 0.7 m wide with 3,840 pixels across, seen from 0.7 m.
const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;
/// Width of a feature's detector in degrees.
const FEATURE: f64 = 0.082;

/// A term of a contrast sensitivity \[ANDERSSON20\]: `a sqrt(pi/b) exp(-pi^2 x^2/b)`, x in degrees.
struct Term {
    a: f64,
    b: f64,
}

const LUMA: Term = Term { a: 1.0, b: 0.0047 };
const RED_GREEN: Term = Term { a: 1.0, b: 0.0053 };
const BLUE_YELLOW: [Term; 2] = [Term { a: 34.1, b: 0.04 }, Term { a: 13.5, b: 0.025 }];

/// A filter in one dimension. Derivatives are sums of differences: the square root that follows would make the rounding of weights that
/// only nearly cancel visible in flat regions.
pub(super) enum Kernel {
    /// Weights from the farthest pixel on one side to the farthest on the other; an odd number.
    Smooth(Vec<f32>),
    /// Weights of v(k) - v(-k), k = 1, 2, ...
    First(Vec<f32>),
    /// Weights of v(k) + v(-k) - 2 v(0), k = 1, 2, ...
    Second(Vec<f32>),
}

impl Kernel {
    /// Adds the filtered values; `at` gives the values so many pixels away.
    pub(super) fn add<'a>(&self, out: &mut [f32], at: impl Fn(isize) -> &'a [f32]) {
        match self {
            Kernel::Smooth(weights) => {
                let reach = (weights.len() / 2) as isize;
                for (k, weight) in (-reach..).zip(weights) {
                    add_scaled(out, at(k), *weight);
                }
            }
            Kernel::First(weights) => {
                for (k, weight) in (1..).zip(weights) {
                    for (out, (after, before)) in out.iter_mut().zip(at(k).iter().zip(at(-k))) {
                        *out += weight * (after - before);
                    }
                }
            }
            Kernel::Second(weights) => {
                for (k, weight) in (1..).zip(weights) {
                    for ((out, middle), (after, before)) in out.iter_mut().zip(at(0)).zip(at(k).iter().zip(at(-k))) {
                        *out += weight * ((after - middle) + (before - middle));
                    }
                }
            }
        }
    }
}

/// The filters.
pub(super) struct Kernels {
    reach: usize,
    luma: Kernel,
    red_green: Kernel,
    /// Both terms along rows.
    blue_yellow: [Kernel; 2],
    /// Both terms along columns, times their share in the sum.
    blue_yellow_shares: [Kernel; 2],
    gauss: Kernel,
    first: Kernel,
    second: Kernel,
}

impl Kernels {
    pub(super) fn new() -> Self {
        // One radius for all: three standard deviations of the widest.
        let widest = (BLUE_YELLOW[0].b / (2.0 * PI * PI)).sqrt();
        let radius = (3.0 * widest * PIXELS_PER_DEGREE).ceil() as i64;
        let terms = BLUE_YELLOW.map(|term| (term.weights(radius), term.a * (PI / term.b).sqrt()));
        // Of a sum of two Gaussians over the plane, each separable, a term's share is its factor times its sum over the plane.
        let volumes = [0, 1].map(|i| terms[i].1 * terms[i].0.iter().sum::<f64>().powi(2));
        let share = |i: usize| volumes[i] / (volumes[0] + volumes[1]);
        let deviation = 0.5 * FEATURE * PIXELS_PER_DEGREE;
        let reach = (3.0 * deviation).ceil() as i64;
        let feature = |derivative: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let weight = |x: f64| derivative(x) * (-x * x / (2.0 * deviation * deviation)).exp();
            (-reach..=reach).map(|x| weight(x as f64)).collect()
        };
        let smooth = |weights: &[f64], sum: f64| Kernel::Smooth(normalised(weights, sum));
        let half = |weights: Vec<f32>| weights[weights.len() / 2 + 1..].to_vec();
        Self {
            reach: radius.max(reach) as usize,
            luma: smooth(&LUMA.weights(radius), 1.0),
            red_green: smooth(&RED_GREEN.weights(radius), 1.0),
            blue_yellow: [0, 1].map(|i| smooth(&terms[i].0, 1.0)),
            blue_yellow_shares: [0, 1].map(|i| smooth(&terms[i].0, share(i))),
            gauss: smooth(&feature(&|_| 1.0), 1.0),
            first: Kernel::First(half(normalised(&feature(&|x| -x), 1.0))),
            second: Kernel::Second(half(normalised(&feature(&|x| x * x / (deviation * deviation) - 1.0), 1.0))),
        }
    }

    /// Pixels beyond a border that a filter may ask for.
    pub(super) fn reach(&self) -> usize {
        self.reach
    }

    /// Channel of the opponent colour and filter, for each plane of the pass along rows.
    pub(super) fn along_rows(&self) -> [(usize, &Kernel); super::PLANES] {
        [
            (0, &self.luma),
            (1, &self.red_green),
            (2, &self.blue_yellow[0]),
            (2, &self.blue_yellow[1]),
            (0, &self.gauss),
            (0, &self.first),
            (0, &self.second),
        ]
    }

    /// Plane of the pass along rows, output and filter, for each addition of the pass along columns.
    pub(super) fn along_columns(&self) -> [(usize, usize, &Kernel); 8] {
        [
            (0, 0, &self.luma),
            (1, 1, &self.red_green),
            (2, 2, &self.blue_yellow_shares[0]),
            (3, 2, &self.blue_yellow_shares[1]),
            (5, 3, &self.gauss),
            (4, 4, &self.first),
            (6, 5, &self.gauss),
            (4, 6, &self.second),
        ]
    }
}

impl Term {
    /// Its Gaussian, not normalised.
    fn weights(&self, radius: i64) -> Vec<f64> {
        let at = |i: i64| i as f64 / PIXELS_PER_DEGREE;
        (-radius..=radius).map(|i| (-PI * PI * at(i) * at(i) / self.b).exp()).collect()
    }
}

/// Positive weights scaled to sum to `sum`, negative ones to `-sum`.
fn normalised(weights: &[f64], sum: f64) -> Vec<f32> {
    let positive: f64 = weights.iter().filter(|w| **w > 0.0).sum();
    let negative: f64 = -weights.iter().filter(|w| **w < 0.0).sum::<f64>();
    weights.iter().map(|w| if *w == 0.0 { 0.0 } else { (sum * w / if *w > 0.0 { positive } else { negative }) as f32 }).collect()
}
