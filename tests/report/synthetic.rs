//! A study that nobody rendered: errors, speeds and pictures by known laws, so that a page's numbers can be foreseen.

use isophote::image::exr::{Plane, write};
use isophote::image::metrics::{EPSILON, METRICS, Pairs};
use isophote::image::picture::Picture;
use isophote::math::Rgb;
use isophote::samplers::{Key, Purpose, Stream};
use isophote::study::records::{CellRecord, Machine, MadeReference, Record, ReferenceRecord, SCHEMA, SnapshotRecord, Status, StudyRecord};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// A method whose every property is planted.
#[derive(Clone, Debug)]
pub(crate) struct FakeMethod {
    pub(crate) label: String,
    pub(crate) name: &'static str,
    pub(crate) settings: Value,
    /// Seconds of an iteration.
    pub(crate) seconds: f64,
    /// Relative standard deviation of one iteration.
    pub(crate) noise: f64,
    /// Exponent of the standard deviation in iterations.
    pub(crate) noise_slope: f64,
    /// Relative bias of one iteration, and its exponent.
    pub(crate) bias: f64,
    pub(crate) bias_slope: f64,
    /// Light paths of an iteration.
    pub(crate) photons: u64,
}

/// A whole study.
#[derive(Clone, Debug)]
pub(crate) struct FakeStudy {
    pub(crate) scenes: Vec<String>,
    pub(crate) methods: Vec<FakeMethod>,
    pub(crate) seeds: u64,
    /// Render time of every cell.
    pub(crate) time: f64,
    pub(crate) size: (usize, usize),
    /// Whether scenes have references.
    pub(crate) references: bool,
    /// Whether pictures along the way are kept.
    pub(crate) keep: bool,
}

impl FakeMethod {
    pub(crate) fn path(label: &str, seconds: f64, noise: f64) -> Self {
        let settings = json!({"max_depth": 8});
        Self { label: label.into(), name: "path", settings, seconds, noise, noise_slope: -0.5, bias: 0.0, bias_slope: 0.0, photons: 0 }
    }

    pub(crate) fn sppm(label: &str, seconds: f64, noise: f64, bias: f64, alpha: f64) -> Self {
        Self {
            label: label.into(),
            name: "sppm",
            settings: json!({"max_depth": 8, "alpha": alpha, "sampler": "uniform"}),
            seconds,
            noise,
            noise_slope: -0.5 * alpha,
            bias,
            bias_slope: alpha - 1.0,
            photons: 16_384,
        }
    }
}

impl FakeStudy {
    /// Four scenes, six methods, five seeds.
    pub(crate) fn large() -> Self {
        let methods = vec![
            FakeMethod::path("path", 0.02, 1.2),
            FakeMethod::sppm("sppm, 1 pixel", 0.09, 0.9, 0.02, 0.75),
            FakeMethod::sppm("sppm, 2 pixels", 0.11, 0.45, 0.06, 0.75),
            FakeMethod::sppm("sppm, 4 pixels", 0.16, 0.22, 0.2, 0.75),
            FakeMethod::sppm("sppm, alpha 0.6", 0.09, 0.8, 0.05, 0.6),
            FakeMethod::path("path, twice the light", 0.038, 0.87),
        ];
        let scenes = ["glass box", "veach bidir", "caustic ring", "long corridor"].map(str::to_owned).to_vec();
        Self { scenes, methods, seeds: 5, time: 8.0, size: (256, 256), references: true, keep: false }
    }

    /// Two scenes, three methods, small pictures.
    pub(crate) fn small() -> Self {
        let methods = vec![
            FakeMethod::path("path", 0.02, 1.0),
            FakeMethod::sppm("sppm", 0.08, 0.5, 0.05, 0.75),
            FakeMethod::path("path again", 0.0201, 1.0),
        ];
        Self { scenes: vec!["box".into(), "ring".into()], methods, seeds: 5, time: 2.0, size: (48, 32), references: true, keep: false }
    }

