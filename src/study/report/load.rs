//! The pictures of a scene: read, checked, measured together, and one kept for each method.

use super::claims::EqualTime;
use super::data::{MethodRuns, Scene, Study};
use super::pictures::shrink;
use super::split::{Against, Split, noise_over_mean};
use crate::image::exr::read_file;
use crate::image::picture::Picture;
use crate::study::records::{CellRecord, SnapshotRecord};
use std::path::Path;

/// A scene's pictures.
pub(super) struct ScenePictures {
    pub(super) reference: Option<Picture>,
    /// Mean of the reference's own variance over r^2 + epsilon, where the variance is known.
    pub(super) reference_noise: Option<f64>,
    /// In the order of the scene's rows.
    pub(super) methods: Vec<MethodPictures>,
    /// Files that could not be used, and why.
    pub(super) problems: Vec<String>,
}

/// One method's pictures.
#[derive(Default)]
pub(super) struct MethodPictures {
    /// The one to look at.
    pub(super) shown: Option<Shown>,
    /// Mean of standard deviation over mean, over the runs' final images.
    pub(super) nsd: Option<f64>,
    /// Final images that could be read.
    pub(super) runs: usize,
    /// Of relmse.
    pub(super) relative: Option<Split>,
    /// Of mse.
    pub(super) absolute: Option<Split>,
    /// Pixels left out of the split and of the map.
    pub(super) masked: usize,
    /// Relative error, root of the mean square over runs and channels.
    pub(super) error_map: Option<Vec<f32>>,
    /// Photon density, if the shown image has that layer.
    pub(super) density: Option<Vec<f32>>,
}

/// A picture to look at.
pub(super) struct Shown {
    pub(super) seed: u64,
    pub(super) snapshot: SnapshotRecord,
    pub(super) picture: Picture,
}

impl ScenePictures {
    /// Reads everything the scene's records name.
    pub(super) fn load(study: &Study, scene: &Scene, equal: Option<&EqualTime>) -> Self {
        let mut problems = Vec::new();
        let read = |path: &Path, problems: &mut Vec<String>| match read(&study.resolve(path)) {
            Ok((picture, density)) => Some((picture, density)),
            Err(message) => {
                problems.push(message);
                None
            }
        };
        let record = scene.reference.as_ref();
        let reference = record.and_then(|r| read(&r.mean, &mut problems)).map(|r| r.0);
        let variance = record.and_then(|r| r.var.as_ref()).and_then(|path| read(path, &mut problems)).map(|r| r.0);
        let variance = variance.filter(|v| reference.as_ref().is_some_and(|r| r.size() == v.size()));
        let epsilon = study.epsilon();
        let seed = common_seed(scene);
        let mut methods = Vec::new();
        for row in &scene.rows {
            let mut all: Vec<(u64, Picture, Option<Vec<f32>>)> = Vec::new();
            for run in &row.runs {
                let Some(path) = &run.image else {
                    problems.push(format!("{} on {}, seed {}: the record names no image", row.label, scene.name, run.seed));
                    continue;
                };
                let Some((picture, density)) = read(path, &mut problems) else { continue };
                let wanted = reference.as_ref().or(all.first().map(|a| &a.1)).map_or(picture.size(), Picture::size);
                if picture.size() == wanted {
                    all.push((run.seed, picture, density));
                } else {
                    let (w, h) = picture.size();
                    problems.push(format!("{}: is {w}x{h} pixels, expected {}x{}", path.display(), wanted.0, wanted.1));
                }
            }
            let mut found = together(&all, reference.as_ref(), variance.as_ref(), epsilon);
            found.shown = shown(row, seed, equal.map(|e| e.seconds), &mut all, &mut |path| read(path, &mut problems).map(|r| r.0));
            methods.push(found);
        }
        let reference_noise = reference.as_ref().zip(variance.as_ref()).map(|(r, v)| relative_noise(r, v, epsilon));
        Self { reference, reference_noise, methods, problems }
    }

