//! References: those given, those found in a cache, and those that have to be made. All end up in the study's folder, so that a report needs
//! nothing outside of it.

use super::{Study, Watch};
use crate::image::exr::read_file;
use crate::image::file::replace;
use crate::image::picture::{ImageError, Picture};
use crate::render::{Interrupt, Metadata, Progress, Reference, SceneRecord, Step};
use crate::scene::mitsuba::LoadedScene;
use crate::study::error::StudyError;
use crate::study::hash::{of_bytes, of_json, short};
use crate::study::plan::{PlanError, ScenePlan};
use crate::study::records::{MadeReference, Record, RecordFile, ReferenceRecord};
use crate::study::references::{About, FIRST_SEED, Files, Job, RunProgress, make};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A reference that the study file names.
pub struct Given {
    /// Bytes of the files.
    mean: Vec<u8>,
    var: Option<Vec<u8>>,
    hash: String,
    noise: Option<f64>,
    /// What the file says about itself, if this program made it.
    metadata: Option<Metadata>,
}

/// Reads what a scene names, and refuses pictures of another size than the scene's.
pub(super) fn read(scene: &ScenePlan, loaded: &LoadedScene) -> Result<Option<Given>, StudyError> {
    let Some(path) = &scene.reference else { return Ok(None) };
    let (mean, metadata) = checked(path, scene, loaded)?;
    let var = scene.reference_var.as_ref().map(|path| Ok::<_, StudyError>((bytes(path)?, checked(path, scene, loaded)?.0))).transpose()?;
    let noise = var.as_ref().map(|(_, variance)| average(&mean, variance));
    let (mean, var) = (bytes(path)?, var.map(|(bytes, _)| bytes));
    let hash = of_bytes(&[&mean, var.as_deref().unwrap_or_default()]);
    Ok(Some(Given { mean, var, hash, noise, metadata }))
}

fn bytes(path: &Path) -> Result<Vec<u8>, StudyError> {
    std::fs::read(path).map_err(StudyError::io(path))
}

fn checked(path: &Path, scene: &ScenePlan, loaded: &LoadedScene) -> Result<(Picture, Option<Metadata>), StudyError> {
    let file = read_file(path)?;
    let metadata = file.metadata.as_deref().and_then(|text| serde_json::from_str(text).ok());
    let picture = file.picture()?;
    let (found, film) = (picture.size(), loaded.scene.camera().resolution());
    if found != film {
        let message = format!("{} is {}x{} pixels, the scene {}x{}", path.display(), found.0, found.1, film.0, film.1);
        let help = format!("resolution = \"{}x{}\" renders the scene at the reference's size", found.0, found.1);
        return Err(PlanError::new(&scene.position, message).help(help).into());
    }
    Ok((picture, metadata))
}

/// Mean of a variance over pixels and channels, where it and the mean are finite.
fn average(mean: &Picture, variance: &Picture) -> f64 {
    let finite = mean.pixels.iter().zip(&variance.pixels).filter(|(m, v)| m.is_finite() && v.is_finite());
    let (sum, count) = finite.fold((0.0, 0_u64), |(sum, count), (_, v)| (sum + (0..3).map(|c| f64::from(v[c])).sum::<f64>(), count + 3));
    sum / count.max(1) as f64
}

