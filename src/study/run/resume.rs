//! What decides a result, and whether a folder's records belong to a plan.

use super::Cell;
use crate::scene::mitsuba::LoadedScene;
use crate::study::error::StudyError;
use crate::study::hash::of_json;
use crate::study::plan::StudyPlan;
use crate::study::records::Record;
use serde_json::{Value, json};
use std::path::Path;

/// Hash of what decides a cell's result, times apart.
pub(super) fn cell_hash(plan: &StudyPlan, loaded: &LoadedScene, cell: Cell, settings: &Value, reference: &str) -> String {
    let method = &plan.methods[cell.method];
    of_json(&json!({
        "version": env!("CARGO_PKG_VERSION"),
        // Two scenes, or two methods, may differ by their names alone; they are cells of their own.
        "scene": plan.scenes[cell.scene].name,
        "method": method.label,
        "scene_hash": loaded.content_hash,
        "name": method.method.name,
        "settings": settings,
        "seed": cell.seed,
        "budget": method.until,
        "snapshots": plan.snapshots.to_string(),
        "keep": plan.keep,
        "reference": reference,
    }))
}

/// The plan with every default filled in.
pub(super) fn plan_json(plan: &StudyPlan, scenes: &[LoadedScene], references: &[String], threads: usize) -> Value {
    let scene = |((scene, loaded), reference): ((&crate::study::plan::ScenePlan, &LoadedScene), &String)| {
        let common = scene.changes.common(0, &loaded.defaults);
        json!({
            "name": scene.name,
            "file": scene.file.display().to_string(),
            "hash": loaded.content_hash,
            "settings": scene.changes.shared_json(&common, &loaded.film),
            "reference": scene.reference.as_ref().map(|path| path.display().to_string()),
            "reference_var": scene.reference_var.as_ref().map(|path| path.display().to_string()),
            "reference_hash": reference,
        })
    };
    json!({
        "name": plan.name,
        "version": env!("CARGO_PKG_VERSION"),
        "threads": threads,
        "snapshots": plan.snapshots.to_string(),
        "keep": plan.keep,
        "seeds": plan.seeds,
        "reference": plan.reference.to_json(),
        "scenes": plan.scenes.iter().zip(scenes).zip(references).map(scene).collect::<Vec<_>>(),
        "methods": plan.methods.iter().map(|method| method.to_json()).collect::<Vec<_>>(),
        "report": plan.report,
    })
}

/// Keys of the plan that may not change within a folder.
const FIXED: [&str; 4] = ["version", "threads", "snapshots", "keep"];
/// Lists of the plan that may grow, and the key that names their items.
const GROWING: [(&str, &str); 2] = [("scenes", "name"), ("methods", "label")];
/// Keys of a scene that say where it is, not what.
const PLACES: [&str; 3] = ["file", "reference", "reference_var"];

/// A list's items by name, without what may change.
fn items(plan: &Value, list: &str) -> Vec<Value> {
    let mut items = plan[list].as_array().cloned().unwrap_or_default();
    for item in items.iter_mut().filter_map(Value::as_object_mut).filter(|_| list == "scenes") {
        item.retain(|key, _| !PLACES.contains(&key.as_str()));
    }
    items
}

/// Hash of what decides the cells' results.
pub(super) fn plan_hash(plan: &Value) -> String {
    let fixed: Vec<&Value> = FIXED.iter().map(|key| &plan[*key]).collect();
    let lists: Vec<Vec<Value>> = GROWING.iter().map(|(list, _)| items(plan, list)).collect();
    of_json(&json!([fixed, plan["seeds"], lists]))
}

/// Refuses a folder whose last plan is not part of this one. Without a cell on record there is nothing to mix up.
pub(super) fn check(folder: &Path, records: &[Record], plan: &Value) -> Result<(), StudyError> {
    let last = records.iter().rev().find_map(|record| match record {
        Record::Study(study) => Some(&study.plan),
        _ => None,
    });
    let begun = records.iter().any(|record| matches!(record, Record::Cell(_)));
    match last.filter(|_| begun).map(|before| difference(before, plan)) {
        Some(Some(why)) => Err(StudyError::OtherStudy { folder: folder.to_path_buf(), why }),
        _ => Ok(()),
    }
}

