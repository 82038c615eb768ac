//! Names of techniques, as options and tests use them.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// A set of techniques, as `--techniques` has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TechniqueName {
    /// Emitter hits, next event estimation and connections between interior vertices
    Vc,
    /// Merges
    Vm,
    /// Light tracing: connections of light vertices to the camera
    Lt,
}

/// One way to make a path, by its place on the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Technique {
    /// So many vertices from the light, the others from the camera: 0 hits an emitter, 1 is next event estimation.
    Connection(u32),
    /// All vertices but the camera's from the light.
    Splat,
    /// The vertex of this number, 1 next to the light, from both sides.
    Merge(u32),
}

impl From<Technique> for String {
    fn from(technique: Technique) -> String {
        match technique {
            Technique::Connection(s) => format!("vc{s}"),
            Technique::Splat => "lt".into(),
            Technique::Merge(i) => format!("vm{i}"),
        }
    }
}

impl FromStr for Technique {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |digits: &str| digits.parse::<u32>().ok();
        let connection = || text.strip_prefix("vc").and_then(number).map(Technique::Connection);
        let merge = || text.strip_prefix("vm").and_then(number).filter(|&i| i > 0).map(Technique::Merge);
        let splat = (text == "lt").then_some(Technique::Splat);
        splat.or_else(connection).or_else(merge).ok_or_else(|| format!("{text} names no technique: write vc0, vc1, .., vm1, vm2, .. or lt"))
    }
}

impl TryFrom<String> for Technique {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for technique in [Technique::Connection(0), Technique::Connection(12), Technique::Splat, Technique::Merge(3)] {
            assert_eq!(String::from(technique).parse(), Ok(technique));
        }
        for wrong in ["", "vc", "vm0", "vm", "lt1", "vc-1", "x"] {
            assert!(wrong.parse::<Technique>().is_err(), "{wrong}");
        }
    }
}
