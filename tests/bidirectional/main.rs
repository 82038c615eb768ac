//! Every technique of the engine of vertex connection and merging by itself, and all of them together, against the path tracer.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../support/mod.rs"]
mod support;

use isophote::integrators::Common;
use isophote::math::Rgb;
use isophote::math::statistics::{Sample, least_squares, sidak, welch};
use isophote::scene::mitsuba::LoadedScene;
use isophote::transport::class::pattern;
use support::{common, image_mean, load_file, load_text, runs, runs_of, sensor};

const SEEDS: u64 = 16;

const PLASTIC: &str = "<bsdf type=\"roughplastic\"><float name=\"alpha\" value=\"0.3\"/></bsdf>";
const MIRROR: &str = "<bsdf type=\"conductor\"><rgb name=\"specular_reflectance\" value=\"0.9\"/></bsdf>";

/// A floor and a wall that do not touch, a metal plate of roughness 0.3, a sphere of `ball`, and what lights them: with a mirror every class of
/// the tests below carries light here, and no two surfaces are so close that a connection between them has no variance.
fn stage(emitter: &str, ball: &str) -> LoadedScene {
    let rectangle = |turn: &str, scale: f32, at: &str, bsdf: &str| {
        format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"{scale}\"/>{turn}<translate value=\"{at}\"/></transform>{bsdf}</shape>"
        )
    };
    let grey = "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.8, 0.7, 0.6\"/></bsdf>";
    let metal = "<bsdf type=\"roughconductor\"><string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\"0.3\"/></bsdf>";
    load_text(&format!(
        "{}{}{}{}<shape type=\"sphere\"><float name=\"radius\" value=\"0.3\"/><point name=\"center\" x=\"0.5\" y=\"-0.6\" z=\"0.2\"/>\
         {ball}</shape>{emitter}",
        sensor([0.0, 0.1, -2.5], [0.0, -0.3, 1.0], [0.0, 1.0, 0.0], 50.0, 12),
        rectangle("<rotate x=\"1\" y=\"0\" z=\"0\" angle=\"-90\"/>", 1.0, "0, -1, 0", grey),
        rectangle("<rotate x=\"0\" y=\"1\" z=\"0\" angle=\"180\"/>", 0.8, "0, 0.3, 1.2", grey),
        rectangle("<rotate x=\"0\" y=\"1\" z=\"0\" angle=\"90\"/>", 0.4, "-1.1, -0.3, 0.2", metal),
    ))
}

/// A large lamp, so that paths that can only hit it do.
const LAMP: &str = "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.6\"/><rotate x=\"1\" y=\"0\" z=\"0\" angle=\"90\"/>\
     <translate value=\"0, 1.2, 0\"/></transform><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0\"/></bsdf>\
     <emitter type=\"area\"><rgb name=\"radiance\" value=\"3, 2, 1\"/></emitter></shape>";

const POINT: &str = "<emitter type=\"point\"><point name=\"position\" x=\"0.1\" y=\"0.8\" z=\"-0.2\"/>\
     <rgb name=\"intensity\" value=\"1, 2, 3\"/></emitter>";

const SUN: &str = "<emitter type=\"directional\"><vector name=\"direction\" x=\"0.3\" y=\"-1\" z=\"0.6\"/>\
     <rgb name=\"irradiance\" value=\"3, 2, 1\"/></emitter>";

const SKY: &str = "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.5, 0.7, 0.9\"/></emitter>";

const SPOT: &str = "<emitter type=\"spot\"><transform name=\"to_world\"><lookat origin=\"0.1, 0.8, 0\" target=\"0.2, -0.6, 0.2\" \
     up=\"0, 0, 1\"/></transform><rgb name=\"intensity\" value=\"6, 5, 4\"/><float name=\"cutoff_angle\" value=\"60\"/></emitter>";

fn means(images: &[Vec<Rgb>]) -> Sample {
    Sample::of(&images.iter().map(|image| image_mean(image)).collect::<Vec<_>>())
}

/// Runs of one kind must be independent of those of all others: seeds of their own.
fn mean(scene: &LoadedScene, method: &str, settings: &str, base: &Common, iterations: u64) -> Sample {
    means(&runs(scene, method, settings, base, iterations, SEEDS))
}

fn path_mean(scene: &LoadedScene, base: &Common, iterations: u64) -> Sample {
    means(&runs_of(scene, "path", "{}", base, iterations, 5001..=5000 + SEEDS))
}