    /// All pictures made smaller by a factor, for a viewer that has to stay small.
    pub(super) fn shrunk(picture: &Picture, factor: usize) -> Picture {
        if factor == 1 { picture.clone() } else { shrink(picture, factor) }
    }
}

/// A picture and its layer `density`, or why not.
fn read(path: &Path) -> Result<(Picture, Option<Vec<f32>>), String> {
    let explain = |error: crate::image::picture::ImageError| {
        let cause = std::error::Error::source(&error).map_or(String::new(), |s| format!(": {s}"));
        format!("{error}{cause}")
    };
    let file = read_file(path).map_err(explain)?;
    let picture = file.picture().map_err(explain)?;
    let density = file.channels.iter().find(|c| c.name == "density.Y" && c.samples.len() == picture.pixels.len());
    Ok((picture, density.map(|c| c.samples.clone())))
}

/// What the final images say together.
fn together(
    all: &[(u64, Picture, Option<Vec<f32>>)],
    reference: Option<&Picture>,
    variance: Option<&Picture>,
    epsilon: f64,
) -> MethodPictures {
    let runs: Vec<&Picture> = all.iter().map(|a| &a.1).collect();
    let mut found = MethodPictures { runs: runs.len(), nsd: noise_over_mean(&runs), ..Default::default() };
    if let Some(reference) = reference.filter(|_| !runs.is_empty()) {
        let against = Against { runs: &runs, reference, variance, epsilon };
        found.relative = against.split(true);
        found.absolute = against.split(false);
        found.masked = against.masked();
        found.error_map = Some(against.relative_error());
    }
    found.density = all.iter().find_map(|a| a.2.clone());
    found
}

/// The lowest seed that every method has, or the lowest of all.
fn common_seed(scene: &Scene) -> Option<u64> {
    let first = scene.rows.first()?;
    let shared = first.seeds().into_iter().find(|seed| scene.rows.iter().all(|r| r.seeds().contains(seed)));
    shared.or_else(|| first.seeds().first().copied())
}

/// The picture nearest to a render time, among the run's kept snapshots and its end.
fn shown(
    row: &MethodRuns,
    seed: Option<u64>,
    seconds: Option<f64>,
    all: &mut Vec<(u64, Picture, Option<Vec<f32>>)>,
    read: &mut dyn FnMut(&Path) -> Option<Picture>,
) -> Option<Shown> {
    let run: &CellRecord = row.runs.iter().find(|r| Some(r.seed) == seed).or(row.runs.first())?;
    let last = run.snapshots.last()?;
    let distance = |s: &SnapshotRecord| seconds.map_or(0.0, |t| (s.seconds / t).ln().abs());
    let kept = run.snapshots.iter().filter(|s| s.image.is_some() && s.iteration < last.iteration);
    let nearest = kept.min_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|s| distance(s) < distance(last));
    if let Some((snapshot, picture)) = nearest.and_then(|s| Some((s, read(s.image.as_deref()?)?))) {
        return Some(Shown { seed: run.seed, snapshot: snapshot.clone(), picture });
    }
    let index = all.iter().position(|a| a.0 == run.seed)?;
    Some(Shown { seed: run.seed, snapshot: last.clone(), picture: all.swap_remove(index).1 })
}

fn relative_noise(reference: &Picture, variance: &Picture, epsilon: f64) -> f64 {
    let terms = reference.pixels.iter().zip(&variance.pixels).filter(|(r, v)| r.is_finite() && v.is_finite());
    let (sum, count) = terms.fold((0.0, 0_u64), |(sum, count), (r, v)| {
        let pixel: f64 = (0..3).map(|c| f64::from(v[c]) / (f64::from(r[c]).powi(2) + epsilon)).sum();
        (sum + pixel, count + 3)
    });
    sum / count.max(1) as f64
}

/// All seeds that any method has.
pub(super) fn seeds_of(scene: &Scene) -> Vec<u64> {
    let mut seeds: Vec<u64> = scene.rows.iter().flat_map(MethodRuns::seeds).collect();
    seeds.sort_unstable();
    seeds.dedup();
    seeds
}
