//! Numbers, transforms, shapes, materials and textures with their defaults, and with every parameter set.

use super::{load, load_files, scene};
use glam::{Affine3A, Vec2, Vec3};
use isophote::math::Rgb;
use isophote::scene::Scene;
use isophote::scene::bsdf::microfacet::{Microfacet, MicrofacetKind, NormalSampling};
use isophote::scene::bsdf::plastic::Plastic;
use isophote::scene::bsdf::roughplastic::RoughPlastic;
use isophote::scene::bsdf::{Bsdf, Lobes};
use isophote::scene::mitsuba::LoadOptions;
use isophote::scene::ray::Ray;
use isophote::scene::shape::{Geometry, Mesh};
use isophote::scene::texture::Texture;

/// The material of a scene's only shape.
fn bsdf(xml: &str) -> Bsdf {
    let loaded = load(&format!("<shape type=\"rectangle\">{xml}</shape>"));
    loaded.parts.bsdfs[loaded.parts.shapes[0].bsdf.0 as usize].clone()
}

fn constant(texture: &Texture) -> [f32; 3] {
    match texture {
        Texture::Constant(c) => c.to_array(),
        other => panic!("{other:?}"),
    }
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-5 * b.abs().max(1e-3)
}

#[track_caller]
fn assert_close(a: f32, b: f32) {
    assert!(close(a, b), "{a} is not {b}");
}

#[track_caller]
fn assert_colour(texture: &Texture, expected: [f32; 3]) {
    assert_eq!(constant(texture), expected);
}

// ---- numbers -------------------------------------------------------------------------------------------------------------------

#[test]
fn numbers_are_parted_by_blanks_or_commas() {
    for value in ["0.1 0.2 0.3", "0.1,0.2,0.3", ".1, .2, .3", " 1e-1\n2e-1\t3e-1 "] {
        let Bsdf::Diffuse(b) = bsdf(&format!("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"{value}\"/></bsdf>")) else {
            panic!()
        };
        assert_colour(&b.reflectance, [0.1, 0.2, 0.3]);
    }
}

#[test]
fn colours_may_be_one_number() {
    for element in ["rgb", "float", "spectrum"] {
        let Bsdf::Diffuse(b) = bsdf(&format!("<bsdf type=\"diffuse\"><{element} name=\"reflectance\" value=\".25\"/></bsdf>")) else {
            panic!()
        };
        assert_colour(&b.reflectance, [0.25; 3]);
    }
}

#[test]
fn points_may_be_written_three_ways() {
    for point in ["x=\"1\" y=\"2\" z=\"3\"", "value=\"1 2 3\"", "value=\"1,2,3\""] {
        let loaded = load(&format!("<shape type=\"sphere\"><point name=\"center\" {point}/></shape>"));
        let Geometry::Sphere(sphere) = &loaded.parts.shapes[0].geometry else { panic!() };
        assert_eq!(sphere.center(), Vec3::new(1.0, 2.0, 3.0));
    }
}

// ---- transforms ----------------------------------------------------------------------------------------------------------------

/// Where a transform takes the rectangle's corner (-1, -1, 0).
fn corner(operations: &str) -> Vec3 {
    let loaded = load(&format!("<shape type=\"rectangle\"><transform name=\"to_world\">{operations}</transform></shape>"));
    let Geometry::Mesh(mesh) = &loaded.parts.shapes[0].geometry else { panic!() };
    mesh.positions[0]
}

