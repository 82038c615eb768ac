//! The camera's side: a pixel's subpaths, and everything they are joined with.

use super::density::Joined;
use super::iteration::Iteration;
use super::light::{LightSide, LightVertex, Merging, Partner};
use super::pyramid::Recorder;
use super::shadows::Shadows;
use super::technique::Technique;
use crate::math::Rgb;
use crate::photons::Search;
use crate::samplers::{Key, Purpose, StratifiedStream, Stream};
use crate::scene::Scene;
use crate::scene::bsdf::Mode;
use crate::scene::camera::CameraRay;
use crate::scene::emitter::DirectSample;
use crate::scene::hit::Hit;
use crate::scene::ray::{RawHit, Ray};
use crate::transport::class::Letters;
use crate::transport::merge::{accepts, cosine_ratio};
use crate::transport::mis::{Carried, Connector, Edge, LightEnd};
use crate::transport::shading::SurfacePoint;
use crate::transport::subpath::{Departure, Start, SubpathVertex, Walk};
use crate::transport::survival::Met;
use crate::transport::walk::{Tally, beyond_emitters};
use glam::{Vec2, Vec3};

/// Light that reaches a pixel of a tile if the edge it came by is free.
struct Unshadowed {
    /// The pixel's place in its tile.
    place: u32,
    edges: u32,
    technique: Technique,
    value: Rgb,
    /// With weight 1.
    all: Rgb,
}

/// Width and height, in pixels, of the tile whose edges are traced together.
pub(super) const TILE: [usize; 2] = [64, 4];

/// A camera subpath under way.
struct Walker<'a> {
    /// Its pixel's place in the tile.
    place: u32,
    stream: StratifiedStream,
    seen: CameraRay,
    walk: Walk,
    /// The last vertex it reached.
    vertex: Option<SubpathVertex<'a>>,
    partner: Option<Partner<'a>>,
    /// What it brought, without light that may be shadowed.
    sum: Rgb,
}

/// Numbers of the subpaths that walk, of those whose vertex is joined to light, and of those that merge there; rays of the first, and
/// what they hit.
#[derive(Default)]
struct Waves {
    walking: Vec<u32>,
    joining: Vec<u32>,
    merging: Vec<u32>,
    rays: Vec<Ray>,
    hits: Vec<Option<RawHit>>,
    /// A search a subpath.
    searches: Vec<Search>,
}

/// Camera subpaths that go together. As many have rays enough for packets, and what they keep stays near the processor.
const TOGETHER: usize = 64;

/// Memory of a tile, used again for the next.
#[derive(Default)]
pub(super) struct TileMemory<'a> {
    walkers: Vec<Walker<'a>>,
    waves: Waves,
    shadows: Shadows<Unshadowed>,
    /// What reached each pixel by edges that are free.
    lit: Vec<Rgb>,
}

/// What the camera subpaths of a tile leave, beside its colours.
pub(super) struct Tile<'m, 'a, R> {
    pub(super) tally: Tally,
    pub(super) record: R,
    pub(super) memory: &'m mut TileMemory<'a>,
}

impl<R: Recorder> Tile<'_, '_, R> {
    /// A path of so many edges to the pixel at `place`, if nothing is on `ray`; `value` says what it brings with the technique's weight.
    #[inline(always)]
    fn join(&mut self, place: u32, ray: impl FnOnce() -> Ray, edges: u32, technique: Technique, weight: f32, value: impl Fn(f32) -> Rgb) {
        let weighted = value(weight);
        let all = if R::ON { value(1.0) } else { weighted };
        if !all.is_black() {
            self.tally.rays += 1;
            self.memory.shadows.push(ray(), Unshadowed { place, edges, technique, value: weighted, all });
        }
    }

    fn light_up(&mut self, scene: &Scene) {
        let Self { tally, record, memory: TileMemory { shadows, lit, .. } } = self;
        shadows.trace(scene, |Unshadowed { place, edges, technique, value, all }| {
            record.add(edges, technique, value, all);
            lit[place as usize] += tally.finite(value);
        });
    }
}

