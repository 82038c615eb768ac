//! One XML element: its kind, its attributes, its value.

use super::error::{Position, Result, SceneError, excerpt, suggest};
use super::number;
use super::plugin::{Kind, Value};
use super::transform::Attribute;
use roxmltree::Node;
use std::path::Path;
use std::sync::Arc;

pub(super) fn kind_of(node: Node<'_, '_>) -> Option<Kind> {
    Kind::ALL.iter().find(|(element, _)| *element == node.tag_name().name()).map(|(_, kind)| *kind)
}

pub(super) fn unknown_element(at: &Position, element: &str) -> SceneError {
    let supported = "default, include, ref, float, integer, boolean, string, rgb, spectrum, point, vector, transform, \
                     sensor, film, rfilter, sampler, integrator, shape, bsdf, emitter, texture";
    let names: Vec<&str> = supported.split(", ").map(str::trim).collect();
    let message = match element {
        "medium" | "phase" | "volume" => format!("<{element}>: participating media are not supported"),
        "alias" | "path" => format!("<{element}> is not supported"),
        _ => format!("<{}> is not an element of a scene", excerpt(element)),
    };
    SceneError::new(at, message).help(suggest(element, &names))
}

pub(super) fn check_attributes(node: Node<'_, '_>, attributes: &[Attribute<'_>], allowed: &[&str]) -> Result<()> {
    match attributes.iter().find(|a| !allowed.contains(&a.name)) {
        None => Ok(()),
        Some(a) => {
            let message = format!("<{}> has no attribute \"{}\"", node.tag_name().name(), excerpt(a.name));
            Err(SceneError::new(&a.position, message).help(suggest(a.name, allowed)))
        }
    }
}

pub(super) fn required<'a, 'n>(
    node: Node<'_, '_>,
    attributes: &'a [Attribute<'n>],
    name: &str,
    at: &Position,
) -> Result<&'a Attribute<'n>> {
    attributes
        .iter()
        .find(|a| a.name == name)
        .ok_or_else(|| SceneError::new(at, format!("<{}> needs the attribute \"{name}\"", node.tag_name().name())))
}

pub(super) fn check_version(version: &Attribute<'_>) -> Result<()> {
    let parts: Vec<Option<u32>> = version.value.split('.').map(|part| part.parse().ok()).collect();
    let wrong = |message: String| {
        SceneError::new(&version.position, message).help("versions 3.x are supported; Mitsuba's own tools convert older scenes")
    };
    if parts.len() > 3 || parts.iter().any(Option::is_none) {
        return Err(wrong(format!("\"{}\" is not a version", excerpt(&version.value))));
    }
    if parts[0] != Some(3) {
        return Err(wrong(format!("the scene is of version {}", excerpt(&version.value))));
    }
    Ok(())
}

/// A parameter's value, and where it stands.
pub(super) fn value_of(element: &str, node: Node<'_, '_>, attributes: &[Attribute<'_>], at: &Position) -> Result<(Value, Position)> {
    let wrong = |a: &Attribute<'_>, why: String| SceneError::new(&a.position, format!("{} of <{element}>: {why}", a.name));
    if element == "spectrum"
        && let Some(file) = attributes.iter().find(|a| a.name == "filename")
    {
        return Err(wrong(file, "spectra from files are not supported".to_owned()).help("colours are RGB here: give one number, or <rgb>"));
    }
    if element == "point" || element == "vector" {
        let separate = ["x", "y", "z"].map(|axis| attributes.iter().find(|a| a.name == axis));
        if separate.iter().any(Option::is_some) {
            if let Some(all) = attributes.iter().find(|a| a.name == "value") {
                return Err(wrong(all, "there are x, y, z too".to_owned()).help("give one of the two"));
            }
            let mut v = [0.0; 3];
            for (value, axis) in v.iter_mut().zip(["x", "y", "z"]) {
                let a = required(node, attributes, axis, at)?;
                *value = number::number(&a.value).map_err(|why| wrong(a, why))?;
            }
            return Ok((Value::Vector(v), at.clone()));
        }
    }
    let a = required(node, attributes, "value", at)?;
    let fail = |why: String| wrong(a, why);
    let value = match element {
        "float" => Value::Float(number::number(&a.value).map_err(fail)?),
        "integer" => Value::Integer(number::integer(&a.value).map_err(fail)?),
        "boolean" if a.value.eq_ignore_ascii_case("true") => Value::Boolean(true),
        "boolean" if a.value.eq_ignore_ascii_case("false") => Value::Boolean(false),
        "boolean" => return Err(fail(format!("\"{}\" is neither true nor false", excerpt(&a.value)))),
        "rgb" => Value::Rgb(number::one_or_three(&a.value).map_err(fail)?),
        "point" | "vector" => Value::Vector(number::one_or_three(&a.value).map_err(fail)?),
        "spectrum" => {
            if a.value.contains(':') || number::words(&a.value).count() > 1 {
                return Err(fail("wavelengths are not supported".to_owned()).help("colours are RGB here: give one number, or <rgb>"));
            }
            Value::Spectrum(number::number(&a.value).map_err(fail)?)
        }
        _ => Value::String(a.value.clone()),
    };
    Ok((value, a.position.clone()))
}

pub(super) fn syntax_error(path: &Path, text: &str, e: &roxmltree::Error) -> SceneError {
    let line_of = |byte: usize| text.as_bytes()[..byte].iter().filter(|b| **b == b'\n').count() as u32 + 1;
    let position = match e {
        roxmltree::Error::DtdDetected => Position::line(path, line_of(text.find("<!DOCTYPE").unwrap_or(0))),
        // Something is missing at the end.
        roxmltree::Error::NodesLimitReached
        | roxmltree::Error::NoRootNode
        | roxmltree::Error::UnclosedRootNode
        | roxmltree::Error::UnexpectedEndOfStream => Position::line(path, line_of(text.trim_end().len())),
        _ => Position { file: Arc::from(path), line: Some(e.pos().row), column: Some(e.pos().col) },
    };
    // The parser's own message ends with the position, which stands in front already.
    let message = e.to_string();
    let message = message.rsplit_once(" at ").filter(|(_, place)| place.contains(':')).map_or(message.as_str(), |(before, _)| before);
    let error = SceneError::new(&position, format!("not well-formed XML: {message}"));
    match e {
        roxmltree::Error::DtdDetected => error.help("document types and entities are not read; use <default> and $name"),
        roxmltree::Error::UnclosedRootNode => error.help("an element is not closed; the file may be cut off"),
        _ => error,
    }
}

/// The parser compares each attribute of an element with all the others, so their number must be bounded before it reads the file.
pub(super) fn check_attribute_counts(path: &Path, text: &str) -> Result<()> {
    const MOST_ATTRIBUTES: usize = 4096;
    let mut end = 0;
    for tag in text.split('<').skip(1) {
        let start = end + 1;
        end = start + tag.len();
        let inside = tag.split('>').next().unwrap_or_default();
        if !inside.starts_with(['!', '?']) && inside.bytes().filter(|byte| *byte == b'=').count() > MOST_ATTRIBUTES {
            let before = text.len().min(text.find('<').unwrap_or(0) + start);
            let line = text.as_bytes()[..before].iter().filter(|byte| **byte == b'\n').count() + 1;
            return Err(SceneError::new(
                &Position::line(path, line as u32),
                format!("an element with more than {MOST_ATTRIBUTES} attributes"),
            ));
        }
    }
    Ok(())
}
