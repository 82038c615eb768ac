//! Stochastic progressive photon mapping: one measurement point a pixel an iteration, photons gathered around it.
//!
//! \[HACHISUKA09\] with the global radius schedule of \[KNAUS11\]: iterations are independent given their index. Every path is counted once:
//! its first event on the camera's side at a lobe rougher than the threshold is the gather; a path without one is seen directly or
//! through a smooth chain, and its emission is added here. The estimate is biased by the finite radius and consistent for alpha < 1.

use super::photon_settings::{PhotonSettings, SamplerName};
use super::{Common, Integrator, IterationStats, MethodError, Settings};
use crate::image::film::Film;
use crate::math::Rgb;
use crate::photons::grid::{Photon, PhotonGrid};
use crate::photons::radius::shrink;
use crate::samplers::{Drawn, Key, PhotonSampler, Purpose, Stream, Uniform, UniformStream};
use crate::scene::Scene;
use crate::scene::bsdf::{Lobes, Mode};
use crate::targets::{LightPath, LightPaths};
use crate::transport::shading::{SurfacePoint, sides_agree};
use crate::transport::walk::{Roulette, Start, Step, Tally, beyond_emitters, walk};
use clap::Args;
use glam::Vec2;
use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

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
        self.photons.validate().map_err(|message| MethodError::Settings { method: "sppm", message })?;
        let SamplerName::Uniform = self.photons.sampler;
        if common.paths.is_some() {
            let message =
                "--paths: photons do not keep the class of their path; use --min-depth and --max-depth, or the method path".into();
            return Err(MethodError::Settings { method: "sppm", message });
        }
        let threshold = self.photons.roughness_threshold.unwrap_or(ROUGHNESS_THRESHOLD);
        Ok(Box::new(Sppm {
            scene,
            common: common.clone(),
            size,
            settings: self.photons.clone(),
            threshold,
            photon_count: self.photons.photons.unwrap_or((size.0 * size.1) as u64),
            cell: 0.0,
        }))
    }
}

/// How the radius is given.
#[derive(Clone, Copy, Debug)]
enum Radius {
    World(f32),
    Footprints(f32),
}

/// SPPM bound to a scene.
struct Sppm<'a> {
    scene: &'a Scene,
    common: Common,
    size: (usize, usize),
    settings: PhotonSettings,
    threshold: f32,
    photon_count: u64,
    /// Side of a grid cell at iteration 0.
    cell: f32,
}

/// Where a camera subpath measures: the first vertex whose event is at a rough lobe.
struct MeasurementPoint<'a> {
    point: SurfacePoint<'a>,
    throughput: Rgb,
    /// Camera edges to here.
    depth: u32,
    /// Path length times the pixel's size on the unit plane, world units.
    footprint: f32,
}

