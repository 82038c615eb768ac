//! Renders of every method: files, metadata, bits.

use crate::bench::{Bench, essence};
use isophote::integrators::METHODS;
use serde_json::json;

const SCENE: &str = "lamp/scene.xml";

#[test]
fn the_image_goes_to_the_folders_name_with_all_metadata() {
    let bench = Bench::new();
    for method in METHODS {
        let statistics = bench.json(&["render", method.name, SCENE, "-D", "radiance=7", "--json"]);
        let file = format!("lamp.{}.exr", method.name);
        assert_eq!(statistics["output"], file);
        let metadata = bench.metadata(&file);
        let keys = "schema version scene method settings radius runs seconds cpu_seconds threads light_paths camera_paths rays rejected errors \
             diagnostics";
        for key in keys.split_whitespace() {
            assert!(metadata.get(key).is_some() && statistics[key] == metadata[key], "{}: {key}", method.name);
        }
        assert_eq!(metadata["method"], method.name);
        assert_eq!(metadata["scene"]["path"], SCENE);
        assert_eq!(metadata["runs"], json!([{"seed": 0, "ranges": [[0, 3]]}]));
        assert_eq!(metadata["settings"]["define"], json!({"radiance": "7"}));
        assert_eq!(metadata["settings"]["max_depth"], 4);
        assert!(metadata["camera_paths"].as_u64().unwrap() >= 3 * 16 * 12);
        assert!(metadata["rays"].as_u64().unwrap() >= 3 * 16 * 12 && metadata["seconds"].as_f64().unwrap() > 0.0);
        // What stands there makes the method again.
        assert!((method.from_json)(&metadata["settings"]).is_ok(), "{}", method.name);
    }
    assert_eq!(bench.files().len(), METHODS.len(), "{:?}", bench.files());
}

#[test]
fn threads_change_no_bit() {
    let bench = Bench::new();
    for method in METHODS {
        let on = |threads: &str| {
            let arguments =
                ["render", method.name, SCENE, "-o", "a.exr", "--threads", threads, "--aov", "variance,count", "--seed", "5", "-q"];
            bench.succeed(&arguments);
            assert_eq!(bench.metadata("a.exr")["threads"].to_string(), threads);
            essence(&bench.read("a.exr"))
        };
        let one = on("1");
        for threads in ["2", "4"] {
            assert!(on(threads) == one, "{} at {threads} threads", method.name);
        }
        let names: Vec<&str> = one.0.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["B", "G", "R", "count.Y", "variance.B", "variance.G", "variance.R"]);
    }
}

/// Chains that draw for connections and merges.
#[test]
fn threads_change_no_bit_of_bidirectional_chains() {
    let bench = Bench::new();
    for (method, sampler) in [("vcm", "visibility"), ("vcm", "spatial"), ("bdpt", "visibility"), ("bdpt", "spatial")] {
        let on = |threads: &str| {
            let fixed = ["render", method, SCENE, "-o", "a.exr", "--sampler", sampler, "--photons", "5000", "--rest", "never", "-q"];
            bench.succeed(&[&fixed[..], &["--threads", threads]].concat());
            essence(&bench.read("a.exr"))
        };
        let one = on("1");
        assert_eq!(one.1["diagnostics"]["sampler"]["draws"], 3, "{method} {sampler}");
        for threads in ["2", "3"] {
            assert!(on(threads) == one, "{method} {sampler} at {threads} threads");
        }
        // Every number of what stands there makes the method again.
        assert_eq!(one.1["settings"]["sampler"], sampler);
        assert_eq!(one.1["settings"]["rest"], "never");
    }
}

#[test]
fn seeds_and_ranges_are_other_images() {
    let bench = Bench::new();
    for method in METHODS {
        let image = |arguments: &[&str]| {
            let fixed = ["render", method.name, SCENE, "-o", "a.exr", "-q"];
            bench.succeed(&[&fixed, arguments].concat());
            essence(&bench.read("a.exr"))
        };
        let one = image(&["--iterations", "2"]);
        assert!(image(&["--iterations", "0:2"]) == one, "{}", method.name);
        assert!(image(&["--iterations", "2", "--seed", "1"]).0 != one.0, "{}", method.name);
        let later = image(&["--iterations", "2:4"]);
        assert_eq!(later.1["runs"][0]["ranges"], json!([[2, 4]]));
        assert!(later.0 != one.0, "{}", method.name);
    }
}

