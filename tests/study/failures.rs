//! What fails is on record, and what does not belong together is refused.

use crate::bench::Bench;
use isophote::image::film::Film;
use isophote::integrators::{Common, Integrator, IterationStats, METHODS, Method, MethodError, Settings, method};
use isophote::render::{Interrupt, Step};
use isophote::scene::Scene;
use isophote::study::plan::StudyPlan;
use isophote::study::records::{CellRecord, Status};
use isophote::study::run::{Options, Standing, Study, Summary, Watch};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Panics in its second iteration if its seed is 2, refuses films wider than 10 pixels, else does nothing.
#[derive(clap::Args, Clone, Debug, Default, Serialize, Deserialize)]
struct Unlucky {}

struct Run(u64);

impl Settings for Unlucky {
    fn build<'a>(&self, _: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError> {
        match size.0 > 10 {
            true => Err(MethodError::Settings { method: "unlucky", message: "too wide".into() }),
            false => Ok(Box::new(Run(common.seed))),
        }
    }
}

impl Integrator for Run {
    fn prepare(&mut self) -> Result<IterationStats, MethodError> {
        Ok(IterationStats::default())
    }
    fn iterate(&mut self, i: u64, film: &mut Film) -> IterationStats {
        assert!(i < 1 || self.0 != 2, "seed 2 brings no luck");
        film.add_eye_samples(|| (), |(), _, _| isophote::math::Rgb::WHITE, |()| ());
        IterationStats::default()
    }
}

/// `path` and the unlucky one.
static TABLE: [Method; 2] = [
    method::<isophote::integrators::path::PathSettings>("path", "As it is", "methods/path.md"),
    method::<Unlucky>("unlucky", "For this test", "methods/path.md"),
];

struct Nobody;

impl Watch for Nobody {
    fn reference(&mut self, _: &str, _: u64, _: u64) {}
    fn begin(&mut self, _: &Standing) {}
    fn step(&mut self, _: Step) {}
    fn end(&mut self, _: &CellRecord) {}
}

fn run(bench: &Bench, options: &Options) -> Summary {
    let plan = StudyPlan::read(&bench.path("s.toml"), &TABLE).unwrap_or_else(|e| panic!("{e}"));
    let study = Study::open(plan).unwrap_or_else(|e| panic!("{e}"));
    study.run(&bench.path("out"), options, &mut Nobody, &Interrupt::default()).unwrap_or_else(|e| panic!("{e}"))
}

const STUDY: &str = "seeds = 3\nbudget = { iterations = 4 }\n[reference]\nruns = 2\nbudget = { iterations = 2 }\n\
    [[scene]]\nname = \"wide\"\nfile = \"lamp/scene.xml\"\n[[scene]]\nname = \"small\"\nfile = \"lamp/scene.xml\"\nresolution = \"6x4\"\n\
    [[method]]\nname = \"path\"\n[[method]]\nname = \"unlucky\"\n";

#[test]
fn a_failed_cell_is_a_record_and_the_study_goes_on() {
    let bench = Bench::new();
    bench.write("s.toml", STUDY);
    let summary = run(&bench, &Options::default());
    assert_eq!((summary.cells, summary.rendered, summary.done, summary.failed.len()), (12, 12, 8, 4));
    let essence = bench.essence("out");
    let failed: Vec<String> = essence
        .cells
        .iter()
        .filter(|cell| cell.status == Status::Failed)
        .map(|cell| format!("{} {} {}: {}", cell.scene, cell.method, cell.seed, cell.error.as_deref().unwrap()))
        .collect();
    let wide = |seed: u64| format!("wide unlucky {seed}: unlucky: too wide");
    assert_eq!(failed, [wide(1), wide(2), "small unlucky 2: panicked: seed 2 brings no luck".into(), wide(3)]);
    assert!(essence.cells.iter().all(|cell| (cell.status == Status::Done) == cell.image.is_some()));
    // Failed cells are not tried again unless asked for, and then there is still one record of each.
    assert_eq!(run(&bench, &Options::default()).rendered, 0);
    let again = run(&bench, &Options { retry: true, ..Options::default() });
    assert_eq!((again.rendered, again.failed.len(), bench.essence("out").cells.len()), (4, 4, 12));
}

#[test]
fn methods_take_turns_and_the_first_one_changes() {
    let bench = Bench::new();
    bench.write("s.toml", &STUDY.replace("seeds = 3", "seeds = 2"));
    let plan = StudyPlan::read(&bench.path("s.toml"), &TABLE).unwrap_or_else(|e| panic!("{e}"));
    let cells = Study::open(plan).unwrap_or_else(|e| panic!("{e}")).cells();
    let order: Vec<(u64, usize, usize)> = cells.iter().map(|c| (c.seed, c.scene, c.method)).collect();
    assert_eq!(order, [(1, 0, 0), (1, 0, 1), (1, 1, 0), (1, 1, 1), (2, 0, 1), (2, 0, 0), (2, 1, 1), (2, 1, 0)]);
}

