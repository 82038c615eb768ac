//! Vertex connection and merging: one engine for every set of techniques, \[VCM-TR\], [THESIS 2.4].
//!
//! An iteration traces light subpaths and keeps their vertices; connects each vertex to the camera; then traces one camera subpath a pixel, which
//! hits emitters, samples lights, and is connected to the vertices of one light subpath. Weights are those of `transport::mis`.

mod eye;
mod iteration;
mod light;
mod technique;

use super::photon_settings::SamplerName;
use super::{Common, Integrator, IterationStats, MethodError, Settings};
use crate::image::film::Film;
use crate::samplers::{PhotonSampler, Uniform};
use crate::scene::Scene;
use crate::targets::points::DepthRange;
use crate::transport::mis::{Heuristic, Sampling, Techniques, Weights};
use crate::transport::subpath::Subpaths;
use crate::transport::walk::Tally;
use clap::Args;
use iteration::Iteration;
use light::{Batch, LightSide};
use serde::{Deserialize, Serialize};

pub use technique::{Technique, TechniqueName};

/// Settings of `bdpt`: the engine without merges.
#[derive(Args, Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct BdptSettings {
    /// Photon sampler
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub sampler: SamplerName,
    /// Light paths per iteration; default one a pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=u64::from(u32::MAX)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photons: Option<u64>,
    /// One technique, with weight 1: for tests.
    #[arg(long, hide = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alone: Option<Technique>,
}

impl Settings for BdptSettings {
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError> {
        if self.sampler != SamplerName::Uniform {
            let message = "only --sampler uniform draws light paths for connections as yet".into();
            return Err(MethodError::Settings { method: "bdpt", message });
        }
        if self.photons == Some(0) {
            return Err(MethodError::Settings { method: "bdpt", message: "--photons must be at least 1".into() });
        }
        Ok(Box::new(Engine {
            scene,
            common: common.clone(),
            size,
            techniques: Techniques::BDPT,
            heuristic: Heuristic::default(),
            photon_count: self.photons.unwrap_or((size.0 * size.1) as u64),
            roughness_threshold: 0.0,
            alone: self.alone,
        }))
    }
}

/// The engine bound to a scene.
struct Engine<'a> {
    scene: &'a Scene,
    common: Common,
    size: (usize, usize),
    techniques: Techniques,
    heuristic: Heuristic,
    photon_count: u64,
    roughness_threshold: f32,
    alone: Option<Technique>,
}

impl Engine<'_> {
    fn depths(&self) -> DepthRange {
        DepthRange { min: self.common.min_depth, max: self.common.max_depth.unwrap_or(u32::MAX) }
    }

    /// Light subpaths of an iteration, their splats in the film.
    fn shoot(&self, iteration: &Iteration<'_, '_>, film: &mut Film, stats: &mut IterationStats) -> LightSide {
        // A path of one edge is a light seen directly, and left to the camera's side.
        let count = if iteration.depths.max > 1 { self.photon_count } else { 0 };
        let mut sampler = Uniform { seed: self.common.seed };
        let keep = |batch: &mut Batch, path: &_, drawn| iteration.keep(batch, path, drawn);
        let draw = sampler.draw(iteration, iteration.index, count, Batch::default, keep);
        stats.light_paths += draw.traced;
        draw.batches.iter().for_each(|batch| stats.count(&batch.tally));
        if self.techniques.light_tracing {
            film.add_splats(&draw.batches, count);
        }
        LightSide::new(draw)
    }
}

impl Integrator for Engine<'_> {
    fn prepare(&mut self) -> Result<IterationStats, MethodError> {
        Ok(IterationStats::default())
    }

    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats {
        let mut stats = IterationStats { camera_paths: (self.size.0 * self.size.1) as u64, ..Default::default() };
        let sampling =
            Sampling { techniques: self.techniques, heuristic: self.heuristic, light_paths: self.photon_count as f64, radius: 1.0 };
        let weights = Weights::new(&sampling);
        let subpaths = Subpaths {
            scene: self.scene,
            weights: &weights,
            roughness_threshold: self.roughness_threshold,
            photons: None,
            classes: self.common.paths.is_some(),
        };
        let iteration = Iteration {
            subpaths,
            techniques: self.techniques,
            common: &self.common,
            index: i,
            size: self.size,
            depths: self.depths(),
            alone: self.alone,
        };
        let light = self.shoot(&iteration, film, &mut stats);
        let sample = |tally: &mut Tally, x: usize, y: usize| iteration.pixel(x, y, &light, tally);
        film.add_eye_samples(Tally::default, sample, |tally| stats.count(&tally));
        stats
    }
}
