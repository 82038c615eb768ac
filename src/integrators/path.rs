//! Path tracing: next event estimation and BSDF sampling joined by the power heuristic [VEACH 9.2]. The oracle of all other methods:
//! it shares the scene and the rule for shading normals with them, and no random walk, no photon, no recursive weight.

use super::{Common, Integrator, IterationStats, MethodError, Settings};
use crate::image::film::Film;
use crate::math::Rgb;
use crate::samplers::{Key, Purpose, Stream};
use crate::scene::Scene;
use crate::scene::bsdf::{Lobes, Mode};
use crate::scene::emitter::EmitterKind;
use crate::transport::class::PathClass;
use crate::transport::shading::SurfacePoint;
use crate::transport::walk::{CEILING, Tally, beyond_emitters};
use clap::Args;
use glam::Vec2;
use serde::{Deserialize, Serialize};

/// The path tracer has no settings of its own.
#[derive(Args, Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct PathSettings {}

impl Settings for PathSettings {
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError> {
        Ok(Box::new(Path { scene, width: size.0, common: common.clone() }))
    }
}

struct Path<'a> {
    scene: &'a Scene,
    width: usize,
    common: Common,
}

impl Integrator for Path<'_> {
    fn prepare(&mut self) -> Result<IterationStats, MethodError> {
        Ok(IterationStats::default())
    }

    /// One sample a pixel.
    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats {
        let mut stats = IterationStats { camera_paths: (film.width() * film.height()) as u64, ..Default::default() };
        let sample = |tally: &mut Tally, x: usize, y: usize| {
            let index = (y * self.width + x) as u64;
            let mut stream = Key { seed: self.common.seed, iteration: i, index, purpose: Purpose::Camera }.stream();
            let value = match &self.common.paths {
                None => self.radiance::<_, false>(x, y, &mut stream, tally),
                Some(_) => self.radiance::<_, true>(x, y, &mut stream, tally),
            };
            tally.finite(value)
        };
        film.add_eye_samples(Tally::default, sample, |tally| stats.count(&tally));
        stats
    }
}

/// Power heuristic with exponent 2 for one sample of each technique [VEACH 9.2]: the weight of the technique whose density is `a`.
#[inline(always)]
fn power_heuristic(a: f32, b: f32) -> f32 {
    // As a ratio: squares of large densities overflow.
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}

