//! `docs/scenes.md` lists what the loader takes.

use super::{load_files, scene};
use isophote::scene::bsdf::ior::{CONDUCTORS, DIELECTRICS};
use isophote::scene::mitsuba::{LoadOptions, supported};

/// A plugin with the least it needs, and a parameter nobody knows: the error lists those it takes.
fn parameters(kind: &str, plugin: &str) -> Vec<String> {
    let needs = match plugin {
        "twosided" | "mask" => "<bsdf type=\"diffuse\"/>",
        "blendbsdf" => "<float name=\"weight\" value=\".5\"/><bsdf type=\"diffuse\"/><bsdf type=\"diffuse\"/>",
        "obj" => "<string name=\"filename\" value=\"a.obj\"/>",
        "bitmap" | "envmap" => "<string name=\"filename\" value=\"a.png\"/>",
        "thinlens" => "<float name=\"aperture_radius\" value=\"1\"/>",
        _ => "",
    };
    let object = format!("<{kind} type=\"{plugin}\">{needs}<float name=\"zzzzzzzzzzzzzzzz\" value=\"1\"/></{kind}>");
    let text = match (kind, plugin) {
        ("emitter", "area") => scene(&format!("<shape type=\"sphere\">{object}</shape>")),
        ("sensor", _) => format!("<scene version=\"3.0.0\">{object}</scene>"),
        ("film", _) => format!("<scene version=\"3.0.0\"><sensor type=\"perspective\">{object}</sensor></scene>"),
        _ => scene(&object),
    };
    let image = super::here("bad/good.png");
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(image, folder.path().join("a.png")).unwrap();
    let picture = folder.path().join("a.png").display().to_string();
    let text = text.replace("a.png", &picture);
    let files = [("scene.xml", text.as_str()), ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")];
    let error = load_files(&files, &LoadOptions::default()).expect_err(&text);
    let help = error.help.unwrap_or_default();
    assert!(error.message.contains("zzzzzzzzzzzzzzzz"), "{kind} {plugin}: {}", error.message);
    if help.starts_with("none") {
        return Vec::new();
    }
    help.trim_start_matches("supported: ").split(", ").map(str::to_owned).collect()
}

#[test]
fn every_plugin_and_parameter_is_documented() {
    let text = include_str!("../../docs/scenes.md");
    let mut missing = Vec::new();
    for (kind, plugin) in supported() {
        // The part of the page about this plugin: from its row or heading to the next plugin's.
        let Some(start) = text.find(&format!("### `{plugin}`")) else {
            missing.push(format!("{kind} {plugin}"));
            continue;
        };
        let section = &text[start + 4..];
        let section = &section[..section.find("\n##").unwrap_or(section.len())];
        missing.extend(
            parameters(kind, plugin)
                .into_iter()
                .filter(|name| !section.contains(&format!("`{name}`")))
                .map(|name| format!("{kind} {plugin}: {name}")),
        );
    }
    assert!(missing.is_empty(), "docs/scenes.md lacks {missing:#?}");
}

#[test]
fn every_medium_and_metal_is_documented() {
    let text = include_str!("../../docs/scenes.md");
    let names = DIELECTRICS.iter().map(|(name, _)| *name).chain(CONDUCTORS.iter().map(|(name, _, _)| *name));
    let missing: Vec<&str> = names.filter(|name| !text.contains(&format!("`{name}`"))).collect();
    assert!(missing.is_empty(), "docs/scenes.md lacks {missing:?}");
}
