//! Help, `compare`, `info`, `list`, `completions`.

use crate::bench::Bench;
use isophote::image::metrics::{METRICS, definitions};
use isophote::integrators::METHODS;
use isophote::math::Rgb;

#[test]
fn every_command_and_method_has_help() {
    let bench = Bench::new();
    for command in ["render", "compare", "diagnose", "info", "list", "completions"] {
        assert!(bench.succeed(&[command, "--help"]).contains("Usage"), "{command}");
        assert!(bench.succeed(&["--help"]).contains(command));
    }
    let options = "iterations time resolution crop hide-emitters max-depth min-depth paths seed threads snapshots checkpoint reference aov \
                   max-memory json preview exposure output define";
    for method in METHODS {
        let help = bench.succeed(&["render", method.name, "--help"]);
        for option in options.split_whitespace() {
            assert!(help.contains(&format!("--{option} ")) || help.contains(&format!("--{option}\n")), "{}: --{option}", method.name);
        }
        assert!(help.starts_with(method.about), "{help}");
        assert!(bench.succeed(&["render", "--help"]).contains(method.about));
    }
}

#[test]
fn compare_prints_the_metrics_of_hand_made_images() {
    let bench = Bench::new();
    bench.write("r.mean.exr", 1, vec![Rgb::new(0.0, 1.0, 2.0)]);
    bench.write("x.exr", 1, vec![Rgb::new(1.0, 1.0, 0.0)]);
    bench.write("y.exr", 1, vec![Rgb::new(0.0, f32::NAN, 2.0)]);
    bench.write("r.var.exr", 1, vec![Rgb::splat(0.25)]);
    let document = bench.json(&["compare", "r.mean.exr", "x.exr", "y.exr", "--json"]);
    let images = document["images"].as_array().unwrap();
    let check = |key: &str, expected: f64| {
        let found = images[0][key].as_f64().unwrap();
        assert!((found - expected).abs() < 1e-9 * expected.max(1.0), "{key}: {found}, by hand {expected}");
    };
    check("mse", 5.0 / 3.0);
    check("rmse", (5.0_f64 / 3.0).sqrt());
    check("relmse", (100.0 + 4.0 / 4.01) / 3.0);
    check("relmse_trimmed", (100.0 + 4.0 / 4.01) / 3.0);
    check("mape", (100.0 + 2.0 / 2.01) / 3.0);
    check("smape", (2.0 / 1.02 + 4.0 / 2.02) / 3.0);
    check("srrmse", (8.0_f64 / 3.0).sqrt());
    check("masked", 0.0);
    // A NaN masks its pixel; nothing is left to measure, and nothing is made up.
    assert_eq!((images[1]["masked"].as_u64(), images[1]["mse"].is_null()), (Some(1), true));
    // The variance beside the reference's mean is found.
    assert_eq!(document["reference_var"]["mse"], 0.25);
    let other = bench.json(&["compare", "r.mean.exr", "x.exr", "--epsilon", "1", "--json"]);
    assert_eq!(other["images"][0]["relmse"].as_f64().unwrap(), (1.0 + 4.0 / 5.0) / 3.0);
    let table = bench.succeed(&["compare", "r.mean.exr", "x.exr", "--epsilon", "0.5"]);
    assert!(METRICS.iter().all(|m| table.contains(m.name)) && table.contains("epsilon e = 0.5"), "{table}");
    assert!(METRICS.iter().all(|m| table.contains(m.formula)), "{table}");
}

