//! The loop itself.

use super::budget::Budget;
use super::clock::{Interrupt, RenderClock};
use super::metadata::{ErrorRecord, MASKED, Metadata, Run};
use super::progress::{Progress, Step};
use super::snapshots::{Snapshot, Snapshots};
use crate::image::exr::{self, Plane};
use crate::image::film::Film;
use crate::image::layers::{Layer, LayerSums};
use crate::image::metrics::{EPSILON, Pairs, SizeMismatch};
use crate::image::picture::{ImageError, Picture};
use crate::image::readings::Readings;
use crate::image::sheet::contact_sheet;
use crate::image::tonemap::{Exposure, write_png};
use crate::integrators::{Integrator, IterationStats, MethodError};
use crate::math::Rgb;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A render cannot start or cannot be kept.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A file.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The method refuses.
    #[error(transparent)]
    Method(#[from] MethodError),
    /// The reference is of another size.
    #[error("{}: the image {source}", path.display())]
    Reference {
        /// The reference.
        path: PathBuf,
        /// The sizes.
        source: SizeMismatch,
    },
    /// A range that starts late, for a method whose iterations depend on earlier ones.
    #[error(
        "{method} carries state from one iteration to the next, so iterations {start}.. cannot be rendered alone: \
         render from 0 and go on with `isophote resume`"
    )]
    Stateful {
        /// The method's name.
        method: String,
        /// First iteration asked for.
        start: u64,
    },
    /// A number of light paths, for a method that traces none.
    #[error("{method} traces no light paths, so a budget of {budget} of them never ends: give it iterations or seconds")]
    NoLightPaths {
        /// The method's name.
        method: String,
        /// Light paths asked for.
        budget: u64,
    },
}

/// Further layers of the EXR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Layers {
    /// `variance.R`, `variance.G`, `variance.B`: variance of the mean image.
    pub variance: bool,
    /// `count.Y`: camera-side samples of the pixel.
    pub count: bool,
    /// The images of single techniques, and a contact sheet of them ([`Output::sheet`]).
    pub pyramid: bool,
    /// `density.Y`, and where targets read regions `density.region.Y`: light vertices per world unit squared and light subpath.
    pub density: bool,
}

/// What is written, and where.
#[derive(Clone, Debug)]
pub struct Output {
    /// The EXR.
    pub path: PathBuf,
    /// Further layers.
    pub layers: Layers,
    /// A PNG to look at.
    pub preview: Option<(PathBuf, Exposure)>,
}

impl Output {
    /// Where the contact sheet of `--aov pyramid` goes: `OUT.pyramid.png` beside `OUT.exr`.
    pub fn sheet(&self) -> PathBuf {
        self.path.with_extension("pyramid.png")
    }

    /// Writes the contact sheet: every picture with one exposure, the image's.
    fn write_sheet(&self, picture: &Picture, layers: &[Layer], means: Vec<Vec<Rgb>>) -> Result<(), ImageError> {
        let exposure = self.preview.as_ref().map_or(Exposure::FromImage, |(_, exposure)| *exposure);
        let of = |(layer, pixels): (&Layer, Vec<Rgb>)| (layer.place, Picture::new(picture.width, picture.height, pixels));
        let pictures: Vec<_> = layers.iter().zip(means).map(of).collect();
        write_png(&self.sheet(), &contact_sheet(&pictures, exposure.scale(picture)), Exposure::Stops(0.0))
    }

    /// Writes a film.
    fn write(&self, path: &Path, film: &Film, metadata: &Metadata) -> Result<(), ImageError> {
        let picture = Picture::new(film.width(), film.height(), film.mean());
        let mut planes = Vec::new();
        if self.layers.variance {
            // Of one iteration no variance is known; NaN says so.
            let unknown = || vec![Rgb::splat(f32::NAN); picture.pixels.len()];
            planes.push(Plane::Colour("variance".into(), film.variance_of_mean().unwrap_or_else(unknown)));
        }
        if self.layers.count {
            planes.push(Plane::Scalar("count".into(), vec![film.eye_count() as f32; picture.pixels.len()]));
        }
        if let Some(readings) = film.readings() {
            let names = readings.names().iter().enumerate();
            planes.extend(names.map(|(image, &name)| Plane::Scalar(name.into(), readings.mean(image))));
        }
        let means = film.layer_means();
        let layers = film.layers().map_or(&[][..], LayerSums::layers);
        planes.extend(layers.iter().zip(&means).map(|(layer, mean)| Plane::Colour(layer.name.clone().into(), mean.clone())));
        let metadata = serde_json::to_value(metadata).map_err(|e| ImageError::content(path, e.to_string()))?;
        exr::write(path, &picture, &planes, Some(&metadata))?;
        if !layers.is_empty() && path == self.path {
            self.write_sheet(&picture, layers, means)?;
        }
        match &self.preview {
            Some((preview, exposure)) if path == self.path => write_png(preview, &picture, *exposure),
            _ => Ok(()),
        }
    }
}

