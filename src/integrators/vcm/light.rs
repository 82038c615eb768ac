//! The light's side: light subpaths, the vertices they leave, and their connections to the camera.

use super::eye::in_class;
use super::iteration::Iteration;
use super::pairing::Pairing;
use super::pyramid::RecordedSplat;
use super::shadows::Shadows;
use super::technique::Technique;
use crate::image::film::Splat;
use crate::math::{Frame, Rgb, fetch};
use crate::photons::Store;
use crate::samplers::{Drawn, Key, LightPathSpace, Purpose, Stream};
use crate::scene::bsdf::Mode;
use crate::scene::camera::CameraConnection;
use crate::scene::hit::Endpoint;
use crate::scene::ray::Ray;
use crate::scene::{Scene, ShapeId};
use crate::targets::shares::Shares;
use crate::targets::{Arrival, Arrivals};
use crate::transport::class::Letters;
use crate::transport::mis::{Carried, Connector, LightEnd};
use crate::transport::shading::SurfacePoint;
use crate::transport::subpath::{Start, SubpathVertex};
use crate::transport::survival::Met;
use crate::transport::walk::Tally;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// A vertex of a light subpath whose surface has a lobe that is no delta: two lines of the processor's cache. Merges ask for the first alone, which
/// ends with the normal.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct LightVertex {
    /// Unit direction towards where the light came from.
    pub(super) wi: Vec3,
    /// Flux that arrives, of the path alone: its mean over paths is the power that arrives here.
    pub(super) flux: Rgb,
    pub(super) carried: Carried<f32>,
    pub(super) end: Endpoint,
    /// Shading normal and first tangent; the second is their product.
    n_s: Vec3,
    s: Vec3,
    uv: Vec2,
    shape: ShapeId,
}

const _: () = assert!(std::mem::offset_of!(LightVertex, end) + size_of::<Vec3>() == 64 && size_of::<LightVertex>() == 128);

impl LightVertex {
    pub(super) fn new(vertex: &SubpathVertex<'_>, point: &SurfacePoint<'_>) -> Self {
        let SurfacePoint { end, frame, uv, given, .. } = *point;
        let (flux, carried) = (vertex.throughput, vertex.carried);
        Self { end, n_s: frame.n, s: frame.s, uv, shape: vertex.hit.shape, wi: given, flux, carried }
    }

    /// Ready to scatter.
    #[inline]
    pub(super) fn point<'a>(&self, scene: &'a crate::scene::Scene) -> SurfacePoint<'a> {
        let frame = Frame { s: self.s, t: self.n_s.cross(self.s), n: self.n_s };
        SurfacePoint::seen_from(self.wi, scene.bsdf(self.shape), self.end, frame, self.uv)
    }
}

impl Arrival for LightVertex {
    #[inline(always)]
    fn end(&self) -> &Endpoint {
        &self.end
    }
    #[inline(always)]
    fn wi(&self) -> Vec3 {
        self.wi
    }
    #[inline(always)]
    fn depth(&self) -> u32 {
        self.carried.edges
    }
}

/// A traced light subpath; a buffer that is filled again and again.
#[derive(Clone, Debug, Default)]
pub(super) struct LightSubpath {
    vertices: Vec<LightVertex>,
    /// Events before each vertex; empty unless classes are kept.
    letters: Vec<Letters>,
    tally: Tally,
}

impl Arrivals for LightSubpath {
    type Vertex = LightVertex;
    #[inline(always)]
    fn vertices(&self) -> &[LightVertex] {
        &self.vertices
    }
    #[inline(always)]
    fn tally(&self) -> &Tally {
        &self.tally
    }
}

impl LightPathSpace for Iteration<'_, '_> {
    type Path = LightSubpath;