impl Sppm<'_> {
    fn radius_at(&self, i: u64) -> Radius {
        let factor = shrink(i, self.settings.alpha);
        match self.settings.radius {
            Some(r) => Radius::World((r * factor) as f32),
            None => Radius::Footprints((self.settings.radius_pixels.unwrap_or(1.0) * factor) as f32),
        }
    }

    fn max_depth(&self) -> u32 {
        self.common.max_depth.unwrap_or(u32::MAX)
    }

    /// Light subpaths to photons, sorted into a grid.
    fn shoot(&self, i: u64, stats: &mut IterationStats) -> (PhotonGrid, Vec<f64>) {
        let paths = LightPaths {
            scene: self.scene,
            roughness_threshold: self.threshold,
            // One more edge joins a photon to the camera.
            max_depth: self.max_depth().saturating_sub(1).min(u32::from(u16::MAX)),
            rr_depth: self.common.rr_depth,
        };
        let keep = |(photons, tally): &mut (Vec<Photon>, Tally), path: &LightPath, drawn: Drawn| {
            tally.add(&path.tally);
            photons.extend(path.vertices.iter().map(|v| Photon {
                p: v.end.p,
                n_g: v.end.n_g,
                wi: v.wi,
                flux: v.flux * drawn.weight as f32,
                depth: v.depth as u16,
                stratum: drawn.stratum as u16,
            }));
        };
        let mut sampler = Uniform { seed: self.common.seed };
        let count = if paths.max_depth == 0 { 0 } else { self.photon_count };
        let draw = sampler.draw(&paths, i, count, || (Vec::new(), Tally::default()), keep);
        let mut photons = Vec::with_capacity(draw.batches.iter().map(|(p, _)| p.len()).sum());
        for (batch, tally) in draw.batches {
            photons.extend(batch);
            stats.count(&tally);
        }
        stats.light_paths += draw.traced;
        let cell = self.cell * shrink(i, self.settings.alpha) as f32;
        (PhotonGrid::build(photons, cell), draw.scales)
    }

    /// A camera subpath: emission along its smooth chain, and the point where it measures, if it comes to one.
    fn measure<S: Stream>(&self, film: Vec2, lens: Vec2, stream: &mut S, tally: &mut Tally) -> (Rgb, Option<MeasurementPoint<'_>>) {
        let camera = self.scene.camera();
        let camera_ray = camera.ray(film, lens);
        let mut start = Start { ray: camera_ray.ray, throughput: Rgb::WHITE, length: camera_ray.start };
        if self.common.hide_emitters {
            let (ray, passed) = beyond_emitters(self.scene, start.ray, tally);
            start = Start { ray, length: start.length + passed, ..start };
        }
        let (mut emission, mut measured) = (Rgb::BLACK, None);
        let counts = |depth: u32| {
            let hidden = depth == 1 && self.common.hide_emitters;
            !hidden && depth >= self.common.min_depth && depth <= self.max_depth()
        };
        let roulette = Roulette { depth: self.common.rr_depth };
        let escape = walk(self.scene, Mode::Radiance, start, roulette, stream, tally, |vertex, stream, _| {
            if vertex.hit.emitter.is_some() && counts(vertex.depth) {
                emission += vertex.throughput * self.scene.emitted(&vertex.hit, -vertex.d, vertex.from).radiance;
            }
            let Some(point) = vertex.point else { return Step::Scatter(Lobes::All, 1.0) };
            if vertex.depth >= self.max_depth() {
                return Step::Stop;
            }
            match split(&point, self.threshold, stream) {
                Split::Gather(probability) => {
                    measured = Some(MeasurementPoint {
                        point,
                        throughput: vertex.throughput * (1.0 / probability),
                        depth: vertex.depth,
                        footprint: vertex.length * camera.pixel_on_unit_plane(),
                    });
                    Step::Stop
                }
                Split::Continue(probability) => Step::Scatter(Lobes::Smooth(self.threshold), probability),
                Split::Absorbed => Step::Stop,
            }
        });
        if let Some(escape) = escape
            && counts(escape.depth)
        {
            emission += escape.throughput * self.scene.escaped(escape.ray.d).radiance;
        }
        (emission, measured)
    }

    /// Flux density around a measurement point, per stratum scaled, times throughput and BSDF.
    fn gather(&self, at: &MeasurementPoint<'_>, radius: Radius, grid: &PhotonGrid, scales: &[f64]) -> Rgb {
        let radius = match radius {
            Radius::World(r) => r,
            Radius::Footprints(p) => p * at.footprint,
        };
        let mut sum = Rgb::BLACK;
        let (max_depth, min_depth) = (self.max_depth(), self.common.min_depth);
        grid.query(at.point.end.p, radius, |photon, _| {
            let depth = at.depth + u32::from(photon.depth);
            if depth <= max_depth && depth >= min_depth {
                sum += merge(&at.point, photon, self.threshold) * scales[usize::from(photon.stratum)] as f32;
            }
        });
        at.throughput * sum * (1.0 / (PI * radius * radius))
    }

    /// Median footprint over pixel centres, on a key of its own ([interface: Footprint]).
    fn median_footprint(&self, stats: &mut IterationStats) -> Option<f32> {
        let mut tally = Tally::default();
        let mut footprints: Vec<f32> = Vec::new();
        for y in 0..self.size.1 {
            for x in 0..self.size.0 {
                let mut stream = pixel_stream(0, 0, self.size.0, x, y, Purpose::Pilot);
                let lens = Vec2::from(stream.next_2d());
                let film = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                footprints.extend(self.measure(film, lens, &mut stream, &mut tally).1.map(|m| m.footprint));
            }
        }
        stats.camera_paths += (self.size.0 * self.size.1) as u64;
        stats.count(&tally);
        let middle = footprints.len() / 2;
        (!footprints.is_empty()).then(|| *footprints.select_nth_unstable_by(middle, f32::total_cmp).1)
    }
}