#[test]
fn snapshots_and_errors_are_kept_on_the_way() {
    let bench = Bench::new();
    for method in METHODS {
        let render = |more: &[&str]| bench.succeed(&[&["render", method.name, SCENE, "-q"], more].concat());
        render(&["-o", "reference.exr", "--seed", "9", "--iterations", "8"]);
        render(&["-o", "a.exr", "--iterations", "5", "--reference", "reference.exr"]);
        let errors = bench.metadata("a.exr")["errors"].as_array().unwrap().clone();
        assert_eq!(errors.iter().map(|e| e["iteration"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2, 4, 5]);
        for (snapshot, record) in [("a.i000004.exr", &errors[2]), ("a.exr", &errors[3])] {
            let found = bench.json(&["compare", "reference.exr", snapshot, "--json"]);
            for key in ["mse", "relmse", "srrmse"] {
                assert_eq!(found["images"][0][key], record[key], "{} {snapshot} {key}", method.name);
            }
        }
        render(&["-o", "b.exr", "--iterations", "7", "--snapshots", "every:3"]);
        let files = bench.files();
        let of = |stem: &str| files.iter().filter(|f| f.starts_with(stem)).map(String::as_str).collect::<Vec<_>>();
        assert_eq!(of("a."), ["a.exr", "a.i000001.exr", "a.i000002.exr", "a.i000004.exr"]);
        assert_eq!(of("b."), ["b.exr", "b.i000003.exr", "b.i000006.exr"]);
    }
}

#[test]
fn time_windows_previews_and_progress() {
    let bench = Bench::new();
    let method = METHODS[0].name;
    let fixed = ["render", method, SCENE, "-o", "a.exr", "--crop", "4,2,8,6", "--preview", "a.png", "--exposure", "-1"];
    let timed = bench.run(&[&fixed[..], &["--time", "0.2"]].concat());
    assert!(timed.status.success() && timed.stdout.is_empty());
    // Without a terminal: plain lines, the last one among them.
    let told = String::from_utf8(timed.stderr).unwrap();
    assert!(told.contains(" iterations, ") && told.contains("it/s") && !told.contains('\u{1b}'), "{told}");
    let metadata = bench.metadata("a.exr");
    assert!(metadata["seconds"].as_f64().unwrap() >= 0.2);
    assert_eq!(metadata["settings"]["crop"], json!([4, 2, 8, 6]));
    assert_eq!(bench.read("a.exr").picture().unwrap().size(), (8, 6));
    assert_eq!(bench.files(), ["a.exr", "a.png"]);
    let quiet = bench.run(&["render", method, SCENE, "-o", "a.exr", "-q"]);
    assert!(quiet.status.success() && quiet.stderr.is_empty());
}

/// Every technique of every length is a layer, and all are on one sheet beside the file.
#[test]
fn a_pyramid_is_layers_and_a_sheet() {
    for (method, lit, dark) in [("bdpt", "weighted.2.vc1.R", "weighted.2.vm1.R"), ("vcm", "unweighted.2.vm1.R", "weighted.4.vc0.R")] {
        let bench = Bench::new();
        let run = ["render", method, SCENE, "-o", "a.exr", "--max-depth", "3", "--iterations", "2", "--aov", "pyramid", "--json", "-q"];
        let statistics = bench.json(&run);
        assert_eq!(bench.files(), ["a.exr", "a.pyramid.png"], "{method}");
        assert_eq!(statistics["pyramid"], "a.pyramid.png");
        assert!(statistics["settings"].get("pyramid").is_none(), "it changes no image");
        let file = bench.read("a.exr");
        let channel = |name: &str| file.channels.iter().find(|channel| channel.name == name);
        assert!(channel(lit).is_some_and(|channel| channel.samples.iter().any(|v| *v > 0.0)), "{method}: {lit}");
        assert!(channel(dark).is_none(), "{method}: {dark}");
    }
}

/// Where densities are asked for they are layers; memory counts them; where they are not known NaN says so.
#[test]
fn densities_are_layers() {
    let bench = Bench::new();
    let small = ["--resolution", "200x200", "--iterations", "1", "--max-memory", "2500K", "-q"];
    let told = |more: &[&str]| bench.run(&[&["render", "sppm", SCENE, "-o", "b.exr", "--photons", "100"], &small[..], more].concat());
    assert!(told(&[]).status.success(), "scene and film alone fit");
    let refused = told(&["--aov", "density", "--sampler", "spatial"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8(refused.stderr).unwrap().contains("--max-memory"));

    let spatial: &[&str] = &["--sampler", "spatial", "--rest", "never"];
    let star: &[&str] = &["--merge-weights", "vcm-star"];
    for (method, options, expected) in
        [("sppm", &[][..], &["density.Y"][..]), ("sppm", spatial, &["density.Y", "density.region.Y"]), ("vcm", star, &["density.Y"])]
    {
        let run = ["render", method, SCENE, "-o", "a.exr", "--iterations", "3", "--aov", "density", "-q"];
        bench.succeed(&[&run[..], options].concat());
        let file = bench.read("a.exr");
        let found: Vec<_> = file.channels.iter().filter(|channel| channel.name.starts_with("density")).collect();
        assert_eq!(found.iter().map(|channel| channel.name.as_str()).collect::<Vec<_>>(), expected, "{method}");
        for channel in found {
            let (lit, unknown) = (channel.samples.iter().any(|v| *v > 0.0), channel.samples.iter().filter(|v| v.is_nan()).count());
            assert!(lit && unknown > 0 && unknown < channel.samples.len(), "{method}, {}: {unknown} unknown", channel.name);
        }
        assert!(bench.succeed(&["info", "a.exr"]).contains("density.Y"));
        assert!(bench.metadata("a.exr")["settings"].get("density").is_none(), "it changes no image");
    }
}
