//! Interrupts: the work is saved, the status says which signal it was.

use crate::bench::{Bench, text};
use isophote::integrators::METHODS;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Starts a render without end, sends it signals once it has iterated, and gives its exit status. The second signal waits until the first is
/// told of: of signals sent together, none is promised to arrive first.
fn interrupt(bench: &Bench, method: &str, signals: &[&str]) -> Option<i32> {
    let arguments = ["render", method, "lamp/scene.xml", "-o", "a.exr", "--time", "600", "--checkpoint", "0.001"];
    let mut child = bench.command(&arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut told = BufReader::new(child.stderr.take().unwrap()).lines();
    let start = Instant::now();
    // The first checkpoint shows that it renders.
    while !bench.path("a.exr").exists() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    for (index, signal) in signals.iter().enumerate() {
        assert!(Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap().success());
        assert!(
            index > 0 || told.any(|line| line.unwrap().contains(&format!("SIG{signal}: ending"))),
            "{method} does not tell of {signal}"
        );
    }
    told.for_each(drop);
    let status = child.wait().unwrap();
    assert!(start.elapsed() < Duration::from_secs(60), "{method} ends only with its time");
    status.code()
}

#[test]
fn the_image_is_saved_and_the_signal_told() {
    for method in METHODS {
        for (signals, expected) in [(&["INT"][..], 130), (&["TERM"][..], 143), (&["INT", "INT", "TERM"][..], 130)] {
            let bench = Bench::new();
            assert_eq!(interrupt(&bench, method.name, signals), Some(expected), "{} {signals:?}", method.name);
            assert_eq!(bench.files(), ["a.exr"], "{} {signals:?}", method.name);
            let picture = bench.read("a.exr").picture().unwrap();
            assert_eq!((picture.size(), picture.non_finite()), ((16, 12), 0));
            let ranges = &bench.metadata("a.exr")["runs"][0]["ranges"][0];
            assert!(ranges[1].as_u64().unwrap() >= 1, "{ranges}");
        }
    }
}

#[test]
fn the_old_image_stays_until_the_new_one_is_whole() {
    // Killed outright at any moment, what stands under the name is a whole image.
    let bench = Bench::new();
    let arguments = ["render", METHODS[0].name, "lamp/scene.xml", "-o", "a.exr", "--time", "600", "--checkpoint", "0.001", "-q"];
    for delay in [30, 60, 90] {
        bench.succeed(&["render", METHODS[0].name, "lamp/scene.xml", "-o", "a.exr", "--iterations", "1", "-q"]);
        let mut child = bench.command(&arguments).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(delay));
        child.kill().unwrap();
        child.wait().unwrap();
        let file = bench.path("a.exr");
        assert!(isophote::image::exr::read_picture(&file).is_ok(), "{} after {delay} ms", text(&file));
    }
}

#[test]
fn a_diagnosis_that_is_interrupted_tells_what_there_is() {
    let bench = Bench::new();
    let arguments = ["diagnose", "lamp/scene.xml", "--sampler", "visibility", "--photons", "20000", "--time", "600"];
    let mut child = bench.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // The first line on iterations shows that there is something to tell.
    let mut told = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(told.any(|line| line.unwrap().contains("iterations,")), "ended by itself");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    std::thread::spawn(move || told.for_each(drop));
    let output = child.wait_with_output().unwrap();
    let table = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(130), "{table}");
    assert!(table.contains("round trips") && table.contains("visibility"), "{table}");
}
