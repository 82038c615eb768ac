//! `isophote compare REFERENCE.exr IMAGE.exr...`.

use super::failure::{Failure, Outcome};
use super::options::positive;
use super::output::{print, print_json, table};
use super::over_runs::OverRuns;
use crate::image::exr::read_picture;
use crate::image::file::variance_beside;
use crate::image::metrics::{EPSILON, METRICS, Measured, Pairs};
use crate::image::picture::Picture;
use crate::image::runs::Runs;
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
    /// Take the images as independent runs of one method: adds nsd, variance and squared bias
    #[arg(long)]
    runs: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What the reference's own noise adds to an error, on average.
struct Floor {
    path: PathBuf,
    variance: Picture,
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
    if arguments.runs && arguments.images.len() < 2 {
        return Err(Failure::new("--runs takes two images or more: one run says nothing of its variance"));
    }
    let mut rows = Vec::new();
    let mut runs = Runs::new(reference.width, reference.height);
    for path in &arguments.images {
        let image = read_picture(path)?;
        let pairs = Pairs::new(&reference, &image)
            .map_err(|e| Failure::new(format!("{}: {e} ({})", path.display(), arguments.reference.display())))?;
        if arguments.runs {
            runs.add(&image).map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
        }
        let values = METRICS.iter().map(|m| m.measure(&pairs, arguments.epsilon)).collect();
        rows.push(Row { path: path.clone(), values, masked: pairs.masked(), pixels: pairs.pixels() });
    }
    let variance = floor.as_ref().map(|f| &f.variance);
    let over_runs = if arguments.runs { Some(OverRuns::measure(&runs, &reference, variance, arguments.epsilon)?) } else { None };
    if arguments.json {
        let mut document = to_json(arguments, &floor, &rows);
        document["runs"] = over_runs.map_or(Value::Null, |o| o.to_json());
        print_json(&document)?
    } else {
        print(&(to_text(arguments, &floor, &rows) + &over_runs.map_or_else(String::new, |o| o.to_text())))?
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
    Ok(mse.zip(relmse).map(|(mse, relmse)| Floor { path, variance, mse, relmse }))
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
        "formulas": METRICS.iter().map(|m| (m.name.to_string(), m.formula.into())).collect::<Map<String, Value>>(),
        "reference_var": floor.as_ref().map(|f| json!({"file": f.path.display().to_string(), "mse": f.mse, "relmse": f.relmse})),
        "images": rows.iter().map(image).collect::<Vec<_>>(),
    })
}

/// A number in a table; a dash where there is none.
pub(super) fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_string(), |v| format!("{v:.5e}"))
}

fn to_text(arguments: &CompareArgs, floor: &Option<Floor>, rows: &[Row]) -> String {
    let mut lines = vec![std::iter::once("image").chain(METRICS.iter().map(|m| m.name)).map(str::to_owned).collect::<Vec<_>>()];
    lines[0].push("masked".to_string());
    for row in rows {
        let mut line = vec![row.path.display().to_string()];
        line.extend(row.values.iter().map(|m| number(m.value)));
        line.push(row.masked.to_string());
        lines.push(line);
    }
    let with_epsilon: Vec<&str> = METRICS.iter().filter(|m| m.uses_epsilon).map(|m| m.name).collect();
    let mut text = table(&lines) + "\n";
    for metric in METRICS {
        text += &format!("{:<14}  {}\n", metric.name, metric.formula);
    }
    text += &format!("reference {}; epsilon e = {} in {}\n", arguments.reference.display(), arguments.epsilon, with_epsilon.join(", "));
    if let Some(Floor { path, mse, relmse, .. }) = floor {
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