impl Study {
    fn job<'a>(&'a self, scene: &'a ScenePlan, loaded: &'a LoadedScene) -> Job<'a> {
        let recipe = &self.plan.reference;
        Job {
            loaded,
            scene: SceneRecord { path: scene.file.display().to_string(), hash: loaded.content_hash.clone() },
            changes: &scene.changes,
            method: recipe.method,
            settings: recipe.settings.as_ref(),
            runs: recipe.runs,
            first_seed: FIRST_SEED,
            budget: recipe.until.budget(),
        }
    }

    /// Hash of each scene's reference: of its bytes if it is given, else of all that decides it.
    pub(super) fn reference_hashes(&self) -> Vec<String> {
        let hash = |((scene, loaded), given): ((&ScenePlan, &LoadedScene), &Option<Given>)| match given {
            Some(given) => given.hash.clone(),
            None => {
                let job = self.job(scene, loaded);
                of_json(&json!({
                    "version": env!("CARGO_PKG_VERSION"),
                    "scene": loaded.content_hash,
                    "method": job.method.name,
                    "settings": job.settings_json(),
                    "runs": job.runs,
                    "first_seed": job.first_seed,
                    "budget": self.plan.reference.until,
                }))
            }
        };
        self.plan.scenes.iter().zip(&self.scenes).zip(&self.given).map(hash).collect()
    }

    /// Refuses to compare an image with itself: no cell may be a run of its own reference.
    pub(super) fn check_references(&self) -> Result<(), StudyError> {
        for ((scene, loaded), given) in self.plan.scenes.iter().zip(&self.scenes).zip(&self.given) {
            let job = self.job(scene, loaded);
            let (name, settings, seeds) = match given {
                None => (job.method.name, job.settings_json(), job.seeds().collect()),
                Some(Given { metadata: Some(m), .. }) if m.scene.hash == loaded.content_hash => {
                    (m.method.as_str(), m.settings.clone(), m.runs.iter().map(|run| run.seed).collect::<Vec<u64>>())
                }
                Some(_) => continue,
            };
            for method in self.plan.methods.iter().filter(|method| method.method.name == name) {
                let common = scene.changes.common(0, &loaded.defaults);
                let own = scene.changes.settings_json(method.settings.as_ref(), &common, &loaded.film);
                if let Some(seed) = self.plan.seeds.iter().find(|seed| own == settings && seeds.contains(seed)) {
                    return Err(StudyError::SameRun { scene: scene.name.clone(), method: method.label.clone(), seed: *seed });
                }
            }
        }
        Ok(())
    }

    /// Puts every scene's reference into the folder and on record; hash and picture by scene, or `None` if a signal came first.
    pub(super) fn references(
        &self,
        folder: &Path,
        records: &[Record],
        file: &mut RecordFile,
        watch: &mut dyn Watch,
        interrupt: &Interrupt,
    ) -> Result<Option<Vec<(String, Reference)>>, StudyError> {
        let home = folder.join("references");
        std::fs::create_dir_all(&home).map_err(StudyError::io(&home))?;
        let mut references = Vec::new();
        for (i, hash) in self.reference_hashes().into_iter().enumerate() {
            let files = Files::named(&home.join(short(&hash)));
            let Some(record) = self.reference(i, &hash, &files, watch, interrupt)? else { return Ok(None) };
            let known = |r: &Record| matches!(r, Record::Reference(old) if (&old.scene, &old.hash) == (&record.scene, &record.hash));
            if !records.iter().any(known) {
                file.append(&Record::Reference(record))?;
            }
            let picture = read_file(&files.mean)?.picture()?;
            references.push((hash, Reference { path: files.mean, picture }));
        }
        Ok(Some(references))
    }

    /// One scene's, in these files.
    fn reference(
        &self,
        scene: usize,
        hash: &str,
        files: &Files,
        watch: &mut dyn Watch,
        interrupt: &Interrupt,
    ) -> Result<Option<ReferenceRecord>, StudyError> {
        let (plan, loaded) = (&self.plan.scenes[scene], &self.scenes[scene]);
        let inside = |path: &Path| path.file_name().map_or_else(PathBuf::new, |name| Path::new("references").join(name));
        let size = loaded.scene.camera().resolution();
        let record = |made: Option<MadeReference>, var: bool, noise| ReferenceRecord {
            scene: plan.name.clone(),
            mean: inside(&files.mean),
            var: var.then(|| inside(&files.var)),
            hash: hash.to_owned(),
            made,
            size,
            noise,
        };
        if let Some(given) = &self.given[scene] {
            copy(&given.mean, &files.mean)?;
            if let Some(var) = &given.var {
                copy(var, &files.var)?;
            }
            return Ok(Some(record(None, given.var.is_some(), given.noise)));
        }
        let about = match self.cached(hash, files)? {
            Some(about) => about,
            None => {
                let failed = |source| StudyError::Reference { scene: plan.name.clone(), source };
                let mut steps = ReferenceSteps { watch, scene: &plan.name };
                let Some(about) = make(&self.job(plan, loaded), files, &mut steps, interrupt).map_err(failed)? else { return Ok(None) };
                self.keep(hash, files)?;
                about
            }
        };
        let made = MadeReference {
            method: about.method,
            settings: about.settings,
            seeds: about.seeds,
            iterations: about.iterations,
            seconds: about.seconds,
        };
        Ok(Some(record(Some(made), true, Some(about.noise))))
    }
}

impl Study {
    /// The files of a reference in the shared cache, if there is one.
    fn cache(&self, hash: &str) -> Option<Files> {
        self.plan.reference.cache.as_ref().map(|folder| Files::named(&folder.join(short(hash))))
    }

    /// A reference made before, in the study's folder or in the cache.
    fn cached(&self, hash: &str, files: &Files) -> Result<Option<About>, StudyError> {
        if let Some(about) = files.complete() {
            files.tidy();
            return Ok(Some(about));
        }
        let Some((shared, about)) = self.cache(hash).and_then(|shared| shared.complete().map(|about| (shared, about))) else {
            return Ok(None);
        };
        transfer(&shared, files)?;
        Ok(Some(about))
    }

    /// Leaves a reference just made to other studies.
    fn keep(&self, hash: &str, files: &Files) -> Result<(), StudyError> {
        let (Some(shared), Some(folder)) = (self.cache(hash), &self.plan.reference.cache) else { return Ok(()) };
        std::fs::create_dir_all(folder).map_err(StudyError::io(folder))?;
        transfer(files, &shared)
    }
}

/// Copies a complete reference; what says that it is complete comes last.
fn transfer(from: &Files, to: &Files) -> Result<(), StudyError> {
    for (from, to) in [(&from.mean, &to.mean), (&from.var, &to.var), (&from.about, &to.about)] {
        copy(&bytes(from)?, to)?;
    }
    Ok(())
}

/// Writes a file unless it is there with this content.
fn copy(content: &[u8], to: &Path) -> Result<(), StudyError> {
    if std::fs::read(to).is_ok_and(|there| there == content) {
        return Ok(());
    }
    Ok(replace(to, |out| out.write_all(content).map_err(|error| ImageError::io(to, error)))?)
}

/// Passes the runs of a reference on.
struct ReferenceSteps<'a> {
    watch: &'a mut dyn Watch,
    scene: &'a str,
}

impl Progress for ReferenceSteps<'_> {
    fn step(&mut self, step: Step) {
        self.watch.step(step);
    }
    fn finish(&mut self) {}
}

impl RunProgress for ReferenceSteps<'_> {
    fn begin(&mut self, run: u64, runs: u64) {
        self.watch.reference(self.scene, run, runs);
    }
}