const SMALL: &str = "seeds = 2\nbudget = { iterations = 4 }\n[reference]\nruns = 2\nbudget = { iterations = 2 }\n\
    [[scene]]\nfile = \"lamp/scene.xml\"\n[[method]]\nname = \"sppm\"\n";

#[test]
fn failures_show_in_the_status_and_the_summary() {
    let bench = Bench::new();
    // sppm keeps no classes of paths: it fails on one of the scenes.
    let classes = "[[scene]]\nname = \"caustics\"\nfile = \"lamp/scene.xml\"\npaths = \"LS+DE\"\n";
    bench.write("s.toml", &format!("{SMALL}{classes}"));
    let (status, stdout, stderr) = bench.run(&["study", "s.toml", "--json"]);
    assert_eq!(status, Some(1), "{stderr}");
    let summary: Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!((&summary["cells"], &summary["done"], &summary["rendered"]), (&4.into(), &2.into(), &4.into()));
    assert_eq!(summary["failed"][0]["scene"], "caustics");
    assert!(summary["failed"][1]["error"].as_str().unwrap().contains("--paths"), "{summary}");
    assert!(bench.path("s.study/records.jsonl").is_file());
}

#[test]
fn a_study_grows_and_nothing_is_rendered_twice() {
    let bench = Bench::new();
    bench.write("s.toml", SMALL);
    bench.succeed(&["study", "s.toml", "-q"]);
    let before = bench.essence("s.study");
    bench.write("s.toml", &SMALL.replace("seeds = 2", "seeds = 3").replace("[[method]]", "[[method]]\nname = \"path\"\n[[method]]"));
    let listed = bench.succeed(&["study", "s.toml", "--dry-run"]);
    assert!(listed.contains("4 of 6 cells to render") && listed.contains("lamp  path  seed 1\n"), "{listed}");
    let summary: Value = serde_json::from_str(&bench.succeed(&["study", "s.toml", "--json", "-q"])).unwrap();
    assert_eq!((&summary["rendered"], &summary["done"]), (&4.into(), &6.into()));
    let after = bench.essence("s.study");
    assert_eq!(after.cells[..2], before.cells[..]);
    assert_eq!(after.references, before.references);
}

#[test]
fn another_study_in_the_same_folder_is_refused() {
    let bench = Bench::new();
    bench.write("s.toml", SMALL);
    bench.succeed(&["study", "s.toml", "-q"]);
    let before = bench.essence("s.study");
    for (old, new, why) in [
        ("iterations = 4", "iterations = 8", "the method \"sppm\" has another iterations"),
        ("seeds = 2", "seeds = [2, 3]", "seed 1 is gone"),
        ("name = \"sppm\"", "name = \"sppm\"\nradius_pixels = 2", "the method \"sppm\" has another radius_pixels"),
        ("runs = 2", "runs = 3", "the scene \"lamp\" has another reference_hash"),
    ] {
        bench.write("s.toml", &SMALL.replace(old, new));
        let (status, _, stderr) = bench.run(&["study", "s.toml", "-q"]);
        assert_eq!(status, Some(2), "{stderr}");
        assert!(stderr.contains(why) && stderr.contains("help: give another folder with -o"), "{stderr}");
    }
    assert_eq!(bench.essence("s.study"), before);
}

#[test]
fn numbers_no_scene_takes_are_refused_with_their_line() {
    let bench = Bench::new();
    bench.write("s.toml", &format!("{SMALL}radius_pixels = 1\nalpha = 1.5\n"));
    let (status, _, stderr) = bench.run(&["study", "s.toml", "-q"]);
    assert_eq!(status, Some(2));
    assert!(stderr.contains("s.toml:11:9: sppm: --alpha must lie in (0, 1], not 1.5"), "{stderr}");
    assert!(!bench.path("s.study").exists());
}

#[test]
fn every_method_runs_in_a_study() {
    let bench = Bench::new();
    let methods: String = METHODS.iter().map(|m| format!("[[method]]\nname = \"{}\"\n", m.name)).collect();
    bench.write("s.toml", &SMALL.replace("[[method]]\nname = \"sppm\"\n", &methods));
    bench.succeed(&["study", "s.toml", "-q"]);
    let cells = bench.essence("s.study").cells;
    assert_eq!(cells.len(), 2 * METHODS.len());
    for cell in cells {
        let at: Vec<u64> = cell.snapshots.iter().map(|s| s.iteration).collect();
        assert_eq!((at.as_slice(), cell.iterations), (&[1, 2, 4][..], 4), "{}", cell.method);
        assert!(cell.snapshots.iter().all(|s| s.values.get("relmse").is_some_and(|v| v.is_some_and(|v| v > 0.0))), "{}", cell.method);
        let (first, last) = (&cell.snapshots[0], &cell.snapshots[2]);
        assert_eq!((last.camera_paths, last.rays), (cell.camera_paths, cell.rays));
        assert!(first.rays < last.rays && last.image == cell.image && first.image.is_none());
    }
}
