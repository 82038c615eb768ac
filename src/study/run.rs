//! The loop over scenes, methods and seeds.
//!
//! For each seed, for each scene, every method: a machine that slows down hurts all methods alike. The method that comes first changes with the
//! seed. A cell is recorded when its image is on the disk, so that a study killed at any moment goes on with the first cell not on record.

mod cell;
mod folder;
mod given;
mod resume;

pub use given::Given;

use super::error::StudyError;
use super::machine::{machine, now};
use super::plan::{PlanError, StudyPlan, Until};
use super::records::{CellRecord, Record, RecordFile, SCHEMA, Status, StudyRecord};
use crate::render::{Interrupt, Progress, Reference, Step};
use crate::scene::mitsuba::{LoadedScene, load};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Instant;

/// One image of a study: places in the plan's lists, and a seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// Place among the scenes.
    pub scene: usize,
    /// Place among the methods.
    pub method: usize,
    /// The seed.
    pub seed: u64,
}

/// Where a study stands when a cell begins.
#[derive(Clone, Debug)]
pub struct Standing<'a> {
    /// The scene's name.
    pub scene: &'a str,
    /// The method's label.
    pub method: &'a str,
    /// The seed.
    pub seed: u64,
    /// Number of the cell in the whole study, from 1.
    pub number: usize,
    /// Cells of the whole study.
    pub cells: usize,
    /// Cells not done yet, with this one.
    pub left: usize,
    /// Seconds until all is done, where cells of each kind left have been seen or have a budget of time.
    pub remaining: Option<f64>,
}

/// Somebody who wants to know how far a study is.
pub trait Watch: Send {
    /// A run of a scene's reference begins; `run` counts from 0.
    fn reference(&mut self, scene: &str, run: u64, runs: u64);
    /// A cell begins.
    fn begin(&mut self, standing: &Standing);
    /// The render under way has done something.
    fn step(&mut self, step: Step);
    /// A cell ended.
    fn end(&mut self, record: &CellRecord);
}

/// What came of a study.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Cells of the whole study.
    pub cells: usize,
    /// Cells rendered now.
    pub rendered: usize,
    /// Cells done, now or before.
    pub done: usize,
    /// Cells that failed, now or before.
    pub failed: Vec<CellRecord>,
    /// The signal that ended it early.
    pub interrupted: Option<i32>,
}

/// How to go about it.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The command as typed, for the record.
    pub command: Vec<String>,
    /// Render the cells again that failed before.
    pub retry: bool,
}

/// A checked study with its scenes loaded.
pub struct Study {
    /// The plan.
    pub plan: StudyPlan,
    scenes: Vec<LoadedScene>,
    given: Vec<Option<Given>>,
}

impl Study {
    /// Loads the scenes and the references given, and checks what needs them: sizes, and settings that no scene takes.
    pub fn open(plan: StudyPlan) -> Result<Self, StudyError> {
        let load = |s: &super::plan::ScenePlan| load(&s.file, &s.changes.load_options());
        let scenes = plan.scenes.iter().map(load).collect::<Result<Vec<_>, _>>()?;
        let given = plan.scenes.iter().zip(&scenes).map(|(scene, loaded)| given::read(scene, loaded)).collect::<Result<Vec<_>, _>>()?;
        let study = Self { plan, scenes, given };
        study.check_settings()?;
        study.check_references()?;
        Ok(study)
    }

    /// Cells in the order in which they are rendered.
    pub fn cells(&self) -> Vec<Cell> {
        let (scenes, methods) = (self.plan.scenes.len(), self.plan.methods.len());
        let of_seed = |(turn, &seed): (usize, &u64)| {
            (0..scenes).flat_map(move |scene| (0..methods).map(move |m| Cell { scene, method: (m + turn) % methods, seed }))
        };
        self.plan.seeds.iter().enumerate().flat_map(of_seed).collect()
    }

