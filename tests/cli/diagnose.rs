//! `diagnose`, and what samplers tell of themselves elsewhere: metadata, records, warnings.

use crate::bench::{Bench, essence};
use serde_json::{Value, json};

const BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/box/scene.xml");

/// Samplers with chains, and the rungs of their ladders.
const CHAINS: [(&str, &[&str]); 4] = [
    ("visibility", &["uniform", "visibility"]),
    ("kernel", &["uniform", "visibility", "kernel"]),
    ("image", &["uniform", "visibility", "kernel", "target"]),
    ("spatial", &["uniform", "visibility", "kernel", "target"]),
];

/// A diagnosis that takes a moment.
fn small<'a>(sampler: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let fixed = ["diagnose", BOX, "--sampler", sampler, "--resolution", "20x20", "--max-depth", "4", "--photons", "20000", "-q"];
    [&fixed[..], more].concat()
}

/// The scene whose lamp is closed in, in the folder.
fn sealed(bench: &Bench) {
    std::fs::write(bench.path("sealed.xml"), include_str!("sealed.xml")).unwrap();
}

fn rungs(sampler: &Value) -> &Vec<Value> {
    sampler["rungs"].as_array().unwrap()
}

#[test]
fn every_sampler_is_diagnosed() {
    let bench = Bench::new();
    for (sampler, names) in CHAINS {
        let document = bench.json(&small(sampler, &["--iterations", "3", "--json"]));
        assert_eq!((&document["method"], &document["settings"]["sampler"]), (&json!("sppm"), &json!(sampler)));
        assert_eq!((&document["iterations"], &document["sampler"]["draws"]), (&json!(3), &json!(3)));
        assert_eq!(document["light_paths"], document["sampler"]["traced"], "start-up and burn-in are counted");
        assert!(document["traces"].is_null() && document["interrupted"].is_null());
        let found = rungs(&document["sampler"]);
        assert_eq!(found.iter().map(|rung| rung["name"].as_str().unwrap()).collect::<Vec<_>>(), names, "{sampler}");
        let number = |rung: &Value, key: &str| rung[key].as_f64().unwrap_or_else(|| panic!("{sampler}: {key} of {rung}"));
        let shares: f64 = found.iter().map(|rung| number(rung, "share")).sum();
        assert!((shares - 1.0).abs() < 1e-9, "{sampler}: {shares}");
        assert!(found[0]["acceptance"].is_null() && number(&found[0], "normalisation") == 1.0);
        let steps: f64 = found.iter().map(|rung| number(rung, "steps") + number(rung, "uncounted")).sum();
        assert_eq!(steps, 60_000.0, "{sampler}");
        for rung in &found[1..] {
            assert!((0.02..0.98).contains(&number(rung, "acceptance")) && number(rung, "dispersion") >= 1.0, "{rung}");
            assert!(number(rung, "normalisation") > 0.0 && number(rung, "normalisation_relative_error") < 0.5, "{rung}");
            assert!(rung.get("traces").is_none());
        }
        assert!(document["sampler"]["round_trips"].as_u64().unwrap() > 0, "{sampler}");
        let regions = &document["sampler"]["regions"];
        assert_eq!(regions.is_null(), ["visibility", "kernel"].contains(&sampler), "{sampler}: {regions}");
        for warning in document["warnings"].as_array().unwrap() {
            assert!(warning["text"].as_str().unwrap().contains("--") && warning["severe"] == json!(false), "{warning}");
        }
    }
}

