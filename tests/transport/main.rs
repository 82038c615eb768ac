//! Whole methods on scenes whose answer is known.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod density;
#[path = "../support/mod.rs"]
mod support;

use isophote::integrators::{Common, METHODS};
use isophote::math::statistics::{Sample, sidak, student_two_sided};
use isophote::scene::mitsuba::LoadedScene;
use support::{common, image_mean, load_text, render, runs, sensor};

/// A closed sphere seen from inside that emits `le` and reflects `rho`: radiance `le rho^(d-1)` for paths of `d` edges, `le/(1-rho)` in all.
fn furnace(rho: f32, le: f32) -> LoadedScene {
    load_text(&format!(
        "{}<shape type=\"sphere\"><boolean name=\"flip_normals\" value=\"true\"/>\
         <bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"{rho}\"/></bsdf>\
         <emitter type=\"area\"><rgb name=\"radiance\" value=\"{le}\"/></emitter></shape>",
        sensor([0.2, 0.1, 0.0], [0.2, 0.1, 1.0], [0.0, 1.0, 0.0], 60.0, 16)
    ))
}

/// A closed cube that emits and reflects everywhere: corners, edges and shadow-ray ends at their worst.
fn furnace_cube(rho: f32, le: f32) -> LoadedScene {
    load_text(&format!(
        "{}<shape type=\"cube\"><boolean name=\"flip_normals\" value=\"true\"/>\
         <bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"{rho}\"/></bsdf>\
         <emitter type=\"area\"><rgb name=\"radiance\" value=\"{le}\"/></emitter></shape>",
        sensor([0.3, 0.1, -0.5], [0.3, 0.1, 1.0], [0.0, 1.0, 0.0], 80.0, 16)
    ))
}

/// Two-sided p-value that run means have this expectation.
fn p_of(sample: &Sample, expected: f64) -> f64 {
    if sample.variance <= 0.0 {
        return if (sample.mean - expected).abs() < 1e-5 * expected { 1.0 } else { 0.0 };
    }
    student_two_sided((sample.mean - expected) / sample.variance.sqrt(), sample.freedom)
}

fn run_mean(scene: &LoadedScene, method: &str, settings: &str, base: &Common, iterations: u64) -> Sample {
    let images = runs(scene, method, settings, base, iterations, 16);
    Sample::of(&images.iter().map(|i| image_mean(i)).collect::<Vec<_>>())
}

