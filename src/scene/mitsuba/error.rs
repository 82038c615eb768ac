//! Where something stands in a file, what is wrong with it, and what to do.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A place in a scene's files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Position {
    /// The file.
    pub file: Arc<Path>,
    /// Line, from 1; `None` for files without lines (images) and for the scene as a whole.
    pub line: Option<u32>,
    /// Column in characters, from 1.
    pub column: Option<u32>,
}

impl Position {
    /// A file as a whole.
    pub fn whole(file: &Path) -> Self {
        Self { file: Arc::from(file), line: None, column: None }
    }

    /// The start of a line.
    pub fn line(file: &Path, line: u32) -> Self {
        Self { file: Arc::from(file), line: Some(line), column: None }
    }
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
            if let Some(column) = self.column {
                write!(f, ":{column}")?;
            }
        }
        Ok(())
    }
}

/// Why a scene was not loaded: the place, what is wrong there, and what is supported instead.
#[derive(Debug, thiserror::Error)]
#[error("{}", self.text())]
pub struct SceneError {
    /// The place that has to be changed.
    pub position: Position,
    /// What is wrong, in one sentence without a full stop.
    pub message: String,
    /// What to do or what is supported.
    pub help: Option<String>,
    /// The places that led here, innermost first: an `include`, a `filename`, a `ref`.
    pub via: Vec<String>,
}

impl SceneError {
    /// An error without help.
    pub fn new(position: &Position, message: impl Into<String>) -> Self {
        Self { position: position.clone(), message: message.into(), help: None, via: Vec::new() }
    }

    /// Adds what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds a place that led here.
    #[must_use]
    pub fn via(mut self, what: &str, position: &Position) -> Self {
        self.via.push(format!("{what} {position}"));
        self
    }

    /// The file that has to be changed.
    pub fn file(&self) -> PathBuf {
        self.position.file.to_path_buf()
    }

    fn text(&self) -> String {
        let mut text = format!("{}: {}", self.position, self.message);
        for via in &self.via {
            text.push_str("\n  ");
            text.push_str(via);
        }
        if let Some(help) = &self.help {
            text.push_str("\n  help: ");
            text.push_str(help);
        }
        text
    }
}

/// Shorthand of this room.
pub(crate) type Result<T> = std::result::Result<T, SceneError>;

/// "did you mean ..., or one of: ..." for a name that is none of `known`.
pub(crate) fn suggest(name: &str, known: &[&str]) -> String {
    // A scene may have a million ids; nobody reads a list of them.
    const MOST_LISTED: usize = 40;
    let mut known: Vec<&str> = known.to_vec();
    known.sort_unstable();
    known.dedup();
    let mut list = known.iter().take(MOST_LISTED).map(|word| excerpt(word)).collect::<Vec<_>>().join(", ");
    if known.len() > MOST_LISTED {
        list.push_str(&format!(" and {} more", known.len() - MOST_LISTED));
    }
    // A third of the letters wrong is a slip of the hand; more is another word.
    let slip = name.chars().count().max(3) / 3;
    let near = known.iter().filter(|word| word.len().abs_diff(name.len()) <= 4 * slip).take(10_000);
    let closest = near.map(|word| (edit_distance(name, word), *word)).min();
    match closest {
        Some((distance, word)) if distance <= slip => format!("did you mean \"{}\"? supported: {list}", excerpt(word)),
        _ if known.is_empty() => "none is supported here".to_owned(),
        _ => format!("supported: {list}"),
    }
}

/// Letters to insert, drop, replace or swap with their neighbour (\[DAMERAU64\], restricted: no letter takes part twice).
fn edit_distance(a: &str, b: &str) -> usize {
    // Names longer than this are no slip of the hand, and the cost is quadratic.
    const LONGEST: usize = 64;
    let a: Vec<char> = a.chars().take(LONGEST).collect();
    let b: Vec<char> = b.chars().take(LONGEST).collect();
    let mut before: Vec<usize> = Vec::new();
    let mut above: Vec<usize> = (0..=b.len()).collect();
    for i in 0..a.len() {
        let mut row = vec![i + 1];
        for j in 0..b.len() {
            let mut cost = (above[j] + usize::from(a[i] != b[j])).min(above[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j] {
                cost = cost.min(before[j - 1] + 1);
            }
            row.push(cost);
        }
        before = std::mem::replace(&mut above, row);
    }
    above[b.len()]
}

/// A word from a file, cut to a length that a terminal bears.
pub(super) fn excerpt(text: &str) -> String {
    const LONGEST: usize = 60;
    if text.chars().count() <= LONGEST { text.to_owned() } else { text.chars().take(LONGEST).chain("...".chars()).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_word_is_suggested() {
        let known = ["reflectance", "alpha", "eta"];
        assert!(suggest("reflectence", &known).starts_with("did you mean \"reflectance\"?"));
        assert!(suggest("roughness", &known).starts_with("supported: alpha, eta, reflectance"));
        assert_eq!((edit_distance("kitten", "sitting"), edit_distance("shpae", "shape"), edit_distance("", "ab")), (3, 1, 2));
    }

    #[test]
    fn an_error_shows_place_message_and_help() {
        let position = Position { file: Arc::from(Path::new("scene.xml")), line: Some(12), column: Some(5) };
        let error = SceneError::new(&position, "alpha is -1").help("alpha must be positive");
        assert_eq!(error.to_string(), "scene.xml:12:5: alpha is -1\n  help: alpha must be positive");
    }
}
