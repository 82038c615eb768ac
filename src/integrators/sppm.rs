//! Stochastic progressive photon mapping: one measurement point a pixel an iteration, photons gathered around it.
//!
//! \[HACHISUKA09\] with the global radius schedule of \[KNAUS11\]. Every path is counted once: its first event on the camera's side at a lobe
//! rougher than the threshold is the gather; a path without one is seen directly or through a smooth chain, and its emission is added here.
//! The estimate is biased by the finite radius and consistent for alpha < 1.
//!
//! With the uniform sampler photons come first and measurement points gather and are gone (`uniform`): an iteration depends on its index alone.
//! A sampler with a target needs the points first (`aimed`).

mod aimed;
mod uniform;

use super::aimed::Aimed;
use super::chains::ChainReport;
use super::eye::{Eye, Radius, Seen};
use super::photon_settings::{GlossyPaths, PhotonSettings};
use super::{Common, Integrator, IterationStats, MethodError, Settings};
use crate::image::film::Film;
use crate::math::Rgb;
use crate::photons::radius::shrink;
use crate::scene::Scene;
use crate::targets::LightPaths;
use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Default roughness threshold of SPPM.
const ROUGHNESS_THRESHOLD: f32 = 0.05;

/// SPPM's settings: the photon options and nothing else.
#[derive(Args, Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SppmSettings {
    /// Photon options.
    #[command(flatten)]
    #[serde(flatten)]
    pub photons: PhotonSettings,
}

impl Settings for SppmSettings {
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError> {
        let settings = |message| MethodError::Settings { method: "sppm", message };
        self.photons.validate().map_err(settings)?;
        if common.paths.is_some() {
            let message =
                "--paths: photons do not keep the class of their path; use --min-depth and --max-depth, or the method path".into();
            return Err(settings(message));
        }
        let threshold = self.photons.roughness_threshold.unwrap_or(ROUGHNESS_THRESHOLD);
        let eye = Eye { scene, common: common.clone(), size, threshold };
        let aimed = self.photons.ladder().map(|ladder| Aimed::new(&self.photons, &ladder, common.seed));
        let photon_count = self.photons.photon_count(size);
        Ok(Box::new(Sppm { eye, settings: self.photons.clone(), photon_count, cell: 0.0, aimed, counts: Counts::default() }))
    }
}

/// Images of densities, by their numbers; the second only where targets read regions.
const DENSITY_IMAGES: &[&str] = &["density", "density.region"];
const DENSITY: usize = 0;
const REGION_DENSITY: usize = 1;

/// SPPM bound to a scene.
struct Sppm<'a> {
    eye: Eye<'a>,
    settings: PhotonSettings,
    photon_count: u64,
    /// Side of a cell of the uniform sampler's grid at iteration 0.
    cell: f32,
    /// Chains and their targets; `None` with the uniform sampler.
    aimed: Option<Aimed>,
    counts: Counts,
}

/// What an iteration counts beside rays and paths.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    /// Pairs of a light vertex and a measurement point that took it.
    deposits: u64,
    glossy: Glossy,
}

impl Counts {
    fn add(&mut self, other: &Counts) {
        self.deposits += other.deposits;
        self.glossy.add(&other.glossy);
    }
}

/// Camera subpaths that met a smooth lobe that was no delta and no rough one, and what they saw: left out in [STF 5].
#[derive(Clone, Copy, Debug, Default)]
struct Glossy {
    paths: u64,
    luminance: f64,
    samples: u64,
}

impl Glossy {
    fn add(&mut self, other: &Glossy) {
        self.paths += other.paths;
        self.luminance += other.luminance;
        self.samples += other.samples;
    }

    fn see(&mut self, seen: &Seen<'_>) {
        self.paths += u64::from(seen.unmeasured);
        self.luminance += f64::from(seen.glossy.luminance());
        self.samples += 1;
    }
}

impl<'a> Sppm<'a> {
    fn radius_at(&self, i: u64) -> Radius {
        let factor = shrink(i, self.settings.alpha);
        match self.settings.radius {
            Some(r) => Radius::World((r * factor) as f32),
            None => Radius::Footprints((self.settings.radius_pixels.unwrap_or(1.0) * factor) as f32),
        }
    }

    /// One more edge joins a photon to the camera.
    fn light_paths(&self) -> LightPaths<'a> {
        LightPaths {
            scene: self.eye.scene,
            roughness_threshold: self.eye.threshold,
            max_depth: self.eye.depths().max.saturating_sub(1).min(u32::from(u16::MAX)),
            rr_depth: self.eye.common.rr_depth,
        }
    }

    /// Emission that counts.
    fn emission(&self, seen: &Seen<'_>) -> Rgb {
        match self.settings.glossy_paths {
            GlossyPaths::Keep => seen.emission + seen.glossy,
            GlossyPaths::Drop => seen.emission,
        }
    }
}

impl Integrator for Sppm<'_> {
    fn prepare(&mut self) -> Result<IterationStats, MethodError> {
        let mut stats = IterationStats::default();
        match self.aimed.take() {
            Some(mut aimed) => {
                // Without any measurement point the grid is never asked.
                self.cell = 2.0 * aimed.prepare(&self.eye, self.radius_at(0), &mut stats).unwrap_or(1.0);
                self.aimed = Some(aimed);
            }
            // The grid's cells are as wide as a typical query, so that one touches about two runs a row.
            None => {
                self.cell = match self.radius_at(0) {
                    Radius::World(r) => 2.0 * r,
                    // Without any measurement point the grid is never asked.
                    Radius::Footprints(p) => 2.0 * p * self.eye.median_footprint(&mut stats).unwrap_or(1.0),
                };
            }
        }
        Ok(stats)
    }

    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats {
        let mut stats = IterationStats { camera_paths: self.eye.pixels() as u64, ..IterationStats::default() };
        let counts = match self.aimed.take() {
            Some(mut aimed) => {
                let rests = aimed.rests(self.photon_count);
                let counts =
                    if rests { self.iterate_uniform(i, film, &mut stats) } else { self.iterate_aimed(&mut aimed, i, film, &mut stats) };
                self.aimed = Some(aimed);
                counts
            }
            None => self.iterate_uniform(i, film, &mut stats),
        };
        self.counts.add(&counts);
        stats
    }

    fn stateless(&self) -> bool {
        self.aimed.is_none()
    }

    fn diagnostics(&self) -> Option<Value> {
        let Counts { deposits, glossy } = self.counts;
        let mut document = json!({ "deposits": deposits });
        if glossy.paths > 0 {
            document["glossy_paths"] = json!({
                "camera_paths": glossy.paths,
                "mean_luminance": glossy.luminance / glossy.samples.max(1) as f64,
                "counted": self.settings.glossy_paths == GlossyPaths::Keep,
            });
        }
        if let Some(aimed) = &self.aimed {
            document["sampler"] = aimed.report().to_json();
        }
        Some(document)
    }

    fn density_images(&self) -> Result<&'static [&'static str], MethodError> {
        let regions = self.aimed.as_ref().is_some_and(Aimed::has_regions);
        Ok(if regions { DENSITY_IMAGES } else { &DENSITY_IMAGES[..1] })
    }

    fn chains(&self) -> Option<ChainReport> {
        self.aimed.as_ref().map(Aimed::report)
    }
}
