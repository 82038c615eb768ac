//! The engine's weights, technique by technique, against the definition: paths of real scenes, made by the engine's own walks, every density
//! asked again of scene, materials, lights and camera.

use super::eye::Joint;
use super::iteration::Iteration;
use super::light::LightVertex;
use super::*;
use crate::math::Rgb;
use crate::samplers::{Key, Purpose, Stream, UniformStream};
use crate::scene::bsdf::Mode;
use crate::scene::emitter::EmitterKind;
use crate::scene::hit::{Endpoint, Hit};
use crate::scene::mitsuba::{LoadOptions, load};
use crate::transport::densities::FullPath;
use crate::transport::densities::scene::{PathLight, PathPlace, ScenePathError, full_path};
use crate::transport::mis::{Carried, Edge, LightEnd, MergeWeights, Scatter};
use crate::transport::shading::SurfacePoint;
use crate::transport::subpath::{Departure, Start, SubpathVertex};
use crate::transport::walk::Tally;
use glam::{Vec2, Vec3};
use std::path::Path;

const COMMON: Common = Common { seed: 3, max_depth: Some(8), min_depth: 1, rr_depth: 5, hide_emitters: false, paths: None };

fn pair(s: &mut UniformStream) -> Vec2 {
    Vec2::from(s.next_2d())
}

/// A subpath's vertices, each with the event that led on from it.
struct Walked<'a> {
    vertices: Vec<SubpathVertex<'a>>,
    departure: Option<Departure>,
}

impl<'a> Walked<'a> {
    /// The place of vertex `i` on a path that goes on as the walk did.
    fn place(&self, i: usize) -> PathPlace {
        let here = &self.vertices[i];
        let next = self.vertices.get(i + 1).map(|next| next.d).or(self.departure.map(|departure| departure.d));
        let delta = next.zip(here.point).is_some_and(|(d, point)| {
            let w = point.frame.to_local(d);
            point.bsdf.delta(point.uv, point.given_local, w).is_some()
        });
        PathPlace { hit: here.hit, delta, photons: photons(&here.hit.end) }
    }

    /// Places of the vertices before `i`.
    fn before(&self, i: usize) -> Vec<PathPlace> {
        (0..i).map(|j| self.place(j)).collect()
    }
}

fn ends_here(hit: &Hit) -> PathPlace {
    PathPlace { hit: *hit, delta: false, photons: photons(&hit.end) }
}

/// An uneven density, known everywhere.
fn photons(end: &Endpoint) -> f64 {
    f64::from(density(end))
}

fn density(end: &Endpoint) -> f32 {
    (end.p.x + 2.0 * end.p.y - end.p.z).sin().exp()
}

/// Random subpaths of a scene.
struct Pair<'a> {
    camera: Walked<'a>,
    lens: Vec3,
    light: Walked<'a>,
    source: Option<PathLight>,
}

impl<'a> Pair<'a> {
    fn new(it: &Iteration<'a, '_>, s: &mut UniformStream) -> Self {
        let scene = it.subpaths.scene;
        let tally = &mut Tally::default();
        let film = pair(s) * Vec2::new(it.size.0 as f32, it.size.1 as f32);
        let seen = scene.camera().ray(film, pair(s));
        let mut camera = Walked { vertices: Vec::new(), departure: None };
        let start = Start { ray: seen.ray, from: seen.end, throughput: Rgb::WHITE };
        camera.departure = it.subpaths.walk(
            Mode::Radiance,
            start,
            s,
            tally,
            |hit, share| it.seen(&seen, hit, share),
            |vertex, _, _| {
                camera.vertices.push(*vertex);
                vertex.carried.edges < 6
            },
        );
        let mut light = Walked { vertices: Vec::new(), departure: None };
        let mut source = None;
        let emission = scene.sample_emission(s.next_1d(), pair(s), pair(s));
        if let Some(emission) = emission.filter(|emission| !emission.flux.is_black()) {
            let start = Start { ray: emission.end.ray(emission.d), from: emission.end, throughput: emission.flux };
            let first = |hit: &Hit, share: f32| {
                let end = LightEnd::of_emission(scene, &emission, &hit.end);
                it.subpaths.weights.from_light(&end.emission, end.edge, share)
            };
            light.departure = it.subpaths.walk(Mode::Importance, start, s, tally, first, |vertex, _, _| {
                light.vertices.push(*vertex);
                vertex.carried.edges < 5
            });
            source = light.vertices.first().and_then(|x1| match emission.kind {
                EmitterKind::Surface => on_light(scene, &x1.hit.end, -emission.d, emission.end.p),
                EmitterKind::Infinite => Some(PathLight::Around(-emission.d)),
                EmitterKind::DeltaPosition | EmitterKind::DeltaDirection => (0..64)
                    .filter_map(|i| scene.sample_direct(x1.hit.end.p, (i as f32 + 0.5) / 64.0, Vec2::splat(0.5)))
                    .find(|sample| sample.emitter == emission.emitter)
                    .map(PathLight::Single),
            });
        }
        Self { camera, lens: seen.end.p, light, source }
    }
}

