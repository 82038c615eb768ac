//! Malformed inputs: each gives an error that names the file and, for XML and OBJ, the line; none panics, none takes long.

use super::here;
use isophote::scene::mitsuba::{LoadOptions, SceneError, load as load_scene};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// One row of `bad/expected.tsv`.
struct Case {
    file: String,
    /// The file at fault, and its line.
    place: PathBuf,
    line: Option<u32>,
    fragment: String,
}

fn cases() -> Vec<Case> {
    let table = std::fs::read_to_string(here("bad/expected.tsv")).unwrap();
    let rows = table.lines().filter(|row| !row.starts_with('#'));
    rows.map(|row| {
        let [file, place, fragment] = row.split('\t').collect::<Vec<_>>()[..] else { panic!("{row}") };
        let (line, place) = place.split_once(' ').unwrap_or((place, file));
        Case { file: file.to_owned(), place: here("bad").join(place), line: line.parse().ok(), fragment: fragment.to_owned() }
    })
    .collect()
}

/// Loads a file of the gallery: a scene by itself, an OBJ file or an image through a scene that names it.
fn load(file: &str) -> Result<(), SceneError> {
    let through = match file.split_once('/') {
        Some(("xml", _)) => return load_scene(&here("bad").join(file), &LoadOptions::default()).map(drop),
        Some(("obj", _)) => "bad/obj.xml",
        _ => "bad/image.xml",
    };
    let options = LoadOptions { defines: vec![("file".to_owned(), file.to_owned())], ..LoadOptions::default() };
    load_scene(&here(through), &options).map(drop)
}

fn check(case: &Case) -> Result<(), String> {
    let start = Instant::now();
    let outcome = catch_unwind(AssertUnwindSafe(|| load(&case.file))).map_err(|_| "panicked".to_owned())?;
    let taken = start.elapsed();
    let Err(error) = outcome else { return Err("was loaded".to_owned()) };
    let text = error.to_string();
    if taken > Duration::from_secs(1) {
        return Err(format!("took {taken:?}: {text}"));
    }
    if case.file.starts_with("image/") {
        let name = case.file.trim_start_matches("image/");
        let named = text.contains(name) && text.contains("image.xml") && error.position.line.is_some();
        return if named { Ok(()) } else { Err(format!("does not name the image and the line that uses it: {text}")) };
    }
    let file = error.file();
    if file.canonicalize().ok() != case.place.canonicalize().ok() {
        return Err(format!("names {} instead of {}: {text}", file.display(), case.place.display()));
    }
    if !text.starts_with(&file.display().to_string()) {
        return Err(format!("does not show the file: {text}"));
    }
    if case.line.is_some() && error.position.line != case.line {
        return Err(format!("names line {:?} instead of {:?}: {text}", error.position.line, case.line));
    }
    if text.contains(&case.fragment) { Ok(()) } else { Err(format!("does not say \"{}\": {text}", case.fragment)) }
}

#[test]
fn every_malformed_input_gives_an_error_with_its_place() {
    let cases = cases();
    assert!(cases.len() >= 200, "{} cases", cases.len());
    let failures: Vec<String> = cases.iter().filter_map(|case| check(case).err().map(|why| format!("{}: {why}", case.file))).collect();
    assert!(failures.is_empty(), "{} of {} cases:\n{}", failures.len(), cases.len(), failures.join("\n"));
}

#[test]
fn only_files_without_a_line_at_fault_have_none() {
    // What has no line: OBJ files that lack something as a whole.
    let without: Vec<String> =
        cases().into_iter().filter(|case| case.line.is_none() && !case.file.starts_with("image/")).map(|case| case.file).collect();
    assert_eq!(without, ["empty", "blank", "only-vertices", "only-remarks", "only-lines", "flat"].map(|name| format!("obj/{name}.obj")));
}

#[test]
fn every_file_of_the_gallery_is_in_the_table() {
    let listed: Vec<String> = cases().into_iter().map(|case| case.file).collect();
    for folder in ["xml", "obj", "image"] {
        for entry in std::fs::read_dir(here("bad").join(folder)).unwrap() {
            let name = format!("{folder}/{}", entry.unwrap().file_name().to_string_lossy());
            // The second half of a pair.
            assert!(listed.contains(&name) || name == "xml/include-circle-b.xml", "{name} is not in expected.tsv");
        }
    }
}

/// What grows with the square of a file's size in a careless loader; each is too large to be kept as a file.
#[test]
fn large_malformed_scenes_take_no_time() {
    let wrap = |body: &str| format!("<scene version=\"3.0.0\">\n{body}\n</scene>");
    let many = |count: usize, line: fn(usize) -> String| (0..count).map(line).collect::<String>();
    let cases = [
        ("many parameters", format!("<shape type=\"sphere\">{}</shape>", many(100_000, |i| format!("<float name=\"p{i}\" value=\"1\"/>")))),
        ("many named shapes", many(100_000, |i| format!("<shape type=\"sphere\" name=\"s{i}\"/>"))),
        (
            "many ids",
            format!(
                "{}<shape type=\"sphere\"><ref id=\"nobody\"/></shape>",
                many(100_000, |i| format!("<bsdf type=\"diffuse\" id=\"id{i}\"/>"))
            ),
        ),
        ("many notes", many(50_000, |_| "<emitter type=\"point\"><float name=\"sampling_weight\" value=\"1\"/></emitter>\n".to_owned())),
        ("a long name", format!("<default name=\"a\" value=\"1\"/><shape type=\"${}\"/>", "b".repeat(1_000_000))),
        ("a long number", format!("<shape type=\"sphere\"><float name=\"radius\" value=\"{}\"/></shape>", "7".repeat(1_000_000))),
        ("deep nesting", format!("{}{}", "<bsdf type=\"twosided\">".repeat(100_000), "</bsdf>".repeat(100_000))),
        ("many attributes", format!("<shape type=\"sphere\"{}/>", many(100_000, |i| format!(" a{i}=\"\"")))),
        ("a long list", format!("<shape type=\"sphere\"><point name=\"center\" value=\"{}\"/></shape>", "7 ".repeat(1_000_000))),
    ];
    for (what, body) in cases {
        let start = Instant::now();
        let error = super::load_files(&[("scene.xml", &wrap(&body))], &LoadOptions::default()).expect_err(what).to_string();
        // A second each would do alone; the tests run side by side.
        assert!(start.elapsed() < Duration::from_secs(4), "{what} took {:?}", start.elapsed());
        assert!(error.len() < 5000 && error.contains("scene.xml"), "{what}: {} bytes of message", error.len());
    }
}
