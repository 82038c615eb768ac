//! A study's folder.

use crate::study::error::StudyError;
use std::path::Path;

/// Removes files that a killed program was writing: they have temporary names until they are whole. Only where studies write: the folder
/// itself, where the page goes, and the two for pictures.
pub(super) fn clean(folder: &Path) -> Result<(), StudyError> {
    let parts = ["images", "references"].map(|part| folder.join(part));
    clean_folder(folder, false)?;
    parts.iter().filter(|part| part.is_dir()).try_for_each(|part| clean_folder(part, true))
}

fn clean_folder(folder: &Path, deep: bool) -> Result<(), StudyError> {
    for entry in std::fs::read_dir(folder).map_err(StudyError::io(folder))? {
        let entry = entry.map_err(StudyError::io(folder))?;
        let (path, kind) = (entry.path(), entry.file_type().map_err(StudyError::io(folder))?);
        let name = entry.file_name();
        if kind.is_dir() {
            if deep {
                clean_folder(&path, deep)?;
            }
        } else if kind.is_file() && name.to_str().is_some_and(|n| n.starts_with(".isophote-") && n.ends_with(".tmp")) {
            std::fs::remove_file(&path).map_err(StudyError::io(&path))?;
        }
    }
    Ok(())
}

/// Removes an image and the films kept on its way: `SEED.exr` and `SEED.i000064.exr`.
pub(super) fn clear(image: &Path) -> Result<(), StudyError> {
    let (Some(folder), Some(seed)) = (image.parent(), image.file_stem().and_then(|stem| stem.to_str())) else { return Ok(()) };
    for entry in std::fs::read_dir(folder).map_err(StudyError::io(folder))? {
        let path = entry.map_err(StudyError::io(folder))?.path();
        let rest = path.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_prefix(seed));
        if rest.is_some_and(|rest| rest == ".exr" || (rest.starts_with(".i") && rest.ends_with(".exr"))) {
            std::fs::remove_file(&path).map_err(StudyError::io(&path))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_belongs_to_the_seed_goes() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["1.exr", "1.i000004.exr", "11.exr", "11.i000004.exr", "1.txt"] {
            std::fs::write(folder.path().join(name), "").expect("written");
        }
        clear(&folder.path().join("1.exr")).expect("removed");
        let mut left: Vec<_> = std::fs::read_dir(folder.path()).expect("there").map(|e| e.expect("a file").file_name()).collect();
        left.sort();
        assert_eq!(left, ["1.txt", "11.exr", "11.i000004.exr"]);
    }
}