/// The light at `p`, found by a ray from `at`.
fn on_light(scene: &Scene, at: &Endpoint, d: Vec3, p: Vec3) -> Option<PathLight> {
    let hit = scene.intersect(&at.ray(d))?;
    (hit.emitter.is_some() && hit.end.p.distance(p) < 1e-4 * hit.t).then_some(PathLight::Surface(hit))
}

/// A path that one technique made: what the engine weighs it, and all its densities.
struct Made {
    technique: Technique,
    weight: f32,
    path: Result<FullPath, ScenePathError>,
    /// No edge so short, no direction so grazing, that rounding of places moves densities.
    sound: bool,
}

fn made(it: &Iteration<'_, '_>, technique: Technique, weight: f32, lens: Vec3, light: &PathLight, places: &[PathPlace]) -> Made {
    let path = full_path(it.subpaths.scene, light, places, lens, it.subpaths.roughness_threshold);
    let mut points: Vec<Vec3> = places.iter().map(|place| place.hit.end.p).collect();
    points.push(lens);
    let to_light = match light {
        PathLight::Surface(hit) => hit.end.p - points[0],
        PathLight::Around(d) => *d * 1e9,
        PathLight::Single(sample) => sample.wi * sample.distance.min(1e9),
    };
    let steep = |d: Vec3, place: &PathPlace| {
        let d = d.normalize();
        d.dot(place.hit.end.n_g).abs() > 0.05 && d.dot(place.hit.frame.n).abs() > 0.05
    };
    let size = it.subpaths.scene.bounding_sphere().1;
    let far = |d: Vec3| d.length() > 0.02 * size;
    let shines = match light {
        PathLight::Surface(hit) => to_light.normalize().dot(hit.end.n_g).abs() > 0.05,
        PathLight::Around(_) | PathLight::Single(_) => true,
    };
    let mut sound = shines && far(to_light) && steep(to_light, &places[0]);
    for (i, place) in places.iter().enumerate() {
        let d = points[i + 1] - points[i];
        sound &= far(d) && steep(d, place) && places.get(i + 1).is_none_or(|next| steep(d, next));
    }
    Made { technique, weight, path, sound }
}