    /// Coordinates: one for the choice of emitter, two for the position, two for the direction, then those of the walk.
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut LightSubpath) {
        let LightSubpath { vertices, letters, tally } = path;
        vertices.clear();
        letters.clear();
        *tally = Tally::default();
        let u_emitter = stream.next_1d();
        let u_position = Vec2::from(stream.next_2d());
        let u_direction = Vec2::from(stream.next_2d());
        let scene = self.subpaths.scene;
        let Some(emission) = scene.sample_emission(u_emitter, u_position, u_direction) else { return };
        if emission.flux.is_black() {
            return;
        }
        let start = Start { ray: emission.end.ray(emission.d), from: emission.end, throughput: emission.flux };
        let first = |hit: &crate::scene::hit::Hit, share: f32| {
            let end = LightEnd::of_emission(scene, &emission, &hit.end);
            self.subpaths.weights.from_light(&end.emission, end.edge, share)
        };
        // One more edge joins a vertex to the camera's side; a merge vertex counts its edges in 16 bits.
        let most = self.depths.max.saturating_sub(1).min(u32::from(u16::MAX));
        self.subpaths.walk(Mode::Importance, start, stream, tally, first, |vertex, _, _| {
            if let Some(point) = vertex.point.filter(|_| vertex.joins) {
                vertices.push(LightVertex::new(vertex, &point));
                if self.subpaths.classes {
                    letters.push(vertex.letters);
                }
            }
            vertex.carried.edges < most
        });
    }

    /// Rung 0 alone.
    fn targets(&self, _path: &LightSubpath, values: &mut [f64]) {
        values.fill(1.0);
    }
}

/// What a batch of light subpaths leaves.
#[derive(Debug, Default)]
pub(super) struct Batch {
    vertices: Vec<LightVertex>,
    letters: Vec<Letters>,
    /// Where each path's vertices end.
    ends: Vec<u32>,
    splats: Vec<Splat>,
    /// The same by length, with weights and without; empty unless images of techniques are kept.
    pub(super) recorded: Vec<RecordedSplat>,
    /// Where each path's splats end.
    splat_ends: Vec<u32>,
    /// Splats of which it is not yet known whether the camera sees where they come from.
    waiting: Shadows<Waiting>,
    /// What paths count for: nothing of independent paths, which all count the same.
    shares: Shares,
    pub(super) tally: Tally,
}

/// A splat if nothing is in its way.
#[derive(Debug)]
struct Waiting {
    /// The path's number in its batch.
    path: u32,
    splat: Splat,
    edges: u32,
    /// With weight 1.
    all: Rgb,
}

impl Batch {
    /// With room for so many vertices: what grows is copied, again and again.
    pub(super) fn with_room(vertices: usize) -> Self {
        Self { vertices: Vec::with_capacity(vertices), ..Self::default() }
    }

    /// Keeps the splats that the camera sees, by length as well if images of techniques are `recorded`.
    fn trace_splats(&mut self, scene: &Scene, recorded: bool) {
        let Self { splats, splat_ends, waiting, tally, recorded: by_length, .. } = self;
        waiting.trace(scene, |Waiting { path, splat, edges, all }| {
            splat_ends.resize((path as usize).max(splat_ends.len()), splats.len() as u32);
            let value = tally.finite(splat.value);
            splats.push(Splat { value, ..splat });
            if recorded {
                by_length.push(RecordedSplat { pixel: splat.pixel, edges, weighted: value, unweighted: all });
            }
        });
    }

    /// Makes every path count for what a sampler with targets says, relative to one of `count` independent paths: splats and the flux of
    /// vertices are multiplied by it. Returns these factors.
    pub(super) fn weigh(&mut self, scales: &[f64], count: u64) -> Vec<f32> {
        let weights: Vec<f32> = self.shares.factors(scales).iter().map(|[weight, _]| (weight * count as f64) as f32).collect();
        let (mut vertex, mut splat) = (0, 0);
        for (weight, (end, splat_end)) in weights.iter().zip(self.ends.iter().zip(&self.splat_ends)) {
            let (end, splat_end) = (*end as usize, *splat_end as usize);
            self.vertices[vertex..end].iter_mut().for_each(|vertex| vertex.flux *= *weight);
            self.splats[splat..splat_end].iter_mut().for_each(|splat| splat.value *= *weight);
            // As many as splats, or none.
            for recorded in self.recorded.iter_mut().take(splat_end).skip(splat) {
                recorded.weighted *= *weight;
                recorded.unweighted *= *weight;
            }
            (vertex, splat) = (end, splat_end);
        }
        weights
    }
}