/// A picture to measure against.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Where it came from.
    pub path: PathBuf,
    /// Itself.
    pub picture: Picture,
}

/// All a render is told beside the method.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// When to stop.
    pub budget: Budget,
    /// Seed, for the record.
    pub seed: u64,
    /// After which iterations to measure.
    pub snapshots: Snapshots,
    /// Whether the film is written after each of them, beside the output.
    pub keep: bool,
    /// Seconds of wall time between saves of the unfinished image.
    pub checkpoint: Option<Duration>,
    /// Reference of the error record.
    pub reference: Option<Reference>,
    /// What to write.
    pub output: Output,
}

/// What came of a render.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The film.
    pub film: Film,
    /// As written.
    pub metadata: Metadata,
    /// The film at each snapshot and at the end, ascending by iteration.
    pub snapshots: Vec<Snapshot>,
    /// Pixels of the image with a component that is infinite or NaN.
    pub non_finite: u64,
    /// The signal that ended it early.
    pub interrupted: Option<i32>,
}

/// Prepares, iterates, saves. `metadata` says what is rendered; the rest of it is filled in here.
///
/// If something fails on the way, what is rendered is saved before the error is returned. A render interrupted before its first iteration
/// writes nothing.
pub fn render(
    method: &mut dyn Integrator,
    plan: &Plan,
    metadata: Metadata,
    progress: &mut dyn Progress,
    interrupt: &Interrupt,
) -> Result<Outcome, RenderError> {
    if let Some(Reference { path, picture }) = &plan.reference
        && picture.size() != plan.size
    {
        let source = SizeMismatch { image: plan.size, reference: picture.size() };
        return Err(RenderError::Reference { path: path.clone(), source });
    }
    let start = plan.budget.iterations.start;
    if start > 0 && !method.stateless() {
        return Err(RenderError::Stateful { method: metadata.method, start });
    }
    let mut film = Film::new(plan.size.0, plan.size.1, plan.output.layers.variance);
    if plan.output.layers.density {
        film.keep_readings(Readings::new(method.density_images()?, plan.size.0 * plan.size.1));
    }
    if plan.output.layers.pyramid {
        film.keep_layers(LayerSums::new(method.technique_layers()?, plan.size.0 * plan.size.1));
    }
    let (clock, stats) = (RenderClock::default(), IterationStats::default());
    let mut session = Session { plan, film, metadata, snapshots: Vec::new(), clock, stats, done: 0 };
    let result = session.iterate(method, progress, interrupt);
    progress.finish();
    let saved = if session.done > 0 { session.record().and_then(|()| session.save(method, &plan.output.path)) } else { Ok(()) };
    let interrupted = result?;
    saved?;
    session.warn(method);
    let non_finite = session.film.mean().iter().filter(|p| !p.is_finite()).count() as u64;
    Ok(Outcome { film: session.film, metadata: session.metadata, snapshots: session.snapshots, non_finite, interrupted })
}

/// A render in progress.
struct Session<'a> {
    plan: &'a Plan,
    film: Film,
    metadata: Metadata,
    snapshots: Vec<Snapshot>,
    clock: RenderClock,
    stats: IterationStats,
    done: u64,
}

