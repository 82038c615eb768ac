//! Vertex connection and merging: one engine for every set of techniques, \[VCM-TR\], [THESIS 2.4].
//!
//! An iteration traces light subpaths, connects their vertices to the camera and keeps them; then it traces one camera subpath a pixel, which
//! hits emitters, samples lights, is connected to the vertices of one light subpath, and merges with those of all that lie near. Weights are
//! those of `transport::mis`.
//!
//! A sampler with a target needs to know first what the camera sees (`aimed`).

mod aimed;
mod density;
mod eye;
mod iteration;
mod light;
mod pairing;
mod pyramid;
mod settings;
mod shadows;
mod technique;

use super::aimed::Aimed;
use super::chains::ChainReport;
use super::eye::Eye;
use super::photon_settings::PhotonSettings;
use super::{Common, Integrator, IterationStats, MethodError};
use crate::image::film::Film;
use crate::image::layers::Layer;
use crate::photons::Grid;
use crate::photons::density::{DensityMap, DensitySettings};
use crate::photons::radius::shrink;
use crate::samplers::{Drawn, PhotonSampler, Uniform};
use crate::scene::Scene;
use crate::scene::hit::Endpoint;
use crate::targets::points::DepthRange;
use crate::transport::mis::{Heuristic, Sampling, Techniques, Weights};
use crate::transport::subpath::{Photons, Subpaths};
use iteration::Iteration;
use light::{Batch, LightSide, MergeVertex, Merging};
use pyramid::Pyramid;
use serde_json::{Value, json};

pub use settings::{BdptSettings, MergeWeightsName, SharedSettings, VcmSettings};
pub use technique::{Technique, TechniqueName};

/// What the engine is told, whichever method asks.
struct EngineSettings {
    techniques: Techniques,
    heuristic: Heuristic,
    photons: PhotonSettings,
    /// Camera subpaths a pixel and iteration.
    camera_paths: Option<u32>,
    alone: Option<Technique>,
}

/// The engine bound to a scene.
struct Engine<'a> {
    scene: &'a Scene,
    common: Common,
    size: (usize, usize),
    techniques: Techniques,
    heuristic: Heuristic,
    photons: PhotonSettings,
    /// Camera subpaths a pixel and iteration, at least 1.
    camera_paths: usize,
    /// Radius of iteration 0, world units; what it is without merges means nothing.
    radius: f64,
    /// What earlier iterations tell of how dense photons lie; `None` for heuristics that do not ask.
    density: Option<DensityMap>,
    alone: Option<Technique>,
    /// Chains and their targets; `None` with the uniform sampler.
    aimed: Option<Aimed>,
    /// Room for vertices that a batch of light subpaths wants: what the largest of the iteration before had.
    room: usize,
    /// Memory of the vertices that merge, kept between iterations: asked of the system anew it costs 2 % of the time.
    merge_vertices: Vec<MergeVertex>,
}

impl<'a> Engine<'a> {
    fn new(scene: &'a Scene, size: (usize, usize), common: &Common, settings: EngineSettings) -> Self {
        let EngineSettings { techniques, heuristic, photons, camera_paths, alone } = settings;
        let camera_paths = camera_paths.map_or_else(|| photons.balanced_camera_paths(size), |paths| paths as usize);
        let ladder = if techniques.merges { photons.ladder_of_one_radius() } else { photons.ladder() };
        let aimed = ladder.map(|ladder| Aimed::new(&photons, &ladder, common.seed));
        Self {
            scene,
            common: common.clone(),
            size,
            techniques,
            heuristic,
            photons,
            camera_paths,
            radius: 1.0,
            density: None,
            alone,
            aimed,
            room: 0,
            merge_vertices: Vec::new(),
        }
    }

