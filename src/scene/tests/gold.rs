//! Against the values in `tests/oracle`, dumped from Mitsuba 3.9.1.

use super::gold_xml;
use super::kit::{apart, scene, scene_with_lights, stream};
use crate::math::Rgb;
use crate::samplers::Stream;
use crate::scene::emitter::{Emitter, EmitterKind};
use crate::scene::ray::Ray;
use crate::scene::texture::{Checkerboard, Texture};
use glam::{Affine2, Vec2, Vec3};
use serde_json::Value;
use std::path::PathBuf;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/oracle")
}

fn gold(file: &str) -> Value {
    // Mitsuba's own failures (a direction to a light that cannot be sampled) are written as NaN, which is no JSON.
    let text = std::fs::read_to_string(folder().join(file)).unwrap().replace("NaN", "null");
    serde_json::from_str(&text).unwrap()
}

fn f(value: &Value) -> f32 {
    value.as_f64().unwrap() as f32
}

fn vec2(value: &Value) -> Vec2 {
    Vec2::new(f(&value[0]), f(&value[1]))
}

fn vec3(value: &Value) -> Vec3 {
    Vec3::new(f(&value[0]), f(&value[1]), f(&value[2]))
}

fn rgb(value: &Value) -> Rgb {
    Rgb::from(vec3(value).to_array())
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

#[test]
fn cameras_send_mitsubas_rays() {
    let values = gold("camera_values.json");
    let mut rays = 0;
    for entry in list(&values["cameras"]) {
        let name = entry["name"].as_str().unwrap();
        let camera = gold_xml::camera(entry["xml"].as_str().unwrap());
        let crop = camera.film().crop_offset.map(|n| n as f32);
        assert_eq!(camera.resolution().0 as u64, entry["output_size"][0].as_u64().unwrap(), "{name}");
        for ray in list(&entry["rays"]) {
            let film = vec2(&ray["film"]) - Vec2::from(crop);
            let lens = if ray["aperture"].is_null() { Vec2::ZERO } else { vec2(&ray["aperture"]) };
            let ours = camera.ray(film, lens);
            assert!(apart(ours.ray.d, vec3(&ray["d"])) < 2e-6, "{name} {ray}: {ours:?}");
            assert!(apart(ours.ray.o, vec3(&ray["o"])) < 2e-6, "{name} {ray}: {ours:?}");
            assert!((ours.ray.t_max / f(&ray["maxt"]) - 1.0).abs() < 1e-5, "{name} {ray}: {ours:?}");
            rays += 1;
        }
    }
    assert!(rays > 80, "only {rays} rays");
}

#[test]
fn shapes_are_where_mitsuba_has_them() {
    let values = gold("shape_values.json");
    let mut hits = 0;
    for entry in list(&values["shapes"]) {
        let name = entry["name"].as_str().unwrap();
        let Some((geometry, _)) = gold_xml::shape(entry["xml"].as_str().unwrap()) else {
            continue;
        };
        // A light that varies, so that texture coordinates are found.
        let (color0, color1, to_uv) = (Texture::grey(1.0), Texture::grey(2.0), Affine2::IDENTITY);
        let board = Texture::Checkerboard(Box::new(Checkerboard { color0, color1, to_uv }));
        let scene = scene_with_lights(vec![(geometry, Some(board))], Vec::new());
        let Emitter::Area(light) = &scene.emitters()[0] else { panic!("no light") };
        assert!((light.area() / f(&entry["area"]) - 1.0).abs() < 1e-6, "{name}: area {} {}", light.area(), entry["area"]);
        for ray in list(&entry["rays"]) {
            let hit = scene.intersect(&Ray::new(vec3(&ray["o"]), vec3(&ray["d"])));
            assert_eq!(hit.is_some(), ray["hit"].as_bool().unwrap(), "{name} {ray}");
            let Some(hit) = hit else { continue };
            let near = |ours: Vec3, key: &str, bound: f32| {
                assert!(apart(ours, vec3(&ray[key])) < bound, "{name}: {key} is {ours}, not {}", ray[key]);
            };
            assert!((hit.t - f(&ray["t"])).abs() < 4e-6, "{name}: t {} {}", hit.t, ray["t"]);
            near(hit.end.p, "p", 4e-6);
            // Under a mirroring transform Mitsuba's geometric normal follows the winding; ours takes the shading normal's side.
            let (n, n_s) = (vec3(&ray["n"]), vec3(&ray["sh_n"]));
            let turned = if n.dot(n_s) < 0.0 { -n } else { n };
            assert!(apart(hit.end.n_g, turned) < 4e-6, "{name}: n is {}, not {turned}", hit.end.n_g);
            near(hit.frame.n, "sh_n", 4e-6);
            assert!((hit.uv - vec2(&ray["uv"])).abs().max_element() < 4e-6, "{name}: uv {} {}", hit.uv, ray["uv"]);
            hits += 1;
        }
    }
    assert!(hits > 200, "only {hits} hits");
}

#[test]
fn tangents_follow_mitsubas_texture_coordinates() {
    use crate::scene::BsdfId;
    use crate::scene::accel::{Accel, Bvh};
    use crate::scene::shape::surface::{Asked, Owner, Surfaces};
    let values = gold("shape_values.json");
    for entry in list(&values["shapes"]) {
        let name = entry["name"].as_str().unwrap();
        let Some((geometry, _)) = gold_xml::shape(entry["xml"].as_str().unwrap()) else {
            continue;
        };
        let (mut surfaces, mut primitives) = (Surfaces::default(), Vec::new());
        let owner = Owner { bsdf: BsdfId(0), emitter: None, asked: Asked { tangents: true, uv: true } };
        surfaces.push(&geometry, owner, &mut primitives);
        let tree = Bvh::build(&primitives);
        for entry in list(&entry["rays"]).iter().filter(|e| e["hit"] == true) {
            let ray = Ray::new(vec3(&entry["o"]), vec3(&entry["d"]));
            let hit = surfaces.hit(&ray, &tree.closest(&ray).unwrap());
            assert!(apart(hit.frame.s, vec3(&entry["frame_s"])) < 2e-5, "{name}: {} {}", hit.frame.s, entry["frame_s"]);
        }
    }
}

/// The image behind the gold values of envmaps.
fn env() -> (usize, usize, Vec<Rgb>) {
    use exr::prelude::*;
    let image = read_first_rgba_layer_from_file(
        folder().join("data/env.exr"),
        |size, _| (size, vec![Rgb::BLACK; size.area()]),
        |(size, pixels), at, (r, g, b, _): (f32, f32, f32, f32)| pixels[at.y() * size.width() + at.x()] = Rgb::new(r, g, b),
    )
    .unwrap();
    let (size, pixels) = image.layer_data.channel_data.pixels;
    (size.width(), size.height(), pixels)
}

#[test]
fn emitters_shine_as_mitsubas() {
    let values = gold("emitter_values.json");
    let env = env();
    let (mut seen, mut delta, mut falloff) = (0, 0, 0);
    for entry in list(&values["emitters"]) {
        let name = entry["name"].as_str().unwrap();
        let xml = entry["xml"].as_str().unwrap();
        let mut shapes = vec![gold_xml::shape(entry["floor"].as_str().unwrap()).unwrap()];
        let mut emitters = Vec::new();
        if xml.starts_with("<shape") {
            match gold_xml::shape(xml) {
                Some((geometry, Some(radiance))) => shapes.push((geometry, Some(radiance))),
                _ => continue,
            }
        } else {
            emitters.push(gold_xml::emitter(xml, &env));
        }
        let scene = scene(shapes, emitters);
        let kind = scene.emitters()[0].kind();
        // --- radiance and density along directions
        for toward in list(&entry["toward"]) {
            let (p, d) = (vec3(&toward["p"]), vec3(&toward["d"]));
            // From a point on the light itself Mitsuba's ray meets the light at once, ours does not.
            if toward["dist"].as_f64().is_some_and(|dist| dist < 1e-3) {
                continue;
            }
            // At the poles of an image the azimuth, and with it the radiance, is anything.
            if name == "envmap" && d.y.abs() > 0.999_999 {
                continue;
            }
            let (emitted, distance) = match scene.intersect(&Ray::new(p + 1e-4 * d, d)) {
                Some(hit) => (scene.emitted(&hit, -d, p), Some(hit.t + 1e-4)),
                None => (scene.escaped(d), None),
            };
            let expected = rgb(&toward["value"]);
            let error = (emitted.radiance - expected).map(f32::abs).max_component();
            assert!(error < 1e-4 * (1.0 + expected.max_component()), "{name}: {:?} {toward}", emitted.radiance);
            if let (Some(distance), false) = (distance, toward["dist"].is_null()) {
                assert!((distance - f(&toward["dist"])).abs() < 1e-5, "{name}: {distance} {toward}");
            }
            // The density of an image is ours: only where it is zero must both agree, which the radiance says.
            let pdf = f(&toward["pdf"]);
            if !name.starts_with("envmap") && !expected.is_black() {
                assert!((emitted.pdf_direct.0 / pdf - 1.0).abs() < 2e-4, "{name}: density {:?} {toward}", emitted.pdf_direct);
            }
            seen += 1;
        }
        // --- light arriving from deltas
        if matches!(kind, EmitterKind::DeltaPosition | EmitterKind::DeltaDirection) {
            for shade in list(&entry["shade"]) {
                let expected = rgb(&shade["weight"]);
                match scene.sample_direct(vec3(&shade["p"]), 0.5, vec2(&shade["u"])) {
                    Some(sample) => {
                        assert!(apart(sample.wi, vec3(&shade["d"])) < 1e-6, "{name}: {sample:?} {shade}");
                        let error = (sample.radiance - expected).map(f32::abs).max_component();
                        assert!(error < 1e-5, "{name}: {sample:?} {shade}");
                        assert_eq!(sample.pdf.0, 1.0, "{name}");
                    }
                    None => assert!(expected.is_black(), "{name}: {shade}"),
                }
                delta += 1;
            }
        }
        if let (Emitter::Spot(spot), false) = (&scene.emitters()[0], entry["falloff"].is_null()) {
            let axis = gold_axis(&scene);
            for step in list(&entry["falloff"]) {
                let angle = f(&step["angle"]).to_radians();
                let d = glam::Quat::from_axis_angle(axis.any_orthonormal_vector(), angle) * axis;
                // Seen from one unit away the irradiance is the intensity.
                let ours = scene.sample_direct(spot.position() + d, 0.5, Vec2::ZERO).map_or(Rgb::BLACK, |s| s.radiance);
                let error = (ours - rgb(&step["intensity"])).map(f32::abs).max_component();
                assert!(error < 2e-4, "{name}: {ours:?} {step}");
                falloff += 1;
            }
        }
    }
    assert!(seen > 100 && delta > 50 && falloff > 10, "too little was compared: {seen} {delta} {falloff}");
}

/// The direction in which a spot alone in its scene shines, found by its own samples: their mean.
fn gold_axis(scene: &crate::scene::Scene) -> Vec3 {
    let mut numbers = stream(1);
    let mut cone = Vec3::ZERO;
    for _ in 0..64 {
        // Opposite azimuths cancel to the axis.
        let (h, turn) = (numbers.next_1d(), 0.5 * numbers.next_1d());
        for turn in [turn, turn + 0.5] {
            if let Some(sample) = scene.sample_emission(0.5, Vec2::ZERO, Vec2::new(h, turn)) {
                cone += sample.d;
            }
        }
    }
    cone.normalize()
}