impl<'a> Iteration<'a, '_> {
    /// What the camera subpaths of a tile's pixels find, for each pixel their mean.
    ///
    /// [`TOGETHER`] subpaths go one edge at a time, and at their vertices one technique at a time: rays are traced together, photons are
    /// asked for long before they are needed, and the processor keeps to one piece of the program. Every pixel's sums have the order they
    /// would have if its subpaths went alone.
    pub(super) fn tile<R: Recorder>(&self, pixels: &[usize], values: &mut [Rgb], joined: &Joined<'a>, tile: &mut Tile<'_, 'a, R>) {
        let scene = self.subpaths.scene;
        tile.memory.lit.clear();
        tile.memory.lit.resize(pixels.len(), Rgb::BLACK);
        values.fill(Rgb::BLACK);
        // Records are kept pixel by pixel.
        let together = if R::ON { 1 } else { TOGETHER };
        for (number, (pixels, values)) in pixels.chunks(together).zip(values.chunks_mut(together)).enumerate() {
            tile.record.start(pixels[0]);
            for path in 0..self.camera_paths {
                self.camera_subpaths((number * together, pixels), path, values, joined, tile);
            }
            if R::ON {
                tile.light_up(scene);
            }
        }
        tile.light_up(scene);
        values.iter_mut().zip(&tile.memory.lit).for_each(|(value, lit)| *value += *lit);
    }

    /// Adds what subpath number `path` of each pixel brings to that mean; light that may be shadowed is left to the tile.
    fn camera_subpaths<R: Recorder>(
        &self,
        (place, pixels): (usize, &[usize]),
        path: usize,
        values: &mut [Rgb],
        joined: &Joined<'a>,
        tile: &mut Tile<'_, 'a, R>,
    ) {
        let mut walkers = std::mem::take(&mut tile.memory.walkers);
        walkers.clear();
        for (i, &pixel) in pixels.iter().enumerate() {
            walkers.push(self.start((pixel, (place + i) as u32), path, joined.light, &mut tile.tally));
        }
        let mut waves = std::mem::take(&mut tile.memory.waves);
        waves.walking.clear();
        waves.walking.extend(0..walkers.len() as u32);
        waves.searches.resize(walkers.len().max(waves.searches.len()), Search::default());
        while !waves.walking.is_empty() {
            self.advance(&mut walkers, &mut waves, tile);
            self.join(&mut walkers, &mut waves, joined, tile);
            waves.walking.retain(|&i| {
                let Walker { walk, vertex, stream, .. } = &mut walkers[i as usize];
                vertex.as_ref().is_some_and(|vertex| {
                    let goes_on = vertex.carried.edges < self.depths.max;
                    goes_on && self.subpaths.go_on(Mode::Radiance, walk, vertex, stream, &mut tile.tally)
                })
            });
        }
        values.iter_mut().zip(&walkers).for_each(|(value, walker)| *value += walker.sum);
        (tile.memory.walkers, tile.memory.waves) = (walkers, waves);
    }

    /// A camera subpath on its first edge.
    fn start(&self, (pixel, place): (usize, u32), path: usize, light: &'a LightSide, tally: &mut Tally) -> Walker<'a> {
        let (x, y) = (pixel % self.size.0, pixel / self.size.0);
        let of_all = self.index * self.camera_paths as u64 + path as u64;
        let mut stream = Key { seed: self.common.seed, iteration: of_all, index: pixel as u64, purpose: Purpose::Camera }.stratified();
        let film = Vec2::new(x as f32, y as f32) + Vec2::from(stream.next_2d());
        let lens = Vec2::from(stream.next_2d());
        let seen = self.subpaths.scene.camera().ray(film, lens);
        let mut ray = seen.ray;
        if self.common.hide_emitters {
            ray = beyond_emitters(self.subpaths.scene, ray, tally).0;
        }
        let start = Start { ray, from: seen.end, throughput: Rgb::WHITE * (1.0 / self.camera_paths as f32) };
        let partner = if self.techniques.connections { light.partner(pixel * self.camera_paths + path) } else { None };
        Walker { place, stream, seen, walk: Walk::new(start), vertex: None, partner, sum: Rgb::BLACK }
    }

    /// Takes all that walk to the ends of their edges; those that leave the scene walk no more.
    fn advance<R: Recorder>(&self, walkers: &mut [Walker<'a>], waves: &mut Waves, tile: &mut Tile<'_, 'a, R>) {
        let scene = self.subpaths.scene;
        let Waves { walking, rays, hits, .. } = waves;
        rays.clear();
        rays.extend(walking.iter().map(|&i| *walkers[i as usize].walk.ray()));
        hits.clear();
        hits.resize(rays.len(), None);
        scene.trace_each(rays, hits);
        tile.tally.rays += rays.len() as u64;
        let mut ends = rays.iter().zip(hits.iter());
        walking.retain(|&i| {
            let walker = &mut walkers[i as usize];
            let Some((ray, Some(raw))) = ends.next() else {
                let found = self.escape(&walker.walk.departure(), &mut tile.record);
                walker.sum += tile.tally.finite(found);
                return false;
            };
            let seen = &walker.seen;
            walker.vertex = Some(self.subpaths.reach(&walker.walk, scene.hit(ray, raw), |hit, share| self.seen(seen, hit, share)));
            true
        });
    }

    /// What is found at the vertices where subpaths are.
    fn join<R: Recorder>(&self, walkers: &mut [Walker<'a>], waves: &mut Waves, joined: &Joined<'a>, tile: &mut Tile<'_, 'a, R>) {
        let scene = self.subpaths.scene;
        let Waves { walking, joining, merging, searches, .. } = waves;
        joining.clear();
        merging.clear();
        // Emitters, and the cells around.
        for &i in walking.iter() {
            let Walker { vertex: Some(vertex), sum, .. } = &mut walkers[i as usize] else { continue };
            if vertex.hit.emitter.is_some() {
                let found = self.hit(vertex, &mut tile.record);
                *sum += tile.tally.finite(found);
            }
            let Some(point) = vertex.point.as_ref().filter(|_| vertex.joins && vertex.carried.edges < self.depths.max) else { continue };
            joining.push(i);
            // Photons lie anywhere in memory: they are asked for before they are needed, step by step.
            if let Some(of) = joined.merging.filter(|_| vertex.carried.share > 0.0) {
                of.store.grid().search(&mut searches[i as usize], point.end.p, self.radius);
                merging.push(i);
            }
        }
        // Light samples, and the photons' positions.
        if self.techniques.connections {
            for &i in joining.iter() {
                let Walker { vertex: Some(vertex), stream, place, .. } = &mut walkers[i as usize] else { continue };
                let Some(point) = &vertex.point else { continue };
                self.next_event(vertex, point, stream, (tile, *place));
            }
        }
        for &i in merging.iter() {
            joined.merging.iter().for_each(|of| of.store.grid().approach(&mut searches[i as usize]));
        }
        // Connections, and the photons.
        for &i in joining.iter() {
            let Walker { vertex: Some(vertex), partner: Some(partner), place, .. } = &walkers[i as usize] else { continue };
            let Some(point) = &vertex.point else { continue };
            for (end, letters) in partner.vertices() {
                self.connect(vertex, point, (end, letters, partner.factor), (tile, *place));
            }
            if tile.memory.shadows.is_full() {
                tile.light_up(scene);
            }
        }
        for &i in merging.iter() {
            joined.merging.iter().for_each(|of| of.store.find(&mut searches[i as usize]));
        }
        // Merges.
        for &i in merging.iter() {
            let Walker { vertex: Some(vertex), sum, .. } = &mut walkers[i as usize] else { continue };
            let (Some(point), Some(of)) = (&vertex.point, joined.merging) else { continue };
            tile.record.merges_at(&point.end);
            let found = self.merge(vertex, point, (of, &searches[i as usize]), &mut tile.record);
            *sum += tile.tally.finite(found);
        }
    }

    /// What the first vertex of a camera subpath carries.
    pub(super) fn seen(&self, seen: &CameraRay, hit: &Hit, share: f32) -> Carried<f32> {
        let edge = Edge::between(1.0, seen.ray.d.dot(hit.end.n_g).abs(), seen.end.p.distance_squared(hit.end.p));
        self.subpaths.weights.from_camera(self.pixel_density(seen.pdf_pixel.0, &hit.end), edge, share)
    }

    /// Does emission count that is met after so many edges?
    fn emission_counts(&self, edges: u32, letters: Letters) -> bool {
        let hidden = edges == 1 && self.common.hide_emitters;
        let matches = || self.common.paths.as_ref().is_none_or(|pattern| Letters::default().join(&[], letters, pattern));
        !hidden && self.depths.contains(edges) && matches()
    }

    /// A light that was hit.
    fn hit<R: Recorder>(&self, vertex: &SubpathVertex<'a>, record: &mut R) -> Rgb {
        let emitted = self.subpaths.scene.emitted(&vertex.hit, -vertex.d, vertex.from.p);
        if emitted.radiance.is_black() || !self.emission_counts(vertex.carried.edges, vertex.letters) {
            return Rgb::BLACK;
        }
        let all = vertex.throughput * emitted.radiance;
        let value = all * self.weigh(Technique::Connection(0), self.hit_weight(vertex));
        record.add(vertex.carried.edges, Technique::Connection(0), value, all);
        value
    }

    pub(super) fn hit_weight(&self, vertex: &SubpathVertex<'a>) -> f32 {
        if vertex.carried.edges == 1 {
            return 1.0;
        }
        let end = LightEnd::of_hit(self.subpaths.scene, &vertex.hit, vertex.d, &vertex.from);
        end.map_or(0.0, |end| self.subpaths.weights.emitter_hit(&vertex.carried, &end.emission))
    }

    /// The light all around.
    fn escape<R: Recorder>(&self, departure: &Departure, record: &mut R) -> Rgb {
        let emitted = self.subpaths.scene.escaped(departure.d);
        if emitted.radiance.is_black() || !self.emission_counts(departure.edges, departure.letters) {
            return Rgb::BLACK;
        }
        let all = departure.throughput * emitted.radiance;
        let value = all * self.weigh(Technique::Connection(0), self.escape_weight(departure));
        record.add(departure.edges, Technique::Connection(0), value, all);
        value
    }

    pub(super) fn escape_weight(&self, departure: &Departure) -> f32 {
        let Some((from, carried, scatter)) = &departure.last else { return 1.0 };
        let Some(end) = LightEnd::of_escape(self.subpaths.scene, departure.d, from) else { return 0.0 };
        let weights = self.subpaths.weights;
        weights.emitter_hit(&weights.extend(carried, *scatter, end.edge.reversed(), 0.0), &end.emission)
    }

    /// A light sample.
    fn next_event<S: Stream, R: Recorder>(
        &self,
        vertex: &SubpathVertex<'a>,
        point: &SurfacePoint<'a>,
        stream: &mut S,
        (tile, place): (&mut Tile<'_, '_, R>, u32),
    ) {
        let scene = self.subpaths.scene;
        let (u_emitter, u) = (stream.next_1d(), Vec2::from(stream.next_2d()));
        let edges = vertex.carried.edges + 1;
        if !self.depths.contains(edges) {
            return;
        }
        let Some(sample) = scene.sample_direct(point.end.p, u_emitter, u) else { return };
        let Some(met) = point.meet(Mode::Radiance, sample.wi) else { return };
        let cos = point.cosine(Mode::Radiance, sample.wi);
        let weight = self.next_event_weight(&vertex.carried, point, &sample, &met);
        let way = (point, Mode::Radiance, sample.wi);
        let class = self.common.paths.as_ref().map(|pattern| self.one_event(pattern, Letters::default(), way, vertex.letters));
        let with = |weight: f32| in_class(vertex.throughput * met.f * sample.radiance * (weight * cos / sample.pdf.0), class);
        // Nothing can be between points that coincide, or on a ray without a direction.
        let ray = || scene.shadow_ray(&point.end, &sample).unwrap_or(Ray { o: point.end.p, d: Vec3::ZERO, t_max: 0.0 });
        tile.join(place, ray, edges, Technique::Connection(1), self.weigh(Technique::Connection(1), weight), with);
    }

    pub(super) fn next_event_weight(&self, carried: &Carried<f32>, point: &SurfacePoint<'a>, sample: &DirectSample, met: &Met) -> f32 {
        let LightEnd { emission, edge } = LightEnd::of_direct(self.subpaths.scene, sample, &point.end);
        self.subpaths.weights.next_event(carried, &emission, edge, met.fwd, met.rev)
    }

    /// A connection to a light vertex.
    fn connect<R: Recorder>(
        &self,
        vertex: &SubpathVertex<'a>,
        point: &SurfacePoint<'a>,
        (partner, letters, factor): (&LightVertex, Letters, f32),
        (tile, place): (&mut Tile<'_, '_, R>, u32),
    ) {
        let edges = vertex.carried.edges + partner.carried.edges + 1;
        if !self.depths.contains(edges) {
            return;
        }
        let other = partner.point(self.subpaths.scene);
        let Some(Joint { w, distance2, here, there }) = Joint::new(point, &other) else { return };
        let weight = self.connection_weight(&vertex.carried, point, partner, &Joint { w, distance2, here, there });
        let cosines = point.cosine(Mode::Radiance, w) * other.cosine(Mode::Importance, -w);
        let ways = [(&other, Mode::Importance, -w), (point, Mode::Radiance, w)];
        let class = self.common.paths.as_ref().map(|pattern| self.two_events(pattern, letters, ways, vertex.letters));
        let with =
            |weight: f32| in_class(vertex.throughput * here.f * there.f * partner.flux * (weight * factor * cosines / distance2), class);
        let technique = Technique::Connection(partner.carried.edges + 1);
        tile.join(place, || point.end.segment(&partner.end), edges, technique, self.weigh(technique, weight), with);
    }

    pub(super) fn connection_weight(&self, carried: &Carried<f32>, point: &SurfacePoint<'a>, partner: &LightVertex, joint: &Joint) -> f32 {
        let Joint { w, distance2, here, there } = joint;
        let edge = Edge::between(w.dot(partner.end.n_g).abs(), w.dot(point.end.n_g).abs(), *distance2);
        self.subpaths.weights.connection(
            &Connector { carried: &partner.carried, rev: there.rev, found: here.fwd * edge.back },
            &Connector { carried, rev: here.rev, found: there.fwd * edge.ahead },
        )
    }

    /// Merges with the light vertices around, whose search has been prepared.
    fn merge<R: Recorder>(
        &self,
        vertex: &SubpathVertex<'a>,
        point: &SurfacePoint<'a>,
        (merging, search): (&Merging, &Search),
        record: &mut R,
    ) -> Rgb {
        let mut sum = Rgb::BLACK;
        let (n_g, n_s) = (point.end.n_g, point.frame.n);
        merging.store.visit(search, |photon| {
            let carried = photon.carried();
            let edges = vertex.carried.edges + carried.edges;
            if !self.depths.contains(edges) || !accepts(n_g, n_s, photon.n_g, photon.wi) {
                return;
            }
            let Some(met) = point.meet(Mode::Radiance, photon.wi) else { return };
            let technique = Technique::Merge(carried.edges);
            let weight = self.weigh(technique, self.merge_weight(&vertex.carried, &carried, &met));
            if weight == 0.0 && !R::ON {
                return;
            }
            let way = (point, Mode::Radiance, photon.wi);
            let class = self.common.paths.as_ref().map(|pattern| self.one_event(pattern, merging.letters(photon), way, vertex.letters));
            let with = |weight: f32| in_class(met.f * photon.flux * (cosine_ratio(point, photon.wi) * weight), class);
            let value = with(weight);
            if R::ON {
                record.add(
                    edges,
                    technique,
                    vertex.throughput * value * self.merge_density,
                    vertex.throughput * with(1.0) * self.merge_density,
                );
            }
            sum += value;
        });
        vertex.throughput * sum * self.merge_density
    }

    #[inline(always)]
    pub(super) fn merge_weight(&self, camera: &Carried<f32>, light: &Carried<f32>, met: &Met) -> f32 {
        self.subpaths.weights.merge(light, met.fwd, camera, met.rev)
    }
}

/// The part of a value that is of the class asked for, where one is.
#[inline(always)]
pub(super) fn in_class(value: Rgb, class: Option<Rgb>) -> Rgb {
    class.map_or(value, |class| value * class)
}

/// Two surface points, one of a camera subpath and one of a light subpath, asked about the edge between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    /// Unit direction from the camera's point to the light's.
    pub(super) w: Vec3,
    pub(super) distance2: f32,
    /// What the camera's point says, and the light's.
    pub(super) here: Met,
    pub(super) there: Met,
}

impl Joint {
    /// `None` where one of them does not scatter along the edge.
    pub(super) fn new(point: &SurfacePoint<'_>, other: &SurfacePoint<'_>) -> Option<Self> {
        let between = other.end.p - point.end.p;
        let distance2 = between.length_squared();
        if distance2 == 0.0 {
            return None;
        }
        let w = between / distance2.sqrt();
        let here = point.meet(Mode::Radiance, w)?;
        let there = other.meet(Mode::Importance, -w)?;
        Some(Self { w, distance2, here, there })
    }
}