#[test]
fn compare_takes_images_as_runs() {
    let bench = Bench::new();
    bench.write("r.mean.exr", 1, vec![Rgb::splat(2.0)]);
    bench.write("r.var.exr", 1, vec![Rgb::splat(0.25)]);
    for (name, value) in [("a.exr", 1.0), ("b.exr", 2.0), ("c.exr", 6.0)] {
        bench.write(name, 1, vec![Rgb::splat(value)]);
    }
    let command = ["compare", "r.mean.exr", "a.exr", "b.exr", "c.exr", "--runs", "--epsilon", "3"];
    let runs = bench.json(&[&command[..], &["--json"]].concat())["runs"].clone();
    // Mean 3, s^2 = 7, s_r^2 = 1/4; over r^2 + 3 = 7.
    let check = |key: &str, expected: f64| {
        let found = runs.pointer(key).unwrap().as_f64().unwrap();
        assert!((found - expected).abs() < 1e-12, "{key}: {found}, by hand {expected}");
    };
    check("/count", 3.0);
    check("/nsd", 7.0_f64.sqrt() / 3.0);
    check("/absolute/mse", 17.0 / 3.0);
    check("/absolute/variance", 7.0);
    check("/absolute/bias2", 1.0 - 7.0 / 3.0 - 0.25);
    check("/absolute/reference_variance", 0.25);
    check("/relative/variance", 1.0);
    let text = bench.succeed(&command);
    assert!(text.contains("nsd 8.81917e-1 over 3 runs") && text.contains("-1.58333e0"), "{text}");
    assert!(bench.json(&["compare", "r.mean.exr", "a.exr", "--json"])["runs"].is_null());
    let refused = bench.run(&["compare", "r.mean.exr", "a.exr", "--runs"]);
    let error = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && error.contains("two images or more"), "{error}");
}

#[test]
fn compare_measures_crops_and_writes_a_page() {
    let bench = Bench::new();
    let reference = vec![Rgb::splat(1.0), Rgb::splat(2.0), Rgb::splat(3.0), Rgb::splat(4.0)];
    bench.write("r.exr", 2, reference.clone());
    bench.write("x.exr", 2, vec![reference[0], Rgb::splat(2.5), reference[2], Rgb::splat(7.0)]);
    let crops = ["--inset", "1,0,1,1", "--inset", "0,1,2,1"];
    let document = bench.json(&[&["compare", "r.exr", "x.exr", "--json", "--html", "page.html"], &crops[..]].concat());
    let insets = document["images"][0]["insets"].as_array().unwrap();
    let mse: Vec<f64> = insets.iter().map(|inset| inset["mse"].as_f64().unwrap()).collect();
    assert_eq!(mse, [0.25, 4.5]);
    assert_eq!((insets[1]["x"].as_u64(), insets[1]["y"].as_u64(), insets[1]["pixels"].as_u64()), (Some(0), Some(1), Some(2)));
    let table = bench.succeed(&[&["compare", "r.exr", "x.exr"], &crops[..]].concat());
    assert!(table.contains("  1,0,1,1  ") && table.contains("  0,1,2,1  "), "{table}");
    let page = std::fs::read_to_string(bench.path("page.html")).unwrap();
    assert!(page.contains("crop 0,1,2,1") && page.contains("4.5000") && page.ends_with("</html>\n"), "{page}");
    assert!(METRICS.iter().all(|m| page.contains(&format!("<th scope=\"col\">{}</th>", m.name))));
    // Nothing to fetch: no address but those of namespaces.
    assert!(!page.replace("http://www.w3.org/", "").contains("http"), "{page}");
}

#[test]
fn info_tells_what_is_in_a_scene_and_in_an_image() {
    let bench = Bench::new();
    let scene = bench.json(&["info", "lamp/scene.xml", "--resolution", "20x10", "--json"]);
    assert_eq!((scene["width"].as_u64(), scene["height"].as_u64()), (Some(20), Some(10)));
    assert_eq!(scene["defaults"]["sample_count"], 3);
    assert_eq!(scene["defaults"]["max_depth"], 4);
    assert_eq!(scene["emitters"]["area"], 1);
    assert_eq!(scene["counts"]["quadrics"], 1);
    assert!(scene["bounds"]["min"].is_array() && scene["memory"]["accelerator"].is_u64() && scene["notes"].is_array());
    assert!(bench.succeed(&["info", "lamp/scene.xml"]).contains("sample_count"));
    bench.succeed(&["render", METHODS[0].name, "lamp/scene.xml", "-o", "a.exr", "--iterations", "1", "-q"]);
    let image = bench.json(&["info", "a.exr", "--json"]);
    assert_eq!((image["width"].as_u64(), image["channels"].as_array().unwrap().len()), (Some(16), 3));
    assert_eq!(image["isophote"]["method"], METHODS[0].name);
    assert!(bench.succeed(&["info", "a.exr"]).contains(METHODS[0].name));
}

