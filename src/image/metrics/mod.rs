//! How far an image is from a reference. One table; the command line, `list` and the error record walk it.
//!
//! All metrics run over linear values, per channel, and are averaged over pixels and channels; `x` is the image tested, `r` the reference.

use super::picture::Picture;

/// Which way a metric improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Zero is perfect.
    Lower,
    /// More is better.
    Higher,
}

/// What a metric measures: values, and the number of them that had to be left out.
type Measure = fn(&Pairs, f64) -> Measured;

/// A line of the table of metrics.
pub struct Metric {
    /// Key in JSON, in files and in tables.
    pub name: &'static str,
    /// Formula, `e` the epsilon.
    pub formula: &'static str,
    /// Whether the epsilon matters.
    pub uses_epsilon: bool,
    /// Direction.
    pub better: Better,
    measure: Measure,
}

/// Every metric.
pub const METRICS: &[Metric] = &[
    lower("mse", "mean (x-r)^2", false, |pairs, _| pairs.mean(|x, r| (x - r) * (x - r))),
    lower("rmse", "sqrt(mean (x-r)^2)", false, |pairs, _| pairs.mean(|x, r| (x - r) * (x - r)).map(f64::sqrt)),
    lower("relmse", "mean (x-r)^2/(r^2+e), r = 0 included", true, |pairs, e| pairs.mean(|x, r| relative_square(x, r, e))),
    lower("relmse_trimmed", "relmse without its largest floor(0.001*3*pixels) values", true, relmse_trimmed),
    lower("mape", "mean |x-r|/(|r|+e)", true, |pairs, e| pairs.mean(|x, r| (x - r).abs() / (r.abs() + e))),
    lower("smape", "mean 2|x-r|/(|x|+|r|+2e)", true, |pairs, e| pairs.mean(|x, r| 2.0 * (x - r).abs() / (x.abs() + r.abs() + 2.0 * e))),
    lower("srrmse", "sqrt(mean ((x-r)/((x+r)/2))^2); where x+r <= 0: 0 if x = r, else left out", false, srrmse),
];

/// The epsilon of relmse, mape and smape unless another is asked for.
pub const EPSILON: f64 = 0.01;

/// Share of the values that relmse_trimmed leaves out.
const TRIMMED: f64 = 0.001;

const fn lower(name: &'static str, formula: &'static str, uses_epsilon: bool, measure: Measure) -> Metric {
    Metric { name, formula, uses_epsilon, better: Better::Lower, measure }
}

/// A metric's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The value; `None` if every value had to be left out.
    pub value: Option<f64>,
    /// Values (one per pixel and channel) this metric left out, beside the pixels masked for all metrics.
    pub left_out: u64,
}

impl Measured {
    fn map(self, f: impl FnOnce(f64) -> f64) -> Self {
        Self { value: self.value.map(f), ..self }
    }
}

/// Two pictures of different sizes cannot be compared.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("is {}x{} pixels, the reference {}x{}", image.0, image.1, reference.0, reference.1)]
pub struct SizeMismatch {
    /// Width and height of the image.
    pub image: (usize, usize),
    /// Width and height of the reference.
    pub reference: (usize, usize),
}

/// The values of two pictures that can be compared: `x` of the image, `r` of the reference.
pub struct Pairs {
    values: Vec<(f64, f64)>,
    masked: u64,
}

impl Pairs {
    /// Pairs the values of two pictures. Pixels where either has an infinite component or a NaN are masked, with all their components.
    pub fn new(reference: &Picture, image: &Picture) -> Result<Self, SizeMismatch> {
        if reference.size() != image.size() {
            return Err(SizeMismatch { image: image.size(), reference: reference.size() });
        }
        let mut values = Vec::with_capacity(3 * image.pixels.len());
        let mut masked = 0;
        for (x, r) in image.pixels.iter().zip(&reference.pixels) {
            if x.is_finite() && r.is_finite() {
                values.extend((0..3).map(|c| (f64::from(x[c]), f64::from(r[c]))));
            } else {
                masked += 1;
            }
        }
        Ok(Self { values, masked })
    }

