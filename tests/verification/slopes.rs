//! How fast errors fall: noise and bias of `sppm` and noise of `path` over two decades of iterations.
//!
//! The estimate after n iterations is a mean over radii r_i = r_0 (i+1)^((alpha-1)/2): its variance goes as n^-alpha, so the standard deviation as
//! n^(-alpha/2), and its bias as r^2, n^(alpha-1), where illumination is smooth within the disk (\[KNAUS11\]). Across an edge the bias of a
//! pixel goes as r at best, so it is measured on a mask: pixels farther than r_0 from every shadow boundary and silhouette (`slopes/mask.txt`, made by `mask.py`).

use super::support::{common, load_file, root};
use isophote::image::film::Film;
use isophote::image::picture::Picture;
use isophote::image::runs::Runs;
use isophote::integrators::{Common, METHODS};
use isophote::math::statistics::least_squares;
use isophote::scene::mitsuba::LoadedScene;
use rayon::prelude::*;

/// Iterations measured: two decades, from where the sums have settled (at 10 the first few radii still bend the curve by 0.03).
const POINTS: [u64; 8] = [16, 32, 64, 128, 256, 512, 1024, 1600];

fn pictures(scene: &LoadedScene, method: &str, settings: &str, common: &Common, points: &[u64]) -> Vec<Picture> {
    let entry = METHODS.iter().find(|m| m.name == method).unwrap();
    let settings = (entry.from_json)(&serde_json::from_str(settings).unwrap()).unwrap();
    let (width, height) = scene.scene.camera().resolution();
    let mut integrator = settings.build(&scene.scene, (width, height), common).unwrap();
    let mut film = Film::new(width, height, false);
    integrator.prepare().unwrap();
    let mut kept = Vec::new();
    for i in 0..points[points.len() - 1] {
        integrator.iterate(i, &mut film);
        film.finish_iteration();
        if points.contains(&(i + 1)) {
            kept.push(Picture::new(width, height, film.mean()));
        }
    }
    kept
}

/// What `seeds` runs say together, at each point.
fn curve(scene: &LoadedScene, method: &str, settings: &str, base: &Common, seeds: u64) -> Vec<Runs> {
    let seeds: Vec<u64> = (1..=seeds).collect();
    let runs: Vec<Vec<Picture>> =
        seeds.par_iter().map(|&seed| pictures(scene, method, settings, &Common { seed, ..base.clone() }, &POINTS)).collect();
    let (width, height) = scene.scene.camera().resolution();
    let together = |point: usize| {
        let mut all = Runs::new(width, height);
        runs.iter().for_each(|run| all.add(&run[point]).unwrap());
        all
    };
    (0..POINTS.len()).map(together).collect()
}

/// Slope of log y on log n, every point with the same weight.
fn slope(y: &[f64]) -> f64 {
    let rows: Vec<Vec<f64>> = POINTS.iter().map(|n| vec![1.0, (*n as f64).ln()]).collect();
    let logs: Vec<f64> = y.iter().map(|y| y.ln()).collect();
    least_squares(&rows, &logs, &vec![1.0; y.len()]).unwrap().coefficients[1]
}

fn list(values: &[f64]) -> String {
    values.iter().map(|v| format!("{v:.2e}")).collect::<Vec<_>>().join(" ")
}

/// Pixels of one kind.
fn mask(kind: u8) -> Vec<bool> {
    let text = std::fs::read(root().join("tests/verification/slopes/mask.txt")).unwrap();
    text.into_iter().filter(|c| *c != b'\n').map(|c| c == kind).collect()
}

#[test]
#[ignore = "minutes; run by .ci/run"]
fn noise_and_bias_of_sppm_fall_as_the_radius_says() {
    let scene = load_file(&root().join("tests/verification/slopes/scene.xml"), None);
    let base = common(0, Some(2));
    let truth = pictures(&scene, "path", "{}", &base, &[4096]).remove(0);
    let (smooth, edge) = (mask(b'#'), mask(b'~'));
    let mut failures = Vec::new();
    for alpha in [2.0 / 3.0, 0.8] {
        let settings = format!(r#"{{"radius": 0.3, "photons": 10000, "alpha": {alpha}}}"#);
        let runs = curve(&scene, "sppm", &settings, &base, 32);
        let parts = |chosen: &[bool]| -> Vec<_> {
            runs.iter().map(|r| r.split(&truth, None).unwrap().average_where(|pixel| chosen[pixel]).unwrap()).collect()
        };
        let (on_smooth, on_edge) = (parts(&smooth), parts(&edge));
        let noise: Vec<f64> = on_smooth.iter().map(|p| p.variance.sqrt()).collect();
        let bias: Vec<f64> = on_smooth.iter().map(|p| p.bias2.max(0.0).sqrt()).collect();
        let bias_at_edges: Vec<f64> = on_edge.iter().map(|p| p.bias2.max(0.0).sqrt()).collect();
        eprintln!(
            "sppm, alpha {alpha:.3}: standard deviation {}\n  bias {}\n  bias near the shadow's edge {}",
            list(&noise),
            list(&bias),
            list(&bias_at_edges)
        );
        let (noise, bias, edges) = (slope(&noise), slope(&bias), slope(&bias_at_edges));
        eprintln!(
            "  slopes: noise {noise:.3} (theory {:.3}), bias {bias:.3} (theory {:.3}), near the edge {edges:.3} (root of r: {:.3})",
            -alpha / 2.0,
            alpha - 1.0,
            (alpha - 1.0) / 4.0
        );
        failures.extend(((noise + alpha / 2.0).abs() > 0.05).then(|| format!("noise {noise} at alpha {alpha}")));
        failures.extend(((bias - (alpha - 1.0)).abs() > 0.05).then(|| format!("bias {bias} at alpha {alpha}")));
    }
    assert!(failures.is_empty(), "{failures:?}");
}

#[test]
#[ignore = "minutes; run by .ci/run"]
fn noise_of_path_falls_as_one_over_the_root() {
    let scene = load_file(&root().join("scenes/box/scene.xml"), Some((24, 24)));
    let runs = curve(&scene, "path", "{}", &common(0, Some(6)), 16);
    let noise: Vec<f64> = runs
        .iter()
        .map(|r| {
            let variance = r.variance().unwrap();
            let values = variance.pixels.iter().flat_map(|p| p.to_array());
            (values.map(f64::from).sum::<f64>() / (3 * variance.pixels.len()) as f64).sqrt()
        })
        .collect();
    let found = slope(&noise);
    eprintln!("path: standard deviation {}, slope {found:.3}", list(&noise));
    assert!((found + 0.5).abs() < 0.05, "slope {found}");
}
