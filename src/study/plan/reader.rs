//! TOML values that know where they stand, so that every mistake is told with its line and column.

use crate::scene::mitsuba::{Position, suggest};
use serde_json::Value;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Why a study file is refused: the place, what is wrong there, and what is supported instead.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{position}: {message}")]
pub struct PlanError {
    /// The place that has to be changed.
    pub position: Position,
    /// What is wrong, in one sentence without a full stop.
    pub message: String,
    /// What to do or what is supported.
    pub help: Option<String>,
}

impl PlanError {
    /// An error without help.
    pub fn new(position: &Position, message: impl Into<String>) -> Self {
        Self { position: position.clone(), message: message.into(), help: None }
    }

    /// Adds what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// Shorthand of this part.
pub(super) type Result<T> = std::result::Result<T, PlanError>;

/// A file and its text.
pub(super) struct Source<'s> {
    file: Arc<Path>,
    text: &'s str,
}

impl<'s> Source<'s> {
    pub(super) fn new(file: &Path, text: &'s str) -> Self {
        Self { file: Arc::from(file), text }
    }

    /// The document's top table.
    pub(super) fn parse(&self) -> Result<Spanned<DeTable<'s>>> {
        DeTable::parse(self.text).map_err(|error| {
            let at = error.span().map_or_else(|| Position::whole(&self.file), |span| self.at(span.start));
            PlanError::new(&at, error.message().replace('\n', ", "))
        })
    }

    /// Where a byte of the text stands.
    fn at(&self, byte: usize) -> Position {
        let before = self.text.get(..byte).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        let number = |count: usize| u32::try_from(count + 1).ok();
        Position {
            file: self.file.clone(),
            line: number(before.matches('\n').count()),
            column: number(before.get(line_start..).unwrap_or("").chars().count()),
        }
    }
}

/// A table.
#[derive(Clone, Copy)]
pub(super) struct Section<'a> {
    source: &'a Source<'a>,
    /// How it is written, as in `[[scene]]`.
    what: &'a str,
    start: usize,
    table: &'a DeTable<'a>,
}

impl<'a> Section<'a> {
    pub(super) fn top(source: &'a Source<'a>, document: &'a Spanned<DeTable<'a>>) -> Self {
        Self { source, what: "the top of a study file", start: 0, table: document.get_ref() }
    }

    /// Where it begins.
    pub(super) fn position(&self) -> Position {
        self.source.at(self.start)
    }

    pub(super) fn error(&self, message: impl Into<String>) -> PlanError {
        PlanError::new(&self.position(), message)
    }

    /// Refuses keys that are not among these.
    pub(super) fn only(&self, known: &[&str]) -> Result<()> {
        for key in self.table.keys() {
            if !known.contains(&key.get_ref().as_ref()) {
                let message = format!("unknown key \"{}\" in {}", key.get_ref(), self.what);
                return Err(PlanError::new(&self.source.at(key.span().start), message).help(suggest(key.get_ref(), known)));
            }
        }
        Ok(())
    }

    pub(super) fn get(&self, key: &str) -> Option<Entry<'a>> {
        let (key, value) = self.table.get_key_value(key)?;
        Some(Entry { source: self.source, key: key.get_ref(), value })
    }

    pub(super) fn entries(&self) -> impl Iterator<Item = Entry<'a>> {
        let source = self.source;
        self.table.iter().map(move |(key, value)| Entry { source, key: key.get_ref(), value })
    }
}

/// A value and the key it belongs to.
#[derive(Clone, Copy)]
pub(super) struct Entry<'a> {
    source: &'a Source<'a>,
    pub(super) key: &'a str,
    value: &'a Spanned<DeValue<'a>>,
}

impl<'a> Entry<'a> {
    pub(super) fn position(&self) -> Position {
        self.source.at(self.value.span().start)
    }

    pub(super) fn error(&self, message: impl Into<String>) -> PlanError {
        PlanError::new(&self.position(), message)
    }

    /// The value is not what the key takes.
    fn expected(&self, what: &str) -> PlanError {
        let found = match self.value.get_ref() {
            DeValue::String(text) => format!("\"{text}\""),
            DeValue::Integer(number) => number.to_string(),
            DeValue::Float(number) => number.to_string(),
            DeValue::Boolean(flag) => flag.to_string(),
            other => format!("a TOML {}", other.type_str()),
        };
        self.error(format!("{} must be {what}, not {found}", self.key))
    }

    pub(super) fn text(&self) -> Result<&'a str> {
        let text = self.value.get_ref().as_str().filter(|text| !text.trim().is_empty());
        text.ok_or_else(|| self.expected("a text that is not empty"))
    }

    /// A text of a form of its own.
    pub(super) fn parsed<T: FromStr<Err = String>>(&self) -> Result<T> {
        self.text()?.parse().map_err(|why| self.error(format!("{}: {why}", self.key)))
    }

    pub(super) fn flag(&self) -> Result<bool> {
        self.value.get_ref().as_bool().ok_or_else(|| self.expected("true or false"))
    }

    /// A whole number in a range.
    pub(super) fn whole(&self, range: std::ops::RangeInclusive<i64>) -> Result<i64> {
        let number = match self.value.get_ref() {
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok(),
            _ => None,
        };
        number.filter(|n| range.contains(n)).ok_or_else(|| {
            let (first, last) = (range.start(), range.end());
            self.expected(&if *last == i64::MAX {
                format!("a whole number from {first}")
            } else {
                format!("a whole number from {first} to {last}")
            })
        })
    }

    /// A finite number, perhaps written as a whole one.
    pub(super) fn number(&self) -> Result<f64> {
        let number = match self.value.get_ref() {
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok().map(|n| n as f64),
            DeValue::Float(number) => number.as_str().parse().ok(),
            _ => None,
        };
        number.filter(|n: &f64| n.is_finite()).ok_or_else(|| self.expected("a finite number"))
    }

    pub(super) fn positive(&self) -> Result<f64> {
        self.number().ok().filter(|n| *n > 0.0).ok_or_else(|| self.expected("a positive number"))
    }

    /// The values of a list; each stands where it stands.
    pub(super) fn list(&self) -> Result<Vec<Entry<'a>>> {
        let list = self.value.get_ref().as_array().ok_or_else(|| self.expected("a list"))?;
        Ok(list.iter().map(|value| Entry { value, ..*self }).collect())
    }

    pub(super) fn is_list(&self) -> bool {
        self.value.get_ref().is_array()
    }

    /// A table; `what` is how it is written.
    pub(super) fn section(&self, what: &'a str) -> Result<Section<'a>> {
        let table = self.value.get_ref().as_table().ok_or_else(|| self.expected("a table"))?;
        Ok(Section { source: self.source, what, start: self.value.span().start, table })
    }

    /// As JSON, for what is read by a type of its own.
    pub(super) fn json(&self) -> Result<Value> {
        Ok(match self.value.get_ref() {
            DeValue::String(text) => text.as_ref().into(),
            DeValue::Boolean(flag) => (*flag).into(),
            DeValue::Integer(_) => self.whole(i64::MIN..=i64::MAX)?.into(),
            DeValue::Float(_) => self.number()?.into(),
            DeValue::Array(_) => Value::Array(self.list()?.iter().map(Entry::json).collect::<Result<_>>()?),
            DeValue::Table(_) => {
                let pairs = self.section("a table")?.entries().map(|e| Ok((e.key.to_owned(), e.json()?))).collect::<Result<_>>()?;
                Value::Object(pairs)
            }
            DeValue::Datetime(_) => return Err(self.expected("a text, a number, true, false, a list or a table")),
        })
    }
}