/// Everything that two subpaths give.
fn all(it: &Iteration<'_, '_>, pair: &Pair<'_>, s: &mut UniformStream) -> Vec<Made> {
    let scene = it.subpaths.scene;
    let (camera, light, lens) = (&pair.camera, &pair.light, pair.lens);
    let reversed = |mut places: Vec<PathPlace>| {
        places.reverse();
        places
    };
    let mut list = Vec::new();
    for (i, vertex) in camera.vertices.iter().enumerate() {
        if vertex.hit.emitter.is_some() && i > 0 && !scene.emitted(&vertex.hit, -vertex.d, vertex.from.p).radiance.is_black() {
            let places = reversed(camera.before(i));
            list.push(made(it, Technique::Connection(0), it.hit_weight(vertex), lens, &PathLight::Surface(vertex.hit), &places));
        }
        let Some(point) = vertex.point.filter(|_| vertex.joins) else { continue };
        let here = || {
            let mut places = camera.before(i);
            places.push(ends_here(&vertex.hit));
            reversed(places)
        };
        // --- a light sample
        let sample = scene.sample_direct(point.end.p, s.next_1d(), Vec2::from(s.next_2d()));
        if let Some(sample) = sample
            && let Some(met) = point.meet(Mode::Radiance, sample.wi)
        {
            let light = match sample.kind {
                EmitterKind::Surface => on_light(scene, &point.end, sample.wi, sample.end.p),
                EmitterKind::Infinite => Some(PathLight::Around(sample.wi)),
                _ => Some(PathLight::Single(sample)),
            };
            let weight = it.next_event_weight(&vertex.carried, &point, &sample, &met);
            list.extend(light.map(|light| made(it, Technique::Connection(1), weight, lens, &light, &here())));
        }
        let Some(source) = &pair.source else { continue };
        for (j, partner) in light.vertices.iter().enumerate() {
            let Some(other) = partner.point.filter(|_| partner.joins) else { continue };
            let Some(joint) = Joint::new(&point, &other) else { continue };
            let stored = LightVertex::new(partner, &other);
            let technique = Technique::Connection(partner.carried.edges + 1);
            let mut places = light.before(j);
            places.push(ends_here(&partner.hit));
            places.extend(here());
            let weight = it.connection_weight(&vertex.carried, &point, &stored, &joint);
            list.push(made(it, technique, weight, lens, source, &places));
            // --- the camera's subpath goes on to the light's vertex and merges there
            if let Some((carried, met)) = arrive(it, vertex, &point, &joint, &other)
                && carried.share > 0.0
            {
                let weight = it.merge_weight(&carried, &partner.carried, &met);
                list.push(made(it, Technique::Merge(partner.carried.edges), weight, lens, source, &places));
            }
        }
    }
    if let Some(departure) = camera.departure.filter(|departure| departure.edges > 1)
        && !scene.escaped(departure.d).radiance.is_black()
    {
        let places = reversed(camera.before(camera.vertices.len()));
        list.push(made(it, Technique::Connection(0), it.escape_weight(&departure), lens, &PathLight::Around(departure.d), &places));
    }
    let Some(source) = &pair.source else { return list };
    for (j, vertex) in light.vertices.iter().enumerate() {
        let Some(point) = vertex.point.filter(|_| vertex.joins) else { continue };
        let lens = pair_lens(s);
        let Some(connection) = scene.camera().connect(&point.end, lens) else { continue };
        let Some(met) = point.meet(Mode::Importance, connection.wo) else { continue };
        let mut places = light.before(j);
        places.push(ends_here(&vertex.hit));
        let weight = it.splat_weight(&LightVertex::new(vertex, &point), &connection, &met);
        list.push(made(it, Technique::Splat, weight, connection.end.p, source, &places));
    }
    list
}

fn pair_lens(s: &mut UniformStream) -> Vec2 {
    pair(s)
}

/// What a camera subpath carries that goes on from `vertex` along the joint, and what its end says about the light's predecessor.
fn arrive(
    it: &Iteration<'_, '_>,
    vertex: &SubpathVertex<'_>,
    point: &SurfacePoint<'_>,
    joint: &Joint,
    other: &SurfacePoint<'_>,
) -> Option<(Carried<f32>, crate::transport::survival::Met)> {
    let edge = Edge::between(joint.w.dot(point.end.n_g).abs(), joint.w.dot(other.end.n_g).abs(), joint.distance2);
    let scatter = Scatter::rough(joint.here.fwd, joint.here.rev);
    // No walk goes where a lobe's far tail is out of range when squared.
    if [joint.here.fwd, joint.here.rev].into_iter().any(|pdf| pdf < 1e-12) {
        return None;
    }
    let end = SurfacePoint::seen_from(-joint.w, other.bsdf, other.end, other.frame, other.uv);
    let carried = it.subpaths.weights.extend(&vertex.carried, scatter, edge, it.subpaths.share(&end));
    Some((carried, end.meet(Mode::Radiance, other.given)?))
}

const FOLDERS: [&str; 16] = [
    "scenes/textured-room",
    "scenes/glass-box",
    "scenes/balls",
    "tests/scenes/roughdielectric-ggx",
    "tests/scenes/roughconductor-beckmann",
    "tests/scenes/roughplastic",
    "tests/scenes/plastic",
    "tests/scenes/blendbsdf",
    "tests/scenes/mask",
    "tests/scenes/thindielectric",
    "tests/scenes/obj-normals",
    "tests/scenes/point-light",
    "tests/scenes/spot-light",
    "tests/scenes/directional-light",
    "tests/scenes/constant-light",
    "tests/scenes/envmap-rotated",
];