impl Session<'_> {
    /// Runs to the end of the budget, or to the signal that it returns.
    fn iterate(
        &mut self,
        method: &mut dyn Integrator,
        progress: &mut dyn Progress,
        interrupt: &Interrupt,
    ) -> Result<Option<i32>, RenderError> {
        if let Some(signal) = interrupt.signal() {
            return Ok(Some(signal));
        }
        progress.step(self.step());
        let prepared = self.clock.time(|| method.prepare())?;
        self.stats.add(&prepared);
        self.metadata.radius = method.radius();
        let mut last_save = Instant::now();
        for i in self.plan.budget.iterations.clone() {
            if self.done > 0 && self.spent()? {
                break;
            }
            if let Some(signal) = interrupt.signal() {
                return Ok(Some(signal));
            }
            let film = &mut self.film;
            let stats = self.clock.time(|| {
                let stats = method.iterate(i, film);
                film.finish_iteration();
                stats
            });
            self.stats.add(&stats);
            self.done += 1;
            progress.step(self.step());
            self.keep(method)?;
            if self.plan.checkpoint.is_some_and(|every| last_save.elapsed() >= every) {
                if let Err(error) = self.save(method, &self.plan.output.path) {
                    // The render can still end well; only the insurance is missing.
                    tracing::warn!("checkpoint not written: {error}");
                }
                last_save = Instant::now();
            }
        }
        Ok(None)
    }

    /// A snapshot and an error record, where they are due.
    fn keep(&mut self, method: &dyn Integrator) -> Result<(), RenderError> {
        if self.plan.snapshots.due(self.done) {
            self.record()?;
            if self.plan.keep {
                self.save(method, &Snapshots::path(&self.plan.output.path, self.done))?;
            }
        }
        Ok(())
    }

    /// Counts and measures, if that is not done yet for this film.
    fn record(&mut self) -> Result<(), RenderError> {
        if self.snapshots.last().is_some_and(|snapshot| snapshot.iteration == self.done) {
            return Ok(());
        }
        let error = self.measure()?;
        let values = error.iter().flat_map(|e| &e.values).filter(|(key, _)| *key != MASKED);
        self.snapshots.push(Snapshot {
            iteration: self.done,
            seconds: self.clock.seconds(),
            cpu_seconds: self.clock.cpu_seconds(),
            light_paths: self.stats.light_paths,
            camera_paths: self.stats.camera_paths,
            rays: self.stats.rays,
            values: values.map(|(key, value)| (key.clone(), value.as_f64())).collect(),
            masked: error.as_ref().and_then(|e| e.values.get(MASKED)).and_then(Value::as_u64).unwrap_or(0),
        });
        self.metadata.errors.extend(error);
        Ok(())
    }

    /// The error against the reference, if there is one.
    fn measure(&self) -> Result<Option<ErrorRecord>, RenderError> {
        let Some(Reference { path, picture }) = &self.plan.reference else { return Ok(None) };
        let image = Picture::new(self.film.width(), self.film.height(), self.film.mean());
        let pairs = Pairs::new(picture, &image).map_err(|source| RenderError::Reference { path: path.clone(), source })?;
        Ok(Some(ErrorRecord::measure(self.done, self.clock.seconds(), &pairs, EPSILON)))
    }

    /// Writes the film as it stands.
    fn save(&mut self, method: &dyn Integrator, path: &Path) -> Result<(), RenderError> {
        let start = self.plan.budget.iterations.start;
        let metadata = &mut self.metadata;
        metadata.runs = vec![Run { seed: self.plan.seed, ranges: vec![[start, start + self.done]] }];
        metadata.seconds = self.clock.seconds();
        metadata.cpu_seconds = self.clock.cpu_seconds();
        metadata.threads = rayon::current_num_threads();
        metadata.light_paths = self.stats.light_paths;
        metadata.camera_paths = self.stats.camera_paths;
        metadata.rays = self.stats.rays;
        metadata.rejected = self.stats.rejected.iter().map(|(cause, count)| (cause.to_string(), *count)).collect();
        metadata.diagnostics = method.diagnostics();
        Ok(self.plan.output.write(path, &self.film, &self.metadata)?)
    }

    /// Tells of chains that make the image wrong; what only makes it noisier is for those who ask.
    fn warn(&self, method: &dyn Integrator) {
        let Some(chains) = method.chains() else { return };
        for warning in chains.warnings().iter().filter(|warning| warning.severe()) {
            tracing::warn!("{} on {}: {}", self.metadata.method, self.metadata.scene.path, chains.words(warning));
        }
    }

    /// Whether the time or the light paths are used up.
    fn spent(&self) -> Result<bool, RenderError> {
        let Budget { time, light_paths, .. } = self.plan.budget;
        if let Some(budget) = light_paths
            && self.stats.light_paths == 0
        {
            return Err(RenderError::NoLightPaths { method: self.metadata.method.clone(), budget });
        }
        Ok(time.is_some_and(|limit| self.clock.seconds() >= limit) || light_paths.is_some_and(|limit| self.stats.light_paths >= limit))
    }

    fn step(&self) -> Step {
        let budget = &self.plan.budget;
        let light_paths = budget.light_paths.map(|limit| self.stats.light_paths as f64 / limit as f64);
        Step { done: self.done, total: budget.total(), seconds: self.clock.seconds(), limit: budget.time, light_paths }
    }
}

#[cfg(test)]
mod tests;
