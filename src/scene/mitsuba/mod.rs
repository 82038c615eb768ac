//! Mitsuba 3 scene files: a documented subset, each parameter with Mitsuba's default and meaning (`docs/scenes.md`).
//!
//! Two stages. `xml` reads the files to a tree of plugins whose parameters remember whether they were read; `build` makes a
//! [`Scene`] of the tree, through one small table a kind. A parameter nobody read is an error, or a note where it cannot change the
//! image. Adding a plugin is its constructor and one line of its kind's table.

mod bsdfs;
mod build;
mod element;
mod emitters;
mod error;
mod files;
mod number;
mod plugin;
mod sensor;
mod shapes;
mod textures;
mod transform;
mod xml;

use error::Result;
pub(crate) use error::suggest;
pub use error::{Position, SceneError};

use super::{Scene, SceneParts};
use std::path::{Path, PathBuf};

/// What the command line changes in a scene.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// `(name, value)` fills `$name`, over the scene's own `default`.
    pub defines: Vec<(String, String)>,
    /// Width and height of the film, instead of the scene's.
    pub resolution: Option<(u32, u32)>,
    /// Window of the film that is rendered, instead of the scene's: left, top, width, height in pixels.
    pub crop: Option<[u32; 4]>,
}

/// The film a scene asks for, after [`LoadOptions`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilmSize {
    /// Pixels across the whole film.
    pub width: u32,
    /// Pixels down the whole film.
    pub height: u32,
    /// Window that is rendered: left, top, width, height; `None` for the whole film.
    pub crop: Option<[u32; 4]>,
}

/// What a scene says about how it wants to be rendered: defaults of the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RenderDefaults {
    /// Samples a pixel, of the `sampler`; Mitsuba's 4 if it says nothing.
    pub sample_count: u32,
    /// Most path edges, of the `integrator`; `None` without limit.
    pub max_depth: Option<u32>,
    /// Path edges from which Russian roulette may end a path, of the `integrator`; Mitsuba's 5 if it says nothing.
    pub rr_depth: u32,
    /// Emitters are not seen directly, of the `integrator`.
    pub hide_emitters: bool,
    /// Type of the `integrator`, if there is one. Not checked: methods are chosen on the command line.
    pub integrator: Option<String>,
}

/// Something a scene says that is read but does not change the image, or that is done differently here.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Note {
    /// The file.
    pub file: PathBuf,
    /// Line, from 1.
    pub line: Option<u32>,
    /// What was noted.
    pub message: String,
}

impl Note {
    fn new(position: &Position, message: String) -> Self {
        Self { file: position.file.to_path_buf(), line: position.line, message }
    }
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: note: {}", self.file.display(), self.message),
            None => write!(f, "{}: note: {}", self.file.display(), self.message),
        }
    }
}

/// A scene's parts, before the accelerator and the emitters' tables are built.
#[derive(Debug)]
pub struct LoadedParts {
    /// Shapes, materials, emitters and camera.
    pub parts: SceneParts,
    /// The film asked for.
    pub film: FilmSize,
    /// What the scene asks of the renderer.
    pub defaults: RenderDefaults,
    /// What was read but is not used, in the order of the files.
    pub notes: Vec<Note>,
    /// Every file read, in the order the scene names them.
    pub files: Vec<PathBuf>,
    /// SHA-256 over the SHA-256 of each of [`LoadedParts::files`], in their order; lower-case hexadecimal. Names, `-D`, resolution and
    /// crop are not in it.
    pub content_hash: String,
    /// Where each shape is written, by the name it has in the parts.
    shape_positions: Vec<(String, Position)>,
}

/// A scene ready to be rendered.
pub struct LoadedScene {
    /// What light meets, and the camera.
    pub scene: Scene,
    /// The film asked for.
    pub film: FilmSize,
    /// What the scene asks of the renderer.
    pub defaults: RenderDefaults,
    /// What was read but is not used, in the order of the files.
    pub notes: Vec<Note>,
    /// Every file read, in the order the scene names them.
    pub files: Vec<PathBuf>,
    /// As [`LoadedParts::content_hash`].
    pub content_hash: String,
}

/// Reads a scene and everything it names, and builds it.
pub fn load(path: &Path, options: &LoadOptions) -> Result<LoadedScene> {
    let LoadedParts { parts, film, defaults, notes, files, content_hash, shape_positions } = load_parts(path, options)?;
    let scene = Scene::build(parts).map_err(|e| {
        let at = match &e {
            super::SceneError::Shape { name, .. } => shape_positions.iter().find(|(shape, _)| shape == name).map(|(_, at)| at.clone()),
            _ => None,
        };
        SceneError::new(&at.unwrap_or_else(|| Position::whole(path)), e.to_string())
    })?;
    Ok(LoadedScene { scene, film, defaults, notes, files, content_hash })
}

/// Reads a scene and everything it names.
pub fn load_parts(path: &Path, options: &LoadOptions) -> Result<LoadedParts> {
    let mut files = files::Files::default();
    let tree = xml::read(path, &options.defines, &mut files)?;
    let mut builder = build::Builder::new(&tree, &mut files);
    let built = builder.scene(options)?;
    let shape_positions = std::mem::take(&mut builder.shape_positions);
    let mut notes = builder.into_notes();
    notes.splice(0..0, tree.notes.iter().cloned());
    let (files, content_hash) = files.finish();
    Ok(LoadedParts { parts: built.parts, film: built.film, defaults: built.defaults, notes, files, content_hash, shape_positions })
}

/// Every plugin the loader knows with the parameters it takes, as `(kind, type)`; what `docs/scenes.md` has to list.
pub fn supported() -> Vec<(&'static str, &'static str)> {
    let bsdfs = bsdfs::TABLE.iter().map(|(name, _)| ("bsdf", *name));
    let shapes = shapes::TABLE.iter().map(|(name, _)| ("shape", *name));
    let emitters = emitters::NAMES.iter().map(|name| ("emitter", *name));
    let textures = textures::TABLE.iter().map(|(name, _)| ("texture", *name));
    let sensors = sensor::SENSORS.iter().map(|name| ("sensor", *name));
    bsdfs.chain(shapes).chain(emitters).chain(textures).chain(sensors).chain([("film", "hdrfilm")]).collect()
}
