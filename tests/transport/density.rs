//! How densely photons lie (`--aov density`), where it is known.

use super::p_of;
use super::support::{common, load_file, load_text, root, sensor};
use isophote::image::film::Film;
use isophote::image::readings::Readings;
use isophote::integrators::{Common, METHODS, MethodError};
use isophote::math::statistics::{Sample, sidak, welch};
use isophote::scene::mitsuba::LoadedScene;
use rayon::prelude::*;
use std::f64::consts::PI;

const SEEDS: u64 = 8;
/// Pixels across the film that looks at the plane, and of a tile.
const ACROSS: usize = 16;
const TILE: usize = 4;

/// A plane one below a point light, seen from two above.
fn plane() -> LoadedScene {
    load_text(&format!(
        "{}<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"9\"/><rotate x=\"1\" y=\"0\" z=\"0\" angle=\"-90\"/>\
         </transform><bsdf type=\"diffuse\"/></shape><emitter type=\"point\"><point name=\"position\" x=\"0\" y=\"1\" z=\"0\"/>\
         <rgb name=\"intensity\" value=\"1, 2, 3\"/></emitter>",
        sensor([0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 60.0, ACROSS as u32)
    ))
}

/// Direct light alone: each path leaves one vertex.
fn direct(seed: u64) -> Common {
    common(seed, Some(2))
}

/// Of a path in all directions alike, per unit of the plane: `cos / (4 pi d^2) = 1 / (4 pi d^3)`, over each pixel.
fn truth() -> Vec<f64> {
    const FINE: usize = 8;
    let half = 2.0 * (PI / 6.0).tan();
    let at = |i: usize| ((i as f64 + 0.5) / (ACROSS * FINE) as f64 * 2.0 - 1.0) * half;
    let mut image = vec![0.0; ACROSS * ACROSS];
    for (y, x) in (0..ACROSS * FINE).flat_map(|y| (0..ACROSS * FINE).map(move |x| (y, x))) {
        let d2 = 1.0 + at(x).powi(2) + at(y).powi(2);
        image[y / FINE * ACROSS + x / FINE] += 1.0 / (4.0 * PI * d2.powf(1.5) * (FINE * FINE) as f64);
    }
    image
}

/// A film with densities or without.
fn film(scene: &LoadedScene, (method, settings): (&str, &str), common: &Common, iterations: u64, reads: bool) -> Film {
    let entry = METHODS.iter().find(|m| m.name == method).unwrap();
    let settings = (entry.from_json)(&serde_json::from_str(settings).unwrap()).unwrap();
    let (width, height) = scene.scene.camera().resolution();
    let mut integrator = settings.build(&scene.scene, (width, height), common).unwrap();
    let mut film = Film::new(width, height, false);
    if reads {
        film.keep_readings(Readings::new(integrator.density_images().unwrap(), width * height));
    }
    integrator.prepare().unwrap();
    for i in 0..iterations {
        integrator.iterate(i, &mut film);
        film.finish_iteration();
    }
    film
}

/// An image of densities over independent runs.
fn runs(scene: &LoadedScene, method: (&str, &str), base: &Common, iterations: u64, image: usize) -> Vec<Vec<f64>> {
    let seeds: Vec<u64> = (1..=SEEDS).map(|seed| base.seed + seed).collect();
    let run = |seed| film(scene, method, &Common { seed, ..base.clone() }, iterations, true).readings().unwrap().mean(image);
    seeds.into_par_iter().with_max_len(1).map(|seed| run(seed).into_iter().map(f64::from).collect()).collect()
}

fn mean_over(image: &[f64], pixels: &[usize]) -> f64 {
    pixels.iter().map(|&pixel| image[pixel]).sum::<f64>() / pixels.len() as f64
}

fn over(runs: &[Vec<f64>], pixels: &[usize]) -> Sample {
    Sample::of(&runs.iter().map(|image| mean_over(image, pixels)).collect::<Vec<_>>())
}

/// The image and its tiles.
fn places(width: usize, height: usize) -> Vec<Vec<usize>> {
    let mut tiles = vec![Vec::new(); width.div_ceil(TILE) * height.div_ceil(TILE)];
    (0..width * height).for_each(|i| tiles[i / width / TILE * width.div_ceil(TILE) + i % width / TILE].push(i));
    tiles.push((0..width * height).collect());
    tiles
}

fn sampled(sampler: &str) -> String {
    let chains = if sampler == "uniform" { "" } else { ", \"rest\": \"never\", \"burn_in\": 200" };
    format!("{{\"sampler\": \"{sampler}\", \"radius\": 0.05, \"alpha\": 1.0, \"photons\": 20000{chains}}}")
}

const SAMPLERS: [&str; 5] = ["uniform", "visibility", "kernel", "image", "spatial"];

#[test]
fn every_sampler_has_the_density_of_a_plane_under_a_point_light() {
    let (scene, truth, places) = (plane(), truth(), places(ACROSS, ACROSS));
    let threshold = sidak(0.01, SAMPLERS.len() * places.len());
    let mut failures = Vec::new();
    for (number, sampler) in (0..).zip(SAMPLERS) {
        let runs = runs(&scene, ("sppm", &sampled(sampler)), &direct(100 * number), 6, 0);
        for pixels in &places {
            let (sample, expected) = (over(&runs, pixels), mean_over(&truth, pixels));
            let (p, spread) = (p_of(&sample, expected), sample.variance.sqrt() / expected);
            let line =
                format!("{sampler}: {:.4} +- {spread:.4} of the truth over {} pixels, p {p:.1e}", sample.mean / expected, pixels.len());
            if pixels.len() == truth.len() {
                eprintln!("{line}");
            }
            let precise = spread < if pixels.len() == truth.len() { 0.01 } else { 0.04 };
            failures.extend((p < threshold || !precise).then_some(line));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// With light between surfaces, glass among them, and pixels that measure in some iterations alone.
#[test]
fn samplers_agree_on_the_density_in_a_box_with_glass() {
    let size = (24, 24);
    let scene = load_file(&root().join("scenes/glass-box/scene.xml"), Some(size));
    let places = places(size.0 as usize, size.1 as usize);
    let base = |seed| common(seed, Some(5));
    let settings = |sampler| sampled(sampler).replace("\"radius\": 0.05", "\"radius_pixels\": 1.0");
    let uniform = runs(&scene, ("sppm", &settings("uniform")), &base(0), 4, 0);
    let threshold = sidak(0.01, 2 * places.len());
    let mut failures = Vec::new();
    for (number, sampler) in (1..).zip(["visibility", "spatial"]) {
        let runs = runs(&scene, ("sppm", &settings(sampler)), &base(100 * number), 4, 0);
        // Whether a pixel has measured is up to camera subpaths.
        let known = |pixel: &usize| uniform.iter().chain(&runs).all(|image| image[*pixel].is_finite());
        for place in &places {
            let pixels: Vec<usize> = place.iter().copied().filter(known).collect();
            if pixels.is_empty() {
                continue;
            }
            let [a, b] = [&uniform, &runs].map(|runs| over(runs, &pixels));
            let (p, spread) = (welch(&a, &b), (a.variance + b.variance).sqrt() / a.mean);
            let line = format!("{sampler}: {:.4} +- {spread:.4} of uniform, p {p:.1e}, {} pixels", b.mean / a.mean, pixels.len());
            let whole = place.len() == (size.0 * size.1) as usize;
            if whole {
                eprintln!("{line}");
                assert!(2 * pixels.len() > place.len() && spread < 0.01, "{line}");
            }
            failures.extend((p.is_nan() || p < threshold).then_some(line));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// What targets read, and the map that weights ask, are smoothed: near the truth, not equal to it.
#[test]
fn regions_and_maps_are_near_the_density_of_the_plane() {
    let (scene, truth) = (plane(), truth());
    let star = "{\"merge_weights\": \"vcm-star\", \"radius\": 0.02, \"alpha\": 1.0, \"photons\": 100000}";
    let (image, spatial) = (sampled("image"), sampled("spatial"));
    for (method, settings, number, allowed) in [("sppm", image.as_str(), 1, 0.15), ("sppm", &spatial, 1, 0.15), ("vcm", star, 0, 0.1)] {
        let runs = runs(&scene, (method, settings), &direct(0), 6, number);
        let ratio = |pixels: &Vec<usize>| over(&runs, pixels).mean / mean_over(&truth, pixels);
        let ratios: Vec<f64> = places(ACROSS, ACROSS).iter().map(ratio).collect();
        let (image, tiles) = (ratios[ratios.len() - 1], &ratios[..ratios.len() - 1]);
        let off = tiles.iter().map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max);
        eprintln!("{method} {settings}: {image:.4} of the truth, a tile off by {off:.4} at most");
        assert!((image - 1.0).abs() < 0.03 && off < allowed, "{method} {settings}: {image}, {ratios:.3?}");
    }
}

#[test]
fn densities_change_no_bit_and_threads_change_none_of_theirs() {
    let scene = load_file(&root().join("scenes/glass-box/scene.xml"), Some((16, 12)));
    let star = "{\"merge_weights\": \"vcm-star\"}";
    for (method, settings) in [("sppm", sampled("uniform").as_str()), ("sppm", &sampled("spatial")), ("vcm", star)] {
        let on = |threads: usize, reads: bool| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| film(&scene, (method, settings), &common(3, Some(5)), 3, reads))
        };
        let (one, three) = (on(1, true), on(3, true));
        assert!(one == three, "{method} {settings}");
        assert_eq!(one.mean(), on(2, false).mean(), "{method} {settings}");
        let densities = one.readings().unwrap().mean(0);
        assert!(densities.iter().filter(|v| **v > 0.0).count() > densities.len() / 2, "{method} {settings}: {densities:?}");
    }
}

#[test]
fn methods_without_densities_say_so() {
    let scene = plane();
    let refused = |method: &str, settings: &str| {
        let entry = METHODS.iter().find(|m| m.name == method).unwrap();
        let settings = (entry.from_json)(&serde_json::from_str(settings).unwrap()).unwrap();
        settings.build(&scene.scene, (ACROSS, ACROSS), &direct(0)).unwrap().density_images()
    };
    for (method, settings) in [("path", "{}"), ("bdpt", "{}"), ("vcm", "{}")] {
        assert!(matches!(refused(method, settings), Err(MethodError::NoDensity)), "{method} {settings}");
    }
    assert_eq!(refused("vcm", "{\"merge_weights\": \"vcm-plus\"}").unwrap(), ["density"]);
    assert_eq!(refused("sppm", "{}").unwrap(), ["density"]);
    assert_eq!(refused("sppm", "{\"sampler\": \"spatial\"}").unwrap(), ["density", "density.region"]);
}