impl Integrator for Sppm<'_> {
    fn prepare(&mut self) -> Result<IterationStats, MethodError> {
        let mut stats = IterationStats::default();
        // The grid's cells are as wide as a typical query, so that one touches about two runs a row.
        self.cell = match self.radius_at(0) {
            Radius::World(r) => 2.0 * r,
            // Without any measurement point the grid is never asked.
            Radius::Footprints(p) => 2.0 * p * self.median_footprint(&mut stats).unwrap_or(1.0),
        };
        Ok(stats)
    }

    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats {
        let mut stats = IterationStats::default();
        let (grid, scales) = self.shoot(i, &mut stats);
        let radius = self.radius_at(i);
        let width = self.size.0;
        let sample = |tally: &mut Tally, x: usize, y: usize| {
            let mut stream = pixel_stream(self.common.seed, i, width, x, y, Purpose::Camera);
            let jitter = Vec2::from(stream.next_2d());
            let lens = Vec2::from(stream.next_2d());
            let position = Vec2::new(x as f32, y as f32) + jitter;
            let (emission, measured) = self.measure(position, lens, &mut stream, tally);
            let value = emission + measured.map_or(Rgb::BLACK, |m| self.gather(&m, radius, &grid, &scales));
            tally.finite(value)
        };
        film.add_eye_samples(Tally::default, sample, |tally| stats.count(&tally));
        stats.camera_paths += (self.size.0 * self.size.1) as u64;
        stats
    }
}

fn pixel_stream(seed: u64, iteration: u64, width: usize, x: usize, y: usize, purpose: Purpose) -> UniformStream {
    Key { seed, iteration, index: (y * width + x) as u64, purpose }.stream()
}

/// What a camera subpath does at a vertex, with the probability of the choice.
enum Split {
    Gather(f32),
    Continue(f32),
    Absorbed,
}

/// Lobes at least as rough as the threshold are gathered at, the others are followed: one set is chosen by its albedo. A coordinate is
/// drawn only where there is a choice.
fn split<S: Stream>(point: &SurfacePoint<'_>, threshold: f32, stream: &mut S) -> Split {
    let rough = point.bsdf.albedo(point.uv, point.given_local, Lobes::Rough(threshold));
    let smooth = point.bsdf.albedo(point.uv, point.given_local, Lobes::Smooth(threshold));
    match (rough > 0.0, smooth > 0.0) {
        (false, false) => Split::Absorbed,
        (true, false) => Split::Gather(1.0),
        (false, true) => Split::Continue(1.0),
        (true, true) => {
            let probability = rough / (rough + smooth);
            if stream.next_1d() < probability { Split::Gather(probability) } else { Split::Continue(1.0 - probability) }
        }
    }
}

/// The largest angle between the normals of a photon and of a measurement point that takes it: 60 degrees. It keeps light from the other
/// side of thin objects and from around corners; what it removes near a corner is part of the radius' bias.
const NORMAL_COSINE: f32 = 0.5;

/// What one photon inside the disk adds: `f flux |wi.n_s|/|wi.n_g|`. Photons arrive per geometric area, so the shading cosine enters as a
/// ratio ([VEACH 5.3]).
fn merge(at: &SurfacePoint<'_>, photon: &Photon, threshold: f32) -> Rgb {
    let (n_g, n_s) = (at.end.n_g, at.frame.n);
    if photon.n_g.dot(n_g) < NORMAL_COSINE || !sides_agree(photon.wi, n_g, n_s) {
        return Rgb::BLACK;
    }
    let wi = at.frame.to_local(photon.wi);
    let ratio = wi.z.abs() / photon.wi.dot(n_g).abs();
    at.bsdf.eval(at.uv, wi, at.given_local, Lobes::Rough(threshold)) * photon.flux * ratio
}
