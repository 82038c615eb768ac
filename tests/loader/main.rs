//! The scene loader: what it takes, with which defaults and values; what it refuses, with which words.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod documentation;
mod fuzz;
mod gallery;
mod gold;
mod lights_and_sensors;
mod options;
mod shared_scenes;
mod values;

use isophote::scene::mitsuba::{LoadOptions, LoadedParts, SceneError, load_parts};
use std::path::{Path, PathBuf};

/// A folder of this test's files.
fn here(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/loader").join(name)
}

/// A sensor that every scene here can use.
const SENSOR: &str = r#"<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="4"/><rfilter type="box"/></film></sensor>"#;

/// Writes files into a fresh folder and loads the first.
fn load_files(files: &[(&str, &str)], options: &LoadOptions) -> Result<LoadedParts, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    load_parts(&folder.path().join(files[0].0), options)
}

/// A scene around `body`.
fn scene(body: &str) -> String {
    format!("<scene version=\"3.0.0\">\n{SENSOR}\n{body}\n</scene>")
}

/// Loads a scene around `body`, which has to be right.
fn load(body: &str) -> LoadedParts {
    load_files(&[("scene.xml", &scene(body))], &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}\n{body}"))
}

/// Loads a scene around `body`, which has to be wrong.
fn refuse(body: &str) -> SceneError {
    load_files(&[("scene.xml", &scene(body))], &LoadOptions::default()).expect_err(body)
}
