//! Why a study does not start or cannot go on. A cell that fails is none of these: it is a record.

use super::plan::PlanError;
use super::records::RecordsError;
use crate::image::picture::ImageError;
use crate::render::RenderError;
use crate::scene::mitsuba::SceneError;
use std::path::{Path, PathBuf};

/// A study does not start or cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The study file.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The records.
    #[error(transparent)]
    Records(#[from] RecordsError),
    /// A picture.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A reference cannot be rendered.
    #[error("the reference of {scene}: {source}")]
    Reference {
        /// The scene's name.
        scene: String,
        /// Why.
        source: RenderError,
    },
    /// A reference would be one of the images it is compared with.
    #[error(
        "the reference of {scene} is the method {method} with the same settings and seed {seed} as a cell of this study: the cell would be compared with itself"
    )]
    SameRun {
        /// The scene's name.
        scene: String,
        /// The method's label.
        method: String,
        /// The seed both have.
        seed: u64,
    },
    /// The folder holds another study.
    #[error("{} holds another study: {why}", folder.display())]
    OtherStudy {
        /// The study's folder.
        folder: PathBuf,
        /// What differs.
        why: String,
    },
    /// A folder or a file.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

impl StudyError {
    /// The system refuses `path`.
    pub(super) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        |source| Self::Io { path: path.to_path_buf(), source }
    }

    /// What to do, where it is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Plan(error) => error.help.clone(),
            Self::OtherStudy { .. } => Some(
                "give another folder with -o; with the same folder a study goes on only if seeds, scenes or methods were added".to_owned(),
            ),
            Self::SameRun { .. } => Some("take other seeds, or make the reference with another method".to_owned()),
            Self::Records(RecordsError::Locked { .. }) => Some("wait for it, or give another folder with -o".to_owned()),
            _ => None,
        }
    }
}
