//! Every photon sampler has the same expected image at a constant radius.

use super::support::{common, load_file, render, root, shared};
use isophote::image::tiles::{run_means, tiles};
use isophote::integrators::Common;
use isophote::math::Rgb;
use isophote::math::statistics::{Sample, sidak, welch};
use rayon::prelude::*;
use std::path::PathBuf;

const SEEDS: u64 = 16;
/// Of 100,000 light paths each.
const ITERATIONS: u64 = 12;
const SAMPLERS: [&str; 4] = ["visibility", "kernel", "image", "spatial"];
/// Scenes a family holds.
const SCENES: usize = 7;

/// Independent runs; samplers take seeds of their own, so that camera subpaths are not shared.
fn images(scene: &isophote::scene::mitsuba::LoadedScene, method: &str, sampler: &str, number: u64) -> Vec<Vec<Rgb>> {
    let alpha = if method == "bdpt" { "" } else { "\"alpha\": 1.0, " };
    let settings = format!("{{\"sampler\": \"{sampler}\", {alpha}\"photons\": 100000}}");
    // Chains that rest would test nothing. Bidirectional methods would trace as many camera subpaths as light subpaths: two a pixel.
    let chains = if method == "sppm" { ", \"rest\": \"never\"}" } else { ", \"rest\": \"never\", \"camera_paths\": 2}" };
    let settings = if sampler == "uniform" { settings } else { settings.replace('}', chains) };
    let base = common(0, scene.defaults.max_depth);
    let run = |seed| render(scene, method, &settings, &Common { seed: 100 * number + seed, ..base.clone() }, ITERATIONS).0;
    (1..=SEEDS).into_par_iter().map(run).collect()
}

/// Run-level Welch tests of every sampler against `base`, the image and tiles of 256 pixels, three channels. Where `base` is not the uniform
/// sampler the image is held against that one too.
fn samplers_agree(file: PathBuf, size: (u32, u32), base: &str) {
    agree(file, size, "sppm", &SAMPLERS, base, SCENES);
}

/// As [`samplers_agree`], for a method, some samplers, and a family of so many scenes.
fn agree(file: PathBuf, size: (u32, u32), method: &str, samplers: &[&str], base: &str, scenes: usize) {
    let scene = load_file(&file, Some(size));
    let (width, height) = (size.0 as usize, size.1 as usize);
    let kept = vec![true; width * height];
    let mut places = vec![("image".to_owned(), (0..kept.len()).collect::<Vec<usize>>())];
    places.extend(tiles(width, height, 16, &kept).into_iter().map(|((x, y), p)| (format!("tile ({x}, {y})"), p)));
    let threshold = sidak(0.01, places.len() * 3 * samplers.len() * scenes);
    let uniform = images(&scene, method, "uniform", 0);
    let bases =
        if base == "uniform" { vec![(base, uniform)] } else { vec![(base, images(&scene, method, base, 99)), ("uniform", uniform)] };
    let mut failures = Vec::new();
    for (number, sampler) in (1..).zip(samplers.iter().copied()) {
        let runs = images(&scene, method, sampler, number);
        // Where the uniform sampler is no base, visibility is as blind as it: tiles that most runs see no light in have no Student's law.
        let tiles = base == "uniform" || sampler != "visibility";
        let compared = |(k, (place, _)): (usize, &(String, Vec<usize>))| (k == 0 && tiles) || place == "image";
        for (k, (place, pixels)) in (0..bases.len()).flat_map(|k| places.iter().map(move |place| (k, place))).filter(|&pair| compared(pair))
        {
            let (base, reference) = &bases[k];
            for channel in 0..3 {
                let [a, b] = [reference, &runs].map(|runs| Sample::of(&run_means(runs, pixels, channel)));
                let p = welch(&a, &b);
                let line = format!(
                    "{sampler}, {place}, channel {channel}: {:.5} +- {:.5}, {base} {:.5} +- {:.5}, p {p:.1e}",
                    b.mean,
                    b.variance.sqrt(),
                    a.mean,
                    a.variance.sqrt()
                );
                if place == "image" {
                    eprintln!("{method} {} {line}", file.display());
                }
                if p < threshold {
                    failures.push(line);
                }
            }
        }
    }
    eprintln!("{}: {} of {} tests below {threshold:.1e}", file.display(), failures.len(), places.len() * 3 * samplers.len());
    assert!(failures.is_empty(), "{}:\n{}", file.display(), failures.join("\n"));
}

macro_rules! own {
    ($($test:ident: $scene:literal, $base:literal;)*) => {$(
        #[test]
        #[ignore = "minutes; hall and canyon run by .ci/run, the others by hand"]
        fn $test() {
            samplers_agree(root().join("scenes").join($scene).join("scene.xml"), (96, 72), $base);
        }
    )*};
}

own! {
    samplers_on_hall: "hall", "uniform";
    samplers_on_villa: "villa", "uniform";
    // Of independent paths one in ten thousand lights the near half of the picture: whole tiles stay black.
    samplers_on_canyon: "canyon", "kernel";
    samplers_on_pool: "pool", "uniform";
    samplers_on_balls: "balls", "uniform";
}

macro_rules! foreign {
    ($($test:ident: $scene:literal;)*) => {$(
        #[test]
        #[ignore = "minutes; run by .ci/run"]
        fn $test() {
            let Some(shared) = shared() else { return };
            samplers_agree(shared.join("scenes").join($scene).join("scene.xml"), (96, 96), "uniform");
        }
    )*};
}

foreign! {
    samplers_on_cbox_spheres: "cbox-spheres";
    samplers_on_veach_bidir: "veach-bidir";
}

macro_rules! bidirectional {
    ($($test:ident: $method:literal, $scene:literal;)*) => {$(
        #[test]
        #[ignore = "minutes; run by .ci/run, glass-box by hand"]
        fn $test() {
            let file = root().join("scenes").join($scene).join("scene.xml");
            agree(file, (96, 72), $method, &["visibility", "spatial"], "uniform", 4);
        }
    )*};
}

bidirectional! {
    vcm_samplers_on_hall: "vcm", "hall";
    vcm_samplers_on_glass_box: "vcm", "glass-box";
    vcm_samplers_on_balls: "vcm", "balls";
    bdpt_samplers_on_hall: "bdpt", "hall";
}
