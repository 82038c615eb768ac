//! Path tracing: next event estimation and BSDF sampling joined by the power heuristic [VEACH 9.2]. The oracle of all other methods:
//! it shares the scene and the rule for shading normals with them, and no random walk, no photon, no recursive weight.
//!
//! A tile of pixels advances together, one edge at a time: all rays of the tile are traced, then every path that met something is
//! shaded, then all rays to lights are traced. No path knows of another; the tile is there for the processor, which works on
//! several of them at once.

mod block;
mod diffuse;
mod follow;

use super::{Common, Integrator, IterationStats, MethodError, Settings};
use crate::image::film::Film;
use crate::math::Rgb;
use crate::samplers::{Key, Purpose, Stream};
use crate::scene::Scene;
use crate::scene::bsdf::Mode;
use crate::scene::emitter::EmitterKind;
use crate::scene::hit::Hit;
use crate::scene::ray::Ray;
use crate::transport::shading::{SurfacePoint, sides_agree};
use crate::transport::walk::{CEILING, Tally, beyond_emitters};
use block::{Arrival, Block, Unshadowed, Walk};
use clap::Args;
use follow::{AnyClass, Follow, Matching};
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::ops::{Add, Div, Mul};

/// Width and height, in pixels, of the tile whose paths advance together.
const TILE: [usize; 2] = [32, 8];

/// The path tracer has no settings of its own.
#[derive(Args, Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct PathSettings {}

impl Settings for PathSettings {
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError> {
        Ok(Box::new(Path { scene, width: size.0, common: common.clone(), tile: TILE }))
    }
}

struct Path<'a> {
    scene: &'a Scene,
    width: usize,
    common: Common,
    /// Width and height of the tile whose paths advance together; nothing but speed depends on it.
    tile: [usize; 2],
}

impl Integrator for Path<'_> {
    fn prepare(&mut self) -> Result<IterationStats, MethodError> {
        Ok(IterationStats::default())
    }

    /// One sample a pixel.
    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats {
        match &self.common.paths {
            None => self.sample_pixels(i, film, &AnyClass),
            Some(pattern) => self.sample_pixels(i, film, &Matching::new(pattern)),
        }
    }
}

/// Power heuristic with exponent 2 for one sample of each technique [VEACH 9.2]: the weight of the technique whose density is `a`.
#[inline(always)]
fn power_heuristic<T: Copy + From<f32> + Add<Output = T> + Mul<Output = T> + Div<Output = T>>(a: T, b: T) -> T {
    // As a ratio: squares of large densities overflow.
    let ratio = b / a;
    T::from(1.0) / (T::from(1.0) + ratio * ratio)
}

