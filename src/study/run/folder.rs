//! A study's folder.

use crate::study::error::StudyError;
use std::path::Path;

/// Removes files that a killed program was writing: they have temporary names until they are whole.
pub(super) fn clean(folder: &Path) -> Result<(), StudyError> {
    for entry in std::fs::read_dir(folder).map_err(StudyError::io(folder))? {
        let entry = entry.map_err(StudyError::io(folder))?;
        let (path, kind) = (entry.path(), entry.file_type().map_err(StudyError::io(folder))?);
        let name = entry.file_name();
        if kind.is_dir() {
            clean(&path)?;
        } else if kind.is_file() && name.to_str().is_some_and(|n| n.starts_with(".isophote-") && n.ends_with(".tmp")) {
            std::fs::remove_file(&path).map_err(StudyError::io(&path))?;
        }
    }
    Ok(())
}