#[test]
fn transforms_apply_in_the_order_written() {
    let cases = [
        ("", Vec3::new(-1.0, -1.0, 0.0)),
        ("<translate x=\"1\" y=\"2\" z=\"3\"/>", Vec3::new(0.0, 1.0, 3.0)),
        ("<translate value=\"1 2 3\"/>", Vec3::new(0.0, 1.0, 3.0)),
        ("<translate y=\"2\"/>", Vec3::new(-1.0, 1.0, 0.0)),
        ("<scale value=\"2\"/>", Vec3::new(-2.0, -2.0, 0.0)),
        ("<scale x=\"2\"/>", Vec3::new(-2.0, -1.0, 0.0)),
        ("<scale value=\"2\"/><translate value=\"1\"/>", Vec3::new(-1.0, -1.0, 1.0)),
        ("<translate value=\"1\"/><scale value=\"2\"/>", Vec3::new(0.0, 0.0, 2.0)),
        ("<rotate z=\"1\" angle=\"90\"/>", Vec3::new(1.0, -1.0, 0.0)),
        ("<rotate value=\"0 0 1\" angle=\"90\"/>", Vec3::new(1.0, -1.0, 0.0)),
        ("<matrix value=\"1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1\"/>", Vec3::new(4.0, 5.0, 7.0)),
        ("<matrix value=\"0 1 0 -1 0 0 0 0 1\"/>", Vec3::new(-1.0, 1.0, 0.0)),
        // The columns are left (-z), up and the direction (+x).
        ("<lookat origin=\"1 2 3\" target=\"5 2 3\" up=\"0 1 0\"/>", Vec3::new(1.0, 1.0, 4.0)),
        ("<lookat origin=\"0,0,0\" target=\"0,0,1\"/>", Vec3::new(-1.0, 1.0, 0.0)),
    ];
    for (operations, expected) in cases {
        let found = corner(operations);
        assert!((found - expected).length() < 1e-5, "{operations} gives {found}, not {expected}");
    }
}

#[test]
fn an_axis_that_is_no_unit_vector_scales_as_in_mitsuba() {
    // Measured with 3.9.1: rows (1, 1, 1), (1, 1, -1), (-1, 1, 0).
    assert!((corner("<rotate x=\"1\" y=\"1\" angle=\"90\"/>") - Vec3::new(-2.0, -2.0, 0.0)).length() < 1e-5);
    let loaded = load("<shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"1\" y=\"1\" angle=\"90\"/></transform></shape>");
    assert!(loaded.notes[0].message.contains("unit axis"), "{:?}", loaded.notes);
}

// ---- shapes --------------------------------------------------------------------------------------------------------------------

fn geometry(xml: &str) -> Geometry {
    load(xml).parts.shapes.remove(0).geometry
}

fn same_mesh(a: &Geometry, b: &Mesh) -> bool {
    format!("{a:?}") == format!("{:?}", Geometry::Mesh(b.clone()))
}

#[test]
fn shapes_have_mitsubas_defaults() {
    assert!(same_mesh(&geometry("<shape type=\"rectangle\"/>"), &Mesh::rectangle(Affine3A::IDENTITY, false)));
    assert!(same_mesh(&geometry("<shape type=\"cube\"/>"), &Mesh::cube(Affine3A::IDENTITY, false)));
    let Geometry::Sphere(sphere) = geometry("<shape type=\"sphere\"/>") else { panic!() };
    assert_eq!((sphere.center(), sphere.radius()), (Vec3::ZERO, 1.0));
    assert!(matches!(geometry("<shape type=\"disk\"/>"), Geometry::Disk(_)));
    let axis =
        "<point name=\"p0\" x=\"0\" y=\"0\" z=\"0\"/><point name=\"p1\" x=\"0\" y=\"0\" z=\"1\"/><float name=\"radius\" value=\"1\"/>";
    let (plain, written) = (geometry("<shape type=\"cylinder\"/>"), geometry(&format!("<shape type=\"cylinder\">{axis}</shape>")));
    assert_eq!(format!("{plain:?}"), format!("{written:?}"));
}

