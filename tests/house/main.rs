//! The house rules that a scan can see: floors, equation keys, pages, provenance.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Rooms from the ground floor up; a room imports only from floors below its own.
const FLOORS: [&str; 12] =
    ["samplers", "math", "image", "scene", "transport", "photons", "targets", "integrators", "render", "study", "cli", "main"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn floor_of(room: &str) -> Option<usize> {
    FLOORS.iter().position(|floor| *floor == room)
}

/// Names of the rooms that a source file imports through `crate::`.
fn imports(text: &str) -> BTreeSet<&str> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    code.flat_map(|line| line.split("crate::").skip(1))
        .map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or(""))
        .collect()
}

#[test]
fn rooms_import_only_from_floors_below() {
    let source = root().join("src");
    let mut wrong = Vec::new();
    for file in files(&source, "rs") {
        let inside = file.strip_prefix(&source).unwrap();
        let first = inside.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
        let room = first.trim_end_matches(".rs").to_owned();
        let Some(own) = floor_of(&room) else { continue };
        let text = fs::read_to_string(&file).unwrap();
        for import in imports(&text) {
            if floor_of(import).is_some_and(|floor| floor > own) {
                wrong.push(format!("{}: {room} may not import {import}", inside.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "imports that run up a floor:\n{}", wrong.join("\n"));
}

#[test]
fn the_scan_sees_an_import() {
    assert!(imports("use crate::render::x;\n").contains("render"));
    assert!(imports("// use crate::render::x;\n").is_empty());
}

/// Equation keys are written `[NAME (12)]` or `[NAME12 3.4]`: capitals first, then perhaps digits.
fn keys(text: &str) -> BTreeSet<String> {
    let is_key = |s: &str| {
        s.len() >= 3
            && s.chars().take(2).all(|c| c.is_ascii_uppercase())
            && s.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || "*-+".contains(c))
    };
    let comments = text.lines().filter(|line| line.trim_start().starts_with("//"));
    comments
        .flat_map(|line| line.split('[').skip(1))
        .filter_map(|rest| rest.split([']', '\\']).next())
        .filter_map(|inside| inside.split([' ', ',', ';']).next())
        .filter(|word| is_key(word))
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_equation_key_is_in_the_references() {
    let references = fs::read_to_string(root().join("docs/references.md")).unwrap();
    let mut unknown = Vec::new();
    for folder in ["src", "samplers/src"] {
        for file in files(&root().join(folder), "rs") {
            for key in keys(&fs::read_to_string(&file).unwrap()) {
                if !references.contains(&format!("[{key}]")) {
                    unknown.push(format!("{}: [{key}]", file.strip_prefix(root()).unwrap().display()));
                }
            }
        }
    }
    assert!(unknown.is_empty(), "keys that docs/references.md does not list:\n{}", unknown.join("\n"));
    assert!(keys("// as in [VEACH (5.17)]\n").contains("VEACH"));
}

#[test]
fn every_method_has_a_page() {
    for method in isophote::integrators::METHODS {
        assert!(root().join("docs").join(method.page).is_file(), "{} has no page docs/{}", method.name, method.page);
    }
}

#[test]
fn every_scene_says_where_it_comes_from() {
    let text = fs::read_to_string(root().join("scenes/README.md")).unwrap();
    for entry in fs::read_dir(root().join("scenes")).unwrap().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().join("scene.xml").is_file() {
            assert!(text.contains(&format!("`{name}`")), "scenes/README.md does not speak of `{name}`");
        }
    }
}

/// Links between pages of the documentation lead somewhere.
#[test]
fn documentation_links_lead_somewhere() {
    let mut broken = Vec::new();
    let mut pages = files(&root().join("docs"), "md");
    pages.push(root().join("README.md"));
    for page in pages {
        let text = fs::read_to_string(&page).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let target = target.split('#').next().unwrap();
            if !target.is_empty() && !target.contains("://") && !page.parent().unwrap().join(target).exists() {
                broken.push(format!("{}: {target}", page.strip_prefix(root()).unwrap().display()));
            }
        }
    }
    assert!(broken.is_empty(), "broken links:\n{}", broken.join("\n"));
}
