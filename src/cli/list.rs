//! `isophote list`.

use super::failure::Outcome;
use super::output::{print, print_json, table};
use crate::image::metrics::{Better, definitions};
use crate::integrators::Method;
use crate::integrators::photon_settings::SamplerName;
use crate::scene::mitsuba::supported;
use clap::{Args, ValueEnum};
use serde_json::{Map, Value, json};
use std::process::ExitCode;

/// A table of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Table {
    /// Rendering methods
    Methods,
    /// Photon samplers
    Samplers,
    /// Materials that scenes may name
    Bsdfs,
    /// Metrics of compare
    Metrics,
}

/// Arguments of `list`.
#[derive(Args, Clone, Debug)]
pub(super) struct ListArgs {
    /// Only this table
    #[arg(value_enum)]
    table: Option<Table>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub(super) fn run(arguments: &ListArgs, methods: &[Method]) -> Outcome {
    let tables = Table::value_variants().iter().filter(|table| arguments.table.is_none_or(|only| only == **table));
    let named = tables.map(|table| (table.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned()), table.rows(methods)));
    if arguments.json {
        let document: Map<String, Value> = named.map(|(name, rows)| (name, Value::Array(rows))).collect();
        print_json(&Value::Object(document))?;
    } else {
        let sections: Vec<String> = named.map(|(name, rows)| section(&name, &rows, arguments.table.is_none())).collect();
        print(&sections.join("\n"))?;
    }
    Ok(ExitCode::SUCCESS)
}

impl Table {
    /// Its lines, as JSON objects with the same keys.
    fn rows(self, methods: &[Method]) -> Vec<Value> {
        match self {
            Table::Methods => {
                methods.iter().map(|m| json!({"name": m.name, "about": m.about, "page": format!("docs/{}", m.page)})).collect()
            }
            Table::Samplers => {
                let value = |sampler: &SamplerName| sampler.to_possible_value();
                let row = |v: clap::builder::PossibleValue| json!({"name": v.get_name(), "about": v.get_help().map(ToString::to_string)});
                SamplerName::value_variants().iter().filter_map(value).map(row).collect()
            }
            Table::Bsdfs => supported().into_iter().filter(|(kind, _)| *kind == "bsdf").map(|(_, name)| json!({"name": name})).collect(),
            Table::Metrics => definitions()
                .map(|(name, formula, direction)| json!({"name": name, "formula": formula, "better": better(direction)}))
                .collect(),
        }
    }
}

fn better(better: Better) -> &'static str {
    match better {
        Better::Lower => "lower",
        Better::Higher => "higher",
    }
}

/// Rows as text, the name first and its explanation behind it.
fn section(title: &str, rows: &[Value], titled: bool) -> String {
    let mut text = if titled { format!("{title}:\n") } else { String::new() };
    let cells = |row: &Value| -> Vec<String> {
        let values = row.as_object().into_iter().flat_map(|map| map.values());
        let texts: Vec<&str> = values.filter_map(Value::as_str).collect();
        let indent = if titled { "  " } else { "" };
        texts.iter().take(1).map(|name| format!("{indent}{name}")).chain(texts.get(1).map(|t| (*t).to_owned())).collect()
    };
    let rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
    let width = rows.iter().filter_map(|row| row.first()).map(|name| name.chars().count()).max().unwrap_or(0);
    // Explanations are prose: to the left, unlike the numbers of `table`.
    for row in &rows {
        match row.as_slice() {
            [name, about, ..] => text += &format!("{name:<width$}  {about}\n"),
            _ => text += &table(std::slice::from_ref(row)),
        }
    }
    text
}