    /// Pixels masked because a component is not finite.
    pub fn masked(&self) -> u64 {
        self.masked
    }

    /// Pixels compared.
    pub fn pixels(&self) -> u64 {
        self.values.len() as u64 / 3
    }

    /// Mean of a function of `x` and `r`.
    pub fn mean(&self, value: impl Fn(f64, f64) -> f64) -> Measured {
        mean_of(self.values.iter().map(|(x, r)| value(*x, *r)), 0)
    }
}

impl Metric {
    /// Measures.
    pub fn measure(&self, pairs: &Pairs, epsilon: f64) -> Measured {
        (self.measure)(pairs, epsilon)
    }
}

/// The metric of a name.
pub fn metric(name: &str) -> Option<&'static Metric> {
    METRICS.iter().find(|m| m.name == name)
}

fn mean_of(values: impl Iterator<Item = f64>, left_out: u64) -> Measured {
    let (sum, count) = values.fold((0.0, 0_u64), |(sum, count), v| (sum + v, count + 1));
    Measured { value: (count > 0).then(|| sum / count as f64), left_out }
}

fn relative_square(x: f64, r: f64, epsilon: f64) -> f64 {
    (x - r) * (x - r) / (r * r + epsilon)
}

fn relmse_trimmed(pairs: &Pairs, epsilon: f64) -> Measured {
    let mut errors: Vec<f64> = pairs.values.iter().map(|(x, r)| relative_square(*x, *r, epsilon)).collect();
    errors.sort_unstable_by(f64::total_cmp);
    let trimmed = (TRIMMED * errors.len() as f64).floor() as usize;
    mean_of(errors[..errors.len() - trimmed].iter().copied(), 0)
}