#[test]
fn the_table_and_the_picture_show_every_rung() {
    let bench = Bench::new();
    let run = ["--iterations", "2", "--ensembles", "5", "-o", "t.svg"];
    let table = bench.succeed(&small("spatial", &run));
    let document = bench.json(&small("spatial", &[&run[..], &["--json"]].concat()));
    assert_eq!(document["traces"], "t.svg");
    let rows: Vec<&str> = table.lines().collect();
    for column in ["rung", "share", "acceptance", "step size", "exchange rate", "tau", "autocorrelation", "ESS", "R-hat", "b", "s.e. of b"]
    {
        assert!(rows[0].contains(column), "{table}");
    }
    for (row, rung) in rows[1..].iter().zip(rungs(&document["sampler"])) {
        assert!(row.starts_with(rung["name"].as_str().unwrap()), "{table}");
        assert!(row.contains(&format!("{:.4e}", rung["normalisation"].as_f64().unwrap())), "{table}");
    }
    let trips = format!("round trips     {}\n", document["sampler"]["round_trips"]);
    assert!(table.contains(&trips) && table.contains("ensembles       5\n") && table.contains("regions in use"), "{table}");
    for warning in document["warnings"].as_array().unwrap() {
        assert!(table.contains(warning["text"].as_str().unwrap()), "{table}");
    }

    let text = std::fs::read_to_string(bench.path("t.svg")).unwrap();
    let tree = roxmltree::Document::parse(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    assert_eq!(tree.root_element().tag_name().name(), "svg");
    let words: Vec<&str> = tree.descendants().filter(|n| n.has_tag_name("text")).filter_map(|n| n.text()).map(str::trim).collect();
    for panel in ["visibility", "kernel", "target"] {
        assert_eq!(words.iter().filter(|word| **word == panel).count(), 1, "{words:?}");
    }
    assert!(!words.contains(&"uniform") && words.contains(&"log T of target"), "{words:?}");
    // Longer than any tick: the traces, one an ensemble and panel.
    let points = |n: &roxmltree::Node| n.attribute("points").map_or(0, |points| points.split_whitespace().count());
    assert_eq!(tree.descendants().filter(|n| points(n) > 20).count(), 3 * 5);
}

#[test]
fn without_a_chain_there_is_nothing_to_diagnose() {
    let bench = Bench::new();
    for more in [&["--sampler", "uniform"][..], &[], &["--sampler", "kernel", "--rungs", "uniform"]] {
        let output = bench.run(&[&["diagnose", "lamp/scene.xml"][..], more].concat());
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{more:?}: {told}");
        assert!(told.contains("no chain to diagnose") && told.contains("help: give --sampler"), "{more:?}: {told}");
    }
    let elsewhere = bench.run(&["diagnose", "lamp/scene.xml", "--sampler", "kernel", "-o", "t.png"]);
    assert_eq!(elsewhere.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&elsewhere.stderr).contains(".svg"));
    assert!(bench.files().is_empty(), "{:?}", bench.files());
}

#[test]
fn threads_change_no_bit_of_a_sampler() {
    let bench = Bench::new();
    // Chains that may rest, and chains that must not.
    for ((sampler, names), rest) in CHAINS.into_iter().flat_map(|chain| [(chain, "easy"), (chain, "never")]) {
        let on = |threads: &str| {
            let fixed = ["render", "sppm", "lamp/scene.xml", "--sampler", sampler, "--photons", "20000", "--iterations", "3"];
            bench.succeed(&[&fixed[..], &["--rest", rest, "-o", "a.exr", "-q", "--threads", threads]].concat());
            essence(&bench.read("a.exr"))
        };
        let (one, two) = (on("1"), on("2"));
        assert!(one == two, "{sampler}: 1 and 2 threads differ");
        let told = &one.1["diagnostics"]["sampler"];
        let [draws, rested] = ["draws", "rested"].map(|key| told[key].as_u64().unwrap());
        assert_eq!((rungs(told).len(), draws + rested), (names.len(), 3), "{sampler}");
        // Most of this scene's light reaches the picture: for visibility alone chains are not worth it.
        assert!(rested == u64::from(rest == "easy") || (rested == 0 && sampler != "visibility"), "{sampler}, --rest {rest}: {rested}");
        assert!(!told.to_string().contains("\"traces\""));
        assert!(one.0.iter().any(|(_, bits)| bits.iter().any(|b| *b != 0)), "{sampler} renders black");
    }
}

