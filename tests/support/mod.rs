//! Shared by the test programs: scenes from text or file, independent runs, references.
#![allow(dead_code, reason = "each test program uses its own part")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use isophote::image::film::Film;
use isophote::image::tiles::Reference;
use isophote::integrators::{Common, IterationStats, METHODS};
use isophote::math::Rgb;
use isophote::scene::mitsuba::{LoadOptions, LoadedScene, load};
use rayon::prelude::*;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of scenes and references beside the checkout, if it is there. Says so loudly where it is not.
pub(crate) fn shared() -> Option<PathBuf> {
    let folder = root().parent()?.join("shared");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("\n*** SKIPPED: ../shared is absent, so nothing is compared with its references ***\n");
    None
}

pub(crate) fn load_file(file: &Path, resolution: Option<(u32, u32)>) -> LoadedScene {
    let options = LoadOptions { resolution, ..Default::default() };
    load(file, &options).unwrap_or_else(|e| panic!("{e}"))
}

/// A scene from the text between `<scene>` and `</scene>`, with a 32 x 32 film unless the text has a sensor.
pub(crate) fn load_text(body: &str) -> LoadedScene {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.xml");
    std::fs::write(&file, format!("<scene version=\"3.0.0\">{body}</scene>")).unwrap();
    load_file(&file, None)
}

/// A perspective sensor of `n` x `n` pixels looking from `from` to `to`.
pub(crate) fn sensor(from: [f32; 3], to: [f32; 3], up: [f32; 3], fov: f32, n: u32) -> String {
    let v = |a: [f32; 3]| format!("{}, {}, {}", a[0], a[1], a[2]);
    format!(
        "<sensor type=\"perspective\"><float name=\"fov\" value=\"{fov}\"/><float name=\"near_clip\" value=\"1e-5\"/>\
         <float name=\"far_clip\" value=\"1e9\"/><transform name=\"to_world\">\
         <lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"{n}\"/>\
         <integer name=\"height\" value=\"{n}\"/><rfilter type=\"box\"/></film></sensor>",
        v(from),
        v(to),
        v(up)
    )
}

pub(crate) fn common(seed: u64, max_depth: Option<u32>) -> Common {
    Common { seed, max_depth, min_depth: 1, rr_depth: 5, hide_emitters: false, paths: None }
}

/// One run: the mean image of `iterations` iterations, and what they did.
pub(crate) fn render(scene: &LoadedScene, method: &str, settings: &str, common: &Common, iterations: u64) -> (Vec<Rgb>, IterationStats) {
    let entry = METHODS.iter().find(|m| m.name == method).unwrap();
    let settings = (entry.from_json)(&serde_json::from_str(settings).unwrap()).unwrap();
    let (width, height) = scene.scene.camera().resolution();
    let mut integrator = settings.build(&scene.scene, (width, height), common).unwrap();
    let mut film = Film::new(width, height, false);
    let mut stats = integrator.prepare().unwrap();
    for i in 0..iterations {
        stats.add(&integrator.iterate(i, &mut film));
        film.finish_iteration();
    }
    (film.mean(), stats)
}

/// Independent runs, seeds 1, 2, ...
pub(crate) fn runs(scene: &LoadedScene, method: &str, settings: &str, base: &Common, iterations: u64, seeds: u64) -> Vec<Vec<Rgb>> {
    runs_of(scene, method, settings, base, iterations, 1..=seeds)
}

/// Independent runs of these seeds, in their order. They go side by side: an iteration of a small film leaves threads idle.
pub(crate) fn runs_of(
    scene: &LoadedScene,
    method: &str,
    settings: &str,
    base: &Common,
    iterations: u64,
    seeds: RangeInclusive<u64>,
) -> Vec<Vec<Rgb>> {
    let run = |seed| render(scene, method, settings, &Common { seed, ..base.clone() }, iterations).0;
    let seeds: Vec<u64> = seeds.collect();
    seeds.into_par_iter().with_max_len(1).map(run).collect()
}

/// `NAME.mean.exr` and `NAME.var.exr`.
pub(crate) fn reference(stem: &Path, runs: usize) -> Reference {
    let read = |ending: &str| {
        let file = PathBuf::from(format!("{}.{ending}.exr", stem.display()));
        isophote::image::exr::read_picture(&file).unwrap_or_else(|e| panic!("{e}"))
    };
    let (mean, variance) = (read("mean"), read("var"));
    Reference { width: mean.width, height: mean.height, mean: mean.pixels, variance: variance.pixels, runs }
}

/// Mean of all channels of all pixels.
pub(crate) fn image_mean(image: &[Rgb]) -> f64 {
    image.iter().map(|c| f64::from(c.mean())).sum::<f64>() / image.len() as f64
}
