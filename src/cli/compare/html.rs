//! The page of `compare --html`: the viewer, and the numbers in a table.

use super::{CompareArgs, Floor, Input, Numbers, Row};
use crate::cli::failure::Failure;
use crate::image::file::{check_writable, replace};
use crate::image::metrics::{Better, METRICS, Metric};
use crate::image::picture::ImageError;
use crate::study::viewer::{Layer, View, document, escape, fragment_at};
use std::io::Write;
use std::path::Path;

/// Refuses what cannot be written, before anything is read.
pub(super) fn check(path: &Path) -> Result<(), Failure> {
    // `--html` without a value would take the next image for its own and replace it.
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("html") && !e.eq_ignore_ascii_case("htm")) {
        let message = format!("--html {}: the page's name has to end in .html", path.display());
        return Err(Failure::new(message).help("as in --html compare.html"));
    }
    Ok(check_writable(path)?)
}

/// Writes the page, whole or not at all.
pub(super) fn write(
    path: &Path,
    arguments: &CompareArgs,
    reference: &Input,
    images: &[Input],
    rows: &[Row],
    floor: &Option<Floor>,
) -> Result<(), Failure> {
    let names = names(&arguments.images);
    let layers = images.iter().zip(rows).zip(&names).map(|((image, row), name)| Layer {
        name: name.clone(),
        picture: &image.picture,
        caption: caption(image, row),
    });
    let view = View {
        id: "pictures".to_string(),
        title: "Pictures".to_string(),
        reference: Some(&reference.picture),
        layers: layers.collect(),
        insets: rows.first().map_or_else(Vec::new, |row| row.insets.iter().map(|(rectangle, _)| *rectangle).collect()),
    };
    let mut body = fragment_at(&view, arguments.epsilon);
    body += &numbers_table(&names, rows);
    body += &notes(arguments, rows, &names, floor);
    let title = format!("Compared with {}", arguments.reference.display());
    let page = document(&title, &body);
    replace(path, |w| w.write_all(page.as_bytes()).map_err(|e| ImageError::io(path, e)))?;
    Ok(())
}

/// File names without their ending, or whole paths where those are not unique.
fn names(paths: &[std::path::PathBuf]) -> Vec<String> {
    let short = |path: &Path| path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned());
    let unique = |name: &String| paths.iter().filter(|other| short(other) == *name).count() == 1;
    let name = |path: &std::path::PathBuf| Some(short(path)).filter(unique).unwrap_or_else(|| path.display().to_string());
    paths.iter().map(name).collect()
}

/// Every metric, and of the file's own record what tells one render from another.
fn caption(image: &Input, row: &Row) -> Vec<(String, String)> {
    let mut caption: Vec<(String, String)> =
        METRICS.iter().zip(&row.whole.values).map(|(metric, m)| (metric.name.to_string(), number(m.value))).collect();
    let record = &image.record;
    if let Some(method) = record["method"].as_str() {
        caption.push(("method".to_string(), method.to_string()));
    }
    let ranges = record["runs"].as_array().into_iter().flatten().flat_map(|run| run["ranges"].as_array().into_iter().flatten());
    let iterations: u64 = ranges.filter_map(|range| range[1].as_u64()?.checked_sub(range[0].as_u64()?)).sum();
    if iterations > 0 {
        caption.push(("iterations".to_string(), iterations.to_string()));
    }
    if let Some(seconds) = record["seconds"].as_f64() {
        caption.push(("render time".to_string(), format!("{} s", number(Some(seconds)))));
    }
    caption
}

