//! Intervals, slopes and ratios over independent runs.

use crate::image::picture::Picture;
use crate::samplers::{Key, Stream};
use crate::study::records::Record;
use maud::html;
use std::path::{Path, PathBuf};

/// From `low` to `high`, both included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval {
    /// Lower end.
    pub(super) low: f64,
    /// Upper end.
    pub(super) high: f64,
}

/// A straight line through logarithms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slope {
    pub(super) slope: f64,
    pub(super) interval: Option<Interval>,
}

/// Of two medians, paired by seed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ratio {
    pub(super) ratio: f64,
    pub(super) interval: Option<Interval>,
    pub(super) runs: usize,
}

/// What an interval says about a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Holds,
    Refuted,
    Undecided { more_runs: Option<usize> },
}

/// Middle of a list.
pub(super) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    (n > 0).then(|| 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]))
}

/// Percentile bootstrap over runs.
pub(super) fn bootstrap(runs: usize, resamples: usize, level: f64, key: Key, statistic: impl Fn(&[usize]) -> f64) -> Option<Interval> {
    if runs < 2 {
        return None;
    }
    let mut stream = key.stream();
    let mut draw = || (stream.next_1d() * runs as f32) as usize;
    let mut values: Vec<f64> = (0..resamples)
        .map(|_| {
            let chosen: Vec<usize> = (0..runs).map(|_| draw()).collect();
            statistic(&chosen)
        })
        .filter(|v| v.is_finite())
        .collect();
    values.sort_by(f64::total_cmp);
    let at = |q: f64| values.get(((values.len() as f64 - 1.0) * q).round() as usize).copied();
    Some(Interval { low: at(0.5 * (1.0 - level))?, high: at(0.5 * (1.0 + level))? })
}

/// Slope of log y on log x of the runs' mean curve.
pub(super) fn log_log_slope(x: &[f64], y: &[Vec<f64>], window: (f64, f64), level: f64, key: Key) -> Option<Slope> {
    let inside: Vec<usize> = (0..x.len()).filter(|&i| x[i] >= window.0 && x[i] <= window.1).collect();
    if inside.len() < 3 || y.is_empty() {
        return None;
    }
    let of = |chosen: &[usize]| {
        let points = inside.iter().map(|&i| (x[i].ln(), (chosen.iter().map(|&k| y[k][i]).sum::<f64>() / chosen.len() as f64).ln()));
        let (mut n, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (a, b) in points {
            (n, sx, sy, sxx, sxy) = (n + 1.0, sx + a, sy + b, sxx + a * a, sxy + a * b);
        }
        (n * sxy - sx * sy) / (n * sxx - sx * sx)
    };
    let all: Vec<usize> = (0..y.len()).collect();
    let slope = of(&all);
    slope.is_finite().then(|| Slope { slope, interval: bootstrap(y.len(), 1000, level, key, of) })
}

/// Ratio of the medians of `a` and `b`.
pub(super) fn paired_ratio(a: &[f64], b: &[f64], level: f64, key: Key) -> Option<Ratio> {
    if a.len() != b.len() {
        return None;
    }
    let of = |chosen: &[usize]| {
        let pick = |v: &[f64]| median(&chosen.iter().map(|&i| v[i]).collect::<Vec<_>>()).unwrap_or(f64::NAN);
        pick(a) / pick(b)
    };
    let all: Vec<usize> = (0..a.len()).collect();
    let ratio = of(&all);
    ratio.is_finite().then(|| Ratio { ratio, interval: bootstrap(a.len(), 1000, level, key, of), runs: a.len() })
}

/// Whether the ratio is at most `bound`; none without an interval.
pub(super) fn at_most(ratio: &Ratio, bound: f64) -> Option<Verdict> {
    let interval = ratio.interval?;
    Some(match interval {
        i if i.high <= bound => Verdict::Holds,
        i if i.low > bound => Verdict::Refuted,
        i => {
            // The interval's width in the logarithm falls with the root of the number of runs.
            let half = 0.5 * (i.high / i.low).ln();
            let distance = (bound / ratio.ratio).ln();
            let more = (ratio.runs as f64 * ((half / distance).powi(2) - 1.0)).ceil();
            let usable = distance > 0.0 && more.is_finite() && more < 1e6;
            Verdict::Undecided { more_runs: usable.then_some(more.max(1.0) as usize) }
        }
    })
}

/// All records of a study's folder; a last line that was cut off is left out.
pub(super) fn read(folder: &Path) -> Result<Vec<Record>, RecordsError> {
    let path = folder.join("records.jsonl");
    let bytes = std::fs::read(&path).map_err(|source| RecordsError::Io { path: path.clone(), source })?;
    let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    let parse = |(i, line): (usize, &[u8])| {
        let refuse = |error: serde_json::Error| RecordsError::Line { path: path.clone(), line: i + 1, message: error.to_string() };
        serde_json::from_slice(line).map_err(refuse)
    };
    bytes[..whole].split_inclusive(|byte| *byte == b'\n').enumerate().map(parse).collect()
}

/// The records of a study cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordsError {
    /// The system refuses the file.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A line is no record of this version.
    #[error("{}:{line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong with it.
        message: String,
    },
}

/// Pixels, from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rectangle {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

/// A picture to flip to.
pub(super) struct Layer<'a> {
    pub(super) name: String,
    pub(super) picture: &'a Picture,
    pub(super) caption: Vec<(String, String)>,
}

/// One scene's pictures.
pub(super) struct View<'a> {
    pub(super) id: String,
    pub(super) title: String,
    pub(super) reference: Option<&'a Picture>,
    pub(super) layers: Vec<Layer<'a>>,
    pub(super) insets: Vec<Rectangle>,
}

/// The pictures of a scene one after the other.
pub(super) fn fragment(view: &View) -> String {
    let mean = |p: &Picture| {
        p.pixels.iter().map(|v| f64::from(v.luminance())).filter(|v| v.is_finite()).sum::<f64>() / p.pixels.len().max(1) as f64
    };
    let reference = view.reference.map(|p| ("Reference".to_string(), p, Vec::new()));
    let layers = view.layers.iter().map(|l| (l.name.clone(), l.picture, l.caption.clone()));
    html! {
        section.viewer id=(view.id) data-insets=(view.insets.len()) {
            h2 { (view.title) }
            @for (name, picture, caption) in reference.into_iter().chain(layers) {
                p { (name) ": mean luminance " (super::numbers::plain(mean(picture))) @for (key, value) in caption { ", " (key) " " (value) } }
            }
        }
    }
    .into_string()
}

/// Script of the sections.
pub(super) const SCRIPT: &str = "";

/// Style of the sections.
pub(super) const STYLE: &str = "";
