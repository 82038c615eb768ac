//! Emitters, sensors and films with their defaults, and with every parameter set.

use super::{load, load_files};
use glam::{Vec2, Vec3};
use isophote::math::Rgb;
use isophote::scene::camera::{FieldOfView, FovAxis, ThinLens};
use isophote::scene::emitter::Emitter;
use isophote::scene::mitsuba::{LoadOptions, LoadedParts};

// ---- emitters ------------------------------------------------------------------------------------------------------------------

fn emitter(xml: &str) -> Emitter {
    load(xml).parts.emitters.remove(0)
}

#[test]
fn point() {
    let Emitter::Point(e) = emitter("<emitter type=\"point\"/>") else { panic!() };
    assert_eq!((e.position, e.intensity), (Vec3::ZERO, Rgb::WHITE));
    let Emitter::Point(e) =
        emitter("<emitter type=\"point\"><point name=\"position\" value=\"1 2 3\"/><rgb name=\"intensity\" value=\"4 5 6\"/></emitter>")
    else {
        panic!()
    };
    assert_eq!((e.position, e.intensity), (Vec3::new(1.0, 2.0, 3.0), Rgb::new(4.0, 5.0, 6.0)));
    let Emitter::Point(e) = emitter("<emitter type=\"point\"><transform name=\"to_world\"><translate x=\"7\"/></transform></emitter>")
    else {
        panic!()
    };
    assert_eq!(e.position, Vec3::new(7.0, 0.0, 0.0));
}

#[test]
fn a_spectrum_on_an_emitter_is_the_equal_energy_spectrum() {
    let Emitter::Point(e) = emitter("<emitter type=\"point\"><spectrum name=\"intensity\" value=\"2\"/></emitter>") else { panic!() };
    // Measured with Mitsuba 3.9.1.
    for (found, expected) in e.intensity.to_array().into_iter().zip([2.409_59, 1.896_58, 1.817_83]) {
        assert!((found - expected).abs() < 1e-5, "{found} is not {expected}");
    }
    let Emitter::Point(e) = emitter("<emitter type=\"point\"><float name=\"intensity\" value=\"2\"/></emitter>") else { panic!() };
    assert_eq!(e.intensity, Rgb::splat(2.0));
}

#[test]
fn spot() {
    let written =
        "<float name=\"cutoff_angle\" value=\"20\"/><float name=\"beam_width\" value=\"15\"/><rgb name=\"intensity\" value=\"1\"/>";
    let (plain, set) = (emitter("<emitter type=\"spot\"/>"), emitter(&format!("<emitter type=\"spot\">{written}</emitter>")));
    assert_eq!(format!("{plain:?}"), format!("{set:?}"));
    let other = emitter("<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"40\"/></emitter>");
    let beam =
        emitter("<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"40\"/><float name=\"beam_width\" value=\"30\"/></emitter>");
    assert_eq!(format!("{other:?}"), format!("{beam:?}"), "the beam is three quarters of the cutoff");
    let Emitter::Spot(e) = emitter("<emitter type=\"spot\"><transform name=\"to_world\"><translate z=\"3\"/></transform></emitter>") else {
        panic!()
    };
    assert_eq!(e.position(), Vec3::new(0.0, 0.0, 3.0));
}

#[test]
fn directional_and_constant() {
    let Emitter::Directional(e) = emitter("<emitter type=\"directional\"/>") else { panic!() };
    assert_eq!(e.direction(), Vec3::Z);
    let Emitter::Directional(e) = emitter("<emitter type=\"directional\"><vector name=\"direction\" value=\"0 -2 0\"/></emitter>") else {
        panic!()
    };
    assert!(e.direction().abs_diff_eq(-Vec3::Y, 1e-6));
    let turned = "<emitter type=\"directional\"><transform name=\"to_world\"><rotate y=\"1\" angle=\"90\"/></transform></emitter>";
    let Emitter::Directional(e) = emitter(turned) else { panic!() };
    assert!(e.direction().abs_diff_eq(Vec3::X, 1e-6));
    let Emitter::Constant(e) = emitter("<emitter type=\"constant\"/>") else { panic!() };
    assert_eq!(e.radiance, Rgb::WHITE);
    let Emitter::Constant(e) = emitter("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1 2 3\"/></emitter>") else { panic!() };
    assert_eq!(e.radiance, Rgb::new(1.0, 2.0, 3.0));
}

#[test]
fn emitters_note_what_changes_noise_only() {
    let loaded = load("<emitter type=\"point\"><float name=\"sampling_weight\" value=\"2\"/></emitter>");
    assert!(loaded.notes[0].message.contains("sampling_weight"), "{:?}", loaded.notes);
}

// ---- sensor and film -----------------------------------------------------------------------------------------------------------