    /// A method that no scene takes has wrong settings; one that some scenes refuse fails in these cells.
    fn check_settings(&self) -> Result<(), StudyError> {
        for method in &self.plan.methods {
            let mut refused = None;
            for (scene, loaded) in self.plan.scenes.iter().zip(&self.scenes) {
                let common = scene.changes.common(0, &loaded.defaults);
                match method.settings.build(&loaded.scene, loaded.scene.camera().resolution(), &common) {
                    Ok(_) => {
                        refused = None;
                        break;
                    }
                    Err(error) => refused = Some(error.to_string()),
                }
            }
            if let Some(message) = refused {
                // The message names the option as on the command line; the key is the same with underscores.
                let named = method.keys.iter().find(|(key, _)| message.contains(&format!("--{} ", key.replace('_', "-"))));
                let position = named.map_or(&method.position, |(_, position)| position);
                return Err(PlanError::new(position, message).into());
            }
        }
        Ok(())
    }

    /// What a cell's result depends on, but for the method's own reference.
    fn cell_hash(&self, cell: Cell, reference: &str) -> String {
        resume::cell_hash(&self.plan, &self.scenes[cell.scene], cell, &self.settings(cell), reference)
    }

    /// All settings of a cell but its seed.
    fn settings(&self, cell: Cell) -> Value {
        let (scene, loaded) = (&self.plan.scenes[cell.scene], &self.scenes[cell.scene]);
        let common = scene.changes.common(cell.seed, &loaded.defaults);
        scene.changes.settings_json(self.plan.methods[cell.method].settings.as_ref(), &common, &loaded.film)
    }

    /// Cells that a folder has no record of. Reads only.
    pub fn left(&self, folder: &Path) -> Result<Vec<Cell>, StudyError> {
        let records = if folder.join("records.jsonl").is_file() { super::records::read(folder)? } else { Vec::new() };
        resume::check(folder, &records, &self.plan_json())?;
        let hashes = self.reference_hashes();
        let on_record: BTreeSet<&str> = records.iter().filter_map(cell_of).map(|cell| cell.cell_hash.as_str()).collect();
        Ok(self.cells().into_iter().filter(|cell| !on_record.contains(self.cell_hash(*cell, &hashes[cell.scene]).as_str())).collect())
    }

    fn plan_json(&self) -> Value {
        resume::plan_json(&self.plan, &self.scenes, &self.reference_hashes(), rayon::current_num_threads())
    }

    /// Renders what a folder does not hold yet, on the threads of the current pool.
    pub fn run(&self, folder: &Path, options: &Options, watch: &mut dyn Watch, interrupt: &Interrupt) -> Result<Summary, StudyError> {
        std::fs::create_dir_all(folder).map_err(StudyError::io(folder))?;
        let (mut file, records) = RecordFile::open(folder)?;
        let plan = self.plan_json();
        resume::check(folder, &records, &plan)?;
        folder::clean(folder)?;
        file.append(&Record::Study(Box::new(self.record(options, plan))))?;
        let Some(references) = self.references(folder, &records, &mut file, watch, interrupt)? else {
            return Ok(Summary { cells: self.cells().len(), interrupted: interrupt.signal(), ..Summary::default() });
        };
        let mut run = Run { study: self, folder, references, file, pace: Pace::new(&self.plan, &records), ended: BTreeMap::new() };
        run.ended = records.iter().filter_map(cell_of).map(|cell| (cell.cell_hash.clone(), cell.clone())).collect();
        if options.retry {
            run.ended.retain(|_, cell| cell.status == Status::Done);
        }
        run.cells(watch, interrupt)
    }

    fn record(&self, options: &Options, plan: Value) -> StudyRecord {
        StudyRecord {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION").to_string(),
            command: options.command.clone(),
            file: self.plan.file.display().to_string(),
            plan_hash: resume::plan_hash(&plan),
            plan,
            machine: machine(rayon::current_num_threads()),
            started: now(),
        }
    }
}

fn cell_of(record: &Record) -> Option<&CellRecord> {
    match record {
        Record::Cell(cell) => Some(cell),
        _ => None,
    }
}