/// A floor and a ball of the one material that no scene file has.
const PHONG: &str = "<scene version=\"3.0.0\"><sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"0, -4, 2\" \
     target=\"0, 0, 0.5\" up=\"0, 0, 1\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"32\"/><integer name=\"height\" \
     value=\"32\"/></film></sensor><bsdf type=\"phong\" id=\"gloss\"><float name=\"exponent\" value=\"12\"/><rgb name=\"diffuse_reflectance\" \
     value=\"0.4\"/><rgb name=\"specular_reflectance\" value=\"0.4\"/></bsdf><shape type=\"rectangle\"><transform name=\"to_world\"><scale \
     value=\"4\"/></transform><ref id=\"gloss\"/></shape><shape type=\"sphere\"><point name=\"center\" x=\"0\" y=\"0\" z=\"1\"/><ref id=\"gloss\"/>\
     </shape><shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"1\" y=\"0\" z=\"0\" angle=\"180\"/><translate x=\"1\" y=\"-1\" \
     z=\"4\"/></transform><emitter type=\"area\"><rgb name=\"radiance\" value=\"5\"/></emitter></shape></scene>";

fn scenes() -> Vec<(&'static str, Scene)> {
    let read = |file: &Path| load(file, &LoadOptions::default()).unwrap().scene;
    let stored = |folder| (folder, read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join("scene.xml")));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.xml");
    std::fs::write(&file, PHONG).unwrap();
    FOLDERS.into_iter().map(stored).chain([("phong", read(&file))]).collect()
}

fn heuristics() -> Vec<Heuristic> {
    let with = |merges, beta| Heuristic::new(merges, beta).unwrap();
    let mut list = vec![Heuristic::default(), with(MergeWeights::Power, 2.0)];
    for merges in [MergeWeights::VcmPlus, MergeWeights::VcmStar] {
        list.extend([1.0, 2.0].map(|beta| with(merges, beta)));
    }
    list
}

#[test]
fn the_engine_weighs_paths_by_their_definition() {
    let mut report = Vec::new();
    let mut wrong = 0;
    for (folder, scene) in scenes() {
        let size = scene.camera().resolution();
        let (mut count, mut kinds, mut worst) = (0, [0; 5], 0.0f64);
        for (number, heuristic) in heuristics().into_iter().enumerate() {
            for techniques in [Techniques::VCM, Techniques::BDPT, Techniques::BPM] {
                let photons = PhotonSettings { photons: Some(10_000), ..PhotonSettings::default() };
                let mut engine = Engine::new(
                    &scene,
                    size,
                    &COMMON,
                    EngineSettings { techniques, heuristic, photons, camera_paths: Some(3), alone: None },
                );
                engine.radius = f64::from(scene.bounding_sphere().1) * 2e-3;
                let sampling = engine.sampling(0);
                let weights = Weights::new(&sampling);
                let it = engine.iteration(0, &sampling, &weights, heuristic.asks_density().then_some(&density));
                for index in 0..250 {
                    let key = Key { seed: 4, iteration: number as u64, index, purpose: Purpose::Test };
                    let mut s = key.stream();
                    let subpaths = Pair::new(&it, &mut s);
                    for Made { technique, weight, path, sound } in all(&it, &subpaths, &mut s) {
                        if !sound {
                            continue;
                        }
                        let path = match path {
                            Ok(path) => path,
                            Err(ScenePathError::Dark) => continue,
                            Err(error) => panic!("{folder}: {error}"),
                        };
                        let defined = path.weights(&sampling);
                        let (expected, kind) = match technique {
                            Technique::Splat => (defined.connections[path.edges()], 3),
                            Technique::Connection(s) => (defined.connections[s as usize], s.min(2) as usize),
                            Technique::Merge(i) => (defined.merges[i as usize], 4),
                        };
                        assert!(weight.is_finite(), "{folder}: {technique:?} {path:?}");
                        let error = (f64::from(weight) - expected).abs() / expected.max(1e-6);
                        if error > 1e-4 && wrong < 20 {
                            eprintln!("{folder} {sampling:?} {technique:?}: {weight} is not {expected}\n{path:?}");
                            wrong += 1;
                        }
                        worst = worst.max(error);
                        count += 1;
                        kinds[kind] += 1;
                    }
                }
            }
        }
        report.push((folder, count, kinds, worst));
    }
    eprintln!("{report:#?}");
    let total: usize = report.iter().map(|(_, count, ..)| count).sum();
    assert!(report.iter().all(|&(.., worst)| worst <= 1e-4) && total > 10_000, "{report:#?}");
}
