//! One cell: an image, or the reason why there is none.

use super::folder::clear;
use super::{Cell, Steps, Study, Watch};
use crate::render::{Interrupt, Layers, Metadata, Outcome, Output, Plan, Reference, SceneRecord, Snapshot, Snapshots, render};
use crate::study::error::StudyError;
use crate::study::hash::file_name;
use crate::study::machine::now;
use crate::study::plan::Keep;
use crate::study::records::{CellRecord, SnapshotRecord, Status};
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Renders a cell and says what came of it; `None` if a signal ended it, and then nothing of it is left.
pub(super) fn render_cell(
    study: &Study,
    cell: Cell,
    hash: &str,
    folder: &Path,
    reference: &Reference,
    watch: &mut dyn Watch,
    interrupt: &Interrupt,
) -> Result<Option<CellRecord>, StudyError> {
    let image = image_of(study, cell);
    let path = folder.join(&image);
    let parent = path.parent().unwrap_or(folder);
    std::fs::create_dir_all(parent).map_err(StudyError::io(parent))?;
    // A study killed here before may have kept more films than this time, if the budget is a time.
    clear(&path)?;
    let mut record = blank(study, cell, hash);
    // What a method does is its own; the film and the integrator of a cell that panicked are dropped with it.
    let attempt = catch_unwind(AssertUnwindSafe(|| attempt(study, cell, &path, reference, watch, interrupt)));
    match attempt.unwrap_or_else(|payload| Err(format!("panicked: {}", said(payload.as_ref())))) {
        Ok(outcome) if outcome.interrupted.is_some() => {
            clear(&path)?;
            return Ok(None);
        }
        Ok(outcome) => {
            // The last film is the final image, and is kept once.
            let twice = Snapshots::path(&path, outcome.film.iterations());
            if twice.is_file() {
                std::fs::remove_file(&twice).map_err(StudyError::io(&twice))?;
            }
            fill(&mut record, outcome, &image, study.plan.keep);
        }
        Err(error) => {
            // A failure after the first iteration has saved what there was; a failed cell has no image.
            clear(&path)?;
            record.error = Some(error);
        }
    }
    Ok(Some(record))
}

/// The final image, relative to the study's folder.
fn image_of(study: &Study, cell: Cell) -> PathBuf {
    let (scene, method) = (&study.plan.scenes[cell.scene].name, &study.plan.methods[cell.method].label);
    Path::new("images").join(file_name(scene)).join(file_name(method)).join(format!("{}.exr", cell.seed))
}

fn attempt(
    study: &Study,
    cell: Cell,
    path: &Path,
    reference: &Reference,
    watch: &mut dyn Watch,
    interrupt: &Interrupt,
) -> Result<Outcome, String> {
    let (scene, loaded, method) = (&study.plan.scenes[cell.scene], &study.scenes[cell.scene], &study.plan.methods[cell.method]);
    let size = loaded.scene.camera().resolution();
    let common = scene.changes.common(cell.seed, &loaded.defaults);
    let mut integrator = method.settings.build(&loaded.scene, size, &common).map_err(|error| error.to_string())?;
    let plan = Plan {
        size,
        budget: method.until.budget(),
        seed: cell.seed,
        snapshots: study.plan.snapshots,
        keep: study.plan.keep == Keep::Snapshots,
        checkpoint: None,
        reference: Some(reference.clone()),
        output: Output { path: path.to_path_buf(), layers: Layers::default(), preview: None },
    };
    let record = SceneRecord { path: scene.file.display().to_string(), hash: loaded.content_hash.clone() };
    let metadata = Metadata::new(record, method.method.name, study.settings(cell));
    render(integrator.as_mut(), &plan, metadata, &mut Steps(watch), interrupt).map_err(|error| chain(&error))
}

/// An error with its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// What a panic said.
fn said(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or(payload.downcast_ref::<&str>().copied()).unwrap_or("without a message")
}

/// The record of a cell that has not begun.
fn blank(study: &Study, cell: Cell, hash: &str) -> CellRecord {
    let method = &study.plan.methods[cell.method];
    CellRecord {
        scene: study.plan.scenes[cell.scene].name.clone(),
        method: method.label.clone(),
        name: method.method.name.to_string(),
        seed: cell.seed,
        status: Status::Failed,
        error: None,
        settings: study.settings(cell),
        scene_hash: study.scenes[cell.scene].content_hash.clone(),
        cell_hash: hash.to_owned(),
        iterations: 0,
        radius: None,
        seconds: 0.0,
        cpu_seconds: 0.0,
        light_paths: 0,
        camera_paths: 0,
        rays: 0,
        rejected: BTreeMap::new(),
        started: now(),
        snapshots: Vec::new(),
        image: None,
        diagnostics: None,
    }
}

fn fill(record: &mut CellRecord, outcome: Outcome, image: &Path, keep: Keep) {
    let Outcome { film, metadata, snapshots, .. } = outcome;
    let image_at = |iteration: u64| match keep {
        _ if iteration == film.iterations() => Some(image.to_path_buf()),
        Keep::Snapshots => Some(Snapshots::path(image, iteration)),
        Keep::Final => None,
    };
    record.status = Status::Done;
    record.iterations = film.iterations();
    record.radius = metadata.radius;
    record.seconds = metadata.seconds;
    record.cpu_seconds = metadata.cpu_seconds;
    record.light_paths = metadata.light_paths;
    record.camera_paths = metadata.camera_paths;
    record.rays = metadata.rays;
    record.rejected = metadata.rejected;
    record.diagnostics = metadata.diagnostics;
    record.image = Some(image.to_path_buf());
    let snapshot_record = |snapshot: Snapshot| SnapshotRecord {
        image: image_at(snapshot.iteration),
        iteration: snapshot.iteration,
        seconds: snapshot.seconds,
        cpu_seconds: snapshot.cpu_seconds,
        light_paths: snapshot.light_paths,
        camera_paths: snapshot.camera_paths,
        rays: snapshot.rays,
        values: snapshot.values,
        masked: snapshot.masked,
    };
    record.snapshots = snapshots.into_iter().map(snapshot_record).collect();
}