    /// Camera subpaths to their first vertex that merges, or would.
    fn eye(&self) -> Eye<'a> {
        Eye { scene: self.scene, common: self.common.clone(), size: self.size, threshold: self.threshold() }
    }

    /// Do light subpaths count? A path of one edge is a light seen directly, and left to the camera's side.
    fn shines(&self) -> bool {
        self.common.max_depth.is_none_or(|most| most > 1)
    }

    /// Light subpaths an iteration, at most.
    fn light_paths(&self) -> u64 {
        self.photons.photon_count(self.size)
    }

    /// Roughness from which a surface merges.
    fn threshold(&self) -> f32 {
        self.photons.roughness_threshold.unwrap_or(0.0)
    }

    /// Path lengths that count.
    fn depths(&self) -> DepthRange {
        DepthRange { min: self.common.min_depth, max: self.common.max_depth.unwrap_or(u32::MAX) }
    }

    fn sampling(&self, i: u64) -> Sampling {
        let radius = self.radius * shrink(i, self.photons.alpha);
        let (light_paths, camera_paths) = (self.light_paths() as f64, self.camera_paths as f64);
        Sampling { techniques: self.techniques, heuristic: self.heuristic, light_paths, camera_paths, radius }
    }

    /// Iteration `i`, whose weights are made ready; `photons` is the expected number of photons that a merge finds, for heuristics that ask.
    fn iteration<'w>(&'w self, i: u64, sampling: &Sampling, weights: &'w Weights<f32>, photons: Option<Photons<'w>>) -> Iteration<'a, 'w> {
        let subpaths =
            Subpaths { scene: self.scene, weights, roughness_threshold: self.threshold(), photons, classes: self.common.paths.is_some() };
        Iteration {
            subpaths,
            techniques: self.techniques,
            common: &self.common,
            index: i,
            size: self.size,
            depths: self.depths(),
            radius: sampling.radius as f32,
            light_paths: sampling.light_paths,
            camera_paths: self.camera_paths,
            merge_density: (1.0 / (sampling.merge_area() * sampling.light_paths)) as f32,
            gain: None,
            alone: self.alone,
            records: false,
        }
    }

    /// Light subpaths of an iteration, their splats in the film.
    fn shoot(&self, iteration: &Iteration<'_, '_>, film: &mut Film, stats: &mut IterationStats) -> LightSide {
        let count = if self.shines() { self.light_paths() } else { 0 };
        let mut sampler = Uniform { seed: self.common.seed };
        let keep = |batch: &mut Batch, path: &_, drawn: &[Drawn]| iteration.keep(batch, path, drawn);
        let mut draw = sampler.draw(iteration, iteration.index, count, || Batch::with_room(self.room), keep);
        iteration.finish(&mut draw.batches);
        stats.light_paths += draw.traced;
        draw.batches.iter().for_each(|batch| stats.count(&batch.tally));
        if self.techniques.light_tracing {
            film.add_splats(&draw.batches, count);
            iteration.record_splats(film, draw.batches.iter().flat_map(|batch| &batch.recorded), stats);
        }
        LightSide::new(draw.batches, None)
    }
}

