//! References: what is in them, going on run by run, the cache, and no image compared with itself.

use crate::bench::Bench;
use isophote::image::exr::read_picture;
use serde_json::Value;
use std::path::Path;

const STUDY: &str = "seeds = 1\nbudget = { iterations = 2 }\n[reference]\nmethod = \"sppm\"\nradius = 0.2\nruns = 3\n\
    budget = { iterations = 2 }\ncache = \"shared\"\n[[scene]]\nfile = \"lamp/scene.xml\"\n[[method]]\nname = \"path\"\n";

const REFERENCE: [&str; 10] = ["reference", "path", "lamp/scene.xml", "--runs", "4", "--iterations", "3", "--seed", "7", "-q"];

fn reference<'a>(name: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    REFERENCE.iter().copied().chain(["-o", name]).chain(more.iter().copied()).collect()
}

#[test]
fn a_reference_is_the_mean_of_its_runs_and_the_variance_of_that() {
    let bench = Bench::new();
    let about: Value = serde_json::from_str(&bench.succeed(&reference("ref", &["--json"]))).unwrap();
    assert_eq!((&about["runs"], &about["seeds"], &about["method"]), (&4.into(), &serde_json::json!([7, 8, 9, 10]), &"path".into()));
    assert_eq!(about["iterations"], serde_json::json!([3, 3, 3, 3]));
    let runs: Vec<_> = (7..11)
        .map(|seed| {
            let (seed, name) = (seed.to_string(), format!("{seed}.exr"));
            bench.succeed(&["render", "path", "lamp/scene.xml", "--iterations", "3", "--seed", &seed, "-o", &name, "-q"]);
            read_picture(&bench.path(&name)).unwrap()
        })
        .collect();
    let (mean, variance) = (read_picture(&bench.path("ref.mean.exr")).unwrap(), read_picture(&bench.path("ref.var.exr")).unwrap());
    let mut noise = 0.0;
    for p in 0..mean.pixels.len() {
        for c in 0..3 {
            let values: Vec<f64> = runs.iter().map(|run| f64::from(run.pixels[p][c])).collect();
            let average = values.iter().sum::<f64>() / 4.0;
            let spread = values.iter().map(|v| (v - average).powi(2)).sum::<f64>() / 3.0 / 4.0;
            assert!((f64::from(mean.pixels[p][c]) - average).abs() <= 1e-7 * average.abs(), "pixel {p}");
            assert!((f64::from(variance.pixels[p][c]) - spread).abs() <= 1e-6 * spread.abs() + 1e-18, "pixel {p}");
            noise += spread / (3.0 * mean.pixels.len() as f64);
        }
    }
    assert!(noise > 0.0 && (about["noise"].as_f64().unwrap() / noise - 1.0).abs() < 1e-6);
    // The variance beside the mean is found, and no run is left behind.
    let compared: Value = serde_json::from_str(&bench.succeed(&["compare", "ref.mean.exr", "7.exr", "--json"])).unwrap();
    assert!((compared["reference_var"]["mse"].as_f64().unwrap() / noise - 1.0).abs() < 1e-6);
    assert!(!bench.path("ref.runs").exists());
}

#[test]
fn runs_done_before_are_not_rendered_again_unless_they_are_others() {
    let bench = Bench::new();
    bench.succeed(&reference("ref", &[]));
    let bytes = |name: &str| std::fs::read(bench.path(name)).unwrap();
    let expected = (read_picture(&bench.path("ref.mean.exr")).unwrap(), read_picture(&bench.path("ref.var.exr")).unwrap());
    std::fs::create_dir(bench.path("again.runs")).unwrap();
    // One run as it should be, one cut short, one of another seed, one that is no image.
    let render = |seed: &str, iterations: &str, to: &str| {
        bench.succeed(&["render", "path", "lamp/scene.xml", "--iterations", iterations, "--seed", seed, "-o", to, "-q"]);
    };
    render("7", "3", "again.runs/7.exr");
    render("8", "2", "again.runs/8.exr");
    render("3", "3", "again.runs/9.exr");
    std::fs::write(bench.path("again.runs/10.exr"), &bytes("again.runs/7.exr")[..100]).unwrap();
    let stderr = bench.run(&reference("again", &[]).into_iter().filter(|a| *a != "-q").collect::<Vec<_>>()).2;
    assert!(
        !stderr.contains("run 1 of 4") && ["run 2 of 4", "run 3 of 4", "run 4 of 4"].iter().all(|run| stderr.contains(run)),
        "{stderr}"
    );
    let found = (read_picture(&bench.path("again.mean.exr")).unwrap(), read_picture(&bench.path("again.var.exr")).unwrap());
    assert!(found == expected);
}

#[test]
fn another_study_finds_the_reference() {
    let bench = Bench::new();
    bench.write("a.toml", STUDY);
    bench.write("b.toml", STUDY);
    bench.succeed(&["study", "a.toml", "-q"]);
    let (status, _, stderr) = bench.run(&["study", "b.toml"]);
    assert!(status == Some(0) && !stderr.contains("reference of"), "{stderr}");
    let (a, b) = (bench.essence("a.study"), bench.essence("b.study"));
    assert_eq!(a, b);
    let made = a.references[0].made.as_ref().unwrap();
    assert_eq!((made.method.as_str(), made.seeds.as_slice()), ("sppm", &[1 << 32, (1 << 32) + 1, (1 << 32) + 2][..]));
    // The study's own copy is enough.
    assert!(bench.path("b.study").join(&b.references[0].mean).is_file() && a.references[0].mean.starts_with("references"));
    assert_eq!(std::fs::read_dir(bench.path("shared")).unwrap().count(), 3);
}

#[test]
fn no_cell_is_compared_with_itself() {
    let bench = Bench::new();
    let same = STUDY.replace("method = \"sppm\"\nradius = 0.2\n", "").replace("seeds = 1", "seeds = [4294967297]");
    bench.write("s.toml", &same);
    let refused = |toml: &str, words: &str| {
        let (status, _, stderr) = bench.run(&["study", toml, "-q"]);
        assert!(status == Some(2) && stderr.contains(words) && stderr.contains("compared with itself"), "{stderr}");
    };
    refused("s.toml", "seed 4294967297");
    // A file that says that it was made so is refused as well; with another seed it is not.
    bench.succeed(&reference("ref", &[]));
    let given = STUDY.replace("file = \"lamp/scene.xml\"", "file = \"lamp/scene.xml\"\nreference = \"ref.mean.exr\"");
    bench.write("s.toml", &given.replace("seeds = 1", "seeds = 8"));
    refused("s.toml", "seed 7");
    bench.write("s.toml", &given);
    bench.succeed(&["study", "s.toml", "-q"]);
    let reference = &bench.essence("s.study").references[0];
    assert!(reference.made.is_none() && reference.var.is_some() && reference.noise.is_some_and(|noise| noise > 0.0));
    assert!(Path::new("references").join("x").parent() == reference.mean.parent());
}

#[test]
fn a_reference_of_another_size_is_refused_with_its_line() {
    let bench = Bench::new();
    bench.succeed(&reference("ref", &["--resolution", "6x4"]));
    bench.write("s.toml", &STUDY.replace("file = \"lamp/scene.xml\"", "file = \"lamp/scene.xml\"\nreference = \"ref.mean.exr\""));
    let (status, _, stderr) = bench.run(&["study", "s.toml", "-q"]);
    assert!(status == Some(2) && stderr.contains("s.toml:11:13: ") && stderr.contains("6x4 pixels, the scene 12x8"), "{stderr}");
    assert!(stderr.contains("resolution = \"6x4\""), "{stderr}");
}
