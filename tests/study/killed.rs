//! A study killed at any moment and started again leaves what one left alone does.

use crate::bench::{Bench, Essence};
use isophote::samplers::{Key, Purpose, Stream};
use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Two scenes, one of them the other without its film's edges, two methods and a reference to be made: 16 cells.
const STUDY: &str = r#"
seeds = 4
budget = { iterations = 40 }
keep = "snapshots"
snapshots = "every:10"
threads = 1
[reference]
runs = 4
budget = { iterations = 60 }
[[scene]]
file = "lamp/scene.xml"
[[scene]]
name = "a window of it"
file = "lamp/scene.xml"
crop = [2, 1, 6, 5]
[[method]]
name = "path"
[[method]]
name = "sppm"
label = "sppm, 2 pixels"
radius_pixels = 2
"#;

/// The study left alone, and how long it took.
fn undisturbed(bench: &Bench) -> (Essence, Duration) {
    bench.write("s.toml", STUDY);
    let start = Instant::now();
    bench.succeed(&["study", "s.toml", "-o", "alone", "-q"]);
    let time = start.elapsed();
    let essence = bench.essence("alone");
    assert!(bench.path("alone/report.html").is_file());
    assert_eq!((essence.cells.len(), essence.references.len()), (16, 2));
    // 16 final images, 3 films kept on the way to each, and two references of three files.
    assert_eq!(essence.files.len(), 16 * 4 + 2 * 3, "{:?}", essence.files.keys());
    (essence, time)
}

fn numbers(seed: u64) -> impl Stream {
    Key { seed, iteration: 0, index: 0, purpose: Purpose::Light }.stream()
}

#[test]
fn killed_at_random_moments_it_leaves_the_same() {
    let bench = Bench::new();
    let (expected, time) = undisturbed(&bench);
    let mut kills = 0;
    for seed in 0..6 {
        let mut random = numbers(seed);
        let folder = format!("killed{seed}");
        for attempt in 0.. {
            assert!(attempt < 200, "it never ends");
            let mut child = bench.command(&["study", "s.toml", "-o", &folder, "-q"]).stderr(Stdio::null()).spawn().unwrap();
            // Longer and longer, so that it comes to an end.
            std::thread::sleep(time.mul_f32(random.next_1d() * (0.3 + 0.02 * attempt as f32)));
            if let Some(status) = child.try_wait().unwrap() {
                assert!(status.success(), "{status}");
                break;
            }
            child.kill().unwrap();
            kills += 1;
            child.wait().unwrap();
        }
        assert_eq!(bench.essence(&folder), expected, "seed {seed}");
    }
    assert!(kills >= 6, "only {kills} kills hit anything");
}

#[test]
fn what_a_kill_leaves_half_written_does_no_harm() {
    let bench = Bench::new();
    let (expected, _) = undisturbed(&bench);
    let records = bench.path("alone/records.jsonl");
    let whole = std::fs::read(&records).unwrap();
    let ends: Vec<usize> = whole.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(i, _)| i).collect();
    let last = expected.cells.last().and_then(|cell| cell.image.as_ref()).unwrap();
    let mut random = numbers(99);
    for _ in 0..4 {
        // The study record stays; the rest is cut anywhere.
        let cut = ends[0] + (random.next_1d() * (whole.len() - ends[0]) as f32) as usize;
        std::fs::write(&records, &whole[..cut]).unwrap();
        std::fs::write(bench.path("alone/images/lamp/path/.isophote-x1.tmp"), "half an image").unwrap();
        std::fs::write(bench.path("alone/references/.isophote-x2.tmp"), "half a reference").unwrap();
        // The last cell is never on record here, so its image may hold anything.
        std::fs::write(bench.path("alone").join(last), "no image").unwrap();
        bench.succeed(&["study", "s.toml", "-o", "alone", "-q"]);
        assert_eq!(bench.essence("alone"), expected, "cut at {cut}");
    }
}

#[test]
fn a_signal_keeps_what_is_done_and_says_so() {
    let bench = Bench::new();
    bench.write("long.toml", &STUDY.replace("iterations = 40", "time = 0.2"));
    for (signal, status) in [("INT", 130), ("TERM", 143)] {
        let folder = format!("stopped{signal}");
        let mut child = bench.command(&["study", "long.toml", "-o", &folder]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let records = bench.path(&folder).join("records.jsonl");
        let start = Instant::now();
        let cells = || std::fs::read_to_string(&records).unwrap_or_default().matches("\"kind\":\"cell\"").count();
        while cells() < 2 && start.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(5));
        }
        let killed = std::process::Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
        assert!(killed.success());
        assert_eq!(child.wait().unwrap().code(), Some(status), "{signal}");
        let essence = bench.essence(&folder);
        assert!((2..16).contains(&essence.cells.len()), "{}", essence.cells.len());
        // Every image belongs to a cell that was done.
        let images = essence.files.keys().filter(|path| path.starts_with("images")).count();
        let recorded: usize =
            essence.cells.iter().map(|c| 1 + c.snapshots.iter().filter(|s| s.image.is_some() && s.image != c.image).count()).sum();
        assert_eq!(images, recorded, "{signal}");
        let mut log = std::io::stderr();
        writeln!(log, "{signal}: {} cells kept", essence.cells.len()).unwrap();
    }
}