/// What in a plan is more than seeds, scenes and methods added to an earlier one.
fn difference(before: &Value, now: &Value) -> Option<String> {
    if let Some(key) = FIXED.iter().find(|key| before[**key] != now[**key]) {
        return Some(format!("{key} was {}, now it is {}", before[*key], now[*key]));
    }
    let seeds = |plan: &Value| plan["seeds"].as_array().cloned().unwrap_or_default();
    if let Some(seed) = seeds(before).iter().find(|seed| !seeds(now).contains(seed)) {
        return Some(format!("seed {seed} is gone"));
    }
    GROWING.iter().find_map(|(list, name)| {
        let now = items(now, list);
        items(before, list).iter().find_map(|old| {
            let kind = list.trim_end_matches('s');
            match now.iter().find(|new| new[*name] == old[*name]) {
                None => Some(format!("the {kind} {} is gone", old[*name])),
                Some(new) => changed(old, new).map(|what| format!("the {kind} {} has another {what}", old[*name])),
            }
        })
    })
}

/// The first key, at any depth, whose value is another.
fn changed(old: &Value, new: &Value) -> Option<String> {
    match (old.as_object(), new.as_object()) {
        (Some(a), Some(b)) => {
            let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
            keys.into_iter().find_map(|key| {
                let (a, b) = (a.get(key).unwrap_or(&Value::Null), b.get(key).unwrap_or(&Value::Null));
                changed(a, b).map(|inner| if inner.is_empty() { key.clone() } else { inner })
            })
        }
        _ => (old != new).then(String::new),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Value {
        json!({
            "version": "1", "threads": 2, "snapshots": "pow2", "keep": "final", "seeds": [1, 2], "report": {},
            "scenes": [{"name": "box", "file": "a.xml", "hash": "h", "settings": {"max_depth": -1}, "reference_hash": "r"}],
            "methods": [{"label": "sppm", "name": "sppm", "settings": {"radius_pixels": 1.0}, "budget": {"time": 4.0}}],
        })
    }

    fn with(path: &str, value: Value) -> Value {
        let mut plan = plan();
        *plan.pointer_mut(path).expect("there") = value;
        plan
    }

    #[test]
    fn more_of_anything_goes_on() {
        let before = plan();
        let mut more = with("/seeds", json!([3, 2, 1]));
        for list in ["scenes", "methods"] {
            let mut another = more[list][0].clone();
            let key = if list == "scenes" { "name" } else { "label" };
            another[key] = "new".into();
            more[list].as_array_mut().expect("a list").insert(0, another);
        }
        assert_eq!(difference(&before, &more), None);
        assert_ne!(plan_hash(&before), plan_hash(&more));
        for (path, value) in [("/scenes/0/file", json!("b.xml")), ("/report", json!({"guides": true}))] {
            let moved = with(path, value);
            assert_eq!((difference(&before, &moved), plan_hash(&moved)), (None, plan_hash(&before)), "{path}");
        }
    }

    #[test]
    fn anything_else_is_told() {
        let cases = [
            ("/threads", json!(1), "threads was 2, now it is 1"),
            ("/keep", json!("snapshots"), "keep was \"final\", now it is \"snapshots\""),
            ("/seeds", json!([2, 3]), "seed 1 is gone"),
            ("/scenes/0/hash", json!("k"), "the scene \"box\" has another hash"),
            ("/scenes/0/settings/max_depth", json!(5), "the scene \"box\" has another max_depth"),
            ("/scenes/0/name", json!("other"), "the scene \"box\" is gone"),
            ("/methods/0/settings", json!({"radius_pixels": 2.0}), "the method \"sppm\" has another radius_pixels"),
            ("/methods/0/settings", json!({}), "the method \"sppm\" has another radius_pixels"),
            ("/methods/0/budget", json!({"time": 8.0}), "the method \"sppm\" has another time"),
        ];
        for (path, value, message) in cases {
            let now = with(path, value);
            assert_eq!(difference(&plan(), &now).as_deref(), Some(message), "{path}");
            assert_ne!(plan_hash(&now), plan_hash(&plan()), "{path}");
        }
    }
}
