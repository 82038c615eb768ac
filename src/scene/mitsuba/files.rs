//! The files of a scene: found, read once, and hashed in the order in which the scene names them.

use super::error::{Position, Result, SceneError, excerpt};
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Larger files are refused: a mistake, or a device that never ends.
const LARGEST_FILE: u64 = 8 << 30;

/// Every file read so far.
#[derive(Default)]
pub(super) struct Files {
    read: Vec<PathBuf>,
    seen: HashSet<PathBuf>,
    hasher: Sha256,
}

impl Files {
    /// The content of a file, which enters the hash when it is first read. `named` is the place that names it.
    pub(super) fn read(&mut self, path: &Path, named: &Position) -> Result<Vec<u8>> {
        let bytes = read_regular(path).map_err(|why| SceneError::new(named, format!("cannot read {}: {why}", path.display())))?;
        if self.seen.insert(path.to_path_buf()) {
            // Each file enters by its own digest, so that the joint between two files cannot move unnoticed.
            self.hasher.update(Sha256::digest(&bytes));
            self.read.push(path.to_path_buf());
        }
        Ok(bytes)
    }

    /// The files read, in order, and the hash over them in lower-case hexadecimal.
    pub(super) fn finish(self) -> (Vec<PathBuf>, String) {
        let digest = self.hasher.finalize();
        let hex = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        (self.read, hex)
    }
}

fn read_regular(path: &Path) -> std::result::Result<Vec<u8>, String> {
    let metadata = std::fs::metadata(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => "no such file".to_owned(),
        _ => e.to_string(),
    })?;
    // A directory, a pipe or a device: reading might never end.
    if !metadata.is_file() {
        return Err("not a regular file".to_owned());
    }
    if metadata.len() > LARGEST_FILE {
        return Err(format!("{} bytes, more than the {LARGEST_FILE} allowed", metadata.len()));
    }
    std::fs::read(path).map_err(|e| e.to_string())
}

/// The file that `name` means when written in a file of the first of `folders`: there, else in the folders of the files that include it.
pub(super) fn resolve(name: &str, folders: &[PathBuf], named: &Position) -> Result<PathBuf> {
    if name.is_empty() || name.contains('\0') {
        return Err(SceneError::new(named, format!("\"{}\" is not a file name", excerpt(name))));
    }
    let candidates: Vec<PathBuf> = folders.iter().map(|folder| folder.join(name)).collect();
    match candidates.iter().find(|path| path.exists()) {
        Some(path) => Ok(path.clone()),
        None => {
            let looked = candidates.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
            Err(SceneError::new(named, format!("file \"{}\" not found", excerpt(name))).help(format!("looked for {looked}")))
        }
    }
}