#[test]
fn shapes_take_their_parameters() {
    let flip = "<boolean name=\"flip_normals\" value=\"true\"/>";
    assert!(same_mesh(&geometry(&format!("<shape type=\"rectangle\">{flip}</shape>")), &Mesh::rectangle(Affine3A::IDENTITY, true)));
    assert!(same_mesh(&geometry(&format!("<shape type=\"cube\">{flip}</shape>")), &Mesh::cube(Affine3A::IDENTITY, true)));
    let Geometry::Mesh(cube) = geometry("<shape type=\"cube\"><boolean name=\"face_normals\" value=\"true\"/></shape>") else { panic!() };
    assert!(cube.normals.is_none());
    let sphere = "<shape type=\"sphere\"><float name=\"radius\" value=\"2\"/><point name=\"center\" x=\"1\" y=\"0\" z=\"0\"/>\
                  <transform name=\"to_world\"><scale value=\"3\"/><translate y=\"1\"/></transform></shape>";
    let Geometry::Sphere(sphere) = geometry(sphere) else { panic!() };
    assert!(sphere.center().abs_diff_eq(Vec3::new(3.0, 1.0, 0.0), 1e-5) && close(sphere.radius(), 6.0));
    for kind in ["sphere", "disk", "cylinder"] {
        let (plain, flipped) =
            (geometry(&format!("<shape type=\"{kind}\"/>")), geometry(&format!("<shape type=\"{kind}\">{flip}</shape>")));
        assert_ne!(format!("{plain:?}"), format!("{flipped:?}"), "{kind}");
    }
}

#[test]
fn obj_files_take_their_parameters() {
    let file = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 .25\nf 1/1 2/1 3/1 4/1\n";
    let mesh = |parameters: &str| {
        let xml = scene(&format!("<shape type=\"obj\"><string name=\"filename\" value=\"meshes/a.obj\"/>{parameters}</shape>"));
        let mut loaded = load_files(&[("scene.xml", &xml), ("meshes/a.obj", file)], &LoadOptions::default()).unwrap();
        let Geometry::Mesh(mesh) = loaded.parts.shapes.remove(0).geometry else { panic!() };
        mesh
    };
    let plain = mesh("");
    assert_eq!((plain.triangles.len(), plain.flip_normals), (2, false));
    assert_eq!(plain.normals.as_ref().unwrap()[0], Vec3::Z);
    assert_eq!(plain.uvs.as_ref().unwrap()[0], Vec2::new(0.0, 0.75));
    assert!(mesh("<boolean name=\"face_normals\" value=\"true\"/>").normals.is_none());
    assert!(mesh("<boolean name=\"flip_normals\" value=\"true\"/>").flip_normals);
    assert_eq!(mesh("<boolean name=\"flip_tex_coords\" value=\"false\"/>").uvs.unwrap()[0], Vec2::new(0.0, 0.25));
    assert_eq!(mesh("<transform name=\"to_world\"><translate z=\"2\"/></transform>").positions[0], Vec3::new(0.0, 0.0, 2.0));
}

#[test]
fn shapes_without_material_are_grey_and_lamps_black() {
    let loaded = load("<shape type=\"sphere\"/><shape type=\"cube\"><emitter type=\"area\"/></shape><shape type=\"sphere\"/>");
    let reflectance = |shape: usize| match &loaded.parts.bsdfs[loaded.parts.shapes[shape].bsdf.0 as usize] {
        Bsdf::Diffuse(b) => constant(&b.reflectance),
        other => panic!("{other:?}"),
    };
    assert_eq!((reflectance(0), reflectance(1), reflectance(2)), ([0.5; 3], [0.0; 3], [0.5; 3]));
    assert!(loaded.parts.shapes[0].radiance.is_none());
    assert_colour(loaded.parts.shapes[1].radiance.as_ref().unwrap(), [1.0; 3]);
}

// ---- materials -----------------------------------------------------------------------------------------------------------------

#[test]
fn diffuse() {
    let Bsdf::Diffuse(b) = bsdf("<bsdf type=\"diffuse\"/>") else { panic!() };
    assert_colour(&b.reflectance, [0.5; 3]);
}

