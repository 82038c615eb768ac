//! Files that are replaced whole or not at all.

use super::picture::ImageError;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes a file under a temporary name beside its own, makes sure it is on the disk, and renames it: whoever reads `path` sees
/// the old file or the new one, whatever happens in between.
pub fn replace(path: &Path, write: impl FnOnce(&mut BufWriter<&mut std::fs::File>) -> Result<(), ImageError>) -> Result<(), ImageError> {
    let io = |error| ImageError::io(path, error);
    let target = target_of(path)?;
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".isophote-").suffix(".tmp");
    #[cfg(unix)]
    {
        // As any file a program makes: what the user's mask leaves of these.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut temporary = builder.tempfile_in(folder).map_err(io)?;
    let mut writer = BufWriter::new(temporary.as_file_mut());
    write(&mut writer)?;
    writer.flush().map_err(io)?;
    drop(writer);
    temporary.as_file().sync_all().map_err(io)?;
    temporary.persist(&target).map_err(|e| io(e.error))?;
    Ok(())
}

/// The file behind a symbolic link, so that the link stays. Refuses what is no file: renaming over a device would remove the device.
fn target_of(path: &Path) -> Result<PathBuf, ImageError> {
    match std::fs::metadata(path) {
        Ok(meta) if meta.is_file() => path.canonicalize().map_err(|e| ImageError::io(path, e)),
        Ok(_) => Err(ImageError::content(path, "is not a file; name one to write to")),
        Err(_) => Ok(path.to_path_buf()),
    }
}

/// `NAME.var.exr` beside a mean `NAME.mean.exr`, if it is there.
pub fn variance_beside(mean: &Path) -> Option<PathBuf> {
    let name = mean.file_name()?.to_str()?.strip_suffix(".mean.exr")?;
    Some(mean.with_file_name(format!("{name}.var.exr"))).filter(|path| path.is_file())
}

/// Whether [`replace`] could write this file, found out before anything is rendered.
pub fn check_writable(path: &Path) -> Result<(), ImageError> {
    let target = target_of(path)?;
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    tempfile::Builder::new().prefix(".isophote-").suffix(".tmp").tempfile_in(folder).map(drop).map_err(|e| ImageError::io(folder, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.txt");
        std::fs::write(&path, "old").expect("written");
        let failed = replace(&path, |w| {
            w.write_all(b"half").expect("written");
            Err(ImageError::content(Path::new("x"), "stopped"))
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read_to_string(&path).expect("there"), "old");
        assert_eq!(std::fs::read_dir(folder.path()).expect("there").count(), 1);
        replace(&path, |w| w.write_all(b"new").map_err(|e| ImageError::io(&path, e))).expect("replaced");
        assert_eq!(std::fs::read_to_string(&path).expect("there"), "new");
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_folders_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        std::fs::write(&file, "old").expect("written");
        std::os::unix::fs::symlink(&file, &link).expect("linked");
        replace(&link, |w| w.write_all(b"new").map_err(|e| ImageError::io(&link, e))).expect("replaced");
        assert_eq!(std::fs::read_to_string(&file).expect("there"), "new");
        assert!(link.symlink_metadata().expect("there").is_symlink());
        assert!(matches!(check_writable(folder.path()), Err(ImageError::Content { .. })));
        assert!(check_writable(&folder.path().join("missing/a.exr")).is_err());
    }
}