/// A scene whose sensor holds `xml`.
fn sensor(kind: &str, xml: &str) -> LoadedParts {
    let scene = format!("<scene version=\"3.0.0\"><sensor type=\"{kind}\">{xml}</sensor></scene>");
    load_files(&[("scene.xml", &scene)], &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn perspective() {
    let loaded = sensor("perspective", "");
    let d = loaded.parts.camera.description();
    assert_eq!((d.field_of_view, d.near_clip, d.far_clip, d.lens), (FieldOfView::FocalLength(50.0), 0.01, 1e4, None));
    assert_eq!((loaded.film.width, loaded.film.height, loaded.film.crop), (768, 576, None));
    assert_eq!(loaded.defaults.sample_count, 4);
    for (word, axis) in
        [("x", FovAxis::X), ("y", FovAxis::Y), ("diagonal", FovAxis::Diagonal), ("smaller", FovAxis::Smaller), ("larger", FovAxis::Larger)]
    {
        let loaded = sensor("perspective", &format!("<float name=\"fov\" value=\"40\"/><string name=\"fov_axis\" value=\"{word}\"/>"));
        assert_eq!(loaded.parts.camera.description().field_of_view, FieldOfView::Angle { degrees: 40.0, axis });
    }
    let set = "<string name=\"focal_length\" value=\"35mm\"/><float name=\"near_clip\" value=\".1\"/><float name=\"far_clip\" value=\"10\"/>\
               <float name=\"principal_point_offset_x\" value=\".25\"/><float name=\"principal_point_offset_y\" value=\"-.5\"/><float name=\"focus_distance\" value=\"3\"/>\
               <float name=\"shutter_close\" value=\"1\"/><transform name=\"to_world\"><translate x=\"1\"/></transform>";
    let loaded = sensor("perspective", set);
    let d = loaded.parts.camera.description();
    assert_eq!((d.field_of_view, d.near_clip, d.far_clip), (FieldOfView::FocalLength(35.0), 0.1, 10.0));
    assert_eq!((d.principal_point_offset, Vec3::from(d.to_world.translation)), (Vec2::new(0.25, -0.5), Vec3::X));
    for name in ["focus_distance", "shutter_close"] {
        assert!(loaded.notes.iter().any(|n| n.message.contains(name)), "{:?}", loaded.notes);
    }
}

#[test]
fn thinlens() {
    let loaded = sensor("thinlens", "<float name=\"aperture_radius\" value=\".5\"/>");
    assert_eq!(loaded.parts.camera.description().lens, Some(ThinLens { aperture_radius: 0.5, focus_distance: 1e4 }));
    let loaded = sensor("thinlens", "<float name=\"aperture_radius\" value=\".5\"/><float name=\"focus_distance\" value=\"3\"/>");
    assert_eq!(loaded.parts.camera.description().lens, Some(ThinLens { aperture_radius: 0.5, focus_distance: 3.0 }));
}

#[test]
fn hdrfilm() {
    let set = "<film type=\"hdrfilm\"><integer name=\"width\" value=\"64\"/><integer name=\"height\" value=\"32\"/><integer name=\"crop_offset_x\" value=\"1\"/>\
               <integer name=\"crop_offset_y\" value=\"2\"/><integer name=\"crop_width\" value=\"10\"/><integer name=\"crop_height\" value=\"20\"/>\
               <string name=\"file_format\" value=\"openexr\"/><string name=\"pixel_format\" value=\"rgba\"/><string name=\"component_format\" value=\"float16\"/>\
               <boolean name=\"banner\" value=\"false\"/><boolean name=\"sample_border\" value=\"true\"/><rfilter type=\"gaussian\"><float name=\"stddev\" value=\".4\"/></rfilter></film>";
    let loaded = sensor("perspective", set);
    assert_eq!((loaded.film.width, loaded.film.height, loaded.film.crop), (64, 32, Some([1, 2, 10, 20])));
    assert_eq!(loaded.parts.camera.resolution(), (10, 20));
    for name in ["file_format", "pixel_format", "component_format", "banner", "sample_border", "gaussian rfilter"] {
        assert!(loaded.notes.iter().any(|n| n.message.contains(name)), "{name} in {:?}", loaded.notes);
    }
    let boxed = sensor("perspective", "<film type=\"hdrfilm\"><rfilter type=\"box\"/></film>");
    assert!(boxed.notes.is_empty(), "{:?}", boxed.notes);
}

#[test]
fn sampler_and_integrator() {
    let loaded = sensor(
        "perspective",
        "<sampler type=\"multijitter\"><integer name=\"sample_count\" value=\"99\"/><integer name=\"seed\" value=\"1\"/></sampler>",
    );
    assert_eq!(loaded.defaults.sample_count, 99);
    assert!(
        loaded.notes.iter().any(|n| n.message.contains("multijitter")) && loaded.notes.iter().any(|n| n.message.contains("seed")),
        "{:?}",
        loaded.notes
    );

    let none = load("").defaults;
    assert_eq!((none.max_depth, none.rr_depth, none.hide_emitters, none.integrator), (None, 5, false, None));
    let set = "<integrator type=\"volpath\"><integer name=\"max_depth\" value=\"7\"/><integer name=\"rr_depth\" value=\"3\"/><boolean name=\"hide_emitters\" value=\"true\"/>\
               <integer name=\"block_size\" value=\"32\"/></integrator>";
    let loaded = load(set);
    let d = &loaded.defaults;
    assert_eq!((d.max_depth, d.rr_depth, d.hide_emitters, d.integrator.as_deref()), (Some(7), 3, true, Some("volpath")));
    assert!(loaded.notes[0].message.contains("block_size"), "{:?}", loaded.notes);
    assert_eq!(load("<integrator type=\"path\"><integer name=\"max_depth\" value=\"-1\"/></integrator>").defaults.max_depth, None);
    let nested = load(
        "<integrator type=\"aov\"><string name=\"aovs\" value=\"dd:depth\"/><integrator type=\"path\"><integer name=\"max_depth\" value=\"4\"/></integrator></integrator>",
    );
    assert_eq!((nested.defaults.max_depth, nested.defaults.integrator.as_deref()), (Some(4), Some("aov")));
}
