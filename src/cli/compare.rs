//! `isophote compare REFERENCE.exr IMAGE.exr...`.

use super::failure::{Failure, Outcome};
use super::options::positive;
use super::output::{print, print_json, table};
use crate::image::exr::read_picture;
use crate::image::file::variance_beside;
use crate::image::metrics::{EPSILON, METRICS, Measured, Pairs};
use crate::image::picture::Picture;
use clap::Args;
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `compare`.
#[derive(Args, Clone, Debug)]
pub(super) struct CompareArgs {
    /// Reference
    #[arg(value_name = "REFERENCE.exr")]
    reference: PathBuf,
    /// Images to measure
    #[arg(value_name = "IMAGE.exr", required = true)]
    images: Vec<PathBuf>,
    /// Variance of the reference's mean [default: NAME.var.exr beside a reference NAME.mean.exr]
    #[arg(long, value_name = "F.exr")]
    reference_var: Option<PathBuf>,
    /// Epsilon of relmse, relmse_trimmed, mape and smape
    #[arg(long, value_name = "E", default_value_t = EPSILON, value_parser = positive)]
    epsilon: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What the reference's own noise adds to an error, on average.
struct Floor {
    path: PathBuf,
    mse: f64,
    relmse: f64,
}

/// One image measured.
struct Row {
    path: PathBuf,
    values: Vec<Measured>,
    masked: u64,
    pixels: u64,
}

/// Runs it.
pub(super) fn run(arguments: &CompareArgs) -> Outcome {
    let reference = read_picture(&arguments.reference)?;
    let floor = floor(arguments, &reference)?;
    let mut rows = Vec::new();
    for path in &arguments.images {
        let image = read_picture(path)?;
        let pairs = Pairs::new(&reference, &image)
            .map_err(|e| Failure::new(format!("{}: {e} ({})", path.display(), arguments.reference.display())))?;
        let values = METRICS.iter().map(|m| m.measure(&pairs, arguments.epsilon)).collect();
        rows.push(Row { path: path.clone(), values, masked: pairs.masked(), pixels: pairs.pixels() });
    }
    if arguments.json {
        print_json(&to_json(arguments, &floor, &rows))?
    } else {
        print(&to_text(arguments, &floor, &rows))?
    }
    Ok(ExitCode::SUCCESS)
}

fn floor(arguments: &CompareArgs, reference: &Picture) -> Result<Option<Floor>, Failure> {
    let Some(path) = arguments.reference_var.clone().or_else(|| variance_beside(&arguments.reference)) else { return Ok(None) };
    let variance = read_picture(&path)?;
    let pairs = Pairs::new(reference, &variance)
        .map_err(|e| Failure::new(format!("{}: {e} ({})", path.display(), arguments.reference.display())))?;
    // The reference's noise is independent of the image's: its variance adds to every expected squared difference.
    let mse = pairs.mean(|variance, _| variance).value;
    let relmse = pairs.mean(|variance, r| variance / (r * r + arguments.epsilon)).value;
    Ok(mse.zip(relmse).map(|(mse, relmse)| Floor { path, mse, relmse }))
}

fn to_json(arguments: &CompareArgs, floor: &Option<Floor>, rows: &[Row]) -> Value {
    let image = |row: &Row| {
        let mut image = Map::new();
        image.insert("image".to_string(), row.path.display().to_string().into());
        for (metric, measured) in METRICS.iter().zip(&row.values) {
            image.insert(metric.name.to_string(), measured.value.into());
            if measured.left_out > 0 {
                image.insert(format!("{}_left_out", metric.name), measured.left_out.into());
            }
        }
        image.insert("masked".to_string(), row.masked.into());
        image.insert("pixels".to_string(), row.pixels.into());
        Value::Object(image)
    };
    json!({
        "reference": arguments.reference.display().to_string(),
        "epsilon": arguments.epsilon,
        "reference_var": floor.as_ref().map(|f| json!({"file": f.path.display().to_string(), "mse": f.mse, "relmse": f.relmse})),
        "images": rows.iter().map(image).collect::<Vec<_>>(),
    })
}

fn to_text(arguments: &CompareArgs, floor: &Option<Floor>, rows: &[Row]) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_string(), |v| format!("{v:.5e}"));
    let mut lines = vec![std::iter::once("image").chain(METRICS.iter().map(|m| m.name)).map(str::to_owned).collect::<Vec<_>>()];
    lines[0].push("masked".to_string());
    for row in rows {
        let mut line = vec![row.path.display().to_string()];
        line.extend(row.values.iter().map(|m| number(m.value)));
        line.push(row.masked.to_string());
        lines.push(line);
    }
    let with_epsilon: Vec<&str> = METRICS.iter().filter(|m| m.uses_epsilon).map(|m| m.name).collect();
    let mut text = table(&lines);
    text += &format!("\nreference {}; epsilon {} in {}\n", arguments.reference.display(), arguments.epsilon, with_epsilon.join(", "));
    if let Some(Floor { path, mse, relmse }) = floor {
        text += &format!("of these the reference's own noise ({}) adds {mse:.5e} to mse and {relmse:.5e} to relmse\n", path.display());
    }
    for row in rows {
        if row.masked > 0 {
            text += &format!("{}: {} pixels masked that are not finite here or in the reference\n", row.path.display(), row.masked);
        }
        for (metric, measured) in METRICS.iter().zip(&row.values).filter(|(_, m)| m.left_out > 0) {
            text += &format!("{}: {} values left out of {}\n", row.path.display(), measured.left_out, metric.name);
        }
    }
    text
}
