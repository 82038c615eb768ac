//! The file of records: locked while a study writes it, and whole up to the last line whatever happens.

use super::{Record, SCHEMA};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The records of a study cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RecordsError {
    /// The system refuses the file.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A line is no record of this version.
    #[error("{}:{line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong with it.
        message: String,
    },
    /// Another program writes it.
    #[error("{}: another isophote is running this study", path.display())]
    Locked {
        /// The file.
        path: PathBuf,
    },
}

/// `records.jsonl` in the folder of a study.
fn path_in(folder: &Path) -> PathBuf {
    folder.join("records.jsonl")
}

/// All records of a study's folder. A last line that was cut off is left out, and of a cell that was tried again only the last record counts.
pub fn read(folder: &Path) -> Result<Vec<Record>, RecordsError> {
    let path = path_in(folder);
    let bytes = std::fs::read(&path).map_err(|source| RecordsError::Io { path: path.clone(), source })?;
    Ok(parse(&path, &bytes)?.0)
}

/// The records, and how many bytes they take.
fn parse(path: &Path, bytes: &[u8]) -> Result<(Vec<Record>, usize), RecordsError> {
    let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    let mut records: Vec<Record> = Vec::new();
    for (i, line) in bytes[..whole].split_inclusive(|byte| *byte == b'\n').enumerate() {
        let refuse = |message: String| RecordsError::Line { path: path.to_path_buf(), line: i + 1, message };
        let record: Record = serde_json::from_slice(line).map_err(|error| refuse(format!("no record of a study: {error}")))?;
        match &record {
            Record::Study(study) if study.schema != SCHEMA => {
                return Err(refuse(format!("records of layout {}, and this program knows {SCHEMA}", study.schema)));
            }
            Record::Cell(new) => records.retain(|r| !matches!(r, Record::Cell(old) if old.cell_hash == new.cell_hash)),
            _ => (),
        }
        records.push(record);
    }
    Ok((records, whole))
}

/// The file, open for more, and for nobody else.
#[derive(Debug)]
pub struct RecordFile {
    path: PathBuf,
    file: File,
}

impl RecordFile {
    /// Opens the records of a folder, or begins them, and reads what is there. A last line that was cut off is removed.
    pub fn open(folder: &Path) -> Result<(Self, Vec<Record>), RecordsError> {
        let path = path_in(folder);
        let io = |source| RecordsError::Io { path: path.clone(), source };
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(io)?;
        match file.try_lock() {
            Ok(()) => (),
            Err(TryLockError::WouldBlock) => return Err(RecordsError::Locked { path }),
            Err(TryLockError::Error(source)) => return Err(io(source)),
        }
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(0)).and_then(|_| file.read_to_end(&mut bytes)).map_err(io)?;
        let (records, whole) = parse(&path, &bytes)?;
        if whole < bytes.len() {
            tracing::warn!("{}: the last line was cut off and is removed", path.display());
            file.set_len(whole as u64).and_then(|()| file.sync_data()).map_err(io)?;
        }
        Ok((Self { path, file }, records))
    }

    /// Adds a line, and returns when it is on the disk.
    pub fn append(&mut self, record: &Record) -> Result<(), RecordsError> {
        let io = |source| RecordsError::Io { path: self.path.clone(), source };
        let mut line = serde_json::to_vec(record).map_err(|error| io(error.into()))?;
        line.push(b'\n');
        self.file.write_all(&line).and_then(|()| self.file.sync_data()).map_err(io)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::records::ReferenceRecord;

    fn record(scene: &str) -> Record {
        let (mean, hash) = ("m.exr".into(), "h".into());
        Record::Reference(ReferenceRecord { scene: scene.into(), mean, var: None, hash, made: None, size: (1, 1), noise: None })
    }

    #[test]
    fn a_line_cut_off_anywhere_is_removed_and_written_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = path_in(folder.path());
        let (mut records, _) = RecordFile::open(folder.path()).expect("begun");
        records.append(&record("a")).expect("written");
        let first = std::fs::read(&file).expect("there").len();
        records.append(&record("b")).expect("written");
        drop(records);
        let whole = std::fs::read(&file).expect("there");
        for cut in first..whole.len() {
            std::fs::write(&file, &whole[..cut]).expect("written");
            assert_eq!(read(folder.path()).expect("readable"), [record("a")], "cut at {cut}");
            let (mut again, there) = RecordFile::open(folder.path()).expect("readable");
            assert_eq!(there, [record("a")]);
            again.append(&record("b")).expect("written");
            assert_eq!(std::fs::read(&file).expect("there"), whole, "cut at {cut}");
        }
    }

    #[test]
    fn a_line_that_is_no_record_is_told_with_its_number() {
        let folder = tempfile::tempdir().expect("a folder");
        let line = serde_json::to_string(&record("a")).expect("JSON");
        std::fs::write(path_in(folder.path()), format!("{line}\n{{\"kind\":\"nothing\"}}\n{line}\n")).expect("written");
        let message = RecordFile::open(folder.path()).expect_err("refused").to_string();
        assert!(message.contains("records.jsonl:2: no record of a study"), "{message}");
    }

    #[test]
    fn two_cannot_write_at_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let (first, _) = RecordFile::open(folder.path()).expect("begun");
        assert!(matches!(RecordFile::open(folder.path()), Err(RecordsError::Locked { .. })));
        drop(first);
        assert!(RecordFile::open(folder.path()).is_ok());
    }
}
