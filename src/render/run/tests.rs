use super::*;
use crate::image::film::Splat;
use crate::render::metadata::SceneRecord;
use crate::render::progress::Silent;
use isophote_samplers::{Key, Purpose, Stream};
use serde_json::json;
use std::sync::atomic::{AtomicU64, Ordering};

/// Noise from keyed streams, on both sides of the film. `at` is called at the start of every iteration.
struct Fake<F> {
    stateless: bool,
    at: F,
}

impl<F: FnMut(u64) + Send> Integrator for Fake<F> {
    fn prepare(&mut self) -> Result<IterationStats, MethodError> {
        Ok(IterationStats { light_paths: 1000, ..IterationStats::default() })
    }
    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats {
        (self.at)(i);
        let stream = |index: u64, purpose| Key { seed: 1, iteration: i, index, purpose }.stream();
        let rays = AtomicU64::new(0);
        film.add_eye_samples(
            || (),
            |(), x, y| {
                rays.fetch_add(2, Ordering::Relaxed);
                Rgb::splat(stream((x + 1000 * y) as u64, Purpose::Camera).next_1d())
            },
            |()| (),
        );
        let paths = (film.width() * film.height()) as u64;
        let batch: Vec<Splat> = (0..paths)
            .map(|k| {
                let mut stream = stream(k, Purpose::Light);
                let pixel = (stream.next_1d() * paths as f32) as u32;
                Splat { pixel, value: Rgb::new(stream.next_1d(), 0.0, 0.0) }
            })
            .collect();
        film.add_splats(&[batch], paths);
        let rejected = [("nan", 1)].into_iter().collect();
        IterationStats { camera_paths: paths, light_paths: paths, rays: rays.into_inner(), rejected }
    }
    fn radius(&self) -> Option<f64> {
        Some(0.25)
    }
    fn stateless(&self) -> bool {
        self.stateless
    }
}

struct Bench {
    folder: tempfile::TempDir,
    plan: Plan,
}

fn bench(iterations: std::ops::Range<u64>) -> Bench {
    let folder = tempfile::tempdir().expect("a folder");
    let output = Output { path: folder.path().join("out.exr"), layers: Layers::default(), preview: None };
    let budget = Budget { iterations, time: None, light_paths: None };
    let (snapshots, size) = (Snapshots::None, (9, 6));
    let plan = Plan { size, budget, seed: 1, snapshots, keep: true, checkpoint: None, reference: None, output };
    Bench { folder, plan }
}

fn metadata() -> Metadata {
    Metadata::new(SceneRecord { path: "a.xml".into(), hash: "0".into() }, "fake", json!({"alpha": 0.75}))
}

impl Bench {
    fn run(&self, at: impl FnMut(u64) + Send, interrupt: &Interrupt) -> Outcome {
        render(&mut Fake { stateless: true, at }, &self.plan, metadata(), &mut Silent, interrupt).expect("rendered")
    }
    fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.folder.path())
            .expect("there")
            .map(|f| f.expect("a file").file_name().to_string_lossy().into())
            .collect();
        names.sort();
        names
    }
    fn read(&self, name: &str) -> (Picture, Metadata) {
        let file = exr::read_file(&self.folder.path().join(name)).expect("an EXR");
        let metadata = serde_json::from_str(file.metadata.as_ref().expect("metadata")).expect("of this schema");
        (file.picture().expect("a picture"), metadata)
    }
}

#[test]
fn counts_and_records_are_complete() {
    let bench = bench(2..7);
    let outcome = bench.run(|_| (), &Interrupt::default());
    let (picture, metadata) = bench.read("out.exr");
    assert_eq!(picture.pixels, outcome.film.mean());
    assert_eq!(metadata, outcome.metadata);
    assert_eq!((metadata.camera_paths, metadata.light_paths, metadata.rays), (5 * 54, 1000 + 5 * 54, 5 * 108));
    assert_eq!(metadata.rejected.get("nan"), Some(&5));
    assert_eq!(metadata.runs, [Run { seed: 1, ranges: vec![[2, 7]] }]);
    assert_eq!((metadata.radius, outcome.non_finite, outcome.interrupted), (Some(0.25), 0, None));
    assert!(metadata.seconds > 0.0 && metadata.errors.is_empty());
    assert_eq!(bench.files(), ["out.exr"]);
}