impl Path<'_> {
    /// Radiance along a random camera ray through a pixel. `CLASSES` follows one set of lobes a vertex, so that every path has a class.
    fn radiance<S: Stream, const CLASSES: bool>(&self, x: usize, y: usize, stream: &mut S, tally: &mut Tally) -> Rgb {
        let scene = self.scene;
        let max_depth = self.common.max_depth.unwrap_or(u32::MAX);
        let film = Vec2::new(x as f32, y as f32) + Vec2::from(stream.next_2d());
        let lens = Vec2::from(stream.next_2d());
        let camera_ray = scene.camera().ray(film, lens);

        let mut sum = Rgb::BLACK;
        let mut ray = camera_ray.ray;
        if self.common.hide_emitters {
            ray = beyond_emitters(scene, ray, tally).0;
        }
        let mut throughput = Rgb::WHITE;
        let mut eta = 1.0f32;
        // Where the last direction left from, and its density; `None` where next event estimation could not have found it.
        let mut from = camera_ray.end.p;
        let mut sampled_pdf = None;
        let mut class = PathClass::default();
        let counts = |depth: u32, class: &PathClass| {
            depth >= self.common.min_depth
                && !(depth == 1 && self.common.hide_emitters)
                && (!CLASSES || self.common.paths.as_ref().is_none_or(|pattern| class.matches(pattern)))
        };

        for depth in 1..=max_depth {
            // ---- Emission met by the ray
            tally.rays += 1;
            let hit = scene.intersect(&ray);
            let emitted = match &hit {
                Some(hit) if hit.emitter.is_none() => None,
                // A copy: what is lent out must lie in memory, and few hits shine.
                Some(hit) => Some(scene.emitted(&{ *hit }, -ray.d, from)),
                None => Some(scene.escaped(ray.d)),
            };
            if let Some(emitted) = emitted
                && counts(depth, &class)
            {
                let weight = sampled_pdf.map_or(1.0, |pdf| power_heuristic(pdf, emitted.pdf_direct.0));
                sum += throughput * emitted.radiance * weight;
            }
            let Some(hit) = hit else { break };
            if depth == max_depth {
                break;
            }

            // ---- The surface
            let Some(point) = SurfacePoint::new(&hit, scene.bsdf(hit.shape), ray.d) else {
                tally.sides_disagree += 1;
                break;
            };
            let mut lobes = Lobes::All;
            if CLASSES {
                let diffuse = point.bsdf.albedo(point.uv, point.given_local, Lobes::Rough(1.0));
                let rest = point.bsdf.albedo(point.uv, point.given_local, Lobes::Smooth(1.0));
                let probability = diffuse / (diffuse + rest);
                let choose_diffuse = stream.next_1d() < probability;
                lobes = if choose_diffuse { Lobes::Rough(1.0) } else { Lobes::Smooth(1.0) };
                throughput *= 1.0 / if choose_diffuse { probability } else { 1.0 - probability };
            }

            // ---- Next event estimation
            let u_emitter = stream.next_1d();
            let u_light = Vec2::from(stream.next_2d());
            if point.bsdf.max_roughness() > 0.0
                && let Some(light) = scene.sample_direct(point.end.p, u_emitter, u_light)
            {
                let (f, pdf) = point.eval_pdf(light.wi, Mode::Radiance, lobes);
                if CLASSES {
                    class.push(if lobes == Lobes::Rough(1.0) { b'D' } else { b'G' });
                }
                if !f.is_black() && counts(depth + 1, &class) {
                    tally.rays += 1;
                    if scene.visible(&point.end, &light) {
                        let reachable = matches!(light.kind, EmitterKind::Surface | EmitterKind::Infinite);
                        let weight = if reachable { power_heuristic(light.pdf.0, pdf) } else { 1.0 };
                        let cos = light.wi.dot(point.frame.n).abs();
                        sum += throughput * f * light.radiance * (cos * weight / light.pdf.0);
                    }
                }
                if CLASSES {
                    class.pop();
                }
            }

            // ---- BSDF sampling
            let u_lobe = stream.next_1d();
            let u_direction = Vec2::from(stream.next_2d());
            let Some(scattered) = point.sample(Mode::Radiance, lobes, u_lobe, u_direction) else { break };
            throughput *= scattered.weight;
            eta *= scattered.eta;
            if CLASSES {
                class.push(if scattered.delta {
                    b'S'
                } else if lobes == Lobes::Rough(1.0) {
                    b'D'
                } else {
                    b'G'
                });
            }
            from = point.end.p;
            sampled_pdf = (!scattered.delta).then_some(scattered.pdf_fwd);

            // ---- Russian roulette
            if depth >= self.common.rr_depth {
                // The squared index undoes the compression of radiance inside glass, which is no loss.
                let survival = (throughput.max_component() * eta * eta).min(CEILING);
                if stream.next_1d() >= survival {
                    break;
                }
                throughput *= 1.0 / survival;
            } else if throughput.is_black() {
                break;
            }
            ray = point.end.ray(scattered.d);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::power_heuristic;

    #[test]
    fn weights_of_two_techniques_sum_to_one() {
        for (a, b) in [(1.0, 1.0), (1e30, 1e-30), (3e20, 2e20), (0.1, 0.7)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-6);
        }
        // Independent form.
        assert!((power_heuristic(2.0, 3.0) - 4.0 / 13.0).abs() < 1e-7);
    }
}