#[test]
fn twosided() {
    let Bsdf::TwoSided(b) = bsdf("<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf>") else { panic!() };
    assert!(matches!(*b.front, Bsdf::Diffuse(_)) && b.back.is_none());
    let Bsdf::TwoSided(b) = bsdf("<bsdf type=\"twosided\"><bsdf type=\"conductor\"/><bsdf type=\"diffuse\"/></bsdf>") else { panic!() };
    assert!(matches!(*b.front, Bsdf::Conductor(_)) && matches!(b.back.as_deref(), Some(Bsdf::Diffuse(_))));
}

#[test]
fn dielectric() {
    let Bsdf::Dielectric(b) = bsdf("<bsdf type=\"dielectric\"/>") else { panic!() };
    assert_close(b.eta, 1.5046 / 1.000277);
    assert_colour(&b.specular_reflectance, [1.0; 3]);
    assert_colour(&b.specular_transmittance, [1.0; 3]);
    let set = "<bsdf type=\"dielectric\"><string name=\"int_ior\" value=\"Water\"/><float name=\"ext_ior\" value=\"1\"/>\
               <rgb name=\"specular_reflectance\" value=\".1\"/><rgb name=\"specular_transmittance\" value=\".2\"/></bsdf>";
    let Bsdf::Dielectric(b) = bsdf(set) else { panic!() };
    assert_close(b.eta, 1.333);
    assert_colour(&b.specular_reflectance, [0.1; 3]);
    assert_colour(&b.specular_transmittance, [0.2; 3]);
}

#[test]
fn thindielectric() {
    let Bsdf::ThinDielectric(b) = bsdf("<bsdf type=\"thindielectric\"/>") else { panic!() };
    assert_close(b.eta, 1.5046 / 1.000277);
    let Bsdf::ThinDielectric(b) =
        bsdf("<bsdf type=\"thindielectric\"><integer name=\"int_ior\" value=\"2\"/><string name=\"ext_ior\" value=\"vacuum\"/></bsdf>")
    else {
        panic!()
    };
    assert_close(b.eta, 2.0);
}

#[test]
fn conductor() {
    let Bsdf::Conductor(b) = bsdf("<bsdf type=\"conductor\"/>") else { panic!() };
    assert_eq!((b.eta, b.k), (Rgb::BLACK, Rgb::WHITE));
    assert_colour(&b.specular_reflectance, [1.0; 3]);
    let Bsdf::Conductor(b) = bsdf("<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/></bsdf>") else { panic!() };
    assert_eq!((b.eta, b.k), (Rgb::BLACK, Rgb::WHITE));
    let Bsdf::Conductor(b) = bsdf("<bsdf type=\"conductor\"><rgb name=\"eta\" value=\"1 2 3\"/></bsdf>") else { panic!() };
    assert_eq!((b.eta, b.k), (Rgb::new(1.0, 2.0, 3.0), Rgb::WHITE));
    let Bsdf::Conductor(b) = bsdf("<bsdf type=\"conductor\"><string name=\"material\" value=\"Au\"/></bsdf>") else { panic!() };
    assert!(close(b.eta.r(), 0.143_036) && close(b.k.b(), 1.603_36), "{b:?}");
}

#[test]
fn roughconductor() {
    let Bsdf::RoughConductor(b) = bsdf("<bsdf type=\"roughconductor\"/>") else { panic!() };
    let d = b.distribution;
    assert_eq!((d.kind, d.alpha_u, d.alpha_v, d.sampling), (MicrofacetKind::Beckmann, 0.1, 0.1, NormalSampling::Visible));
    let set = "<bsdf type=\"roughconductor\"><string name=\"distribution\" value=\"GGX\"/><float name=\"alpha_u\" value=\".2\"/><float name=\"alpha_v\" value=\".3\"/>\
               <boolean name=\"sample_visible\" value=\"false\"/><rgb name=\"eta\" value=\"1\"/><rgb name=\"k\" value=\"2\"/><rgb name=\"specular_reflectance\" value=\".4\"/></bsdf>";
    let Bsdf::RoughConductor(b) = bsdf(set) else { panic!() };
    let d = b.distribution;
    assert_eq!((d.kind, d.alpha_u, d.alpha_v, d.sampling), (MicrofacetKind::Ggx, 0.2, 0.3, NormalSampling::All));
    assert_eq!((b.eta, b.k), (Rgb::WHITE, Rgb::splat(2.0)));
    assert_colour(&b.specular_reflectance, [0.4; 3]);
}

