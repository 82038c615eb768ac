//! Paths of real scenes: the scene's numbers asked for from both ends, and the recursion from what walks drew against the definition from
//! what materials answer afterwards.

use super::{Event, Light, Numbers, SETS, Segment, heuristics};
use crate::samplers::{Key, Purpose, Stream, UniformStream};
use crate::scene::Scene;
use crate::scene::bsdf::Mode;
use crate::scene::emitter::EmitterKind;
use crate::scene::hit::Hit;
use crate::scene::mitsuba::{LoadOptions, load};
use crate::transport::densities::FullPath;
use crate::transport::densities::scene::{PathLight, PathPlace, full_path};
use crate::transport::mis::{LightEnd, Sampling};
use crate::transport::shading::SurfacePoint;
use crate::transport::survival::Onward;
use glam::{Vec2, Vec3};
use std::path::Path;

fn scene(folder: &str) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join("scene.xml");
    load(&file, &LoadOptions::default()).unwrap().scene
}

fn stream(index: u64) -> UniformStream {
    Key { seed: 9, iteration: 0, index, purpose: Purpose::Test }.stream()
}

fn pair(s: &mut UniformStream) -> Vec2 {
    Vec2::from(s.next_2d())
}

/// Largest relative difference of the four numbers.
fn difference(a: &LightEnd, b: &LightEnd) -> f32 {
    let numbers = |l: &LightEnd| [l.emission.sampled, l.emission.direct, l.edge.ahead, l.edge.back];
    let relative = |(x, y): (f32, f32)| if x == y { 0.0 } else { (x - y).abs() / x.abs().max(y.abs()) };
    numbers(a).into_iter().zip(numbers(b)).map(relative).fold(0.0, f32::max)
}

/// A ray of light and the camera's side's way to the same light, by a hit, an escape or a light sample, have one and the same end.
#[test]
fn the_light_looks_the_same_from_both_ends() {
    let folders = ["emitter-shapes", "many-lights", "point-light", "spot-light", "directional-light", "constant-light", "envmap-rotated"];
    let mut kinds = [0; 4];
    for folder in folders {
        let scene = scene(&format!("tests/scenes/{folder}"));
        for index in 0..2_000 {
            let mut s = stream(index);
            let Some(light) = scene.sample_emission(s.next_1d(), pair(&mut s), pair(&mut s)) else { continue };
            let Some(at) = scene.intersect(&light.end.ray(light.d)).map(|hit| hit.end) else { continue };
            // Rounding of grazing directions and of short edges is not at stake.
            if light.cos_light < 0.05 || light.d.dot(at.n_g).abs() < 0.05 || at.p.distance(light.end.p) < 0.1 {
                continue;
            }
            let sent = LightEnd::of_emission(&scene, &light, &at);
            let back = at.ray(-light.d);
            let seen = match light.kind {
                EmitterKind::Surface => scene
                    .intersect(&back)
                    .filter(|hit| hit.end.p.distance(light.end.p) < 1e-3)
                    .and_then(|hit| LightEnd::of_hit(&scene, &hit, back.d, &at)),
                EmitterKind::Infinite => LightEnd::of_escape(&scene, back.d, &at),
                EmitterKind::DeltaPosition | EmitterKind::DeltaDirection => (0..64)
                    .filter_map(|i| scene.sample_direct(at.p, (i as f32 + 0.5) / 64.0, Vec2::splat(0.5)))
                    .find(|sample| sample.emitter == light.emitter)
                    .map(|sample| LightEnd::of_direct(&scene, &sample, &at)),
            };
            let Some(seen) = seen else { continue };
            assert!(difference(&sent, &seen) < 2e-3, "{folder}, {index}: {light:?}\n{sent:?}\n{seen:?}");
            kinds[light.kind as usize] += 1;

            // Light samples of surfaces and of all around say the same as the ray that follows them.
            let Some(sample) = scene.sample_direct(at.p, s.next_1d(), pair(&mut s)) else { continue };
            let ray = at.ray(sample.wi);
            let followed = match sample.kind {
                EmitterKind::Surface => scene
                    .intersect(&ray)
                    .filter(|hit| hit.end.p.distance(sample.end.p) < 1e-3 && sample.cos_light > 0.05)
                    .and_then(|hit| LightEnd::of_hit(&scene, &hit, ray.d, &at)),
                EmitterKind::Infinite => LightEnd::of_escape(&scene, ray.d, &at),
                EmitterKind::DeltaPosition | EmitterKind::DeltaDirection => None,
            };
            if let Some(followed) = followed {
                let drawn = LightEnd::of_direct(&scene, &sample, &at);
                assert!(difference(&drawn, &followed) < 5e-3, "{folder}, {index}: {sample:?}\n{drawn:?}\n{followed:?}");
            }
        }
    }
    assert!(kinds.iter().all(|&n| n >= 500), "{kinds:?}");
}