impl AsRef<[Splat]> for Batch {
    fn as_ref(&self) -> &[Splat] {
        &self.splats
    }
}

/// All light subpaths of an iteration, in the order of their numbers.
#[derive(Debug, Default)]
pub(super) struct LightSide {
    pub(super) batches: Vec<Batch>,
    /// Number of the first path of each batch.
    firsts: Vec<usize>,
    paths: usize,
    /// Which path a pixel is connected to; by its number where paths are independent.
    pairing: Option<Pairing>,
}

impl LightSide {
    pub(super) fn new(mut batches: Vec<Batch>, pairing: Option<Pairing>) -> Self {
        let (mut firsts, mut paths) = (Vec::with_capacity(batches.len()), 0);
        for batch in &mut batches {
            // What is in the film is done with.
            batch.splats = Vec::new();
            batch.splat_ends = Vec::new();
            batch.waiting = Shadows::default();
            batch.recorded = Vec::new();
            firsts.push(paths);
            paths += batch.ends.len();
        }
        Self { batches, firsts, paths, pairing }
    }

    /// Vertices of the batch that has most.
    pub(super) fn largest_batch(&self) -> usize {
        self.batches.iter().map(|batch| batch.vertices.len()).max().unwrap_or(0)
    }

    /// The light subpath that camera subpath number `pixel` is connected to; `None` where there is none.
    pub(super) fn partner(&self, pixel: usize) -> Option<Partner<'_>> {
        let (path, factor) = match &self.pairing {
            None => (pixel % self.paths.max(1), 1.0),
            Some(pairing) => pairing.partner(pixel)?,
        };
        let number = self.firsts.partition_point(|&first| first <= path).saturating_sub(1);
        let batch = self.batches.get(number)?;
        let place = path - self.firsts[number];
        let start = place.checked_sub(1).map_or(0, |before| batch.ends[before] as usize);
        Some(Partner { batch, range: start..batch.ends[place] as usize, factor })
    }
}

/// A light subpath that a camera subpath is connected to.
pub(super) struct Partner<'b> {
    batch: &'b Batch,
    range: Range<usize>,
    /// On what connections bring: one over the number of light subpaths and the probability of this one.
    pub(super) factor: f32,
}

impl<'b> Partner<'b> {
    /// Its vertices, each with the events before it.
    pub(super) fn vertices(&self) -> impl Iterator<Item = (&'b LightVertex, Letters)> + use<'b> {
        let batch = self.batch;
        self.range.clone().map(move |i| (&batch.vertices[i], batch.letters.get(i).copied().unwrap_or_default()))
    }
}

/// A light vertex as merges need it: 60 bytes, kept as 64, so that each lies in one line of the processor's cache.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct MergeVertex {
    /// Unit geometric normal.
    pub(super) n_g: Vec3,
    /// Unit direction towards where the light came from.
    pub(super) wi: Vec3,
    pub(super) flux: Rgb,
    last: f32,
    connections: f32,
    merges: f32,
    shares: f32,
    mergeable: u16,
    edges: u16,
    /// Its number before sorting: where its class is.
    place: u32,
}

impl MergeVertex {
    fn new(vertex: &LightVertex, place: u32) -> Self {
        let LightVertex { end, wi, flux, carried, .. } = *vertex;
        let Carried { last, connections, merges, shares, mergeable, edges, .. } = carried;
        // Whole numbers; walks are far shorter than these can count.
        let (mergeable, edges) = (mergeable as u16, edges.min(u32::from(u16::MAX)) as u16);
        Self { n_g: end.n_g, wi, flux, last, connections, merges, shares, mergeable, edges, place }
    }

