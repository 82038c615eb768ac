//! Records and pictures of a study as one HTML file that loads nothing.
//!
//! `data` sorts the records, `claims` decides, `load` and `split` measure the pictures together, the rest draws and writes.

mod answers;
mod charts;
mod claims;
mod data;
mod gallery;
mod load;
mod numbers;
mod page;
mod pictures;
mod plots;
mod section;
mod split;
mod svg;
mod tables;

use crate::image::file::replace;
use crate::image::picture::ImageError;
use data::Study;
use load::ScenePictures;
use section::Section;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Pixels the viewers of a page may hold in all: six bytes each, hardly compressible, and a third more as text.
const VIEWER_PIXELS: usize = 2_000_000;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The records cannot be read.
    #[error(transparent)]
    Records(#[from] crate::study::records::RecordsError),
    /// There are no records.
    #[error("{}: no cell and no start of a study is on record", folder.display())]
    Empty {
        /// The folder.
        folder: PathBuf,
    },
    /// A picture or a chart cannot be made.
    #[error("{message}")]
    Picture {
        /// What is wrong.
        message: String,
    },
    /// The page cannot be written.
    #[error(transparent)]
    Write(#[from] ImageError),
}

/// What the page holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Scenes.
    pub scenes: usize,
    /// Methods.
    pub methods: usize,
    /// Cells that are done.
    pub done: usize,
    /// Cells that failed.
    pub failed: usize,
    /// Cells the plan asks for, where the records say.
    pub planned: Option<usize>,
    /// The page's size.
    pub bytes: usize,
    /// Pictures that could not be used, and why; the page says so too.
    pub problems: Vec<String>,
}

/// Writes the page of the study in the folder `dir` to `out`, replacing it whole.
pub fn write(dir: &Path, out: &Path) -> Result<Summary, ReportError> {
    let study = Study::new(dir, crate::study::records::read(dir)?)?;
    crate::image::file::check_writable(out)?;
    let factor = viewer_factor(&study);
    let equals: Vec<_> = study.scenes.iter().map(|s| study.metric().and_then(|metric| claims::equal_time(s, metric))).collect();
    let (mut sections, mut problems) = (Vec::new(), Vec::new());
    for (index, (scene, equal)) in study.scenes.iter().zip(&equals).enumerate() {
        let pictures = ScenePictures::load(&study, scene, equal.as_ref());
        problems.extend(pictures.problems.iter().cloned());
        sections.push(Section { study: &study, scene, index, equal: equal.as_ref(), pictures, factor }.render()?);
    }
    let text = page::page(&study, &equals, &sections);
    replace(out, |file| file.write_all(text.as_bytes()).map_err(|source| ImageError::Io { path: out.to_path_buf(), source }))?;
    let (done, failed) = study.ended();
    Ok(Summary {
        scenes: study.scenes.len(),
        methods: study.methods.len(),
        done,
        failed,
        planned: study.planned,
        bytes: text.len(),
        problems,
    })
}

/// By how much pictures in the viewers are made smaller, so that all of them fit into a page.
fn viewer_factor(study: &Study) -> usize {
    let pixels = |s: &data::Scene| s.reference.as_ref().map_or(0, |r| r.size.0 * r.size.1 * (s.rows.len() + 1));
    let total: usize = study.scenes.iter().map(pixels).sum();
    (total as f64 / VIEWER_PIXELS as f64).sqrt().ceil().max(1.0) as usize
}
