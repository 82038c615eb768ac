//! A folder with a scene, and the program run in it.

use isophote::image::exr::{self, ExrFile};
use isophote::image::picture::Picture;
use isophote::math::Rgb;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A lit floor, small and quick.
const SCENE: &str = r#"<scene version="3.0.0">
    <default name="radiance" value="5"/>
    <integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="45"/>
        <transform name="to_world"><lookat origin="0, -4, 2" target="0, 0, 0.5" up="0, 0, 1"/></transform>
        <sampler type="independent"><integer name="sample_count" value="3"/></sampler>
        <film type="hdrfilm">
            <integer name="width" value="16"/><integer name="height" value="12"/><rfilter type="box"/>
        </film>
    </sensor>
    <shape type="rectangle">
        <transform name="to_world"><scale value="2"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
    </shape>
    <shape type="sphere">
        <point name="center" x="0" y="0" z="1.5"/><float name="radius" value="0.3"/>
        <emitter type="area"><rgb name="radiance" value="$radiance"/></emitter>
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

    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isophote"));
        command.args(arguments).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    pub(crate) fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs what has to succeed; its standard output.
    pub(crate) fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs what has to print one JSON document.
    pub(crate) fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.succeed(arguments)).unwrap()
    }

    pub(crate) fn read(&self, name: &str) -> ExrFile {
        exr::read_file(&self.path(name)).unwrap_or_else(|e| panic!("{e}"))
    }

    pub(crate) fn metadata(&self, name: &str) -> Value {
        self.read(name).metadata_json().unwrap().unwrap()
    }

    pub(crate) fn write(&self, name: &str, width: usize, pixels: Vec<Rgb>) {
        let height = pixels.len() / width;
        exr::write(&self.path(name), &Picture::new(width, height, pixels), &[], None).unwrap();
    }

    /// Names of the files in the folder.
    pub(crate) fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap().flatten().filter(|entry| entry.path().is_file());
        let mut names: Vec<String> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

/// All that has to be equal between two runs of the same render: the bits of every channel, and the metadata but the times and threads.
pub(crate) fn essence(file: &ExrFile) -> (Vec<(String, Vec<u32>)>, Value) {
    let bits = |c: &exr::Channel| (c.name.clone(), c.samples.iter().map(|v| v.to_bits()).collect());
    let mut metadata = file.metadata_json().unwrap().unwrap();
    for key in ["seconds", "cpu_seconds", "threads"] {
        metadata[key] = Value::Null;
    }
    for record in metadata["errors"].as_array_mut().unwrap() {
        record["seconds"] = Value::Null;
    }
    (file.channels.iter().map(bits).collect(), metadata)
}

/// The path as an argument.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