fn srrmse(pairs: &Pairs, _: f64) -> Measured {
    let square = |&(x, r): &(f64, f64)| {
        if x + r > 0.0 {
            let relative = (x - r) / (0.5 * (x + r));
            Some(relative * relative)
        } else {
            (x == r).then_some(0.0)
        }
    };
    let left_out = pairs.values.iter().filter(|pair| square(pair).is_none()).count() as u64;
    mean_of(pairs.values.iter().filter_map(square), left_out).map(f64::sqrt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;

    fn row(values: &[[f32; 3]]) -> Picture {
        Picture::new(values.len(), 1, values.iter().map(|v| Rgb::from(*v)).collect())
    }

    fn value(name: &str, reference: &Picture, image: &Picture, epsilon: f64) -> Measured {
        metric(name).expect("a metric").measure(&Pairs::new(reference, image).expect("one size"), epsilon)
    }

    /// The pictures of `tests/oracle/metrics.py`, made by the same integer arithmetic.
    fn oracle_pictures() -> (Picture, Picture) {
        let number = |i: u64, salt: u64| ((i * 2_654_435_761 + salt * 40_503) % 4_294_967_296 / 65_536) as f32;
        let colours = |f: &dyn Fn(u64) -> f32| {
            let pixels = (0..2000).map(|p| Rgb::new(f(3 * p), f(3 * p + 1), f(3 * p + 2))).collect();
            Picture::new(50, 40, pixels)
        };
        let reference = colours(&|i| if i % 17 == 0 { 0.0 } else { number(i, 1) / 16384.0 });
        let image = colours(&|i| {
            let r = if i % 17 == 0 { 0.0 } else { number(i, 1) / 16384.0 };
            let x = r + (number(i, 2) - 32768.0) / 65536.0;
            if i % 101 == 0 {
                -x
            } else if i % 1009 == 0 {
                100.0 * x
            } else if i % 34 == 0 {
                0.0
            } else {
                x
            }
        });
        (reference, image)
    }

    #[test]
    fn values_are_those_of_the_independent_script() {
        let (reference, image) = oracle_pictures();
        let stored: serde_json::Value = serde_json::from_str(include_str!("../../../tests/oracle/metrics.json")).expect("JSON");
        for (epsilon, key) in [(0.01, "0.01"), (0.5, "0.5")] {
            for metric in METRICS {
                let found = value(metric.name, &reference, &image, epsilon).value.expect("a value");
                let expected = stored[key][metric.name].as_f64().expect("stored");
                assert!((found / expected - 1.0).abs() < 1e-12, "{} at {epsilon}: {found}, the script {expected}", metric.name);
            }
        }
        let left_out = value("srrmse", &reference, &image, 0.01).left_out;
        assert_eq!(left_out, stored["srrmse_left_out"].as_u64().expect("stored"));
    }

    #[test]
    fn two_values_by_hand() {
        // One pixel: r = (0, 1, 2), x = (1, 1, 0).
        let (reference, image) = (row(&[[0.0, 1.0, 2.0]]), row(&[[1.0, 1.0, 0.0]]));
        let check = |name: &str, expected: f64| {
            let found = value(name, &reference, &image, 0.01).value.expect("a value");
            assert!((found - expected).abs() < 1e-12 * expected, "{name}: {found}, by hand {expected}");
        };
        check("mse", 5.0 / 3.0);
        check("rmse", (5.0_f64 / 3.0).sqrt());
        check("relmse", (100.0 + 4.0 / 4.01) / 3.0);
        check("relmse_trimmed", (100.0 + 4.0 / 4.01) / 3.0);
        check("mape", (100.0 + 2.0 / 2.01) / 3.0);
        check("smape", (2.0 / 1.02 + 4.0 / 2.02) / 3.0);
        check("srrmse", (8.0_f64 / 3.0).sqrt());
    }

    #[test]
    fn equal_pictures_differ_by_nothing() {
        let (reference, _) = oracle_pictures();
        for metric in METRICS {
            assert_eq!(value(metric.name, &reference, &reference, EPSILON), Measured { value: Some(0.0), left_out: 0 }, "{}", metric.name);
        }
    }

    #[test]
    fn pixels_that_are_not_finite_are_masked_whole_and_counted() {
        let reference = row(&[[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [f32::INFINITY, 0.0, 0.0], [5.0, 5.0, 5.0]]);
        let image = row(&[[2.0, 2.0, 2.0], [f32::NAN, 9.0, 9.0], [0.0, 0.0, 0.0], [5.0, 5.0, 5.0]]);
        let pairs = Pairs::new(&reference, &image).expect("one size");
        assert_eq!((pairs.masked(), pairs.pixels()), (2, 2));
        assert_eq!(value("mse", &reference, &image, EPSILON).value, Some(0.5));
        let nothing = row(&[[f32::NAN; 3]]);
        assert_eq!(value("mse", &nothing, &nothing, EPSILON).value, None);
    }

    #[test]
    fn trimming_takes_the_floor() {
        // 333 pixels: floor(0.999) = 0 values go; 334 pixels: floor(1.002) = 1 goes.
        for (pixels, expected) in [(333, 1.0 / 999.0), (334, 0.0)] {
            let reference = row(&vec![[0.0; 3]; pixels]);
            let mut values = vec![[0.0; 3]; pixels];
            values[7][1] = 1.0;
            let found = value("relmse_trimmed", &reference, &row(&values), 1.0).value.expect("a value");
            assert!((found - expected).abs() < 1e-15, "{pixels} pixels: {found}");
        }
    }

    #[test]
    fn sizes_must_agree() {
        let mismatch = Pairs::new(&row(&[[0.0; 3]]), &row(&[[0.0; 3], [0.0; 3]])).err().expect("refused");
        assert_eq!(mismatch.to_string(), "is 2x1 pixels, the reference 1x1");
    }
}