    /// Writes records and pictures.
    pub(crate) fn write(&self, folder: &Path) {
        let mut lines = vec![Record::Study(Box::new(self.start()))];
        for (index, scene) in self.scenes.iter().enumerate() {
            let truth = truth(index, self.size);
            if self.references {
                lines.push(Record::Reference(self.reference(folder, scene, index, &truth)));
            }
            for seed in 1..=self.seeds {
                for (number, method) in self.methods.iter().enumerate() {
                    lines.push(Record::Cell(Box::new(self.cell(folder, (scene, index), (method, number), seed, &truth))));
                }
            }
        }
        write_lines(folder, &lines);
    }

    fn start(&self) -> StudyRecord {
        StudyRecord {
            schema: SCHEMA,
            version: "0.1.0".into(),
            command: ["isophote", "study", "made up.toml"].map(str::to_owned).to_vec(),
            file: "made up.toml".into(),
            plan: json!({
                "name": "made up",
                "seeds": (1..=self.seeds).collect::<Vec<_>>(),
                "scene": self.scenes.iter().map(|s| json!({"name": s})).collect::<Vec<_>>(),
                "method": self.methods.iter().map(|m| json!({"label": m.label, "name": m.name})).collect::<Vec<_>>(),
                "report": {},
            }),
            plan_hash: "5f1c".into(),
            machine: Machine { cpu: "Imaginary 9000".into(), processors: 2, threads: 2, os: "linux x86_64".into(), memory: Some(8 << 30) },
            started: "2026-01-02T03:04:05Z".into(),
        }
    }

    fn reference(&self, folder: &Path, scene: &str, index: usize, truth: &Picture) -> ReferenceRecord {
        let (mean, var) = (format!("references/{index}.mean.exr"), format!("references/{index}.var.exr"));
        std::fs::create_dir_all(folder.join("references")).expect("a folder");
        let variance = 1e-8;
        let noise = Picture::new(self.size.0, self.size.1, vec![Rgb::splat(variance); truth.pixels.len()]);
        write(&folder.join(&mean), truth, &[], None).expect("written");
        write(&folder.join(&var), &noise, &[], None).expect("written");
        let made =
            MadeReference { method: "path".into(), settings: json!({}), seeds: vec![101, 102], iterations: vec![4096; 2], seconds: 700.0 };
        ReferenceRecord {
            scene: scene.into(),
            mean: mean.into(),
            var: Some(var.into()),
            hash: format!("aa{index:02}"),
            made: Some(made),
            size: self.size,
            noise: Some(f64::from(variance)),
        }
    }

    fn cell(&self, folder: &Path, scene: (&str, usize), method: (&FakeMethod, usize), seed: u64, truth: &Picture) -> CellRecord {
        let (method, number) = method;
        let key = |index: u64| Key { seed, iteration: (scene.1 * 100 + number) as u64, index, purpose: Purpose::Test };
        // Machines are not steady: a few per cent of speed differ from run to run.
        let speed = 1.0 + 0.06 * (f64::from(key(0).stream().next_1d()) - 0.5);
        let seconds = method.seconds * speed;
        let last = (self.time / seconds).ceil().max(1.0) as u64;
        let mut iterations: Vec<u64> = (0..40).map(|e| 1 << e).take_while(|i| *i < last).collect();
        iterations.push(last);
        let path = |end: &str| format!("images/{}/{number}/{seed}{end}.exr", scene.1);
        std::fs::create_dir_all(folder.join(path("x")).parent().expect("a parent")).expect("a folder");
        let mut snapshots = Vec::new();
        for &iteration in &iterations {
            let picture = method.picture(truth, iteration, key(iteration));
            let is_last = iteration == last;
            let image = if is_last { path("") } else { path(&format!(".i{iteration:06}")) };
            if is_last || self.keep {
                let density = picture.pixels.iter().map(|p| p.luminance()).collect();
                let planes = if method.photons > 0 { vec![Plane::Scalar("density".into(), density)] } else { Vec::new() };
                write(&folder.join(&image), &picture, &planes, None).expect("written");
            }
            let values = if self.references { measured(truth, &picture) } else { BTreeMap::new() };
            let samples = (self.size.0 * self.size.1) as u64 * iteration;
            snapshots.push(SnapshotRecord {
                iteration,
                seconds: seconds * iteration as f64,
                cpu_seconds: 1.9 * seconds * iteration as f64,
                light_paths: method.photons * iteration,
                camera_paths: samples,
                rays: 9 * samples,
                values,
                masked: 0,
                image: (is_last || self.keep).then(|| image.into()),
            });
        }
        let end = snapshots.last().expect("at least one").clone();
        CellRecord {
            scene: scene.0.into(),
            method: method.label.clone(),
            name: method.name.into(),
            seed,
            status: Status::Done,
            error: None,
            settings: method.settings.clone(),
            scene_hash: format!("5ce9e{}", scene.1),
            cell_hash: format!("{}-{number}-{seed}", scene.1),
            iterations: last,
            radius: (method.photons > 0).then_some(0.01),
            seconds: end.seconds,
            cpu_seconds: end.cpu_seconds,
            light_paths: end.light_paths,
            camera_paths: end.camera_paths,
            rays: end.rays,
            rejected: BTreeMap::new(),
            started: "2026-01-02T03:04:06Z".into(),
            snapshots,
            image: Some(path("").into()),
            diagnostics: (method.photons > 0).then(|| json!({"acceptance": 0.3125, "chains": {"count": 4, "ess": [812.0, 790.5]}})),
        }
    }
}

