//! Films measured and kept on the way.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A film on the way, or the last one.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Iterations in the film.
    pub iteration: u64,
    /// Render time until then, wall seconds.
    pub seconds: f64,
    /// Processor seconds over the same spans, all threads.
    pub cpu_seconds: f64,
    /// Light subpaths until then, start-up counted.
    pub light_paths: u64,
    /// Camera subpaths until then.
    pub camera_paths: u64,
    /// Rays until then.
    pub rays: u64,
    /// Value by metric; `None` where none could be computed; empty without a reference.
    pub values: BTreeMap<String, Option<f64>>,
    /// Pixels left out because a component is not finite here or in the reference.
    pub masked: u64,
}

/// After which iterations the film is measured or kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Snapshots {
    /// Never.
    None,
    /// After 1, 2, 4, 8, ... iterations.
    PowersOfTwo,
    /// After every multiple of a positive number.
    Every(u64),
}

impl FromStr for Snapshots {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self::None),
            "pow2" => Ok(Self::PowersOfTwo),
            _ => match text.strip_prefix("every:").map(str::parse) {
                Some(Ok(n)) if n > 0 => Ok(Self::Every(n)),
                _ => Err("expected none, pow2 or every:N with N > 0".to_string()),
            },
        }
    }
}

impl std::fmt::Display for Snapshots {
    /// As it is typed.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::PowersOfTwo => f.write_str("pow2"),
            Self::Every(n) => write!(f, "every:{n}"),
        }
    }
}

impl Snapshots {
    /// Whether the film is kept after `done` iterations of this render.
    pub fn due(self, done: u64) -> bool {
        match self {
            Self::None => false,
            Self::PowersOfTwo => done.is_power_of_two(),
            Self::Every(n) => done.is_multiple_of(n),
        }
    }

    /// Where the film after `done` iterations goes: `OUT.i000064.exr` beside `OUT.exr`.
    pub fn path(output: &Path, done: u64) -> PathBuf {
        let extension = output.extension().map_or_else(|| "exr".to_string(), |e| e.to_string_lossy().into_owned());
        output.with_extension(format!("i{done:06}.{extension}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snapshots_fall_where_asked() {
        let due = |text: &str| -> Vec<u64> {
            let snapshots: Snapshots = text.parse().expect("known");
            (1..20).filter(|n| snapshots.due(*n)).collect()
        };
        assert!(due("none").is_empty());
        assert_eq!(due("pow2"), [1, 2, 4, 8, 16]);
        assert_eq!(due("every:6"), [6, 12, 18]);
        for wrong in ["every:0", "every:", "every", "pow3", ""] {
            assert!(wrong.parse::<Snapshots>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn names_stand_beside_the_output() {
        assert_eq!(Snapshots::path(Path::new("a/b.path.exr"), 64), Path::new("a/b.path.i000064.exr"));
        assert_eq!(Snapshots::path(Path::new("b"), 12_345_678), Path::new("b.i12345678.exr"));
    }
}