#[test]
fn a_furnace_has_the_same_radiance_everywhere_and_per_depth() {
    let (rho, le) = (0.5, 0.5);
    let mut failures = Vec::new();
    let threshold = sidak(0.01, 12);
    for (shape, scene) in [("sphere", furnace(rho, le)), ("cube", furnace_cube(rho, le))] {
        for depth in 1..=5u32 {
            let base = Common { min_depth: depth, ..common(0, Some(depth)) };
            let sample = run_mean(&scene, "path", "{}", &base, 8);
            let expected = f64::from(le * rho.powi(depth as i32 - 1));
            let p = p_of(&sample, expected);
            if p < threshold {
                failures.push(format!("{shape}, depth {depth}: {sample:?}, expected {expected}, p {p:.2e}"));
            }
        }
        let sample = run_mean(&scene, "path", "{}", &common(0, None), 16);
        if p_of(&sample, 1.0) < threshold {
            failures.push(format!("{shape}, all depths: {sample:?}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Photons fill a furnace evenly, so density estimation has no bias away from edges; per depth it must agree too.
#[test]
fn photon_mapping_of_a_spherical_furnace() {
    let scene = furnace(0.5, 0.5);
    let settings = "{\"radius\": 0.1, \"alpha\": 1.0, \"photons\": 4000}";
    let threshold = sidak(0.01, 4);
    let mut failures = Vec::new();
    for (depth, expected) in [(Some(1), 0.5), (Some(2), 0.75), (Some(4), 0.9375), (None, 1.0)] {
        let sample = run_mean(&scene, "sppm", settings, &common(0, depth), 8);
        // The cap that a ball of radius r cuts from the sphere has area pi r^2 exactly: curvature adds no bias.
        if p_of(&sample, expected) < threshold {
            failures.push(format!("depth {depth:?}: {sample:?}, expected {expected}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// A diffuse floor and what lights it, seen from `from` at the point (0, 0, 0) alone.
fn floor(from: [f32; 3], extra: &str) -> LoadedScene {
    load_text(&format!(
        "{}<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"10\"/></transform>\
         <bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.8\"/></bsdf></shape>{extra}",
        sensor(from, [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.02, 4)
    ))
}

/// Radiance leaving a Lambertian floor under irradiance `e`.
fn leaving(e: f64) -> f64 {
    e * 0.8 / std::f64::consts::PI
}

#[test]
fn direct_light_has_its_analytic_value() {
    let pi = std::f64::consts::PI;
    // A square of half-side a at height h facing down, seen from the point under its centre: the standard configuration factor, four corners.
    let (a, h) = (0.5f64, 2.0f64);
    let (x, y) = (a / h, a / h);
    let corner = 0.5 / pi
        * (x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan() + y / (1.0 + y * y).sqrt() * (x / (1.0 + y * y).sqrt()).atan());
    let down = "<transform name=\"to_world\"><rotate x=\"1\" y=\"0\" z=\"0\" angle=\"180\"/>";
    let cases = [
        ("point", "<emitter type=\"point\"><point name=\"position\" x=\"0.5\" y=\"0\" z=\"2\"/><rgb name=\"intensity\" value=\"3\"/></emitter>".to_owned(), {
            let d2: f64 = 0.25 + 4.0;
            3.0 * 2.0 / d2.sqrt() / d2
        }),
        ("sphere", "<shape type=\"sphere\"><point name=\"center\" x=\"0\" y=\"0\" z=\"3\"/><float name=\"radius\" value=\"1\"/><emitter type=\"area\"><rgb name=\"radiance\" value=\"2\"/></emitter></shape>".to_owned(), pi * 2.0 / 9.0),
        ("rectangle", format!("<shape type=\"rectangle\">{down}<scale x=\"0.5\" y=\"0.5\" z=\"1\"/><translate x=\"0\" y=\"0\" z=\"2\"/></transform><emitter type=\"area\"><rgb name=\"radiance\" value=\"2\"/></emitter></shape>"), pi * 2.0 * 4.0 * corner),
        ("disk", format!("<shape type=\"disk\">{down}<translate x=\"0\" y=\"0\" z=\"2\"/></transform><emitter type=\"area\"><rgb name=\"radiance\" value=\"2\"/></emitter></shape>"), pi * 2.0 / 5.0),
        ("constant", "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.7\"/></emitter>".to_owned(), pi * 0.7),
        ("directional", "<emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"3\" z=\"-4\"/><rgb name=\"irradiance\" value=\"2\"/></emitter>".to_owned(), 2.0 * 0.8),
    ];
    let threshold = sidak(0.01, cases.len());
    let mut failures = Vec::new();
    for (name, emitter, irradiance) in cases {
        // From the side, where no emitter hangs in between.
        let scene = floor([4.0, 0.0, 4.0], &emitter);
        let base = Common { min_depth: 2, ..common(0, Some(2)) };
        let sample = run_mean(&scene, "path", "{}", &base, 64);
        let p = p_of(&sample, leaving(irradiance));
        if p < threshold {
            failures.push(format!("{name}: {sample:?}, expected {}, p {p:.2e}", leaving(irradiance)));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// A small closed box with a lamp, a mirror sphere and a glass sphere, scaled as a whole.
fn still_life(scale: f32) -> LoadedScene {
    let s = scale;
    let v = |x: f32, y: f32, z: f32| [x * s, y * s, z * s];
    let center = |x: f32, y: f32, z: f32| format!("<point name=\"center\" x=\"{}\" y=\"{}\" z=\"{}\"/>", x * s, y * s, z * s);
    load_text(&format!(
        "{}<shape type=\"cube\"><boolean name=\"flip_normals\" value=\"true\"/><transform name=\"to_world\"><scale value=\"{s}\"/></transform>\
         <bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.6\"/></bsdf></shape>\
         <shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"1\" y=\"0\" z=\"0\" angle=\"90\"/><scale value=\"{}\"/>\
         <translate x=\"0\" y=\"{}\" z=\"0\"/></transform><emitter type=\"area\"><rgb name=\"radiance\" value=\"3\"/></emitter></shape>\
         <shape type=\"sphere\"><float name=\"radius\" value=\"{}\"/>{}<bsdf type=\"conductor\"/></shape>\
         <shape type=\"sphere\"><float name=\"radius\" value=\"{}\"/>{}<bsdf type=\"dielectric\"/></shape>",
        sensor(v(0.0, 0.0, -0.95), v(0.0, 0.0, 1.0), [0.0, 1.0, 0.0], 80.0, 24),
        0.5 * s,
        0.99 * s,
        0.3 * s,
        center(-0.4, -0.7, 0.3),
        0.3 * s,
        center(0.4, -0.6, 0.2),
    ))
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let scene = still_life(1.0);
    for method in METHODS {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render(&scene, method.name, "{}", &common(7, None), 3))
        };
        let (one, stats) = on(1);
        assert!(image_mean(&one) > 0.0);
        for threads in [2, 3, 8] {
            let (image, other) = on(threads);
            assert!(image.iter().zip(&one).all(|(a, b)| a == b), "{} with {threads} threads", method.name);
            assert_eq!(other, stats, "{} with {threads} threads", method.name);
        }
    }
}

/// There is no absolute length anywhere: a scene a thousand times smaller or larger is the same picture.
#[test]
fn scaled_scenes_give_the_same_picture() {
    let reference = still_life(1.0);
    for method in METHODS {
        let mean = |scene: &LoadedScene| run_mean(scene, method.name, "{}", &common(0, Some(12)), 4);
        let one = mean(&reference);
        for scale in [1e-3, 1e3] {
            let scaled = mean(&still_life(scale));
            let p = isophote::math::statistics::welch(&one, &scaled);
            assert!(p > 0.001, "{} at scale {scale}: {scaled:?} against {one:?}", method.name);
            // The same seeds walk nearly the same paths, so the means differ by far less than their noise.
            assert!((scaled.mean / one.mean - 1.0).abs() < 0.01, "{} at scale {scale}: {} against {}", method.name, scaled.mean, one.mean);
        }
    }
}

/// Photon mapping, extrapolated to radius 0, and path tracing agree on the still life: reflections, refractions, caustics.
#[test]
fn photon_mapping_extrapolates_to_path_tracing() {
    let scene = still_life(1.0);
    let base = common(0, Some(8));
    let path = run_mean(&scene, "path", "{}", &base, 64);
    let radii = [1.0, 1.5, 2.0, 3.0];
    let samples: Vec<Sample> = radii
        .iter()
        .map(|r| run_mean(&scene, "sppm", &format!("{{\"radius_pixels\": {r}, \"alpha\": 1.0, \"photons\": 20000}}"), &base, 20))
        .collect();
    let rows: Vec<Vec<f64>> = radii.iter().map(|r: &f64| vec![1.0, *r, r * r]).collect();
    let y: Vec<f64> = samples.iter().map(|s| s.mean).collect();
    let variance: Vec<f64> = samples.iter().map(|s| s.variance).collect();
    let fit = isophote::math::statistics::least_squares(&rows, &y, &variance).unwrap();
    let intercept = Sample { n: 16.0, mean: fit.coefficients[0], variance: fit.covariance[0][0], freedom: 60.0 };
    let p = isophote::math::statistics::welch(&intercept, &path);
    assert!(p > 0.01, "intercept {intercept:?}, path {path:?}, E(r) {y:?}, p {p:.2e}");
    assert!((intercept.variance.sqrt() / intercept.mean) < 0.01, "the test has no power: {intercept:?}");
}