#[test]
fn snapshots_are_the_renders_that_stop_there() {
    let mut long = bench(0..6);
    long.plan.snapshots = Snapshots::PowersOfTwo;
    long.run(|_| (), &Interrupt::default());
    assert_eq!(long.files(), ["out.exr", "out.i000001.exr", "out.i000002.exr", "out.i000004.exr"]);
    let short = bench(0..4);
    short.run(|_| (), &Interrupt::default());
    let (kept, metadata) = long.read("out.i000004.exr");
    assert_eq!(kept, short.read("out.exr").0);
    assert_eq!(metadata.runs[0].ranges, [[0, 4]]);
}

#[test]
fn errors_are_recorded_at_snapshots_and_at_the_end() {
    let mut bench = bench(0..6);
    bench.plan.snapshots = Snapshots::PowersOfTwo;
    let path = PathBuf::from("reference.exr");
    bench.plan.reference = Some(Reference { path: path.clone(), picture: Picture::new(9, 6, vec![Rgb::splat(0.5); 54]) });
    let outcome = bench.run(|_| (), &Interrupt::default());
    let at: Vec<u64> = outcome.metadata.errors.iter().map(|e| e.iteration).collect();
    assert_eq!(at, [1, 2, 4, 6]);
    let (picture, _) = bench.read("out.i000002.exr");
    let reference = bench.plan.reference.as_ref().expect("set");
    let pairs = Pairs::new(&reference.picture, &picture).expect("one size");
    // The film's mean and the file's pixels are the same numbers.
    assert_eq!(outcome.metadata.errors[1].values, ErrorRecord::measure(2, 0.0, &pairs, EPSILON).values);
    bench.plan.reference = Some(Reference { path, picture: Picture::new(6, 9, vec![Rgb::BLACK; 54]) });
    let error = render(&mut Fake { stateless: true, at: |_| () }, &bench.plan, metadata(), &mut Silent, &Interrupt::default());
    let message = error.expect_err("another size").to_string();
    assert_eq!(message, "reference.exr: the image is 9x6 pixels, the reference 6x9");
}

#[test]
fn a_signal_ends_it_after_the_running_iteration_and_saves() {
    let bench = bench(0..1000);
    let interrupt = Interrupt::default();
    let raised = interrupt.clone();
    let outcome = bench.run(
        move |i| {
            if i == 2 {
                raised.raise(15)
            }
        },
        &interrupt,
    );
    assert_eq!((outcome.interrupted, outcome.film.iterations()), (Some(15), 3));
    assert_eq!(bench.read("out.exr").1.runs[0].ranges, [[0, 3]]);
}

#[test]
fn a_signal_before_the_first_iteration_writes_nothing() {
    let bench = bench(0..4);
    let interrupt = Interrupt::default();
    interrupt.raise(2);
    assert_eq!(bench.run(|_| (), &interrupt).interrupted, Some(2));
    assert!(bench.files().is_empty());
}

#[test]
fn time_ends_it_after_the_iteration_that_passes_the_limit() {
    let mut bench = bench(0..u64::MAX);
    bench.plan.budget.time = Some(0.05);
    let outcome = bench.run(|_| std::thread::sleep(Duration::from_millis(20)), &Interrupt::default());
    assert!(outcome.metadata.seconds >= 0.05);
    assert!((1..=3).contains(&outcome.film.iterations()), "{}", outcome.film.iterations());
    assert_eq!(outcome.interrupted, None);
    // However little time there is, there is an image.
    bench.plan.budget.time = Some(1e-9);
    assert_eq!(bench.run(|_| (), &Interrupt::default()).film.iterations(), 1);
}

#[test]
fn checkpoints_save_the_unfinished_image() {
    let mut bench = bench(0..3);
    bench.plan.checkpoint = Some(Duration::ZERO);
    let path = bench.plan.output.path.clone();
    let mut seen = Vec::new();
    let seen_by = &mut seen;
    bench.run(
        move |_| {
            let ranges = |file: exr::ExrFile| file.metadata_json().ok().flatten().map(|m| m["runs"][0]["ranges"].to_string());
            seen_by.push(exr::read_file(&path).ok().and_then(ranges));
        },
        &Interrupt::default(),
    );
    assert_eq!(seen, [None, Some("[[0,1]]".to_string()), Some("[[0,2]]".to_string())]);
}

#[test]
fn methods_with_state_start_at_zero() {
    let bench = bench(5..9);
    let error = render(&mut Fake { stateless: false, at: |_| () }, &bench.plan, metadata(), &mut Silent, &Interrupt::default());
    let message = error.expect_err("refused").to_string();
    assert!(message.contains("resume") && message.contains("fake"), "{message}");
}