/// A technique alone, its mean at radius 0 if it merges; `sampler` is what is said of the light subpaths.
fn alone(scene: &LoadedScene, technique: &str, sampler: &str, base: &Common, iterations: u64) -> Sample {
    let settings = |more: &str| format!("{{\"alone\": \"{technique}\"{sampler}{more}}}");
    if !technique.starts_with("vm") {
        return mean(scene, "bdpt", &settings(""), base, iterations);
    }
    let radii = [0.04, 0.06, 0.08, 0.12];
    let at = |(k, radius): (usize, &f64)| {
        let photons = if sampler.is_empty() { ", \"photons\": 4000" } else { "" };
        let more = format!(", \"radius\": {radius}, \"alpha\": 1.0{photons}");
        let before = 100 * (k as u64 + 1);
        means(&runs_of(scene, "vcm", &settings(&more), base, iterations, before + 1..=before + SEEDS))
    };
    let samples: Vec<Sample> = radii.iter().enumerate().map(at).collect();
    let rows: Vec<Vec<f64>> = radii.iter().map(|r: &f64| vec![1.0, *r, r * r]).collect();
    let y: Vec<f64> = samples.iter().map(|s| s.mean).collect();
    let variance: Vec<f64> = samples.iter().map(|s| s.variance).collect();
    let fit = least_squares(&rows, &y, &variance).unwrap();
    Sample { n: SEEDS as f64, mean: fit.coefficients[0], variance: fit.covariance[0][0], freedom: 4.0 * (SEEDS as f64 - 1.0) }
}

/// Techniques that can make a class of paths, with the light that it comes from.
const CASES: [(&str, &str, &[&str]); 13] = [
    (LAMP, "LDE", &["vc0", "vc1", "lt", "vm1"]),
    (POINT, "LDE", &["vc1", "lt", "vm1"]),
    (SPOT, "LDE", &["vc1", "lt"]),
    (SUN, "LDE", &["vc1", "lt", "vm1"]),
    (SKY, "LDE", &["vc0", "vc1", "lt", "vm1"]),
    (LAMP, "LDDE", &["vc0", "vc1", "vc2", "lt", "vm1", "vm2"]),
    (POINT, "LDDE", &["vc1", "vc2", "lt", "vm1", "vm2"]),
    (SKY, "LDDE", &["vc0", "vc1", "vc2", "lt"]),
    (LAMP, "LSDE", &["vc0", "lt", "vm2"]),
    (LAMP, "LDSE", &["vc0", "vc1", "vm1"]),
    (POINT, "LDSE", &["vc1", "vm1"]),
    (LAMP, "LDGDE", &["vc0", "vc1", "vc2", "vc3", "lt", "vm1", "vm2", "vm3"]),
    (POINT, "LDGDE", &["vc1", "vc2", "vc3", "lt"]),
];

