//! The tables of a study file.

use super::labels::{Written, label};
use super::reader::{Entry, PlanError, Result, Section, Source};
use super::{Keep, MethodPlan, ReferencePlan, ScenePlan, StudyPlan, Until};
use crate::image::file::variance_beside;
use crate::integrators::{BoxedSettings, Method};
use crate::render::{Changes, Crop, Snapshots};
use crate::scene::mitsuba::suggest;
use crate::transport::class::pattern;
use clap::Command;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

const TOP: &[&str] = &["name", "seeds", "budget", "keep", "snapshots", "threads", "reference", "scene", "method", "report"];
const SCENE: &[&str] =
    &["name", "file", "reference", "reference_var", "resolution", "crop", "define", "max_depth", "min_depth", "hide_emitters", "paths"];
const METHOD: &[&str] = &["name", "label", "budget"];
const REFERENCE: &[&str] = &["method", "runs", "budget", "cache"];
const BUDGET: &[&str] = &["time", "iterations", "photons"];

/// More cells of one kind than anybody waits for: a mistake.
const MOST_SEEDS: i64 = 1_000_000;
/// Runs of a reference unless told.
const RUNS: u64 = 8;
/// Iterations of a run unless told.
const REFERENCE_ITERATIONS: u64 = 512;

/// Reads a whole study file.
pub(super) fn study(file: &Path, text: &str, methods: &'static [Method]) -> Result<StudyPlan> {
    let source = Source::new(file, text);
    let document = source.parse()?;
    let top = Section::top(&source, &document);
    top.only(TOP)?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let default = top.get("budget").map(|entry| budget(&entry)).transpose()?;
    let scenes = scenes(&top, folder)?;
    let name = match top.get("name") {
        Some(entry) => entry.text()?.to_owned(),
        None => file.file_stem().map_or_else(|| "study".into(), |stem| stem.to_string_lossy().into_owned()),
    };
    Ok(StudyPlan {
        file: file.to_path_buf(),
        name,
        seeds: seeds(&top)?,
        keep: keep(&top)?,
        snapshots: top.get("snapshots").map_or(Ok(Snapshots::PowersOfTwo), |entry| entry.parsed())?,
        threads: top.get("threads").map(|entry| entry.whole(1..=4096)).transpose()?.map(|n| n as usize),
        reference: reference(&top, folder, methods)?,
        methods: method_list(&top, default, methods)?,
        report: report(&top, &scenes)?,
        scenes,
    })
}

fn seeds(top: &Section) -> Result<Vec<u64>> {
    let entry =
        top.get("seeds").ok_or_else(|| top.error("seeds are missing").help("seeds = 8 for 1 to 8, or a list as in seeds = [3, 5]"))?;
    if !entry.is_list() {
        let count = entry.whole(1..=MOST_SEEDS)?;
        return Ok((1..=count as u64).collect());
    }
    let mut seeds = Vec::new();
    for item in entry.list()? {
        let seed = item.whole(0..=i64::MAX)? as u64;
        if seeds.contains(&seed) {
            return Err(item.error(format!("seed {seed} stands here twice")));
        }
        seeds.push(seed);
    }
    if seeds.is_empty() {
        return Err(entry.error("the list of seeds is empty"));
    }
    Ok(seeds)
}

fn keep(top: &Section) -> Result<Keep> {
    match top.get("keep").map(|entry| Ok((entry, entry.text()?))).transpose()? {
        None | Some((_, "final")) => Ok(Keep::Final),
        Some((_, "snapshots")) => Ok(Keep::Snapshots),
        Some((entry, other)) => Err(entry.error(format!("unknown keep \"{other}\"")).help("supported: final, snapshots")),
    }
}

fn budget(entry: &Entry) -> Result<Until> {
    let section = entry.section("a budget")?;
    section.only(BUDGET)?;
    let given: Vec<Entry> = section.entries().collect();
    let [one] = given.as_slice() else {
        return Err(entry.error("a budget takes exactly one of time, iterations and photons").help("as in budget = { time = 4.0 }"));
    };
    Ok(match one.key {
        "time" => {
            Until::Time(one.positive().ok().filter(|s| *s < 4e9).ok_or_else(|| one.error("time must be a positive number of seconds"))?)
        }
        "iterations" => Until::Iterations(one.whole(1..=i64::MAX)? as u64),
        _ => Until::Photons(one.whole(1..=i64::MAX)? as u64),
    })
}

