//! `isophote compare REFERENCE.exr IMAGE.exr...`.

mod html;

use super::failure::{Failure, Outcome};
use super::options::positive;
use super::output::{print, print_json, table};
use super::over_runs::OverRuns;
use crate::image::exr::{read_file, read_picture};
use crate::image::file::variance_beside;
use crate::image::metrics::{EPSILON, METRICS, Measured, Pairs, SizeMismatch};
use crate::image::picture::Picture;
use crate::image::runs::Runs;
use crate::render::Crop;
use crate::study::viewer::Rectangle;
use clap::Args;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
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
    /// Measure this crop as well; can be given several times
    #[arg(long, value_name = "X,Y,W,H")]
    inset: Vec<Crop>,
    /// Write a page to look at: the pictures to flip between, their errors, these numbers
    #[arg(long, value_name = "F.html")]
    html: Option<PathBuf>,
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

/// What is in an image file.
struct Input {
    /// The program's own record; `null` in files of other programs, and where it is damaged: the pixels are what is compared.
    record: Value,
    picture: Picture,
}

/// One image measured.
struct Row {
    path: PathBuf,
    whole: Numbers,
    insets: Vec<(Rectangle, Numbers)>,
}

/// A picture, or a crop of it, measured.
struct Numbers {
    values: Vec<Measured>,
    masked: u64,
    pixels: u64,
}

/// Runs it.
pub(super) fn run(arguments: &CompareArgs) -> Outcome {
    if let Some(path) = &arguments.html {
        html::check(path)?;
    }
    let reference = read_input(&arguments.reference)?;
    let insets = arguments.inset.iter().map(|inset| rectangle(inset, &reference.picture)).collect::<Result<Vec<_>, _>>()?;
    let floor = floor(arguments, &reference.picture)?;
    if arguments.runs && arguments.images.len() < 2 {
        return Err(Failure::new("--runs takes two images or more: one run says nothing of its variance"));
    }
    let mut rows = Vec::new();
    let mut runs = Runs::new(reference.picture.width, reference.picture.height);
    // Pictures stay in memory only if they are shown.
    let mut shown = Vec::new();
    for path in &arguments.images {
        let image = read_input(path)?;
        let mismatch = |e| Failure::new(format!("{}: {e} ({})", path.display(), arguments.reference.display()));
        let whole = measure(&reference.picture, &image.picture, arguments.epsilon).map_err(mismatch)?;
        if arguments.runs {
            runs.add(&image.picture).map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
        }
        let crop = |r: &Rectangle| {
            let (reference, image) = (r.crop(&reference.picture), r.crop(&image.picture));
            measure(&reference, &image, arguments.epsilon).map(|numbers| (*r, numbers)).map_err(mismatch)
        };
        let insets = insets.iter().map(crop).collect::<Result<_, _>>()?;
        rows.push(Row { path: path.clone(), whole, insets });
        if arguments.html.is_some() {
            shown.push(image);
        }
    }
    if let Some(path) = &arguments.html {
        html::write(path, arguments, &reference, &shown, &rows, &floor)?;
    }
    let variance = floor.as_ref().map(|f| &f.variance);
    let over_runs = if arguments.runs { Some(OverRuns::measure(&runs, &reference.picture, variance, arguments.epsilon)?) } else { None };
    if arguments.json {
        let mut document = to_json(arguments, &floor, &rows);
        document["runs"] = over_runs.map_or(Value::Null, |o| o.to_json());
        print_json(&document)?
    } else {
        print(&(to_text(arguments, &floor, &rows) + &over_runs.map_or_else(String::new, |o| o.to_text())))?
    }
    Ok(ExitCode::SUCCESS)
}

fn read_input(path: &Path) -> Result<Input, Failure> {
    let file = read_file(path)?;
    Ok(Input { record: file.metadata_json().ok().flatten().unwrap_or(Value::Null), picture: file.picture()? })
}

fn measure(reference: &Picture, image: &Picture, epsilon: f64) -> Result<Numbers, SizeMismatch> {
    let pairs = Pairs::new(reference, image)?;
    let values = METRICS.iter().map(|m| m.measure(&pairs, epsilon)).collect();
    Ok(Numbers { values, masked: pairs.masked(), pixels: pairs.pixels() })
}

/// A crop that lies inside the picture.
fn rectangle(inset: &Crop, picture: &Picture) -> Result<Rectangle, Failure> {
    let Crop([x, y, width, height]) = *inset;
    let inside = |start: u32, length: u32, size: usize| u64::from(start) + u64::from(length) <= size as u64;
    if !inside(x, width, picture.width) || !inside(y, height, picture.height) {
        let message = format!("--inset {x},{y},{width},{height} reaches out of the picture");
        return Err(Failure::new(message).help(format!("the reference has {}x{} pixels", picture.width, picture.height)));
    }
    let [x, y, width, height] = [x, y, width, height].map(|v| v as usize);
    Ok(Rectangle { x, y, width, height })
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
    let insert = |object: &mut Map<String, Value>, numbers: &Numbers| {
        for (metric, measured) in METRICS.iter().zip(&numbers.values) {
            object.insert(metric.name.to_string(), measured.value.into());
            if measured.left_out > 0 {
                object.insert(format!("{}_left_out", metric.name), measured.left_out.into());
            }
        }
        object.insert("masked".to_string(), numbers.masked.into());
        object.insert("pixels".to_string(), numbers.pixels.into());
    };
    let inset = |(r, numbers): &(Rectangle, Numbers)| {
        let mut inset = Map::new();
        for (key, value) in [("x", r.x), ("y", r.y), ("width", r.width), ("height", r.height)] {
            inset.insert(key.to_string(), value.into());
        }
        insert(&mut inset, numbers);
        Value::Object(inset)
    };
    let image = |row: &Row| {
        let mut image = Map::new();
        image.insert("image".to_string(), row.path.display().to_string().into());
        insert(&mut image, &row.whole);
        image.insert("insets".to_string(), row.insets.iter().map(inset).collect());
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
    let line = |name: String, numbers: &Numbers| {
        let mut line = vec![name];
        line.extend(numbers.values.iter().map(|m| number(m.value)));
        line.push(numbers.masked.to_string());
        line
    };
    for row in rows {
        lines.push(line(row.path.display().to_string(), &row.whole));
        lines.extend(row.insets.iter().map(|(r, numbers)| line(format!("  {r}"), numbers)));
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
        if row.whole.masked > 0 {
            text += &format!("{}: {} pixels masked that are not finite here or in the reference\n", row.path.display(), row.whole.masked);
        }
        for (metric, measured) in METRICS.iter().zip(&row.whole.values).filter(|(_, m)| m.left_out > 0) {
            text += &format!("{}: {} values left out of {}\n", row.path.display(), measured.left_out, metric.name);
        }
    }
    text
}
