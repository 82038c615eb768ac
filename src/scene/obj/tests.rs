use super::*;

fn options() -> ObjOptions {
    ObjOptions { to_world: DMat4::IDENTITY, normals: VertexNormals::FileOrComputed, flip_tex_coords: true, flip_normals: false }
}

fn mesh(text: &str) -> ObjMesh {
    read(text.as_bytes(), &options()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn quads_are_fanned_and_v_is_flipped() {
    let loaded = mesh(&format!("{SQUARE}vt 0 .25\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 2\nf 1/1/1 2/2/1 3/3/1 4/4/1\n"));
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(loaded.mesh.uvs.unwrap()[0], Vec2::new(0.0, 0.75));
    assert_eq!(loaded.mesh.normals.unwrap(), [Vec3::Z; 4]);
}

#[test]
fn relative_indices_groups_and_remarks_are_read() {
    let loaded = mesh(
        "\u{feff}# head\no a\ng b c\nusemtl x\ns 1\nv 0 0 0 # first\nv 1 0 0 1\nv 1 1 0 .5 .5 .5\nf -3 -2 -1\ng second\nv 0 1 0\nf 1 -2 -1\n",
    );
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(loaded.mesh.normals.unwrap().len(), 4, "vertices are shared across groups");
}

#[test]
fn missing_normals_are_weighted_by_angle() {
    // A corner of a cube whose sides are cut differently: by angle, not by number or area, the normal is the diagonal.
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 0\nf 1 5 2\nf 1 3 5\nf 1 2 4\nf 1 4 3\n";
    let normal = mesh(text).mesh.normals.unwrap()[0];
    let expected = -Vec3::ONE.normalize();
    assert!((normal - expected).length() < 1e-6, "{normal}");
}

#[test]
fn mixed_texture_coordinates_are_kept_apart() {
    let loaded = mesh(&format!("{SQUARE}vt .5 .5\nvt .7 .5\nf 1 2 3\nf 1/1 3/-1 4/1\n"));
    let uvs = loaded.mesh.uvs.unwrap();
    let of = |triangle: usize| loaded.mesh.triangles[triangle].map(|i| uvs[i as usize]);
    // (0, 0) of the file, flipped
    assert_eq!(of(0), [Vec2::new(0.0, 1.0); 3]);
    assert_eq!(of(1), [Vec2::new(0.5, 0.5), Vec2::new(0.7, 0.5), Vec2::new(0.5, 0.5)]);
    assert!(loaded.notes[0].contains("3 of 6 corners"), "{:?}", loaded.notes);
}

#[test]
fn triangles_without_area_are_counted() {
    let loaded = mesh(&format!("{SQUARE}f 1 2 3\nf 1 1 2\nf 1 2 2\n"));
    assert_eq!(loaded.mesh.triangles.len(), 1);
    assert!(loaded.notes[0].contains("2 of 3 triangles"), "{:?}", loaded.notes);
}

#[test]
fn transforms_reach_positions_and_normals() {
    let to_world = DMat4::from_translation(DVec3::X) * DMat4::from_scale(DVec3::new(2.0, 1.0, 1.0));
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 1 0\nf 1//1 2//1 3//1\n";
    let mesh = read(text.as_bytes(), &ObjOptions { to_world, ..options() }).unwrap().mesh;
    assert_eq!(mesh.positions[1], Vec3::new(3.0, 0.0, 0.0));
    assert!((mesh.normals.unwrap()[0] - Vec3::new(0.5, 1.0, 0.0).normalize()).length() < 1e-6);
}

#[test]
fn errors_name_the_line() {
    for (text, line, fragment) in [
        ("v 0 0 nan\nf 1 1 1", 1, "not finite"),
        ("v 0 0 0\nv 1e39 0 0\nv 0 1 0\nf 1 2 3", 2, "not finite"),
        ("v 0 0 0\nv 1 0 0\n\nf 1 2 3", 4, "vertex 3"),
        ("v 0 0\nf 1 1 1", 1, "2 numbers"),
        ("v 0 0 1.2.3\nf 1 1 1", 1, "not a number"),
        ("v 0 0 0\nf 1 1 -2", 2, "relative"),
        ("v 0 0 0\nf 1 1 -9223372036854775808", 2, "relative"),
        ("v 0 0 0\nf 1 1 9223372036854775807", 2, "beyond"),
        ("v 0 0 0\nf 0 1 1", 2, "start at 1"),
        ("v 0 0 0\nf 1 1", 2, "2 corners"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nf 1//1 2//1 3//1", 4, "without length"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1 2 3", 6, "names no normals"),
        ("v 0 0 0\ncurv 0 1 1", 2, "free-form"),
        ("v 0 0 0\nxyz 0", 2, "not a statement"),
        ("v 0 0 0 2\n", 1, "weight"),
    ] {
        let error = read(text.as_bytes(), &options()).expect_err(text);
        assert!(error.line == Some(line) && error.message.contains(fragment), "{text:?} gave {error}");
    }
}