/// The tables of a list such as `[[scene]]`, at least one.
fn tables<'a>(top: &Section<'a>, key: &str, what: &'a str) -> Result<Vec<Section<'a>>> {
    let entry = top.get(key).ok_or_else(|| top.error(format!("there is no {what}")))?;
    if !entry.is_list() {
        return Err(entry.error(format!("write {what}: there may be several")));
    }
    let tables = entry.list()?.iter().map(|item| item.section(what)).collect::<Result<Vec<_>>>()?;
    if tables.is_empty() { Err(entry.error(format!("there is no {what}"))) } else { Ok(tables) }
}

/// A file that has to be there, named relative to the study's folder.
fn existing(entry: &Entry, folder: &Path) -> Result<PathBuf> {
    let path = folder.join(entry.text()?);
    if path.is_file() { Ok(path) } else { Err(entry.error(format!("{}: there is no file {}", entry.key, path.display()))) }
}

fn scenes(top: &Section, folder: &Path) -> Result<Vec<ScenePlan>> {
    let mut scenes: Vec<ScenePlan> = Vec::new();
    for section in tables(top, "scene", "[[scene]]")? {
        let scene = scene(&section, folder)?;
        if let Some(first) = scenes.iter().find(|other| other.name == scene.name) {
            let message = format!("two scenes are called \"{}\", the other in line {}", scene.name, first.position.line.unwrap_or(0));
            return Err(PlanError::new(&scene.position, message).help("give each a name of its own: name = \"...\""));
        }
        scenes.push(scene);
    }
    Ok(scenes)
}

fn scene(section: &Section, folder: &Path) -> Result<ScenePlan> {
    section.only(SCENE)?;
    let file = section.get("file").ok_or_else(|| section.error("[[scene]] has no file").help("file = \"../box/scene.xml\""))?;
    let path = existing(&file, folder)?;
    let name = match section.get("name") {
        Some(entry) => entry.text()?.to_owned(),
        None => folder_name(&path),
    };
    let reference = section.get("reference").map(|entry| existing(&entry, folder)).transpose()?;
    let reference_var = match (section.get("reference_var"), &reference) {
        (Some(entry), None) => return Err(entry.error("reference_var without a reference").help("name the mean as reference")),
        (Some(entry), Some(_)) => Some(existing(&entry, folder)?),
        (None, mean) => mean.as_deref().and_then(variance_beside),
    };
    let position = section.get("reference").map_or_else(|| file.position(), |entry| entry.position());
    Ok(ScenePlan { name, file: path, changes: changes(section)?, reference, reference_var, position })
}

/// The name of the folder that holds a file.
fn folder_name(file: &Path) -> String {
    let absolute = std::fs::canonicalize(file).unwrap_or_else(|_| file.to_path_buf());
    let name = absolute.parent().and_then(Path::file_name).or(absolute.file_stem());
    name.map_or_else(|| "scene".into(), |n| n.to_string_lossy().into_owned())
}

fn changes(section: &Section) -> Result<Changes> {
    let depth = |entry: Entry| match entry.whole(-1..=i64::from(u32::MAX))? {
        0 => Err(entry.error("max_depth must be -1 or a number of path edges from 1")),
        depth => Ok(depth),
    };
    let class = |entry: Entry| pattern(entry.text()?).map_err(|why| entry.error(format!("paths: {why}")));
    Ok(Changes {
        resolution: section.get("resolution").map(|entry| entry.parsed()).transpose()?,
        crop: section.get("crop").map(|entry| crop(&entry)).transpose()?,
        define: section.get("define").map_or(Ok(Vec::new()), |entry| define(&entry))?,
        max_depth: section.get("max_depth").map(depth).transpose()?,
        min_depth: section.get("min_depth").map_or(Ok(1), |entry| entry.whole(1..=i64::from(u32::MAX)))? as u32,
        hide_emitters: section.get("hide_emitters").map_or(Ok(false), |entry| entry.flag())?,
        paths: section.get("paths").map(class).transpose()?,
    })
}