/// A vertex of a camera's walk: where it came along an edge of this length, and how it went on, if it did.
#[derive(Clone, Copy)]
struct Walked<'a> {
    hit: Hit,
    point: SurfacePoint<'a>,
    length: f32,
    on: Option<Onward>,
}

/// A path from the camera to a light: the numbers that its walk drew, and all its densities, asked for afterwards.
struct Found {
    drawn: Numbers,
    full: FullPath,
}

/// The light at a path's end as the two ask for it.
struct Source {
    kind: EmitterKind,
    end: LightEnd,
    light: PathLight,
    to_light: Vec3,
}

fn found(scene: &Scene, walk: &[Walked<'_>], pixel: f32, lens: Vec3, source: &Source) -> Found {
    let Source { kind, end, light, to_light } = source;
    // The light's edge as two cosines over a squared length of 1.
    let mut segments = vec![Segment { cos_left: end.edge.back, cos_arrived: end.edge.ahead, distance2: 1.0 }];
    let (mut events, mut places) = (Vec::new(), Vec::new());
    for (i, vertex) in walk.iter().enumerate().rev() {
        let point = &vertex.point;
        let wi = point.frame.to_local(vertex.on.map_or(*to_light, |on| on.d));
        let wo = point.given_local;
        // From the light: this vertex is left towards the camera's side.
        segments.push(Segment {
            cos_left: point.given.dot(point.end.n_g).abs(),
            cos_arrived: i.checked_sub(1).map_or(1.0, |before| point.given.dot(walk[before].point.end.n_g).abs()),
            distance2: vertex.length * vertex.length,
        });
        let photons = 1.0 + i as f32;
        let event = |to_light, to_camera, delta: Option<[f32; 3]>| Event { to_light, to_camera, merges: delta.is_none(), delta, photons };
        events.push(match vertex.on {
            None => {
                let met = point.meet(Mode::Radiance, *to_light);
                event(met.map_or(0.0, |met| met.fwd), met.map_or(0.0, |met| met.rev), None)
            }
            Some(Onward { scatter, .. }) if scatter.delta => {
                let eta = point.bsdf.delta(point.uv, wo, wi).unwrap().eta;
                let spread = if eta == 1.0 { 1.0 } else { wo.z.abs() / (eta * eta * wi.z.abs()) };
                event(scatter.fwd * spread, scatter.rev, Some([wi.z.abs(), wo.z.abs(), 1.0 / eta]))
            }
            Some(Onward { scatter, .. }) => event(scatter.fwd, scatter.rev, None),
        });
        places.push(PathPlace { hit: vertex.hit, delta: events.last().unwrap().delta.is_some(), photons: f64::from(photons) });
    }
    let light_kind = match kind {
        EmitterKind::Surface => Light::Surface,
        EmitterKind::DeltaPosition => Light::Position,
        EmitterKind::DeltaDirection => Light::Direction,
        EmitterKind::Infinite => Light::Environment,
    };
    let (position, direct) = (end.emission.sampled, end.emission.direct);
    let drawn = Numbers { light: light_kind, segments, events, position, direction: 1.0, direct, pixel };
    Found { drawn, full: full_path(scene, light, &places, lens, 0.0).unwrap() }
}

/// Every path of a few camera walks: those that end at a light, and those that a light sample completes.
fn paths(scene: &Scene, index: u64) -> Vec<Found> {
    let mut s = stream(index);
    let (width, height) = scene.camera().resolution();
    let film = pair(&mut s) * Vec2::new(width as f32, height as f32);
    let start = scene.camera().ray(film, pair(&mut s));
    let (pixel, lens) = (start.pdf_pixel.0, start.end.p);
    let (mut ray, mut before) = (start.ray, start.start);
    let mut walk: Vec<Walked<'_>> = Vec::new();
    let mut list = Vec::new();
    while walk.len() < 7 {
        let hit = scene.intersect(&ray);
        if let Some(from) = walk.last().map(|last| last.point.end) {
            let (kind, end, light) = match hit {
                Some(hit) => (EmitterKind::Surface, LightEnd::of_hit(scene, &hit, ray.d, &from), PathLight::Surface(hit)),
                None => (EmitterKind::Infinite, LightEnd::of_escape(scene, ray.d, &from), PathLight::Around(ray.d)),
            };
            let source = end.map(|end| Source { kind, end, light, to_light: ray.d });
            list.extend(source.filter(|source| sound(&walk, source)).map(|source| found(scene, &walk, pixel, lens, &source)));
        }
        let Some(hit) = hit else { break };
        let Some(point) = SurfacePoint::new(&hit, scene.bsdf(hit.shape), ray.d) else { break };
        walk.push(Walked { hit, point, length: before + hit.t, on: None });
        let sample = scene.sample_direct(point.end.p, s.next_1d(), pair(&mut s));
        if let Some(sample) = sample.filter(|sample| point.meet(Mode::Radiance, sample.wi).is_some()) {
            let light = match sample.kind {
                EmitterKind::Surface => scene
                    .intersect(&point.end.ray(sample.wi))
                    .filter(|hit| hit.end.p.distance(sample.end.p) < 1e-4 * sample.distance)
                    .map(PathLight::Surface),
                EmitterKind::Infinite => Some(PathLight::Around(sample.wi)),
                EmitterKind::DeltaPosition | EmitterKind::DeltaDirection => Some(PathLight::Single(sample)),
            };
            let end = LightEnd::of_direct(scene, &sample, &point.end);
            let source = light.map(|light| Source { kind: sample.kind, end, light, to_light: sample.wi });
            list.extend(source.filter(|source| sound(&walk, source)).map(|source| found(scene, &walk, pixel, lens, &source)));
        }
        let Some(on) = point.scatter(Mode::Radiance, s.next_1d(), pair(&mut s), s.next_1d()) else { break };
        if let Some(last) = walk.last_mut() {
            last.on = Some(on);
        }
        (ray, before) = (point.end.ray(on.d), 0.0);
    }
    list
}

/// Is no direction so grazing that the rounding of places moves its cosine by a share that counts?
fn sound(walk: &[Walked<'_>], source: &Source) -> bool {
    let steep = |d: Vec3, point: &SurfacePoint<'_>| d.dot(point.end.n_g).abs() > 0.1 && d.dot(point.frame.n).abs() > 0.1;
    let light = match source.light {
        PathLight::Surface(hit) => source.to_light.dot(hit.end.n_g).abs() > 0.1 && hit.t > 0.1,
        PathLight::Around(_) | PathLight::Single(_) => true,
    };
    let on = |vertex: &Walked<'_>| vertex.on.map_or(source.to_light, |on| on.d);
    light && walk.iter().all(|v| v.length > 0.3 && steep(v.point.given, &v.point) && steep(on(v), &v.point))
}

/// Is no direction in a lobe's far tail, and no lobe so sharp, that the rounding of places moves
/// its density by a share that counts?
fn walkable(path: &Numbers) -> bool {
    let sound = |pdf: f32| pdf == 0.0 || (pdf > 1e-5 && pdf < 30.0);
    path.events.iter().all(|e| [e.to_camera, e.to_light].into_iter().all(sound))
}

#[test]
fn recursion_is_the_definition_on_real_paths() {
    let folders = [
        "scenes/textured-room",
        "scenes/glass-box",
        "scenes/box",
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
        "tests/scenes/constant-light",
        "tests/scenes/directional-light",
        "tests/scenes/envmap-rotated",
    ];
    let mut report = Vec::new();
    for folder in folders {
        let scene = scene(folder);
        let radius = f64::from(scene.bounding_sphere().1) * 1e-3;
        let (mut count, mut relative, mut sum) = (0, 0.0f64, 0.0f64);
        for Found { drawn, full } in (0..2_500).flat_map(|index| paths(&scene, index)).filter(|found| walkable(&found.drawn)).take(1_600) {
            count += 1;
            for techniques in SETS {
                for heuristic in heuristics() {
                    let sampling = Sampling { techniques, heuristic, light_paths: 1e5, camera_paths: 2.0, radius };
                    let defined = full.weights(&sampling);
                    let carried = drawn.recursion::<f32>(&sampling);
                    // What no walk makes, no walk weighs.
                    let connections = (0..=full.edges()).filter(|&s| full.connection(s) > 0.0);
                    let merges = (0..=full.edges()).filter(|&i| full.merge(i) > 0.0);
                    let pairs = connections.map(|s| (carried.connections[s], defined.connections[s]));
                    let mut total = 0.0;
                    for (a, b) in pairs.chain(merges.map(|i| (carried.merges[i], defined.merges[i]))) {
                        assert!(a.is_finite(), "{folder}: {sampling:?}, {drawn:?}");
                        // Weights that no picture shows are held to a share of a small one.
                        relative = relative.max((a - b).abs() / b.max(1e-6));
                        total += a;
                    }
                    sum = sum.max((total - defined.total()).abs());
                }
            }
        }
        report.push((folder, count, relative, sum));
    }
    assert!(report.iter().all(|&(_, count, relative, sum)| count >= 300 && relative <= 1e-4 && sum <= 1e-5), "{report:#?}");
}
