//! Records and pictures of a study as one HTML file that loads nothing.

mod charts;
mod claims;
mod data;
mod interim;
mod numbers;
mod pictures;
mod split;
mod svg;

use std::path::{Path, PathBuf};

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A picture or a chart cannot be made.
    #[error("{message}")]
    Picture {
        /// What is wrong.
        message: String,
    },
    /// Nothing.
    #[error("{}", folder.display())]
    Empty {
        /// The folder.
        folder: PathBuf,
    },
}
