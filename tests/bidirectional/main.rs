//! Every technique of the engine of vertex connection and merging by itself, and all of them together, against the path tracer.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../support/mod.rs"]
mod support;

use isophote::integrators::Common;
use isophote::math::statistics::{Sample, least_squares, sidak, welch};
use isophote::scene::mitsuba::LoadedScene;
use isophote::transport::class::pattern;
use support::{common, image_mean, load_text, runs, sensor};

const SEEDS: u64 = 16;

/// A closed box with a metal plate of roughness 0.3, a mirror sphere and what lights it. Every class of the tests below carries light here.
fn stage(emitter: &str) -> LoadedScene {
    load_text(&format!(
        "{}<shape type=\"cube\"><boolean name=\"flip_normals\" value=\"true\"/>\
         <bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.6, 0.5, 0.4\"/></bsdf></shape>\
         <shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.5\"/><rotate x=\"1\" y=\"0\" z=\"0\" angle=\"-70\"/>\
         <translate x=\"-0.4\" y=\"-0.7\" z=\"0.2\"/></transform><bsdf type=\"twosided\"><bsdf type=\"roughconductor\">\
         <string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\"0.3\"/></bsdf></bsdf></shape>\
         <shape type=\"sphere\"><float name=\"radius\" value=\"0.35\"/><point name=\"center\" x=\"0.4\" y=\"-0.5\" z=\"0.3\"/>\
         <bsdf type=\"conductor\"><rgb name=\"specular_reflectance\" value=\"0.9\"/></bsdf></shape>{emitter}",
        sensor([0.0, 0.0, -0.95], [0.0, -0.1, 1.0], [0.0, 1.0, 0.0], 80.0, 12)
    ))
}

/// A large lamp, so that paths that can only hit it do.
const LAMP: &str = "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.6\"/><rotate x=\"1\" y=\"0\" z=\"0\" angle=\"90\"/>\
     <translate x=\"0\" y=\"0.95\" z=\"0\"/></transform><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0\"/></bsdf>\
     <emitter type=\"area\"><rgb name=\"radiance\" value=\"3, 2, 1\"/></emitter></shape>";

const POINT: &str = "<emitter type=\"point\"><point name=\"position\" x=\"0.1\" y=\"0.8\" z=\"0\"/>\
     <rgb name=\"intensity\" value=\"1, 2, 3\"/></emitter>";

const SPOT: &str = "<emitter type=\"spot\"><transform name=\"to_world\"><lookat origin=\"0.1, 0.8, 0\" target=\"0.2, -0.6, 0.2\" \
     up=\"0, 0, 1\"/></transform><rgb name=\"intensity\" value=\"6, 5, 4\"/><float name=\"cutoff_angle\" value=\"60\"/></emitter>";

fn mean(scene: &LoadedScene, method: &str, settings: &str, base: &Common, iterations: u64) -> Sample {
    let images = runs(scene, method, settings, base, iterations, SEEDS);
    Sample::of(&images.iter().map(|i| image_mean(i)).collect::<Vec<_>>())
}

/// A technique alone, its mean at radius 0 if it merges.
fn alone(scene: &LoadedScene, technique: &str, base: &Common, iterations: u64) -> Sample {
    let settings = |more: &str| format!("{{\"alone\": \"{technique}\"{more}}}");
    if !technique.starts_with("vm") {
        return mean(scene, "bdpt", &settings(""), base, iterations);
    }
    let radii = [0.03, 0.045, 0.06, 0.09];
    // Radii must be independent of each other: seeds of their own.
    let at = |(k, radius): (usize, &f64)| {
        let more = format!(", \"radius\": {radius}, \"alpha\": 1.0, \"photons\": 2000");
        let images = (1..=SEEDS).map(|s| {
            let base = Common { seed: 100 * (k as u64 + 1) + s, ..base.clone() };
            image_mean(&support::render(scene, "vcm", &settings(&more), &base, iterations).0)
        });
        Sample::of(&images.collect::<Vec<_>>())
    };
    let samples: Vec<Sample> = radii.iter().enumerate().map(at).collect();
    let rows: Vec<Vec<f64>> = radii.iter().map(|r: &f64| vec![1.0, *r, r * r]).collect();
    let y: Vec<f64> = samples.iter().map(|s| s.mean).collect();
    let variance: Vec<f64> = samples.iter().map(|s| s.variance).collect();
    let fit = least_squares(&rows, &y, &variance).unwrap();
    Sample { n: SEEDS as f64, mean: fit.coefficients[0], variance: fit.covariance[0][0], freedom: 4.0 * (SEEDS as f64 - 1.0) }
}

/// Every technique that can make a path of the class has the path tracer's mean, alone and with weight 1.
fn pure(light: &str, class: &str, techniques: &[&str], precision: f64, iterations: u64) -> Vec<String> {
    let scene = stage(light);
    let base = Common { paths: Some(pattern(class).unwrap()), ..common(0, Some(6)) };
    let path = mean(&scene, "path", "{}", &base, 32 * iterations);
    let threshold = sidak(0.01, 60);
    let mut failures = Vec::new();
    for technique in techniques {
        let sample = alone(&scene, technique, &base, iterations);
        let p = welch(&sample, &path);
        let spread = (sample.variance + path.variance).sqrt() / path.mean;
        let line = format!("{class} {technique}: ratio {:.4} +- {spread:.4}, p {p:.1e}", sample.mean / path.mean);
        eprintln!("{line}");
        if p < threshold || spread > precision || path.mean <= 0.0 {
            failures.push(line);
        }
    }
    failures
}

#[test]
fn each_connection_alone_is_the_path_tracer() {
    let mut failures = Vec::new();
    failures.extend(pure(LAMP, "LDE", &["vc0", "vc1", "lt"], 0.01, 64));
    failures.extend(pure(POINT, "LDE", &["vc1", "lt"], 0.01, 64));
    failures.extend(pure(SPOT, "LDE", &["vc1", "lt"], 0.01, 64));
    failures.extend(pure(LAMP, "LDDE", &["vc0", "vc1", "vc2", "lt"], 0.02, 64));
    failures.extend(pure(POINT, "LDDE", &["vc1", "vc2", "lt"], 0.02, 64));
    failures.extend(pure(LAMP, "LSDE", &["vc0", "lt"], 0.02, 64));
    failures.extend(pure(LAMP, "LDSE", &["vc0", "vc1"], 0.02, 64));
    failures.extend(pure(POINT, "LDSE", &["vc1"], 0.02, 64));
    failures.extend(pure(LAMP, "LDGDE", &["vc0", "vc1", "vc2", "vc3", "lt"], 0.04, 64));
    failures.extend(pure(POINT, "LDGDE", &["vc1", "vc2", "vc3", "lt"], 0.04, 64));
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
#[ignore]
fn adhoc() {
    let light = match std::env::var("LIGHT").unwrap().as_str() {
        "lamp" => LAMP,
        "point" => POINT,
        _ => SPOT,
    };
    let class = std::env::var("CLASS").unwrap();
    let techniques = std::env::var("TECH").unwrap();
    let n: u64 = std::env::var("N").unwrap().parse().unwrap();
    let list: Vec<&str> = techniques.split(',').collect();
    eprintln!("{:?}", pure(light, &class, &list, 1.0, n));
}
