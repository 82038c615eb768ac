//! A folder with scenes and studies, the program run in it, and all of a study that has to come out the same.

use isophote::image::exr;
use isophote::study::records::{self, CellRecord, Record, ReferenceRecord};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A lit floor, small and quick.
const SCENE: &str = r#"<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="45"/>
        <transform name="to_world"><lookat origin="0, -4, 2" target="0, 0, 0.5" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/><rfilter type="box"/></film>
    </sensor>
    <shape type="rectangle">
        <transform name="to_world"><scale value="2"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
    </shape>
    <shape type="sphere">
        <point name="center" x="0" y="0" z="1.5"/><float name="radius" value="0.3"/>
        <emitter type="area"><rgb name="radiance" value="5"/></emitter>
    </shape>
</scene>
"#;

/// A temporary folder, in it `lamp/scene.xml`.
pub(crate) struct Bench(tempfile::TempDir);

impl Bench {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("lamp")).unwrap();
        std::fs::write(folder.path().join("lamp/scene.xml"), SCENE).unwrap();
        Self(folder)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isophote"));
        command.args(arguments).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    /// Runs to the end; exit status, standard output, standard error.
    pub(crate) fn run(&self, arguments: &[&str]) -> (Option<i32>, String, String) {
        let Output { status, stdout, stderr } = self.command(arguments).output().unwrap();
        (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
    }

    pub(crate) fn succeed(&self, arguments: &[&str]) -> String {
        let (status, stdout, stderr) = self.run(arguments);
        assert_eq!(status, Some(0), "{arguments:?}: {stderr}");
        stdout
    }

    /// What a study left, times apart.
    pub(crate) fn essence(&self, folder: &str) -> Essence {
        let folder = self.path(folder);
        let mut essence = Essence { cells: Vec::new(), references: Vec::new(), files: BTreeMap::new() };
        for record in records::read(&folder).unwrap() {
            match record {
                Record::Study(_) => (),
                Record::Reference(mut reference) => {
                    if let Some(made) = &mut reference.made {
                        made.seconds = 0.0;
                    }
                    essence.references.push(reference);
                }
                Record::Cell(cell) => essence.cells.push(timeless(*cell)),
            }
        }
        files(&folder, &folder, &mut essence.files);
        essence
    }
}

/// All that has to be equal between two runs of a study.
#[derive(Debug, PartialEq)]
pub(crate) struct Essence {
    pub(crate) cells: Vec<CellRecord>,
    pub(crate) references: Vec<ReferenceRecord>,
    /// Bits of the channels and metadata of every EXR, content of every other file but the records and the page, by path.
    pub(crate) files: BTreeMap<PathBuf, (Vec<u32>, Value)>,
}

fn timeless(mut cell: CellRecord) -> CellRecord {
    (cell.seconds, cell.cpu_seconds, cell.started) = (0.0, 0.0, String::new());
    for snapshot in &mut cell.snapshots {
        (snapshot.seconds, snapshot.cpu_seconds) = (0.0, 0.0);
    }
    cell
}

fn files(folder: &Path, root: &Path, found: &mut BTreeMap<PathBuf, (Vec<u32>, Value)>) {
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            files(&path, root, found);
            continue;
        }
        let name = path.strip_prefix(root).unwrap().to_path_buf();
        let content = match path.extension().and_then(|e| e.to_str()) {
            Some("exr") => {
                let file = exr::read_file(&path).unwrap_or_else(|e| panic!("{e}"));
                let bits = file.channels.iter().flat_map(|c| c.samples.iter().map(|v| v.to_bits())).collect();
                (bits, without_times(file.metadata_json().unwrap().unwrap_or(Value::Null)))
            }
            Some("json") => (Vec::new(), without_times(serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap())),
            // The records are compared above, and the page tells times.
            Some("jsonl" | "html") => continue,
            _ => (std::fs::read(&path).unwrap().into_iter().map(u32::from).collect(), Value::Null),
        };
        found.insert(name, content);
    }
}

fn without_times(mut metadata: Value) -> Value {
    for key in ["seconds", "cpu_seconds"] {
        if let Some(time) = metadata.get_mut(key) {
            *time = Value::Null;
        }
    }
    for record in metadata.get_mut("errors").and_then(Value::as_array_mut).into_iter().flatten() {
        record["seconds"] = Value::Null;
    }
    metadata
}
