//! A colour image in memory, and where a file's error goes.

use crate::math::Rgb;
use std::path::{Path, PathBuf};

/// Linear colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width * height` of them, row-major from the top left.
    pub pixels: Vec<Rgb>,
}

impl Picture {
    /// From its pixels.
    ///
    /// # Panics
    /// If there are not `width * height` pixels.
    pub fn new(width: usize, height: usize, pixels: Vec<Rgb>) -> Self {
        assert_eq!(pixels.len(), width * height, "a picture of {width}x{height}");
        Self { width, height, pixels }
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Pixels with a component that is infinite or NaN.
    pub fn non_finite(&self) -> u64 {
        self.pixels.iter().filter(|p| !p.is_finite()).count() as u64
    }
}

/// An image file cannot be read or written, or does not hold what is asked of it.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The system refuses the file.
    #[error("{}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is there, but is no picture that can be used.
    #[error("{}: {message}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it and what would do.
        message: String,
    },
}

impl ImageError {
    /// The system refuses `path`.
    pub(crate) fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), source }
    }

    /// `path` holds something else.
    pub(crate) fn content(path: &Path, message: impl Into<String>) -> Self {
        Self::Content { path: path.to_path_buf(), message: message.into() }
    }
}