#[test]
fn roughdielectric() {
    let Bsdf::RoughDielectric(b) = bsdf("<bsdf type=\"roughdielectric\"/>") else { panic!() };
    assert_close(b.eta, 1.5046 / 1.000277);
    assert_eq!((b.distribution.kind, b.distribution.alpha_u), (MicrofacetKind::Beckmann, 0.1));
    let Bsdf::RoughDielectric(b) = bsdf("<bsdf type=\"roughdielectric\"><float name=\"alpha\" value=\".4\"/></bsdf>") else { panic!() };
    assert_eq!((b.distribution.alpha_u, b.distribution.alpha_v), (0.4, 0.4));
}

/// Two materials whose inside is hidden are the same if they scatter the same.
fn scatters_the_same(a: &Bsdf, b: &Bsdf) {
    for z in [0.3f32, 0.7, 0.95] {
        let wi = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
        for wo in [Vec3::Z, Vec3::new(-0.6, 0.0, 0.8), Vec3::new(0.0, 0.6, 0.8)] {
            assert_eq!(a.eval(Vec2::ZERO, wi, wo, Lobes::All), b.eval(Vec2::ZERO, wi, wo, Lobes::All), "{a:?} {b:?}");
        }
        assert_eq!(a.albedo(Vec2::ZERO, wi, Lobes::All), b.albedo(Vec2::ZERO, wi, Lobes::All), "{a:?} {b:?}");
    }
}

#[test]
fn plastic() {
    let expected = Plastic::new(1.49 / 1.000277, Texture::grey(0.5), Texture::grey(1.0), false);
    scatters_the_same(&bsdf("<bsdf type=\"plastic\"/>"), &Bsdf::Plastic(expected));
    let set = "<bsdf type=\"plastic\"><float name=\"int_ior\" value=\"1.9\"/><float name=\"ext_ior\" value=\"1\"/><rgb name=\"diffuse_reflectance\" value=\".1\"/>\
               <rgb name=\"specular_reflectance\" value=\".2\"/><boolean name=\"nonlinear\" value=\"true\"/></bsdf>";
    scatters_the_same(&bsdf(set), &Bsdf::Plastic(Plastic::new(1.9, Texture::grey(0.1), Texture::grey(0.2), true)));
}

#[test]
fn roughplastic() {
    let distribution = |kind, alpha| Microfacet { kind, alpha_u: alpha, alpha_v: alpha, sampling: NormalSampling::Visible };
    let expected =
        RoughPlastic::new(distribution(MicrofacetKind::Beckmann, 0.1), 1.49 / 1.000277, Texture::grey(0.5), Texture::grey(1.0), false);
    scatters_the_same(&bsdf("<bsdf type=\"roughplastic\"/>"), &Bsdf::RoughPlastic(Box::new(expected)));
    let set = "<bsdf type=\"roughplastic\"><string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\".3\"/><float name=\"int_ior\" value=\"1.5\"/>\
               <float name=\"ext_ior\" value=\"1\"/><boolean name=\"nonlinear\" value=\"true\"/></bsdf>";
    let expected = RoughPlastic::new(distribution(MicrofacetKind::Ggx, 0.3), 1.5, Texture::grey(0.5), Texture::grey(1.0), true);
    scatters_the_same(&bsdf(set), &Bsdf::RoughPlastic(Box::new(expected)));
}