/// `"X,Y,W,H"` or a list of the four.
fn crop(entry: &Entry) -> Result<Crop> {
    if !entry.is_list() {
        return entry.parsed();
    }
    let numbers = entry.list()?.iter().map(|n| n.whole(0..=i64::from(u32::MAX))).collect::<Result<Vec<_>>>()?;
    match numbers.as_slice() {
        [x, y, width, height] if *width > 0 && *height > 0 => Ok(Crop([*x as u32, *y as u32, *width as u32, *height as u32])),
        _ => Err(entry.error("crop must be left, top, width and height in pixels, as in [100, 50, 64, 64]")),
    }
}

/// Values of `$name`: texts, numbers and flags as Mitsuba's `-D` takes them.
fn define(entry: &Entry) -> Result<Vec<(String, String)>> {
    let pair = |value: Entry| match value.json()? {
        Value::String(text) => Ok((value.key.to_owned(), text)),
        Value::Array(_) | Value::Object(_) => Err(value.error(format!("{} must be a text, a number, true or false", value.key))),
        plain => Ok((value.key.to_owned(), plain.to_string())),
    };
    entry.section("define")?.entries().map(pair).collect()
}

fn method_of(entry: &Entry, methods: &'static [Method]) -> Result<&'static Method> {
    let name = entry.text()?;
    methods.iter().find(|m| m.name == name).ok_or_else(|| {
        let known: Vec<&str> = methods.iter().map(|m| m.name).collect();
        entry.error(format!("unknown method \"{name}\"")).help(suggest(name, &known))
    })
}

/// Keys of a method's settings: its long options with underscores.
fn option_keys(method: &Method) -> Vec<String> {
    let command = (method.augment)(Command::new(method.name));
    command.get_arguments().filter_map(|a| a.get_long()).map(|long| long.replace('-', "_")).collect()
}

/// Reads all keys but `own` as the method's settings.
fn settings(section: &Section, method: &Method, own: &[&str]) -> Result<(Box<dyn BoxedSettings>, Map<String, Value>)> {
    let options = option_keys(method);
    let known: Vec<&str> = own.iter().copied().chain(options.iter().map(String::as_str)).collect();
    section.only(&known)?;
    let entries: Vec<Entry> = section.entries().filter(|entry| !own.contains(&entry.key)).collect();
    let map: Map<String, Value> = entries.iter().map(|e| Ok((e.key.to_owned(), e.json()?))).collect::<Result<_>>()?;
    match (method.from_json)(&Value::Object(map.clone())) {
        Ok(settings) => Ok((settings, map)),
        Err(whole) => {
            // Which of them? The one that is refused alone.
            let alone = |entry: &&Entry| (method.from_json)(&json!({entry.key: map.get(entry.key)})).is_err();
            Err(match entries.iter().find(alone) {
                Some(entry) => entry.error(format!("{}: {whole}", entry.key)),
                None => section.error(format!("{}: {whole}", method.name)),
            })
        }
    }
}

fn method_list(top: &Section, default: Option<Until>, methods: &'static [Method]) -> Result<Vec<MethodPlan>> {
    let (mut plans, mut written) = (Vec::new(), Vec::new());
    for section in tables(top, "method", "[[method]]")? {
        let name = section.get("name").ok_or_else(|| section.error("[[method]] has no name").help(names(methods)))?;
        let method = method_of(&name, methods)?;
        let (settings, map) = settings(&section, method, METHOD)?;
        let own = section.get("budget").map(|entry| budget(&entry)).transpose()?;
        let until = own.or(default).ok_or_else(|| {
            section.error(format!("{} has no budget, and the study has none", method.name)).help("budget = { iterations = 64 }")
        })?;
        let position = name.position();
        // A method without photons never traces the number of light paths that would end it.
        if matches!(until, Until::Photons(_)) && !option_keys(method).iter().any(|key| key == "photons") {
            let message = format!("{} traces no light paths, so a budget of photons never ends", method.name);
            return Err(PlanError::new(&position, message).help("give this method a budget of its own, as in budget = { time = 4.0 }"));
        }
        written.push(Written { label: section.get("label").map(|e| e.text().map(str::to_owned)).transpose()?, settings: map });
        let keys = section.entries().map(|entry| (entry.key.to_owned(), entry.position())).collect();
        plans.push(MethodPlan { label: String::new(), method, settings, until, position, keys });
    }
    label(&mut plans, &written)?;
    Ok(plans)
}

fn names(methods: &[Method]) -> String {
    format!("supported: {}", methods.iter().map(|m| m.name).collect::<Vec<_>>().join(", "))
}

fn reference(top: &Section, folder: &Path, methods: &'static [Method]) -> Result<ReferencePlan> {
    let entry = top.get("reference");
    let section = entry.map(|entry| entry.section("[reference]")).transpose()?;
    let get = |key: &str| section.and_then(|section| section.get(key));
    let method = match get("method") {
        Some(entry) => method_of(&entry, methods)?,
        None => methods.iter().find(|m| m.name == "path").ok_or_else(|| top.error("[reference] names no method").help(names(methods)))?,
    };
    let settings = match &section {
        Some(section) => settings(section, method, REFERENCE)?.0,
        None => (method.from_json)(&json!({})).map_err(|error| top.error(error.to_string()))?,
    };
    let until = get("budget").map_or(Ok(Until::Iterations(REFERENCE_ITERATIONS)), |entry| budget(&entry))?;
    // The variance of a mean needs two runs.
    let runs = get("runs").map_or(Ok(RUNS as i64), |entry| entry.whole(2..=1_000_000))? as u64;
    let cache = get("cache").map(|entry| Ok(folder.join(entry.text()?))).transpose()?;
    let position = entry.map_or_else(|| top.position(), |entry| entry.position());
    Ok(ReferencePlan { method, settings, runs, until, cache, position })
}

/// The `[report]` table, checked and passed on.
fn report(top: &Section, scenes: &[ScenePlan]) -> Result<Value> {
    let Some(entry) = top.get("report") else { return Ok(json!({})) };
    let section = entry.section("[report]")?;
    section.only(&["insets", "slope", "guides"])?;
    if let Some(slope) = section.get("slope") {
        let window = slope.section("slope")?;
        window.only(&["from", "to"])?;
        let bounds = window.entries().map(|entry| entry.positive()).collect::<Result<Vec<f64>>>()?;
        let (from, to) = (window.get("from"), window.get("to"));
        if let (Some(from), Some(to)) = (from, to)
            && from.number()? >= to.number()?
        {
            return Err(to.error("slope: to must be larger than from"));
        }
        if bounds.is_empty() {
            return Err(slope.error("slope takes from and to, in iterations"));
        }
    }
    if let Some(guides) = section.get("guides") {
        guides.flag()?;
    }
    for inset in section.get("insets").map_or(Ok(Vec::new()), |entry| entry.list())? {
        check_inset(&inset, scenes)?;
    }
    entry.json()
}

fn check_inset(entry: &Entry, scenes: &[ScenePlan]) -> Result<()> {
    let inset = entry.section("an inset")?;
    inset.only(&["scene", "x", "y", "width", "height"])?;
    let scene = inset.get("scene");
    if let Some(scene) = scene
        && !scenes.iter().any(|known| Some(known.name.as_str()) == scene.text().ok())
    {
        let known: Vec<&str> = scenes.iter().map(|s| s.name.as_str()).collect();
        return Err(scene.error(format!("there is no scene \"{}\" in this study", scene.text()?)).help(suggest(scene.text()?, &known)));
    }
    for key in ["x", "y", "width", "height"] {
        let value = inset.get(key).ok_or_else(|| inset.error(format!("an inset needs x, y, width and height; {key} is missing")))?;
        let number = value.number()?;
        let smallest_fits = if key.len() > 1 { number > 0.0 } else { number >= 0.0 };
        if !smallest_fits || (scene.is_none() && number > 1.0) {
            let unit =
                if scene.is_some() { "pixels of the scene's film" } else { "fractions of the film from 0 to 1, as it names no scene" };
            return Err(value.error(format!("{key} of an inset is {number}: it takes {unit}")));
        }
    }
    Ok(())
}
