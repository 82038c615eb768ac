//! Loading a scene with what the command line changes in it. The only place of this room that calls the loader.

use super::failure::Failure;
use super::options::Define;
use crate::render::{Changes, Crop, Resolution};
use crate::scene::mitsuba::{LoadedScene, load};
use std::path::{Path, PathBuf};

/// Options that change a scene.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct SceneArgs {
    /// Scene, a Mitsuba 3 XML file
    #[arg(value_name = "SCENE.xml", help_heading = None)]
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) changes: SceneChanges,
}

/// Changes of a scene.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct SceneChanges {
    /// Size of the film in pixels, instead of the scene's
    #[arg(long, value_name = "WxH")]
    pub(crate) resolution: Option<Resolution>,
    /// Window of the film to render: left, top, width, height in pixels
    #[arg(long, value_name = "X,Y,W,H")]
    pub(crate) crop: Option<Crop>,
    /// Fills $NAME in the scene
    #[arg(short = 'D', long, value_name = "NAME=VALUE")]
    pub(crate) define: Vec<Define>,
}

/// Loads a scene.
pub(crate) fn open(path: &Path, changes: &Changes) -> Result<LoadedScene, Failure> {
    Ok(load(path, &changes.load_options())?)
}

impl SceneChanges {
    /// As checked.
    pub(crate) fn changes(&self) -> Changes {
        let define = self.define.iter().map(|d| (d.name.clone(), d.value.clone())).collect();
        Changes { resolution: self.resolution, crop: self.crop, define, ..Changes::default() }
    }
}

/// Bytes the scene holds.
pub(crate) fn bytes(loaded: &LoadedScene) -> u64 {
    let memory = loaded.scene.memory();
    (memory.accelerator + memory.surfaces + memory.emitters) as u64
}