#[test]
fn a_sealed_lamp_is_black_and_told() {
    let bench = Bench::new();
    sealed(&bench);
    for (sampler, names) in CHAINS {
        let fixed = ["render", "sppm", "sealed.xml", "--sampler", sampler, "--photons", "20000", "--iterations", "3", "-o", "a.exr"];
        let output = bench.run(&[&fixed[..], &["--json"]].concat());
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{sampler}: {told}");
        assert!(told.contains("WARN") && told.contains("no light path reached a measurement point"), "{sampler}: {told}");
        assert!(!told.contains("from uniform to"), "that nothing went round is no news: {told}");
        let picture = bench.read("a.exr").picture().unwrap();
        assert!(picture.pixels.iter().all(|p| [p[0], p[1], p[2]] == [0.0; 3]), "{sampler} is not black");
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(document["non_finite_pixels"], 0);
        let found = rungs(&document["diagnostics"]["sampler"]);
        assert_eq!(found.len(), names.len());
        // Three over the paths that the last iteration traced on rung 0: between all of them and the floor of a tenth.
        for rung in &found[1..] {
            let bound = rung["normalisation_error"].as_f64().unwrap();
            assert_eq!((rung["normalisation"].as_f64(), rung["steps"].as_u64()), (Some(0.0), Some(0)), "{sampler}: {rung}");
            assert!((3.0 / 20_000.0..=3.0 / 1_900.0).contains(&bound), "{sampler}: {bound}");
        }
        // Quiet is quiet.
        assert!(bench.run(&[&fixed[..], &["-q"]].concat()).stderr.is_empty());
    }
    let fixed = ["diagnose", "sealed.xml", "--sampler", "spatial", "--photons", "20000", "--iterations", "2", "-q", "-o", "t.svg"];
    let table = bench.succeed(&fixed);
    assert!(table.contains("0.0000e0") && table.contains("< ") && table.contains("warning: no light path reached"), "{table}");
    assert!(!table.contains("NaN") && !table.contains("inf"), "{table}");
    let picture = std::fs::read_to_string(bench.path("t.svg")).unwrap();
    assert!(roxmltree::Document::parse(&picture).is_ok() && picture.contains("no step was counted") && !picture.contains("NaN"));
    let document = bench.json(&[&fixed[..], &["--json"]].concat());
    let warnings = document["warnings"].as_array().unwrap();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert_eq!((&warnings[0]["kind"], &warnings[0]["severe"]), (&json!("nothing_visible"), &json!(true)));
}

#[test]
fn a_lit_scene_is_rendered_without_a_word() {
    let bench = Bench::new();
    let arguments = ["render", "sppm", "lamp/scene.xml", "--sampler", "spatial", "--photons", "20000", "--iterations", "1"];
    let told = String::from_utf8(bench.run(&arguments).stderr).unwrap();
    assert!(!told.contains("WARN"), "{told}");
    // What info says of the file is a table, not the JSON.
    let info = bench.succeed(&["info", "lamp.sppm.exr"]);
    assert!(info.contains("exchange rate") && info.contains("round trips") && info.contains("regions in use"), "{info}");
    assert!(info.lines().any(|line| line.starts_with("kernel ")) && !info.contains("next_share"), "{info}");
    assert!(bench.json(&["info", "lamp.sppm.exr", "--json"])["isophote"]["diagnostics"]["sampler"]["rungs"].is_array());
}

#[test]
fn records_of_a_study_hold_what_the_image_holds() {
    let bench = Bench::new();
    let study = "seeds = 1\nbudget = { iterations = 2 }\n[[scene]]\nfile = \"lamp/scene.xml\"\n[[method]]\nname = \"path\"\n[[method]]\n\
                 name = \"sppm\"\nsampler = \"visibility\"\nphotons = 20000\n";
    std::fs::write(bench.path("s.toml"), study).unwrap();
    bench.succeed(&["study", "s.toml", "-q"]);
    let records = std::fs::read_to_string(bench.path("s.study/records.jsonl")).unwrap();
    let cells: Vec<Value> =
        records.lines().map(|line| serde_json::from_str(line).unwrap()).filter(|r: &Value| r["kind"] == "cell").collect();
    let of = |name: &str| cells.iter().find(|cell| cell["name"] == name).unwrap();
    assert!(of("path")["diagnostics"].is_null());
    let told = &of("sppm")["diagnostics"];
    assert_eq!((rungs(&told["sampler"]).len(), told["sampler"].get("traces")), (2, None));
    let image = format!("s.study/{}", of("sppm")["image"].as_str().unwrap());
    assert_eq!(*told, bench.metadata(&image)["diagnostics"]);
    // The report has a line a rung, and no JSON.
    let page = std::fs::read_to_string(bench.path("s.study/report.html")).unwrap();
    assert!(page.contains("sampler.rungs.visibility") && !page.contains("{&quot;name"), "no rung in the report");
}