#[test]
fn blend_and_mask() {
    let Bsdf::Blend(b) =
        bsdf("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\".25\"/><bsdf type=\"diffuse\"/><bsdf type=\"conductor\"/></bsdf>")
    else {
        panic!()
    };
    assert_colour(&b.weight, [0.25; 3]);
    assert!(matches!((&*b.first, &*b.second), (Bsdf::Diffuse(_), Bsdf::Conductor(_))));
    let Bsdf::Mask(b) = bsdf("<bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf>") else { panic!() };
    assert_colour(&b.opacity, [0.5; 3]);
    let Bsdf::Mask(b) = bsdf("<bsdf type=\"mask\"><float name=\"opacity\" value=\".9\"/><bsdf type=\"diffuse\"/></bsdf>") else { panic!() };
    assert_colour(&b.opacity, [0.9; 3]);
}

#[test]
fn phong_is_noted_as_foreign_to_mitsuba_3() {
    let Bsdf::Phong(b) = bsdf("<bsdf type=\"phong\"/>") else { panic!() };
    assert_colour(&b.diffuse_reflectance, [0.5; 3]);
    assert_colour(&b.specular_reflectance, [0.2; 3]);
    assert_eq!(b.exponent, 30.0);
    let loaded = load("<shape type=\"sphere\"><bsdf type=\"phong\"><integer name=\"exponent\" value=\"5\"/></bsdf></shape>");
    assert!(loaded.notes[0].message.contains("not a plugin of Mitsuba 3"), "{:?}", loaded.notes);
}

#[test]
fn very_small_alphas_are_raised_with_a_note() {
    let loaded = load("<shape type=\"sphere\"><bsdf type=\"roughconductor\"><float name=\"alpha\" value=\"1e-6\"/></bsdf></shape>");
    let Bsdf::RoughConductor(b) = &loaded.parts.bsdfs[0] else { panic!() };
    assert_eq!(b.distribution.alpha_u, 1e-4);
    assert!(loaded.notes[0].message.contains("raised"), "{:?}", loaded.notes);
}

#[test]
fn references_share_materials() {
    let loaded =
        load("<bsdf type=\"diffuse\" id=\"a\"/><shape type=\"sphere\"><ref id=\"a\"/></shape><shape type=\"cube\"><ref id=\"a\"/></shape>");
    assert_eq!(loaded.parts.bsdfs.len(), 1);
    // A reference may come before what it names.
    let loaded = load("<shape type=\"cube\"><ref id=\"a\"/></shape><bsdf type=\"conductor\" id=\"a\"/>");
    assert!(matches!(loaded.parts.bsdfs[0], Bsdf::Conductor(_)));
    let nested = "<bsdf type=\"diffuse\" id=\"a\"/><texture type=\"checkerboard\" id=\"t\"/><bsdf type=\"diffuse\" id=\"b\"><ref name=\"reflectance\" id=\"t\"/></bsdf>\
                  <bsdf type=\"blendbsdf\" id=\"c\"><float name=\"weight\" value=\".5\"/><ref id=\"a\"/><ref id=\"b\"/></bsdf><shape type=\"cube\"><ref id=\"c\"/></shape>";
    let Bsdf::Blend(b) = &load(nested).parts.bsdfs[0] else { panic!() };
    assert!(matches!(&*b.second, Bsdf::Diffuse(d) if matches!(d.reflectance, Texture::Checkerboard(_))));
}

// ---- textures ------------------------------------------------------------------------------------------------------------------