/// Every technique that can make a path of a class has the path tracer's mean, alone and with weight 1. `precision` is the largest relative
/// standard error of a comparison that counts as one.
fn pure(iterations: u64, precision: f64, sampler: &str, asked: impl Fn(&str, &str) -> bool) {
    let threshold = sidak(0.01, CASES.iter().map(|(.., techniques)| techniques.len()).sum());
    let (mut failures, mut compared) = (Vec::new(), 0);
    for (light, class, techniques) in CASES {
        let scene = stage(light, MIRROR);
        let base = Common { paths: Some(pattern(class).unwrap()), ..common(0, Some(6)) };
        let techniques: Vec<&str> = techniques.iter().copied().filter(|technique| asked(class, technique)).collect();
        if techniques.is_empty() {
            continue;
        }
        let path = path_mean(&scene, &base, 8 * iterations);
        for technique in techniques {
            let sample = alone(&scene, technique, sampler, &base, iterations);
            let p = welch(&sample, &path);
            let spread = (sample.variance + path.variance).sqrt() / path.mean;
            let line = format!("{class} {technique}: ratio {:.4} +- {spread:.4}, p {p:.1e}", sample.mean / path.mean);
            eprintln!("{line}");
            compared += 1;
            if p < threshold || spread.is_nan() || spread > precision {
                failures.push(line);
            }
        }
    }
    assert!(compared > 0 && failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn each_technique_alone_is_the_path_tracer() {
    pure(24, 0.1, "", |class, technique| class == "LDE" || class == "LDDE" && !technique.starts_with("vm") && technique != "vc0");
}

#[test]
#[ignore = "minutes; run by .ci/run"]
fn each_technique_alone_is_the_path_tracer_closely() {
    pure(256, 0.1, "", |class, technique| !(class == "LDGDE" && technique.starts_with("vm")));
}

/// The noisiest of them: three times the iterations for the same precision.
#[test]
#[ignore = "minutes; run by .ci/run"]
fn merges_alone_on_a_glossy_path_are_the_path_tracer() {
    pure(768, 0.1, "", |class, technique| class == "LDGDE" && technique.starts_with("vm"));
}

/// Those that use light subpaths, drawn by chains in every iteration: each path counts for what its strata say, in splats, connections and merges.
#[test]
#[ignore = "minutes; run by .ci/run"]
fn techniques_alone_by_chains_are_the_path_tracer() {
    let sampler = ", \"sampler\": \"visibility\", \"rest\": \"never\", \"burn_in\": 200, \"photons\": 4000, \"camera_paths\": 1";
    pure(96, 0.1, sampler, |class, technique| ["LDE", "LDDE"].contains(&class) && !["vc0", "vc1"].contains(&technique));
}

/// All techniques together, by every heuristic.
#[test]
fn all_techniques_together_are_the_path_tracer() {
    let threshold = sidak(0.01, 5 * 7 + 2 * 2);
    let mut failures = Vec::new();
    for (name, light) in [("lamp", LAMP), ("point", POINT), ("spot", SPOT), ("sun", SUN), ("sky", SKY)] {
        // Caustics of lights without size are beyond the path tracer.
        let scene = stage(light, if light == LAMP || light == SKY { MIRROR } else { PLASTIC });
        let base = common(0, Some(6));
        let path = path_mean(&scene, &base, 256);
        let vcm = |more: &str| format!("{{\"radius\": 0.01, \"photons\": 1000{more}}}");
        let cases = [
            ("bdpt", "{}".to_owned()),
            ("vcm", vcm("")),
            ("vcm", vcm(", \"merge_weights\": \"power\", \"beta\": 2")),
            ("vcm", vcm(", \"merge_weights\": \"vcm-plus\"")),
            ("vcm", vcm(", \"merge_weights\": \"vcm-star\"")),
            // Several camera subpaths a pixel: a splat is worth less beside them.
            ("bdpt", "{\"camera_paths\": 3}".to_owned()),
            ("vcm", vcm(", \"camera_paths\": 3")),
        ];
        // Chains at work: densities of light subpaths that weights are told of, and connections to paths that count for different amounts.
        let chains = |sampler: &str| {
            format!("\"sampler\": \"{sampler}\", \"rest\": \"never\", \"burn_in\": 100, \"photons\": 4000, \"camera_paths\": 4")
        };
        let sampled = [("bdpt", format!("{{{}}}", chains("visibility"))), ("vcm", format!("{{\"radius\": 0.01, {}}}", chains("spatial")))];
        let cases = cases.into_iter().chain(sampled.into_iter().filter(|_| name == "lamp" || name == "point"));
        for (method, settings) in cases {
            let sample = mean(&scene, method, &settings, &base, 32);
            let p = welch(&sample, &path);
            let spread = (sample.variance + path.variance).sqrt() / path.mean;
            let line = format!("{name}, {method} {settings}: ratio {:.5} +- {spread:.5}, p {p:.1e}", sample.mean / path.mean);
            eprintln!("{line}");
            // Merges weighed by VCM+ count for more than they find where fewer than one photon is expected.
            let precision = if settings.contains("vcm-plus") { 0.02 } else { 0.01 };
            if p < threshold || spread > precision {
                failures.push(line);
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Nothing that is not a number comes up in scenes as they are.
#[test]
fn no_contribution_is_given_up() {
    for light in [LAMP, POINT, SPOT, SUN, SKY] {
        let scene = stage(light, MIRROR);
        for (method, settings) in [("bdpt", "{}"), ("vcm", "{}"), ("vcm", "{\"merge_weights\": \"vcm-star\", \"beta\": 2}")] {
            let (image, stats) = support::render(&scene, method, settings, &common(1, Some(12)), 16);
            assert!(image.iter().all(|c| c.is_finite()) && image_mean(&image) > 0.0, "{method} {settings}");
            assert_eq!(stats.rejected.get("non_finite"), None, "{method} {settings}");
        }
    }
}

/// Light tracing, that is walks of the light's side and nothing else, over bent normals: the adjoint factor. What it does for paths through lobes
/// that are no deltas it does for all of these scenes.
#[test]
fn light_tracing_over_bent_normals_is_the_path_tracer() {
    let mut failures = Vec::new();
    for name in ["coarse-smooth-spheres", "obj-normals", "emitter-negative-scale"] {
        let scene = load_file(&support::root().join("tests/scenes").join(name).join("scene.xml"), Some((16, 16)));
        let base = Common { min_depth: 2, ..common(0, Some(4)) };
        let path = path_mean(&scene, &base, 256);
        let sample = mean(&scene, "vcm", "{\"techniques\": [\"lt\"], \"photons\": 2000}", &base, 32);
        let p = welch(&sample, &path);
        let spread = (sample.variance + path.variance).sqrt() / path.mean;
        let line = format!("{name}: ratio {:.5} +- {spread:.5}, p {p:.1e}", sample.mean / path.mean);
        eprintln!("{line}");
        if p < sidak(0.01, 3) || spread > 0.005 {
            failures.push(line);
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