/// A study under way.
struct Run<'a> {
    study: &'a Study,
    folder: &'a Path,
    /// Hash and picture, by scene.
    references: Vec<(String, Reference)>,
    file: RecordFile,
    pace: Pace,
    /// Records by the hash of their cell.
    ended: BTreeMap<String, CellRecord>,
}

impl Run<'_> {
    /// Renders the cells without a record.
    fn cells(&mut self, watch: &mut dyn Watch, interrupt: &Interrupt) -> Result<Summary, StudyError> {
        let cells = self.study.cells();
        let hashes: Vec<String> = cells.iter().map(|c| self.study.cell_hash(*c, &self.references[c.scene].0)).collect();
        let mut left: Vec<usize> = (0..cells.len()).filter(|i| !self.ended.contains_key(&hashes[*i])).collect();
        let mut summary = Summary { cells: cells.len(), ..Summary::default() };
        left.reverse();
        while let Some(&i) = left.last() {
            if interrupt.signal().is_some() {
                break;
            }
            let cell = cells[i];
            let (scene, method) = (&self.study.plan.scenes[cell.scene].name, &self.study.plan.methods[cell.method].label);
            let remaining = self.pace.remaining(left.iter().map(|i| cells[*i]));
            let (number, count) = (cells.len() - left.len() + 1, cells.len());
            watch.begin(&Standing { scene, method, seed: cell.seed, number, cells: count, left: left.len(), remaining });
            let start = Instant::now();
            let Some(record) =
                cell::render_cell(self.study, cell, &hashes[i], self.folder, &self.references[cell.scene].1, watch, interrupt)?
            else {
                break;
            };
            self.file.append(&Record::Cell(Box::new(record.clone())))?;
            watch.end(&record);
            self.pace.add(cell, start.elapsed().as_secs_f64());
            self.ended.insert(hashes[i].clone(), record);
            summary.rendered += 1;
            left.pop();
        }
        summary.interrupted = interrupt.signal().filter(|_| !left.is_empty());
        let of_study = hashes.iter().filter_map(|hash| self.ended.get(hash));
        summary.failed = of_study.clone().filter(|cell| cell.status == Status::Failed).cloned().collect();
        summary.done = of_study.count() - summary.failed.len();
        Ok(summary)
    }
}

/// How long cells take.
struct Pace {
    /// Sum and number of wall seconds, by scene and method.
    seen: BTreeMap<(usize, usize), (f64, u32)>,
    until: Vec<Until>,
}

impl Pace {
    fn new(plan: &StudyPlan, records: &[Record]) -> Self {
        let mut pace = Self { seen: BTreeMap::new(), until: plan.methods.iter().map(|m| m.until).collect() };
        for record in records.iter().filter_map(cell_of).filter(|cell| cell.status == Status::Done) {
            let scene = plan.scenes.iter().position(|s| s.name == record.scene);
            let method = plan.methods.iter().position(|m| m.label == record.method);
            if let (Some(scene), Some(method)) = (scene, method) {
                pace.add(Cell { scene, method, seed: record.seed }, record.seconds);
            }
        }
        pace
    }

    fn add(&mut self, cell: Cell, seconds: f64) {
        let (sum, count) = self.seen.entry((cell.scene, cell.method)).or_default();
        (*sum, *count) = (*sum + seconds, *count + 1);
    }

    /// Seconds for cells to come: what cells of the same scene and method took; before the first of them its budget, if that is a time.
    fn remaining(&self, mut cells: impl Iterator<Item = Cell>) -> Option<f64> {
        cells.try_fold(0.0, |sum, cell| {
            let seen = self.seen.get(&(cell.scene, cell.method)).map(|(sum, count)| sum / f64::from(*count));
            let planned = match self.until[cell.method] {
                Until::Time(seconds) => Some(seconds),
                Until::Iterations(_) | Until::Photons(_) => None,
            };
            Some(sum + seen.or(planned)?)
        })
    }
}

/// Passes a render's steps on.
struct Steps<'a>(&'a mut dyn Watch);

impl Progress for Steps<'_> {
    fn step(&mut self, step: Step) {
        self.0.step(step);
    }
    fn finish(&mut self) {}
}
