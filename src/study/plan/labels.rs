//! Names for methods that the study file gives none.

use super::MethodPlan;
use super::reader::{PlanError, Result};
use serde_json::{Map, Value};

/// What a `[[method]]` says: the label if it has one, and its own settings as written.
pub(super) struct Written {
    pub(super) label: Option<String>,
    pub(super) settings: Map<String, Value>,
}

/// Labels every method, and refuses two of one name. A method without a label is called by its name and by what tells it from the others of
/// that name.
pub(super) fn label(methods: &mut [MethodPlan], written: &[Written]) -> Result<()> {
    let names: Vec<&str> = methods.iter().map(|m| m.method.name).collect();
    for (i, method) in methods.iter_mut().enumerate() {
        method.label = match &written[i].label {
            Some(label) => label.clone(),
            None => automatic(i, &names, written),
        };
    }
    for (i, method) in methods.iter().enumerate() {
        if let Some(first) = methods[..i].iter().find(|other| other.label == method.label) {
            let line = first.position.line.unwrap_or(0);
            let message = format!("two methods are called \"{}\", the other in line {line}", method.label);
            return Err(PlanError::new(&method.position, message).help("give each a label of its own: label = \"...\""));
        }
    }
    Ok(())
}

/// `sppm`, or `sppm, radius_pixels 2` where another sppm has another radius.
fn automatic(i: usize, names: &[&str], written: &[Written]) -> String {
    let own = &written[i].settings;
    let others: Vec<&Map<String, Value>> =
        (0..names.len()).filter(|j| *j != i && names[*j] == names[i]).map(|j| &written[j].settings).collect();
    let differs = |key: &str| others.iter().any(|other| other.get(key) != own.get(key));
    let plain = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let parts = own.iter().filter(|(key, _)| differs(key)).map(|(key, value)| format!(", {key} {}", plain(value)));
    std::iter::once(names[i].to_owned()).chain(parts).collect()
}
