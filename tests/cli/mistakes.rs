//! What goes wrong is told in one line, with status 2, before anything is rendered.

use crate::bench::Bench;
use isophote::integrators::METHODS;
use isophote::math::Rgb;

/// Runs what has to be refused; what it tells.
fn refused(bench: &Bench, arguments: &[&str]) -> String {
    let output = bench.run(arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {told}");
    assert!(output.stdout.is_empty(), "{arguments:?} prints to standard output");
    assert!(!told.contains("panicked") && !told.contains("RUST_BACKTRACE"), "{arguments:?}: {told}");
    told
}

#[test]
fn usage_that_is_wrong_is_told() {
    let bench = Bench::new();
    let method = METHODS[0].name;
    refused(&bench, &[]);
    let mistakes: &[(&[&str], &str)] = &[
        (&["rendr"], "render"),
        (&["resume", "a.exr"], "unrecognized"),
        (&["render"], "METHOD"),
        (&["render", "magic", "lamp/scene.xml"], "magic"),
        (&["render", method], "SCENE.xml"),
        (&["render", method, "lamp/scene.xml", "--tev", "a:1"], "--tev"),
        (&["render", method, "lamp/scene.xml", "--resolution", "64"], "WIDTHxHEIGHT"),
        (&["render", method, "lamp/scene.xml", "--iterations", "0"], "no iteration"),
        (&["render", method, "lamp/scene.xml", "--iterations", "9:3"], "no iteration"),
        (&["render", method, "lamp/scene.xml", "--max-depth", "0"], "-1"),
        (&["render", method, "lamp/scene.xml", "--time", "-1"], "seconds"),
        (&["render", method, "lamp/scene.xml", "--paths", "L("], "L("),
        (&["render", method, "lamp/scene.xml", "--exposure", "2"], "--preview"),
        (&["render", method, "lamp/scene.xml", "--snapshots", "often"], "pow2"),
        (&["render", method, "lamp/scene.xml", "--aov", "depth"], "variance"),
        (&["render", "vcm", "lamp/scene.xml", "--sampler", "spatial", "--combine", "last"], "--combine last"),
        (&["render", "bdpt", "lamp/scene.xml", "--sampler", "visibility", "--combine", "average"], "--combine average"),
        (&["render", "vcm", "lamp/scene.xml", "--sampler", "visibility", "--merge-weights", "vcm-star"], "--sampler uniform"),
        (&["render", "bdpt", "lamp/scene.xml", "--ensembles", "4"], "--sampler visibility"),
        (&["compare", "a.exr"], "IMAGE"),
        (&["compare", "a.exr", "b.exr", "--inset", "1,2,3"], "LEFT,TOP,WIDTH,HEIGHT"),
        (&["compare", "a.exr", "--html", "b.exr", "c.exr"], "b.exr"),
        (&["list", "colours"], "methods"),
    ];
    for (arguments, expected) in mistakes {
        let told = refused(&bench, arguments);
        assert!(told.contains(expected), "{arguments:?}: {told}");
    }
    assert!(bench.files().is_empty(), "{:?}", bench.files());
}

#[test]
fn input_that_is_bad_is_told_with_its_name() {
    let bench = Bench::new();
    let method = METHODS[0].name;
    std::fs::write(bench.path("text.exr"), "no picture at all").unwrap();
    std::fs::write(bench.path("broken.xml"), "<scene version=\"3.0.0\">\n  <shape type=\"sphere\">\n</scene>").unwrap();
    bench.write("small.exr", 2, vec![Rgb::WHITE; 4]);
    bench.write("large.exr", 3, vec![Rgb::WHITE; 9]);
    let before = bench.files();
    let mistakes: &[(&[&str], &[&str])] = &[
        (&["render", method, "missing.xml"], &["missing.xml"]),
        (&["render", method, "broken.xml"], &["broken.xml:"]),
        (&["render", method, "lamp/scene.xml", "-o", "nowhere/a.exr"], &["nowhere"]),
        (&["render", method, "lamp/scene.xml", "-o", "lamp"], &["lamp", "not a file"]),
        (&["render", method, "lamp/scene.xml", "--reference", "text.exr"], &["text.exr", "not a readable EXR"]),
        (&["render", method, "lamp/scene.xml", "--reference", "small.exr"], &["small.exr", "16x12", "2x2", "help:"]),
        (&["render", method, "lamp/scene.xml", "--max-memory", "1K"], &["--max-memory", "help:"]),
        (&["render", method, "lamp/scene.xml", "--crop", "10,10,20,20"], &["crop"]),
        (&["render", "path", "lamp/scene.xml", "--aov", "pyramid"], &["--aov pyramid", "bdpt and vcm"]),
        (&["render", "bdpt", "lamp/scene.xml", "--aov", "pyramid", "--max-depth", "-1"], &["--aov pyramid", "--max-depth", "16"]),
        (&["render", "vcm", "lamp/scene.xml", "--aov", "pyramid", "--max-depth", "17"], &["--aov pyramid", "--max-depth", "16"]),
        (&["render", "vcm", "lamp/scene.xml", "--aov", "pyramid", "--max-depth", "16", "--max-memory", "1M"], &["--max-memory", "help:"]),
        (&["render", "path", "lamp/scene.xml", "--aov", "density"], &["--aov density", "sppm", "vcm-plus or vcm-star"]),
        (&["render", "vcm", "lamp/scene.xml", "--aov", "density"], &["--aov density", "vcm-plus or vcm-star"]),
        (&["compare", "small.exr", "large.exr"], &["large.exr", "3x3", "2x2"]),
        (&["compare", "missing.exr", "small.exr"], &["missing.exr"]),
        (&["compare", "small.exr", "small.exr", "--inset", "1,0,2,1"], &["--inset 1,0,2,1", "2x2"]),
        (&["compare", "small.exr", "small.exr", "--html", "small.exr"], &["small.exr", ".html"]),
        // The page is refused before the images are read.
        (&["compare", "missing.exr", "small.exr", "--html", "nowhere/a.html"], &["nowhere"]),
        (&["info", "missing.exr"], &["missing.exr"]),
        (&["info", "text.exr"], &["text.exr", "not a readable EXR"]),
    ];
    for (arguments, expected) in mistakes {
        let told = refused(&bench, arguments);
        assert!(told.starts_with("error: "), "{arguments:?}: {told}");
        for part in *expected {
            assert!(told.contains(part), "{arguments:?} does not tell {part:?}: {told}");
        }
    }
    assert_eq!(bench.files(), before);
}

#[test]
fn options_of_samplers_that_contradict_each_other_are_told() {
    let bench = Bench::new();
    let mistakes: &[(&[&str], &str)] = &[
        (&["--sampler", "visibility", "--rungs", "uniform,visibility"], "--rungs needs --sampler kernel, image or spatial"),
        (&["--sampler", "uniform", "--combine", "last"], "give --sampler visibility, kernel, image or spatial"),
        (&["--sampler", "spatial", "--rungs", "uniform,target,kernel"], "in the order visibility, kernel, target"),
        (&["--sampler", "spatial", "--rungs", "visibility,target"], "must begin with uniform"),
        (&["--sampler", "kernel", "--steps", "fixed", "--rest", "easy"], "--rest easy needs --steps measured"),
        (&["--sampler", "kernel", "--acceptance", "1"], "--acceptance must lie in (0, 1)"),
        (&["--sampler", "metropolis"], "[possible values: uniform, visibility, kernel, image, spatial]"),
        (&["--sampler", "spatial", "--rungs", "uniform,full"], "full"),
        (&["--sampler", "spatial", "--ensembles", "1"], "2..=4096"),
    ];
    for (options, expected) in mistakes {
        for command in [&["render", "sppm", "lamp/scene.xml"][..], &["diagnose", "lamp/scene.xml"]] {
            let told = refused(&bench, &[command, options].concat());
            assert!(told.contains(expected), "{command:?} {options:?}: {told}");
        }
    }
    assert!(bench.files().is_empty(), "{:?}", bench.files());
}