fn numbers_table(names: &[String], rows: &[Row]) -> String {
    let head: String = METRICS.iter().map(|m| format!("<th scope=\"col\">{}</th>", m.name)).collect();
    let line = |class: &str, name: &str, numbers: &Numbers, best: &[Option<f64>]| {
        let cells = numbers.values.iter().zip(best).map(|(measured, best)| {
            let class = if measured.value.is_some() && measured.value == *best { " class=\"least\"" } else { "" };
            format!("<td{class}>{}</td>", number(measured.value))
        });
        let cells: String = cells.collect();
        format!("<tr{class}><th scope=\"row\">{}</th>{cells}<td>{}</td></tr>\n", escape(name), numbers.masked)
    };
    let mut body = String::new();
    let best = best_of(rows.iter().map(|row| &row.whole));
    let insets = rows.first().map_or(0, |row| row.insets.len());
    let best_of_insets: Vec<_> = (0..insets).map(|i| best_of(rows.iter().map(|row| &row.insets[i].1))).collect();
    for (row, name) in rows.iter().zip(names) {
        body += &line("", name, &row.whole, &best);
        for ((rectangle, numbers), best) in row.insets.iter().zip(&best_of_insets) {
            body += &line(" class=\"inset\"", &format!("crop {rectangle}"), numbers, best);
        }
    }
    format!(
        "<h2 id=\"numbers\">Numbers</h2>\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-labelledby=\"numbers\">\
         <table class=\"numbers\">\n<thead><tr><th scope=\"col\">image</th>{head}<th scope=\"col\">masked</th></tr></thead>\n\
         <tbody>\n{body}</tbody></table></div>\n"
    )
}

/// The best value of each metric, where there is something to be better than.
fn best_of<'a>(numbers: impl Iterator<Item = &'a Numbers> + Clone) -> Vec<Option<f64>> {
    let better = |metric: &Metric, a: f64, b: f64| match metric.better {
        Better::Lower => a.min(b),
        Better::Higher => a.max(b),
    };
    let several = numbers.clone().count() > 1;
    let best = |(i, metric): (usize, &Metric)| numbers.clone().filter_map(|n| n.values[i].value).reduce(|a, b| better(metric, a, b));
    METRICS.iter().enumerate().map(|m| best(m).filter(|_| several)).collect()
}

fn notes(arguments: &CompareArgs, rows: &[Row], names: &[String], floor: &Option<Floor>) -> String {
    let mut html = String::from("<p class=\"note\">Measured on the files' own values; the best of a column is bold");
    html += if rows.iter().any(|row| !row.insets.is_empty()) { ", among the pictures and among each crop.</p>\n" } else { ".</p>\n" };
    if let Some(Floor { path, mse, relmse, .. }) = floor {
        let (path, mse, relmse) = (escape(&path.display().to_string()), number(Some(*mse)), number(Some(*relmse)));
        html += &format!("<p class=\"note\">Of these the reference's own noise ({path}) adds {mse} to mse and {relmse} to relmse.</p>\n");
    }
    for (row, name) in rows.iter().zip(names) {
        for (metric, measured) in METRICS.iter().zip(&row.whole.values).filter(|(_, m)| m.left_out > 0) {
            html += &format!("<p class=\"note\">{}: {} values left out of {}.</p>\n", escape(name), measured.left_out, metric.name);
        }
    }
    html += "<h2>Formulas</h2>\n<dl class=\"formulas\">\n";
    for metric in METRICS {
        html += &format!("<dt>{}</dt><dd>{}</dd>\n", metric.name, escape(metric.formula));
    }
    html += &format!(
        "</dl>\n<p class=\"note\">x is the image, r the reference, e = {}; means over pixels and channels of linear values. Masked are pixels not \
         finite in either image.</p>\n<h2>Files</h2>\n",
        arguments.epsilon
    );
    html += &format!("<p class=\"note\">Reference: {}</p>\n", escape(&arguments.reference.display().to_string()));
    for (path, name) in arguments.images.iter().zip(names) {
        html += &format!("<p class=\"note\">{}: {}</p>\n", escape(name), escape(&path.display().to_string()));
    }
    html + &format!("<p class=\"note\">isophote {}</p>\n", env!("CARGO_PKG_VERSION"))
}

/// Five digits, scientific where plain digits would be long.
fn number(value: Option<f64>) -> String {
    match value {
        None => "–".to_string(),
        Some(0.0) => "0".to_string(),
        Some(v) if (1e-3..1e5).contains(&v.abs()) => {
            let decimals = (4 - v.abs().log10().floor() as i32).max(0) as usize;
            format!("{v:.decimals$}")
        }
        Some(v) => format!("{v:.4e}"),
    }
}