#[test]
fn list_names_everything_there_is() {
    let bench = Bench::new();
    let all = bench.json(&["list", "--json"]);
    let names = |table: &str| -> Vec<&str> { all[table].as_array().unwrap().iter().map(|row| row["name"].as_str().unwrap()).collect() };
    assert_eq!(names("methods"), METHODS.iter().map(|m| m.name).collect::<Vec<_>>());
    assert_eq!(names("metrics"), definitions().map(|(name, _, _)| name).collect::<Vec<_>>());
    assert!(names("samplers").contains(&"uniform") && names("bsdfs").contains(&"diffuse"));
    let text = bench.succeed(&["list"]);
    for table in ["methods", "samplers", "bsdfs", "metrics"] {
        assert!(text.contains(table));
        assert!(bench.json(&["list", table, "--json"])[table] == all[table]);
        let first = names(table)[0];
        assert!(bench.succeed(&["list", table]).contains(first), "{table}");
    }
}

#[test]
fn shells_get_completions() {
    let bench = Bench::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = bench.succeed(&["completions", shell]);
        assert!(script.contains("isophote") && METHODS.iter().all(|m| script.contains(m.name)), "{shell}");
    }
}

/// The examples of `docs/json.md`, in its order.
fn examples() -> Vec<serde_json::Value> {
    let page = include_str!("../../docs/json.md");
    page.split("```json\n").skip(1).map(|rest| serde_json::from_str(rest.split("```").next().unwrap()).unwrap()).collect()
}

#[test]
fn the_documented_examples_have_the_keys_that_are_printed() {
    let bench = Bench::new();
    let rendered = bench.json(&["render", "sppm", "lamp/scene.xml", "-o", "a.exr", "--json", "-q"]);
    let study = "seeds = 2\nbudget = { iterations = 1 }\n[[scene]]\nfile = \"lamp/scene.xml\"\nreference = \"a.exr\"\n[[method]]\nname = \"path\"\n";
    std::fs::write(bench.path("s.toml"), study).unwrap();
    let printed = [
        rendered,
        bench.json(&["diagnose", "lamp/scene.xml", "--sampler", "image", "--iterations", "1", "--json", "-q"]),
        bench.json(&["compare", "a.exr", "a.exr", "--json"]),
        bench.json(&["reference", "path", "lamp/scene.xml", "--runs", "2", "--iterations", "1", "-o", "ref", "--json", "-q"]),
        bench.json(&["study", "s.toml", "--json", "-q"]),
        bench.json(&["info", "a.exr", "--json"]),
        bench.json(&["info", "lamp/scene.xml", "--json"]),
        bench.json(&["list", "--json"]),
    ];
    let keys = |value: &serde_json::Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    let examples = examples();
    assert_eq!(examples.len(), printed.len());
    for (example, printed) in examples.iter().zip(&printed) {
        assert_eq!(keys(example), keys(printed));
    }
    for part in ["images", "channels", "methods", "samplers", "bsdfs", "metrics"] {
        for (example, printed) in examples.iter().zip(&printed).filter(|(example, _)| example.get(part).is_some_and(|p| p.is_array())) {
            assert_eq!(keys(&example[part][0]), keys(&printed[part][0]), "{part}");
        }
    }
    for part in ["defaults", "counts", "memory", "film", "bounds"] {
        assert_eq!(keys(&examples[6][part]), keys(&printed[6][part]), "{part}");
    }
    let sampler = |documents: &[serde_json::Value]| documents[1]["sampler"].clone();
    let (example, printed) = (sampler(&examples), sampler(&printed));
    assert_eq!(keys(&example), keys(&printed));
    for part in ["/rungs/1", "/regions"] {
        assert_eq!(keys(example.pointer(part).unwrap()), keys(printed.pointer(part).unwrap()), "{part}");
    }
}