impl FakeMethod {
    /// The truth with this method's noise and bias after so many iterations.
    fn picture(&self, truth: &Picture, iteration: u64, key: Key) -> Picture {
        let n = iteration as f64;
        let (noise, bias) = (self.noise * n.powf(self.noise_slope), self.bias * n.powf(self.bias_slope));
        let mut stream = key.stream();
        let mut normal = || {
            // Twelve uniforms, less six: variance one.
            (0..4).map(|_| f64::from(stream.next_1d())).sum::<f64>() * 3_f64.sqrt() - 2.0 * 3_f64.sqrt()
        };
        let mut value = |t: f32| (f64::from(t) * (1.0 + bias + noise * normal())) as f32;
        let pixels = truth.pixels.iter().map(|p| p.map(&mut value)).collect();
        Picture::new(truth.width, truth.height, pixels)
    }
}

/// Something to look at: discs of light over a gradient.
fn truth(index: usize, (width, height): (usize, usize)) -> Picture {
    let pixel = |i: usize| {
        let (x, y) = ((i % width) as f32 / width as f32 - 0.5, (i / width) as f32 / height as f32 - 0.5);
        let turn = index as f32 * 0.7;
        let (u, v) = (x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos());
        let ring = (-((u.hypot(v) - 0.28).abs() * 22.0)).exp();
        let lamp = if (u - 0.1).hypot(v + 0.25) < 0.08 { 6.0 } else { 0.0 };
        let floor = 0.15 + 0.25 * (0.5 - y) + if ((u * 8.0).floor() + (v * 8.0).floor()) as i32 % 2 == 0 { 0.08 } else { 0.0 };
        Rgb::new(floor + 1.6 * ring + lamp, floor * 0.92 + 1.1 * ring + lamp * 0.9, floor * 0.8 + 0.5 * ring + lamp * 0.7)
    };
    Picture::new(width, height, (0..width * height).map(pixel).collect())
}

fn measured(truth: &Picture, picture: &Picture) -> BTreeMap<String, Option<f64>> {
    let pairs = Pairs::new(truth, picture).expect("one size");
    METRICS.iter().map(|m| (m.name.to_string(), m.measure(&pairs, EPSILON).value)).collect()
}

/// Writes records as a study does.
pub(crate) fn write_lines(folder: &Path, lines: &[Record]) {
    std::fs::create_dir_all(folder).expect("a folder");
    let text: String = lines.iter().map(|l| serde_json::to_string(l).expect("JSON") + "\n").collect();
    std::fs::write(folder.join("records.jsonl"), text).expect("written");
}

/// Reads them back, to change some.
pub(crate) fn read_lines(folder: &Path) -> Vec<Record> {
    let text = std::fs::read_to_string(folder.join("records.jsonl")).expect("read");
    text.lines().map(|l| serde_json::from_str(l).expect("a record")).collect()
}