impl<'a> Path<'a> {
    /// One sample a pixel; `eye` is the class of a path that has only begun.
    fn sample_pixels<F: Follow>(&self, i: u64, film: &mut Film, eye: &F) -> IterationStats {
        let mut stats = IterationStats { camera_paths: (film.width() * film.height()) as u64, ..Default::default() };
        let sample = |block: &mut Block<'a, F>, pixels: &[usize], radiances: &mut [Rgb]| {
            let mut tally = Tally::default();
            self.start(i, pixels, eye, block, &mut tally);
            radiances.fill(Rgb::BLACK);
            for depth in 1..=self.common.max_depth.unwrap_or(u32::MAX) {
                if block.live.is_empty() {
                    break;
                }
                self.advance(depth, block, radiances, &mut tally);
            }
            radiances.iter_mut().for_each(|radiance| *radiance = tally.finite(*radiance));
            tally
        };
        let paths = self.tile[0] * self.tile[1];
        film.add_eye_tiles(self.tile, || Block::new(paths), sample, |tally| stats.count(&tally));
        stats
    }

    /// Fills the block with a random camera ray through each of these pixels.
    fn start<F: Follow>(&self, i: u64, pixels: &[usize], eye: &F, block: &mut Block<'a, F>, tally: &mut Tally) {
        block.clear();
        for &pixel in pixels {
            let (x, y) = (pixel % self.width, pixel / self.width);
            let mut stream = Key { seed: self.common.seed, iteration: i, index: pixel as u64, purpose: Purpose::Camera }.stream();
            let film = Vec2::new(x as f32, y as f32) + Vec2::from(stream.next_2d());
            let lens = Vec2::from(stream.next_2d());
            let camera_ray = self.scene.camera().ray(film, lens);
            let mut ray = camera_ray.ray;
            if self.common.hide_emitters {
                ray = beyond_emitters(self.scene, ray, tally).0;
            }
            let from = camera_ray.end.p;
            block.push(Walk { stream, throughput: Rgb::WHITE, eta: 1.0, from, sampled_pdf: None, follow: eye.clone() }, ray);
        }
    }

    /// Takes every live path of the block along its edge number `depth` and, where it goes on, chooses the next one.
    fn advance<F: Follow>(&self, depth: u32, block: &mut Block<'a, F>, radiances: &mut [Rgb], tally: &mut Tally) {
        tally.rays += block.rays.len() as u64;
        self.scene.trace_each(&block.rays, &mut block.hits);
        self.arrive(depth, block, radiances, tally);
        block.diffuse.look_up();
        self.find_light(depth, block, radiances, tally);
        self.scatter(depth, block);
        self.scene.occluded_each(&block.shadow_rays, &mut block.blocked);
        for (light, _) in block.lights.iter().zip(&block.blocked).filter(|(_, blocked)| !**blocked) {
            radiances[light.walk as usize] += light.value;
        }
    }

    /// Adds the emission that paths meet, and finds the surfaces from which they may go on.
    fn arrive<F: Follow>(&self, depth: u32, block: &mut Block<'a, F>, radiances: &mut [Rgb], tally: &mut Tally) {
        let Block { walks, live, rays, hits, arrivals, diffuse, .. } = block;
        let last = Some(depth) == self.common.max_depth;
        let in_eights = F::EVERY && self.scene.lights_by_area();
        let roulette = depth >= self.common.rr_depth;
        arrivals.clear();
        diffuse.clear();
        for ((&number, ray), hit) in live.iter().zip(rays.iter()).zip(hits.iter()) {
            if last && hit.is_some_and(|raw| !self.scene.shines(&raw)) {
                continue;
            }
            let walk = &mut walks[number as usize];
            let hit = hit.as_ref().map(|raw| self.scene.hit(ray, raw));
            if let Some(emission) = self.emission(depth, walk, ray, hit.as_ref()) {
                radiances[number as usize] += emission;
            }
            let Some(hit) = hit.filter(|_| !last) else { continue };
            let bsdf = self.scene.bsdf(hit.shape);
            let z = -ray.d.dot(hit.frame.n);
            if in_eights && let Some((texture, side)) = bsdf.as_diffuse(z) {
                if !sides_agree(-ray.d, hit.end.n_g, hit.frame.n) {
                    tally.sides_disagree += 1;
                } else if z * side > 0.0 {
                    diffuse.push((number, walk), &hit, (texture, side), roulette, |u_pick, u| self.scene.sample_light_point(u_pick, u));
                }
                continue;
            }
            let Some(point) = SurfacePoint::new(&hit, bsdf, ray.d) else {
                tally.sides_disagree += 1;
                continue;
            };
            walk.throughput *= walk.follow.choose_lobes(&point, &mut walk.stream);
            arrivals.push(Arrival { walk: number, point });
        }
    }

    /// What a path gains by the emission it meets; `None` where nothing shines.
    #[inline(always)]
    fn emission<F: Follow>(&self, depth: u32, walk: &Walk<F>, ray: &Ray, hit: Option<&Hit>) -> Option<Rgb> {
        let emitted = match hit {
            Some(hit) if hit.emitter.is_none() => return None,
            // A copy: what is lent out must lie in memory, and few hits shine.
            Some(hit) => self.scene.emitted(&{ *hit }, -ray.d, walk.from),
            None => self.scene.escaped(ray.d),
        };
        let hidden = depth == 1 && self.common.hide_emitters;
        if emitted.radiance.is_black() || depth < self.common.min_depth || hidden || !walk.follow.emission_counts() {
            return None;
        }
        let weight = walk.sampled_pdf.map_or(1.0, |pdf| power_heuristic(pdf, emitted.pdf_direct.0));
        Some(walk.throughput * emitted.radiance * weight)
    }

    /// Next event estimation: a light sample for every surface point, and the ray that tells whether it counts.
    fn find_light<F: Follow>(&self, depth: u32, block: &mut Block<'a, F>, radiances: &mut [Rgb], tally: &mut Tally) {
        let Block { walks, arrivals, diffuse, lights, shadow_rays, .. } = block;
        lights.clear();
        shadow_rays.clear();
        if depth + 1 >= self.common.min_depth {
            diffuse.find_light(|light, ray| {
                tally.rays += 1;
                if ray.d == Vec3::ZERO {
                    radiances[light.walk as usize] += light.value;
                } else {
                    lights.push(light);
                    shadow_rays.push(ray);
                }
            });
        }
        for &Arrival { walk: number, ref point } in arrivals.iter() {
            let walk = &mut walks[number as usize];
            let u_emitter = walk.stream.next_1d();
            let u_light = Vec2::from(walk.stream.next_2d());
            if point.bsdf.max_roughness() <= 0.0 {
                continue;
            }
            let Some(light) = self.scene.sample_direct(point.end.p, u_emitter, u_light) else { continue };
            let (f, pdf) = point.eval_pdf(light.wi, Mode::Radiance, walk.follow.lobes());
            if f.is_black() || depth + 1 < self.common.min_depth || !walk.follow.light_counts() {
                continue;
            }
            let reachable = matches!(light.kind, EmitterKind::Surface | EmitterKind::Infinite);
            let weight = if reachable { power_heuristic(light.pdf.0, pdf) } else { 1.0 };
            let cos = light.wi.dot(point.frame.n).abs();
            let value = walk.throughput * f * light.radiance * (cos * weight / light.pdf.0);
            tally.rays += 1;
            match self.scene.shadow_ray(&point.end, &light) {
                Some(ray) => {
                    lights.push(Unshadowed { walk: number, value });
                    shadow_rays.push(ray);
                }
                None => radiances[number as usize] += value,
            }
        }
    }

    /// BSDF sampling and Russian roulette: the next ray of every path that goes on.
    fn scatter<F: Follow>(&self, depth: u32, block: &mut Block<'a, F>) {
        let Block { walks, live, rays, arrivals, diffuse, .. } = block;
        live.clear();
        rays.clear();
        diffuse.scatter(depth >= self.common.rr_depth, walks, live, rays);
        for &Arrival { walk: number, ref point } in arrivals.iter() {
            let walk = &mut walks[number as usize];
            let u_lobe = walk.stream.next_1d();
            let u_direction = Vec2::from(walk.stream.next_2d());
            let Some(scattered) = point.sample(Mode::Radiance, walk.follow.lobes(), u_lobe, u_direction) else { continue };
            walk.throughput *= scattered.weight;
            walk.eta *= scattered.eta;
            walk.follow.scatter(scattered.delta);
            walk.from = point.end.p;
            walk.sampled_pdf = (!scattered.delta).then_some(scattered.pdf_fwd);
            if depth >= self.common.rr_depth {
                // The squared index undoes the compression of radiance inside glass, which is no loss.
                let survival = (walk.throughput.max_component() * walk.eta * walk.eta).min(CEILING);
                if walk.stream.next_1d() >= survival {
                    continue;
                }
                walk.throughput *= 1.0 / survival;
            } else if walk.throughput.is_black() {
                continue;
            }
            live.push(number);
            rays.push(point.end.ray(scattered.d));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::bsdf::Lobes;
    use crate::scene::mitsuba::{LoadOptions, load};

    /// Tiles are there for speed: neither the picture nor the counts depend on their size, whether or not it divides the film's.
    #[test]
    fn tiles_of_any_size_give_the_same_bits() {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bench/cornell-box/scene.xml");
        let (width, height) = (19, 7);
        let loaded = load(&file, &LoadOptions { resolution: Some((width as u32, height as u32)), ..Default::default() }).unwrap();
        let pattern = crate::transport::class::pattern("LDD?E").unwrap();
        for paths in [None, Some(pattern)] {
            let common = Common { seed: 5, max_depth: Some(6), min_depth: 2, rr_depth: 3, hide_emitters: true, paths };
            let render = |tile: [usize; 2]| {
                let mut film = Film::new(width, height, true);
                let mut path = Path { scene: &loaded.scene, width, common: common.clone(), tile };
                let mut stats = IterationStats::default();
                for i in 0..3 {
                    stats.add(&path.iterate(i, &mut film));
                    film.finish_iteration();
                }
                (film, stats)
            };
            let one = render([1, 1]);
            assert!(one.0.mean().iter().any(|c| !c.is_black()));
            for tile in [[2, 1], [1, 3], [5, 2], [width, height], [32, 8]] {
                assert!(render(tile) == one, "tiles of {tile:?}");
            }
        }
    }

    /// Every path counts, but none is done eight at a time.
    #[derive(Clone)]
    struct OneByOne;

    impl Follow for OneByOne {
        const EVERY: bool = false;

        fn choose_lobes<S: Stream>(&mut self, _point: &SurfacePoint<'_>, _stream: &mut S) -> f32 {
            1.0
        }

        fn lobes(&self) -> Lobes {
            Lobes::All
        }

        fn emission_counts(&self) -> bool {
            true
        }

        fn light_counts(&mut self) -> bool {
            true
        }

        fn scatter(&mut self, _delta: bool) {}
    }

    /// Diffuse vertices done eight at a time are those done one by one: pictures and counts, to the bit. Among the scenes are textures, both
    /// sides, glass, bent normals, lights of many kinds, and one whose lights forbid it.
    #[test]
    fn eight_at_a_time_give_the_bits_of_one_by_one() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut by_area = 0;
        for name in [
            "tests/bench/cornell-box",
            "scenes/textured-room",
            "scenes/glass-box",
            "tests/scenes/twosided",
            "tests/scenes/emitter-textured",
            "tests/scenes/emitter-shapes",
            "tests/scenes/disk-cylinder",
            "tests/scenes/obj-normals",
        ] {
            let (width, height) = (21, 13);
            let options = LoadOptions { resolution: Some((width as u32, height as u32)), ..Default::default() };
            let loaded = load(&root.join(name).join("scene.xml"), &options).unwrap();
            by_area += usize::from(loaded.scene.lights_by_area());
            for min_depth in [1, 3] {
                let common = Common { seed: 5, max_depth: Some(9), min_depth, rr_depth: 3, hide_emitters: false, paths: None };
                let path = Path { scene: &loaded.scene, width, common, tile: TILE };
                let (mut eight, mut one) = (Film::new(width, height, false), Film::new(width, height, false));
                for i in 0..4 {
                    let counts = path.sample_pixels(i, &mut eight, &AnyClass);
                    assert_eq!(counts, path.sample_pixels(i, &mut one, &OneByOne), "{name}");
                }
                assert!(eight == one, "{name}");
            }
        }
        assert!((4..8).contains(&by_area), "{by_area} scenes whose lights are points by area");
    }

    #[test]
    fn weights_of_two_techniques_sum_to_one() {
        for (a, b) in [(1.0f32, 1.0), (1e30, 1e-30), (3e20, 2e20), (0.1, 0.7)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-6);
        }
        // Independent form.
        assert!((power_heuristic(2.0f32, 3.0) - 4.0 / 13.0).abs() < 1e-7);
    }
}