#[test]
fn checkerboard() {
    let Bsdf::Diffuse(b) = bsdf("<bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"checkerboard\"/></bsdf>") else { panic!() };
    let Texture::Checkerboard(c) = &b.reflectance else { panic!() };
    assert_eq!((c.color0.mean(), c.color1.mean()), (Rgb::splat(0.4), Rgb::splat(0.2)));
    let set = "<bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"checkerboard\"><rgb name=\"color0\" value=\".1\"/><rgb name=\"color1\" value=\".9 .8 .7\"/>\
               <transform name=\"to_uv\"><scale x=\"2\" y=\"3\"/><rotate z=\"1\" angle=\"30\"/><translate x=\".5\"/></transform></texture></bsdf>";
    let Bsdf::Diffuse(b) = bsdf(set) else { panic!() };
    let Texture::Checkerboard(c) = &b.reflectance else { panic!() };
    assert_eq!((c.color0.mean(), c.color1.mean()), (Rgb::splat(0.1), Rgb::new(0.9, 0.8, 0.7)));
    // Measured with Mitsuba 3.9.1: rows (1.73205, -1.5, .5) and (1, 2.59808, 0).
    let m = c.to_uv.matrix2;
    assert!(m.x_axis.abs_diff_eq(Vec2::new(1.732_05, 1.0), 1e-4) && m.y_axis.abs_diff_eq(Vec2::new(-1.5, 2.598_08), 1e-4), "{:?}", c.to_uv);
    assert!(c.to_uv.translation.abs_diff_eq(Vec2::new(0.5, 0.0), 1e-5));
}

/// A quadric's hits have texture coordinates where the shape's material or light has a texture in any place, and only there.
#[test]
fn coordinates_are_found_where_a_texture_asks() {
    let materials: [(&str, &str, &[&str]); 12] = [
        ("diffuse", "", &["reflectance"]),
        ("dielectric", "", &["specular_reflectance", "specular_transmittance"]),
        ("thindielectric", "", &["specular_reflectance", "specular_transmittance"]),
        ("roughdielectric", "", &["specular_reflectance", "specular_transmittance"]),
        ("conductor", "", &["specular_reflectance"]),
        ("roughconductor", "", &["specular_reflectance"]),
        ("plastic", "", &["diffuse_reflectance", "specular_reflectance"]),
        ("roughplastic", "", &["diffuse_reflectance", "specular_reflectance"]),
        ("phong", "", &["diffuse_reflectance", "specular_reflectance"]),
        ("mask", "<bsdf type=\"diffuse\"/>", &["opacity"]),
        ("blendbsdf", "<bsdf type=\"diffuse\"/><bsdf type=\"conductor\"/>", &["weight"]),
        ("twosided", "", &[]),
    ];
    let board = |name: &str| format!("<texture type=\"checkerboard\" name=\"{name}\"/>");
    let textured = format!("<bsdf type=\"diffuse\">{}</bsdf>", board("reflectance"));
    let plain = "<bsdf type=\"diffuse\"/>";
    // Plain ones first.
    let mut cases: Vec<(bool, String)> = Vec::new();
    for (name, nested, parameters) in materials {
        let nested = if name == "twosided" { plain } else { nested };
        let numbers = if name == "blendbsdf" { "<float name=\"weight\" value=\"0.3\"/>" } else { "" };
        cases.push((false, format!("<bsdf type=\"{name}\">{nested}{numbers}</bsdf>")));
        cases.extend(parameters.iter().map(|parameter| (true, format!("<bsdf type=\"{name}\">{nested}{}</bsdf>", board(parameter)))));
    }
    let within = |outside: &str, inside: &str| format!("<bsdf type=\"{outside}\">{inside}</bsdf>");
    let weight = "<float name=\"weight\" value=\"0.3\"/>";
    cases.extend([
        (true, within("mask", &textured)),
        (true, within("twosided", &textured)),
        (true, within("twosided", &format!("{plain}{textured}"))),
        (true, within("blendbsdf", &format!("{weight}{plain}{textured}"))),
        (true, within("blendbsdf", &format!("{weight}{textured}{plain}"))),
        (false, "<emitter type=\"area\"/>".to_owned()),
        (true, format!("<emitter type=\"area\">{}</emitter>", board("radiance"))),
    ]);
    for (asked, case) in cases {
        for shape in ["sphere", "cylinder"] {
            let scene = Scene::build(load(&format!("<shape type=\"{shape}\">{case}</shape>")).parts).unwrap();
            let ray = Ray::new(Vec3::new(3.0, 0.2, 0.3), Vec3::NEG_X);
            assert_eq!(scene.intersect(&ray).unwrap().uv != Vec2::ZERO, asked, "{shape}: {case}");
        }
    }
}
