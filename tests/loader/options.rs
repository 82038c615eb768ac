//! `default` and `-D`, `include`, resolution and crop, notes, files and their hash.

use super::{SENSOR, load, load_files, refuse, scene};
use glam::Vec3;
use isophote::scene::mitsuba::{LoadOptions, LoadedParts, SceneError};
use isophote::scene::shape::Geometry;

fn with(text: &str, defines: &[(&str, &str)]) -> Result<LoadedParts, SceneError> {
    let defines = defines.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    load_files(&[("scene.xml", &scene(text))], &LoadOptions { defines, ..LoadOptions::default() })
}

fn radius(loaded: &LoadedParts) -> f32 {
    match &loaded.parts.shapes[0].geometry {
        Geometry::Sphere(sphere) => sphere.radius(),
        other => panic!("{other:?}"),
    }
}

const BALL: &str = "<default name=\"r\" value=\"2\"/><shape type=\"sphere\"><float name=\"radius\" value=\"$r\"/></shape>";

#[test]
fn defaults_are_overridden_by_defines() {
    assert_eq!(radius(&with(BALL, &[]).unwrap()), 2.0);
    assert_eq!(radius(&with(BALL, &[("r", "3")]).unwrap()), 3.0);
    // Without a default the -D has to be there; with two defaults the first counts.
    assert_eq!(radius(&with("<shape type=\"sphere\"><float name=\"radius\" value=\"$r\"/></shape>", &[("r", "3")]).unwrap()), 3.0);
    assert_eq!(radius(&with(&format!("<default name=\"r\" value=\"5\"/>{BALL}"), &[]).unwrap()), 5.0);
}

#[test]
fn names_fill_any_attribute_in_any_place() {
    let text =
        "<default name=\"kind\" value=\"sph\"/><default name=\"name\" value=\"rad\"/><shape type=\"${}\"/>".replace("${}", "$kindere");
    assert!(with(&text, &[]).is_ok(), "$kind is the longest known name in $kindere");
    let both = "<default name=\"r\" value=\"1\"/><default name=\"rs\" value=\"2\"/><shape type=\"sphere\"><float name=\"radius\" value=\"$rs\"/></shape>";
    assert_eq!(radius(&with(both, &[]).unwrap()), 2.0);
    assert_eq!(with("<integrator type=\"$i\"/>", &[("i", "bdpt")]).unwrap().defaults.integrator.as_deref(), Some("bdpt"));
    let escaped = with("<bsdf type=\"diffuse\" id=\"a\\$b\"/><shape type=\"cube\"><ref id=\"a\\$b\"/></shape>", &[]).unwrap();
    assert_eq!(escaped.parts.shapes.len(), 1);
}

#[test]
fn unknown_defines_are_errors() {
    let error = with(BALL, &[("radius", "3")]).unwrap_err().to_string();
    assert!(error.contains("-D radius") && error.contains("supported: r"), "{error}");
}