impl Integrator for Engine<'_> {
    fn prepare(&mut self) -> Result<IterationStats, MethodError> {
        let mut stats = IterationStats::default();
        if self.techniques.merges {
            self.radius = match self.photons.radius {
                Some(radius) => radius,
                None => {
                    // Where no pixel's centre shows a surface that merges, hardly any subpath will find one; a scene without extent has none.
                    let fallback = |extent: f32| if extent > 0.0 { 1e-3 * extent } else { 1.0 };
                    let footprint = self.eye().median_footprint(&mut stats).unwrap_or_else(|| fallback(self.scene.bounding_sphere().1));
                    self.photons.radius_pixels.unwrap_or(1.0) * f64::from(footprint)
                }
            };
        }
        if self.heuristic.asks_density() && self.techniques.merges {
            self.density = Some(DensityMap::new(DensitySettings::for_radius(self.radius as f32)));
        }
        if let Some(mut aimed) = self.aimed.take() {
            aimed.prepare(&self.eye(), self.measured_radius(0).0, &mut stats);
            self.aimed = Some(aimed);
        }
        Ok(stats)
    }

    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats {
        let mut stats = IterationStats { camera_paths: (self.size.0 * self.size.1 * self.camera_paths) as u64, ..Default::default() };
        let (mut density, mut aimed) = (self.density.take(), self.aimed.take());
        let merge_vertices = std::mem::take(&mut self.merge_vertices);
        let rests = aimed.as_mut().is_some_and(|aimed| !self.shines() || aimed.rests(self.light_paths()));
        let mut chains = aimed.as_mut().filter(|_| !rests);
        let sights = chains.as_mut().map(|aimed| self.aim(aimed, i, &mut stats));
        let gain = chains.as_ref().zip(sights.as_ref()).and_then(|(aimed, sights)| aimed.gain(sights));
        let mut sampling = self.sampling(i);
        if gain.is_some() && self.techniques.merges {
            sampling.heuristic = sampling.heuristic.by_photons();
        }
        let weights = Weights::new(&sampling);
        let area = sampling.merge_area() as f32;
        let photons = density.as_ref().map(|map| move |end: &Endpoint| map.photons(end.p, area));
        let fewer = gain.map(|gain| move |end: &Endpoint| gain.at(end).recip());
        let photons = match (&photons, &fewer) {
            (Some(photons), _) => Some(photons as Photons<'_>),
            (None, Some(fewer)) => Some(fewer as Photons<'_>),
            (None, None) => None,
        };
        let iteration = Iteration { gain, records: film.layers().is_some(), ..self.iteration(i, &sampling, &weights, photons) };
        let (light, sums) = match (&mut chains, &sights) {
            (Some(aimed), Some(sights)) => self.shoot_aimed((aimed, sights), &iteration, film, &mut stats),
            _ => (self.shoot(&iteration, film, &mut stats), None),
        };
        let merging = self.techniques.merges.then(|| Merging::new(&light, Grid::cell_for(iteration.radius), merge_vertices));
        iteration.camera_side(film, &light, merging.as_ref(), density.as_ref(), &mut stats);
        // Only now, when every weight of the iteration is known.
        if let (Some(map), Some(merging)) = (&mut density, &merging) {
            let grid = merging.store.grid();
            map.insert(grid.len(), |place| grid.position(place));
        }
        if let (Some(aimed), Some(sights)) = (chains, sights) {
            aimed.learn(sights, sums.as_deref());
        }
        let room = light.largest_batch();
        (self.density, self.aimed, self.room) = (density, aimed, room);
        self.merge_vertices = merging.map_or_else(Vec::new, |merging| merging.store.into_items());
        stats
    }

    fn stateless(&self) -> bool {
        self.aimed.is_none() && !(self.techniques.merges && self.heuristic.asks_density())
    }

    fn radius(&self) -> Option<f64> {
        self.techniques.merges.then_some(self.radius)
    }

    fn technique_layers(&self) -> Result<Vec<Layer>, MethodError> {
        let pyramid = Pyramid::new(self.techniques, self.depths()).ok_or(MethodError::PyramidDepth { most: pyramid::LONGEST })?;
        Ok(pyramid.layers())
    }

    fn density_images(&self) -> Result<&'static [&'static str], MethodError> {
        // The map counts light subpaths as drawn: settings allow it with independent ones alone.
        let maps = self.techniques.merges && self.heuristic.asks_density();
        if maps { Ok(&["density"]) } else { Err(MethodError::NoDensity) }
    }

    fn diagnostics(&self) -> Option<Value> {
        self.aimed.as_ref().map(|aimed| json!({ "sampler": aimed.report().to_json() }))
    }

    fn chains(&self) -> Option<ChainReport> {
        self.aimed.as_ref().map(Aimed::report)
    }
}

#[cfg(test)]
mod tests;
