//! Paths of real scenes: the scene's numbers asked for from both ends, and the recursion from what walks drew against the definition from
//! what materials answer afterwards.

use super::{Event, Light, Numbers, SETS, Segment, heuristics};
use crate::samplers::{Key, Purpose, Stream, UniformStream};
use crate::scene::Scene;
use crate::scene::bsdf::{Lobes, Mode};
use crate::scene::emitter::EmitterKind;
use crate::scene::mitsuba::{LoadOptions, load};
use crate::transport::mis::{LightEnd, Sampling};
use crate::transport::shading::{Scattered, SurfacePoint};
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
    point: SurfacePoint<'a>,
    length: f32,
    on: Option<Scattered>,
}

/// A path from the camera to a light, as drawn and as asked for afterwards.
fn numbers(walk: &[Walked<'_>], pixel: f32, kind: EmitterKind, end: &LightEnd, to_light: Vec3) -> [Numbers; 2] {
    let light = match kind {
        EmitterKind::Surface => Light::Surface,
        EmitterKind::DeltaPosition => Light::Position,
        EmitterKind::DeltaDirection => Light::Direction,
        EmitterKind::Infinite => Light::Environment,
    };
    // The light's edge as two cosines over a squared length of 1.
    let mut segments = vec![Segment { cos_left: end.edge.back, cos_arrived: end.edge.ahead, distance2: 1.0 }];
    let (mut drawn, mut asked) = (Vec::new(), Vec::new());
    for (i, vertex) in walk.iter().enumerate().rev() {
        let point = &vertex.point;
        let wi = point.frame.to_local(vertex.on.map_or(to_light, |on| on.d));
        let wo = point.given_local;
        // From the light: this vertex is left towards the camera's side.
        segments.push(Segment {
            cos_left: point.given.dot(point.end.n_g).abs(),
            cos_arrived: i.checked_sub(1).map_or(1.0, |before| point.given.dot(walk[before].point.end.n_g).abs()),
            distance2: vertex.length * vertex.length,
        });
        let rough = Event {
            to_light: point.bsdf.pdf(point.uv, wo, wi, Lobes::All),
            to_camera: point.bsdf.pdf(point.uv, wi, wo, Lobes::All),
            delta: None,
            merges: true,
            photons: 1.0 + i as f32,
        };
        let events = match vertex.on {
            None => [rough, rough],
            Some(on) if on.delta => {
                let delta = Some([wi.z.abs(), wo.z.abs(), 1.0 / on.eta]);
                [Event { to_light: on.pdf_fwd, to_camera: on.pdf_rev, delta, merges: false, ..rough }; 2]
            }
            Some(on) => [Event { to_light: on.pdf_fwd, to_camera: on.pdf_rev, ..rough }, rough],
        };
        drawn.push(events[0]);
        asked.push(events[1]);
    }
    let path = |events| Numbers {
        light,
        segments: segments.clone(),
        events,
        position: end.emission.sampled,
        direction: 1.0,
        direct: end.emission.direct,
        pixel,
    };
    [path(drawn), path(asked)]
}

/// Every path of a few camera walks: those that end at a light, and those that a light sample completes.
fn paths(scene: &Scene, index: u64) -> Vec<[Numbers; 2]> {
    let mut s = stream(index);
    let (width, height) = scene.camera().resolution();
    let film = pair(&mut s) * Vec2::new(width as f32, height as f32);
    let start = scene.camera().ray(film, pair(&mut s));
    let pixel = start.pdf_pixel.0;
    let (mut ray, mut before) = (start.ray, start.start);
    let mut walk: Vec<Walked<'_>> = Vec::new();
    let mut found = Vec::new();
    while walk.len() < 7 {
        let hit = scene.intersect(&ray);
        if let Some(from) = walk.last().map(|last| last.point.end) {
            let (kind, end) = match &hit {
                Some(hit) => (EmitterKind::Surface, LightEnd::of_hit(scene, hit, ray.d, &from)),
                None => (EmitterKind::Infinite, LightEnd::of_escape(scene, ray.d, &from)),
            };
            found.extend(end.map(|end| numbers(&walk, pixel, kind, &end, ray.d)));
        }
        let Some(point) = hit.and_then(|hit| SurfacePoint::new(&hit, scene.bsdf(hit.shape), ray.d)) else { break };
        let length = before + hit.map_or(0.0, |hit| hit.t);
        walk.push(Walked { point, length, on: None });
        let sample = scene.sample_direct(point.end.p, s.next_1d(), pair(&mut s));
        if let Some(sample) = sample.filter(|sample| point.eval_pdf(sample.wi, Mode::Radiance, Lobes::All).1 > 0.0) {
            let end = LightEnd::of_direct(scene, &sample, &point.end);
            found.push(numbers(&walk, pixel, sample.kind, &end, sample.wi));
        }
        let Some(on) = point.sample(Mode::Radiance, Lobes::All, s.next_1d(), pair(&mut s)) else { break };
        if let Some(last) = walk.last_mut() {
            last.on = Some(on);
        }
        (ray, before) = (point.end.ray(on.d), 0.0);
    }
    found
}

/// Is no density so small, in a lobe's far tail, that its square is out of f32's range? No walk draws a direction there.
fn walkable(path: &Numbers) -> bool {
    path.events.iter().all(|e| [e.to_camera, e.to_light].into_iter().all(|pdf| pdf == 0.0 || pdf > 1e-12))
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
        "tests/scenes/blendbsdf",
        "tests/scenes/point-light",
        "tests/scenes/directional-light",
        "tests/scenes/envmap-rotated",
    ];
    let mut report = Vec::new();
    for folder in folders {
        let scene = scene(folder);
        let radius = f64::from(scene.bounding_sphere().1) * 1e-3;
        let (mut count, mut relative, mut sum) = (0, 0.0f64, 0.0f64);
        for [drawn, asked] in (0..1_500).flat_map(|index| paths(&scene, index)).filter(|[_, asked]| walkable(asked)) {
            let full = asked.full();
            count += 1;
            for techniques in SETS {
                for heuristic in heuristics() {
                    let sampling = Sampling { techniques, heuristic, light_paths: 1e5, radius };
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
