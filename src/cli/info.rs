//! `isophote info FILE.exr|SCENE.xml`.

use super::diagnose::table::numbers;
use super::failure::{Failure, Outcome};
use super::output::{bytes, print, print_json};
use super::scene::{self, SceneChanges};
use crate::image::exr::{ExrFile, read_file};
use crate::integrators::chains::ChainReport;
use crate::scene::bsdf::Bsdf;
use crate::scene::emitter::Emitter;
use crate::scene::mitsuba::LoadedScene;
use clap::Args;
use serde_json::{Map, Value, json};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `info`.
#[derive(Args, Clone, Debug)]
pub(super) struct InfoArgs {
    /// EXR file or scene
    #[arg(value_name = "FILE.exr|SCENE.xml")]
    file: PathBuf,
    #[command(flatten)]
    changes: SceneChanges,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub(super) fn run(arguments: &InfoArgs) -> Outcome {
    let document = if is_exr(&arguments.file)? {
        exr_json(&read_file(&arguments.file)?)?
    } else {
        scene_json(&arguments.file, &scene::open(&arguments.file, &arguments.changes.changes())?)
    };
    if arguments.json {
        print_json(&document)?
    } else {
        print(&text(&document))?
    }
    Ok(ExitCode::SUCCESS)
}

/// By its first bytes; a file that cannot be that short is what its name says.
fn is_exr(path: &Path) -> Result<bool, Failure> {
    const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
    let mut start = [0; 4];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start));
    match read {
        Ok(()) if start == MAGIC => Ok(true),
        Err(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => Err(Failure::new(format!("{}: {error}", path.display()))),
        _ => Ok(path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"))),
    }
}

fn exr_json(file: &ExrFile) -> Result<Value, Failure> {
    let channel = |c: &crate::image::exr::Channel| json!({"name": c.name, "type": c.kind, "width": c.width, "height": c.height});
    let picture = file.picture().ok();
    let mean = picture.as_ref().map(|p| {
        let finite: Vec<_> = p.pixels.iter().filter(|v| v.is_finite()).collect();
        [0, 1, 2].map(|c| finite.iter().map(|v| f64::from(v[c])).sum::<f64>() / finite.len().max(1) as f64)
    });
    Ok(json!({
        "file": file.path.display().to_string(),
        "kind": "exr",
        "width": picture.as_ref().map(|p| p.width),
        "height": picture.as_ref().map(|p| p.height),
        "channels": file.channels.iter().map(channel).collect::<Vec<_>>(),
        "mean": mean,
        "non_finite_pixels": picture.as_ref().map(|p| p.non_finite()),
        "isophote": file.metadata_json()?,
    }))
}

fn scene_json(path: &Path, loaded: &LoadedScene) -> Value {
    let (scene, film, defaults) = (&loaded.scene, &loaded.film, &loaded.defaults);
    let (counts, memory) = (scene.counts(), scene.memory());
    let (width, height) = scene.camera().resolution();
    json!({
        "file": path.display().to_string(),
        "kind": "scene",
        "hash": loaded.content_hash,
        "width": width,
        "height": height,
        "film": {"width": film.width, "height": film.height, "crop": film.crop},
        "defaults": {
            "sample_count": defaults.sample_count,
            "max_depth": defaults.max_depth.map_or(-1, i64::from),
            "rr_depth": defaults.rr_depth,
            "hide_emitters": defaults.hide_emitters,
            "integrator": defaults.integrator,
        },
        "counts": {
            "shapes": counts.shapes, "triangles": counts.triangles, "quadrics": counts.quadrics,
            "bsdfs": counts.bsdfs, "emitters": counts.emitters,
        },
        "bsdfs": tally(scene.bsdfs().iter().map(bsdf_kind)),
        "emitters": tally(scene.emitters().iter().map(emitter_kind)),
        "bounds": scene.bounds().map(|b| json!({"min": b.min.to_array(), "max": b.max.to_array()})),
        "memory": {
            "accelerator": memory.accelerator, "surfaces": memory.surfaces, "emitters": memory.emitters,
            "film": crate::image::film::Film::bytes(width, height, false),
        },
        "files": loaded.files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>(),
        "notes": loaded.notes.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

/// How often each name occurs, sorted by name.
fn tally(names: impl Iterator<Item = &'static str>) -> Value {
    let mut counts = std::collections::BTreeMap::<&str, u64>::new();
    for name in names {
        *counts.entry(name).or_default() += 1;
    }
    counts.into_iter().map(|(name, count)| (name.to_owned(), count.into())).collect::<Map<String, Value>>().into()
}

fn bsdf_kind(bsdf: &Bsdf) -> &'static str {
    match bsdf {
        Bsdf::Diffuse(_) => "diffuse",
        Bsdf::TwoSided(_) => "twosided",
        Bsdf::Dielectric(_) => "dielectric",
        Bsdf::ThinDielectric(_) => "thindielectric",
        Bsdf::Conductor(_) => "conductor",
        Bsdf::RoughConductor(_) => "roughconductor",
        Bsdf::RoughDielectric(_) => "roughdielectric",
        Bsdf::Plastic(_) => "plastic",
        Bsdf::RoughPlastic(_) => "roughplastic",
        Bsdf::Blend(_) => "blendbsdf",
        Bsdf::Mask(_) => "mask",
        Bsdf::Phong(_) => "phong",
    }
}

fn emitter_kind(emitter: &Emitter) -> &'static str {
    match emitter {
        Emitter::Area(_) => "area",
        Emitter::Point(_) => "point",
        Emitter::Spot(_) => "spot",
        Emitter::Directional(_) => "directional",
        Emitter::Constant(_) => "constant",
        Emitter::Envmap(_) => "envmap",
    }
}

/// The document for people: one line an entry, lists and objects indented below their key.
fn text(document: &Value) -> String {
    let mut out = String::new();
    let mut document = document.clone();
    // What methods tell of themselves is nested deeper than the rest, and has a section of its own.
    let isophote = document.get_mut("isophote").and_then(Value::as_object_mut);
    let told = isophote.and_then(|metadata| metadata.shift_remove("diagnostics")).unwrap_or(Value::Null);
    if let Value::Object(map) = &document {
        for (key, value) in map {
            entry(&mut out, key, value);
        }
    }
    out + &diagnostics(&told)
}

/// What a method tells of itself: chains as `isophote diagnose` shows them, the rest by key.
fn diagnostics(told: &Value) -> String {
    let mut out = String::new();
    for (key, value) in told.as_object().into_iter().flatten() {
        match ChainReport::from_json(value) {
            Some(chains) => out += &format!("{key}\n{}", numbers(&chains)),
            None => entry(&mut out, key, value),
        }
    }
    out
}

fn entry(out: &mut String, key: &str, value: &Value) {
    match value {
        Value::Null => {}
        Value::Object(map) if map.is_empty() => {}
        Value::Array(list) if list.is_empty() => {}
        Value::Object(map) => {
            let width = map.keys().map(String::len).max().unwrap_or(0);
            *out += &format!("{key}\n");
            for (name, value) in map {
                let shown = match value.as_u64() {
                    Some(count) if key == "memory" => bytes(count),
                    _ => scalar(value),
                };
                *out += &format!("  {name:<width$}  {shown}\n");
            }
        }
        Value::Array(list) if list.iter().any(|v| v.is_object() || v.is_string()) => {
            *out += &format!("{key}\n");
            for line in list {
                let fields = |map: &Map<String, Value>| map.values().map(scalar).collect::<Vec<_>>().join("  ");
                *out += &format!("  {}\n", line.as_object().map_or_else(|| scalar(line), fields));
            }
        }
        _ => *out += &format!("{key}: {}\n", scalar(value)),
    }
}

/// A value in one line.
fn scalar(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