#[test]
fn included_files_resolve_their_own_files_and_see_the_defaults() {
    let main = scene(
        "<default name=\"r\" value=\"4\"/><include filename=\"parts/ball.xml\"/><shape type=\"cube\"><include filename=\"parts/grey.xml\"/></shape>",
    );
    let ball = "<scene version=\"3.0.0\"><default name=\"r\" value=\"9\"/><shape type=\"sphere\"><float name=\"radius\" value=\"$r\"/></shape>\
                <shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape><shape type=\"obj\"><string name=\"filename\" value=\"top.obj\"/></shape></scene>";
    let grey = "<bsdf version=\"3.0.0\" type=\"conductor\"/>";
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let files = [
        ("scene.xml", main.as_str()),
        ("parts/ball.xml", ball),
        ("parts/grey.xml", grey),
        ("parts/a.obj", triangle),
        ("top.obj", triangle),
    ];
    let loaded = load_files(&files, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(radius(&loaded), 4.0);
    assert_eq!(loaded.parts.shapes.len(), 4);
    let names: Vec<_> = loaded.files.iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect();
    assert_eq!(names, ["scene.xml", "ball.xml", "grey.xml", "a.obj", "top.obj"]);
}

#[test]
fn errors_in_included_files_name_both_places() {
    let files = [
        ("scene.xml", scene("<include filename=\"b.xml\"/>")),
        ("b.xml", "<scene version=\"3.0.0\">\n<shape type=\"bal\"/></scene>".to_owned()),
    ];
    let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
    let error = load_files(&files, &LoadOptions::default()).unwrap_err();
    // The wrong type is found when everything is read, the wrong element while the file is.
    assert!(error.file().ends_with("b.xml") && error.position.line == Some(2), "{error}");
    let broken = [files[0], ("b.xml", "<scene version=\"3.0.0\">\n<ball/></scene>")];
    let text = load_files(&broken, &LoadOptions::default()).unwrap_err().to_string();
    assert!(text.contains("b.xml:2:1") && text.contains("included at") && text.contains("scene.xml:3:1"), "{text}");
}

#[test]
fn the_command_line_sets_resolution_and_crop() {
    let film = |options: LoadOptions| load_files(&[("scene.xml", &scene(""))], &options).map(|l| (l.film, l.parts.camera.resolution()));
    let (size, camera) = film(LoadOptions { resolution: Some((100, 50)), ..LoadOptions::default() }).unwrap();
    assert_eq!((size.width, size.height, size.crop, camera), (100, 50, None, (100, 50)));
    let (size, camera) = film(LoadOptions { crop: Some([1, 1, 3, 2]), ..LoadOptions::default() }).unwrap();
    assert_eq!((size.width, size.height, size.crop, camera), (8, 4, Some([1, 1, 3, 2]), (3, 2)));
    for options in [
        LoadOptions { resolution: Some((0, 50)), ..LoadOptions::default() },
        LoadOptions { resolution: Some((1 << 20, 1 << 20)), ..LoadOptions::default() },
        LoadOptions { crop: Some([7, 0, 3, 2]), ..LoadOptions::default() },
        LoadOptions { crop: Some([u32::MAX, 0, 3, 2]), ..LoadOptions::default() },
        LoadOptions { crop: Some([0, 0, 0, 2]), ..LoadOptions::default() },
    ] {
        assert!(film(options.clone()).is_err(), "{options:?}");
    }
    let cropped = scene("").replace("<rfilter", "<integer name=\"crop_width\" value=\"4\"/><rfilter");
    let error = load_files(&[("scene.xml", &cropped)], &LoadOptions { resolution: Some((100, 50)), ..LoadOptions::default() }).unwrap_err();
    assert!(error.to_string().contains("--crop"), "{error}");
}

#[test]
fn the_hash_is_over_contents_and_nothing_else() {
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let xml = scene(
        "<shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape><shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape>",
    );
    let hash = |name: &str, xml: &str, obj: &str, options: &LoadOptions| {
        let loaded = load_files(&[(name, xml), ("a.obj", obj)], options).unwrap();
        assert_eq!(loaded.files.len(), 2, "a file named twice is read once");
        loaded.content_hash
    };
    let options = LoadOptions::default();
    let first = hash("scene.xml", &xml, triangle, &options);
    assert_eq!(first.len(), 64);
    assert_eq!(first, hash("other.xml", &xml, triangle, &options));
    assert_eq!(first, hash("scene.xml", &xml, triangle, &LoadOptions { resolution: Some((9, 9)), ..LoadOptions::default() }));
    assert_ne!(first, hash("scene.xml", &xml, &triangle.replace('1', "2").replace("f 2 2 3", "f 1 2 3"), &options));
    assert_ne!(first, hash("scene.xml", &format!("{xml}\n"), triangle, &options));
    // Both sums by hand: SHA-256 of the digests of "scene" and its files.
    let lone = load_files(&[("scene.xml", &scene(""))], &options).unwrap();
    assert_eq!(lone.files.len(), 1);
    assert_ne!(lone.content_hash, first);
}

#[test]
fn two_environments_and_two_sensors_are_refused() {
    assert!(refuse(SENSOR).to_string().contains("second sensor"));
    assert!(refuse("<emitter type=\"constant\"/><emitter type=\"constant\"/>").to_string().contains("second emitter around"));
}

#[test]
fn notes_name_file_and_line() {
    let loaded = load("<emitter type=\"point\">\n<float name=\"sampling_weight\" value=\"2\"/></emitter>");
    let note = &loaded.notes[0];
    assert!(note.line == Some(4) && note.to_string().contains("scene.xml:4: note:"), "{note}");
    assert_eq!(loaded.parts.camera.position(), Vec3::ZERO);
}