    /// What its vertex carried, but for the share, which is the camera vertex's where the two merge.
    #[inline(always)]
    pub(super) fn carried(&self) -> Carried<f32> {
        let Self { last, connections, merges, shares, mergeable, edges, .. } = *self;
        Carried { last, connections, merges, share: 0.0, shares, mergeable: f32::from(mergeable), edges: u32::from(edges) }
    }
}

/// The light vertices that camera subpaths merge with.
pub(super) struct Merging {
    pub(super) store: Store<MergeVertex>,
    /// Events before each vertex, by [`MergeVertex::place`]; empty unless classes are kept.
    letters: Vec<Letters>,
}

impl Merging {
    /// Sorts all vertices that may merge into cells of side `cell`; `memory` held those of an earlier iteration.
    pub(super) fn new(light: &LightSide, cell: f32, memory: Vec<MergeVertex>) -> Self {
        let of_batch = |(number, batch): (usize, &Batch)| -> Vec<[u32; 2]> {
            let merge = batch.vertices.iter().enumerate().filter(|(_, vertex)| vertex.carried.share > 0.0);
            merge.map(|(i, _)| [number as u32, i as u32]).collect()
        };
        let places: Vec<[u32; 2]> = light.batches.par_iter().enumerate().flat_map_iter(of_batch).collect();
        let kept = |&[batch, place]: &[u32; 2]| light.batches[batch as usize].letters.get(place as usize).copied();
        let letters = places.iter().map_while(kept).collect();
        let vertex = |i: usize| {
            let [batch, place] = places[i].map(|n| n as usize);
            &light.batches[batch].vertices[place]
        };
        // Close together, since they are read again in the order of cells.
        let positions: Vec<Vec3> = (0..places.len()).into_par_iter().with_min_len(1 << 12).map(|i| vertex(i).end.p).collect();
        let ahead = |i: usize| fetch(vertex(i));
        let item = |i: usize| MergeVertex::new(vertex(i), i as u32);
        let store = Store::build_in(memory, places.len(), |i| positions[i], ahead, item, cell);
        Self { store, letters }
    }

    /// Events before a vertex.
    pub(super) fn letters(&self, vertex: &MergeVertex) -> Letters {
        self.letters.get(vertex.place as usize).copied().unwrap_or_default()
    }
}

impl Iteration<'_, '_> {
    /// Keeps an independent light subpath, and what it brings to the camera.
    pub(super) fn keep(&self, batch: &mut Batch, path: &LightSubpath, drawn: &[Drawn]) {
        batch.tally.add(&path.tally);
        self.connect_and_keep(batch, path, drawn);
    }

    /// The same for a subpath whose weight comes from its sampler, and whose tracing is counted elsewhere; one without vertices leaves nothing.
    pub(super) fn keep_weighted(&self, batch: &mut Batch, path: &LightSubpath, drawn: &[Drawn]) {
        if path.vertices.is_empty() {
            return;
        }
        self.connect_and_keep(batch, path, drawn);
        batch.shares.add(drawn);
    }

    /// The last step of all batches, before anything is asked of them: their splats are complete.
    pub(super) fn finish(&self, batches: &mut [Batch]) {
        batches.par_iter_mut().for_each(|batch| {
            batch.trace_splats(self.subpaths.scene, self.records);
            batch.splat_ends.resize(batch.ends.len(), batch.splats.len() as u32);
        });
    }