#[test]
fn layers_and_previews_are_written() {
    let mut bench = bench(0..4);
    bench.plan.output.layers = Layers { variance: true, count: true, ..Layers::default() };
    bench.plan.output.preview = Some((bench.folder.path().join("out.png"), Exposure::FromImage));
    let outcome = bench.run(|_| (), &Interrupt::default());
    let file = exr::read_file(&bench.plan.output.path).expect("an EXR");
    assert_eq!(file.layer("variance").expect("a layer").pixels, outcome.film.variance_of_mean().expect("kept"));
    assert_eq!(file.layer("count").expect("a layer").pixels[0], Rgb::splat(4.0));
    assert_eq!(bench.files(), ["out.exr", "out.png"]);
}

#[test]
fn threads_change_no_bit() {
    let on = |threads: usize| {
        let mut bench = bench(0..5);
        bench.plan.output.layers.variance = true;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let outcome = pool.install(|| bench.run(|_| (), &Interrupt::default()));
        let channels = exr::read_file(&bench.plan.output.path).expect("an EXR").channels;
        let bits: Vec<u32> = channels.iter().flat_map(|c| c.samples.iter().map(|v| v.to_bits())).collect();
        assert_eq!(outcome.metadata.threads, threads);
        (bits, Metadata { seconds: 0.0, cpu_seconds: 0.0, threads: 0, ..outcome.metadata })
    };
    let one = on(1);
    for threads in [2, 4] {
        assert!(on(threads) == one, "{threads} threads");
    }
}

#[test]
fn light_paths_end_it_with_the_iteration_that_reaches_them() {
    // 1000 at the start, 54 an iteration.
    for (budget, iterations) in [(1000, 1), (1054, 1), (1055, 2), (1000 + 54 * 5, 5)] {
        let mut bench = bench(0..u64::MAX);
        bench.plan.budget = Budget::of_light_paths(budget);
        let outcome = bench.run(|_| (), &Interrupt::default());
        assert_eq!((outcome.film.iterations(), outcome.metadata.light_paths), (iterations, 1000 + 54 * iterations), "{budget}");
    }
}

#[test]
fn a_number_of_light_paths_is_refused_where_there_are_none() {
    struct Dark;
    impl Integrator for Dark {
        fn prepare(&mut self) -> Result<IterationStats, MethodError> {
            Ok(IterationStats::default())
        }
        fn iterate(&mut self, _: u64, film: &mut Film) -> IterationStats {
            film.add_eye_samples(|| (), |(), _, _| Rgb::BLACK, |()| ());
            IterationStats::default()
        }
    }
    let mut bench = bench(0..u64::MAX);
    bench.plan.budget = Budget::of_light_paths(10);
    let error = render(&mut Dark, &bench.plan, metadata(), &mut Silent, &Interrupt::default()).expect_err("it would never end");
    assert!(matches!(error, RenderError::NoLightPaths { budget: 10, .. }), "{error}");
}

#[test]
fn snapshots_are_measured_whether_kept_or_not() {
    let mut bench = bench(0..6);
    bench.plan.snapshots = Snapshots::PowersOfTwo;
    bench.plan.keep = false;
    let plain = bench.run(|_| (), &Interrupt::default());
    assert_eq!(bench.files(), ["out.exr"]);
    let counts: Vec<[u64; 4]> = plain.snapshots.iter().map(|s| [s.iteration, s.light_paths, s.camera_paths, s.rays]).collect();
    assert_eq!(counts, [1, 2, 4, 6].map(|n| [n, 1000 + 54 * n, 54 * n, 108 * n]));
    assert!(plain.snapshots.windows(2).all(|s| s[0].seconds < s[1].seconds && s[0].values.is_empty()));
    assert_eq!(plain.snapshots[3].seconds, plain.metadata.seconds);
    let mut pixels = vec![Rgb::splat(0.5); 54];
    pixels[7] = Rgb::splat(f32::NAN);
    bench.plan.reference = Some(Reference { path: "reference.exr".into(), picture: Picture::new(9, 6, pixels) });
    let measured = bench.run(|_| (), &Interrupt::default());
    for (snapshot, error) in measured.snapshots.iter().zip(&measured.metadata.errors) {
        assert_eq!((snapshot.iteration, snapshot.masked, error.values[MASKED].as_u64()), (error.iteration, 1, Some(1)));
        assert_eq!(snapshot.values.len() + 1, error.values.len());
        // The picture is smaller than the window of ssim.
        assert!(snapshot.values.iter().all(|(key, value)| value.is_some() != (key == "ssim") && error.values[key].as_f64() == *value));
    }
    assert_eq!(measured.snapshots.len(), 4);
}