    #[inline(always)]
    fn connect_and_keep(&self, batch: &mut Batch, path: &LightSubpath, drawn: &[Drawn]) {
        let index = drawn.first().map_or(0, |drawn| drawn.index);
        if self.techniques.light_tracing {
            let key = Key { seed: self.common.seed, iteration: self.index, index: self.pixels() + index, purpose: Purpose::Connect };
            let mut stream = self.subpaths.scene.camera().description().lens.map(|_| key.stream());
            for (i, vertex) in path.vertices.iter().enumerate() {
                let lens = stream.as_mut().map_or(Vec2::ZERO, |stream| Vec2::from(stream.next_2d()));
                let letters = path.letters.get(i).copied().unwrap_or_default();
                self.splat(vertex, letters, lens, batch);
            }
            if batch.waiting.is_full() {
                batch.trace_splats(self.subpaths.scene, self.records);
            }
        }
        if self.keeps_vertices() {
            batch.vertices.extend_from_slice(&path.vertices);
            batch.letters.extend_from_slice(&path.letters);
        }
        batch.ends.push(batch.vertices.len() as u32);
    }

    /// Connects a light vertex to the camera.
    fn splat(&self, vertex: &LightVertex, letters: Letters, lens: Vec2, batch: &mut Batch) {
        let edges = vertex.carried.edges + 1;
        if !self.depths.contains(edges) {
            return;
        }
        let Some(connection) = self.subpaths.scene.camera().connect(&vertex.end, lens) else { return };
        let point = vertex.point(self.subpaths.scene);
        let Some(met) = point.meet(Mode::Importance, connection.wo) else { return };
        let density = connection.pdf_pixel.0 / connection.distance2;
        let weight = self.weigh(Technique::Splat, self.splat_weight(vertex, &connection, &met));
        if weight == 0.0 && !self.records {
            return;
        }
        let way = (&point, Mode::Importance, connection.wo);
        let class = self.common.paths.as_ref().map(|pattern| self.one_event(pattern, letters, way, Letters::default()));
        let cosine = point.cosine(Mode::Importance, connection.wo);
        let with = |weight: f32| in_class(vertex.flux * met.f * (cosine * density * weight), class);
        let value = with(weight);
        let all = if self.records { with(1.0) } else { value };
        if all.is_black() {
            return;
        }
        let Some(ray) = self.line_of_sight(vertex, &connection, &mut batch.tally) else { return };
        let (x, y) = (connection.film.x as usize, connection.film.y as usize);
        let splat = Splat { pixel: (y * self.size.0 + x) as u32, value };
        batch.waiting.push(ray, Waiting { path: batch.ends.len() as u32, splat, edges, all });
    }

    /// Weight of a light vertex connected to the camera.
    pub(super) fn splat_weight(&self, vertex: &LightVertex, connection: &CameraConnection, met: &Met) -> f32 {
        let found =
            self.pixel_density(connection.pdf_pixel.0, &vertex.end) * connection.wo.dot(vertex.end.n_g).abs() / connection.distance2;
        self.subpaths.weights.splat(&Connector { carried: &vertex.carried, rev: met.rev, found })
    }

    /// The ray that is free if and only if the camera sees a light vertex, but for what it looks through. `None` where that hides the vertex.
    fn line_of_sight(&self, vertex: &LightVertex, connection: &CameraConnection, tally: &mut Tally) -> Option<Ray> {
        let scene = self.subpaths.scene;
        tally.rays += 1;
        if !self.common.hide_emitters {
            return Some(vertex.end.segment(&connection.near));
        }
        // The camera's first edge passes emitters, and shows none: asked here and now, and then of a ray that meets nothing.
        let shines = |shape: ShapeId| scene.shapes().get(shape.0 as usize).is_some_and(|shape| shape.emitter.is_some());
        let mut ray = connection.near.segment(&vertex.end);
        loop {
            match scene.intersect(&ray) {
                None => return (!shines(vertex.shape)).then_some(Ray { t_max: 0.0, ..ray }),
                Some(hit) if hit.emitter.is_none() => return None,
                Some(hit) => {
                    tally.rays += 1;
                    ray = hit.end.segment(&vertex.end);
                }
            }
        }
    }
}
