//! What a scene is built from: refusals, numbers, and lights whose radiance varies.

use super::kit::{Mean, expect_mean, pair, scene, stream};
use crate::math::Rgb;
use crate::samplers::Stream;
use crate::scene::bsdf::Bsdf;
use crate::scene::bsdf::diffuse::Diffuse;
use crate::scene::camera::{Camera, CameraDescription, FilmSpec};
use crate::scene::emitter::{Constant, Emitter, EmitterError, Envmap, Point, Spot};
use crate::scene::ray::Ray;
use crate::scene::shape::{Cylinder, Disk, Geometry, Mesh, Shape, ShapeError, Sphere};
use crate::scene::texture::{Checkerboard, Texture};
use crate::scene::{BsdfId, EmitterId, Scene, SceneCounts, SceneError, SceneParts, ShapeId};
use glam::{Affine2, Affine3A, Vec2, Vec3};

fn parts(geometry: Geometry, bsdf: u32, radiance: Option<Texture>, emitters: Vec<Emitter>) -> SceneParts {
    SceneParts {
        shapes: vec![Shape { name: "it".into(), geometry, bsdf: BsdfId(bsdf), radiance }],
        bsdfs: vec![Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::splat(0.5)) })],
        emitters,
        camera: Camera::new(CameraDescription::default(), FilmSpec::new(4, 3)).unwrap(),
    }
}

fn square() -> Geometry {
    Geometry::Mesh(Mesh::rectangle(Affine3A::IDENTITY, false))
}

#[test]
fn impossible_scenes_are_refused() {
    let refused = |parts| Scene::build(parts).err().unwrap();
    assert!(matches!(refused(parts(square(), 1, None, Vec::new())), SceneError::NoSuchBsdf { bsdf: 1, count: 1, .. }));
    let sky = || Emitter::Constant(Constant { radiance: Rgb::WHITE });
    assert!(matches!(refused(parts(square(), 0, None, vec![sky(), sky()])), SceneError::Environments(2)));
    let point = Emitter::Point(Point { position: Vec3::ONE, intensity: Rgb::new(1.0, -1.0, 1.0) });
    assert!(matches!(
        refused(parts(square(), 0, None, vec![point])),
        SceneError::Emitter { number: 0, source: EmitterError::Value { .. } }
    ));
    let broken = Mesh { triangles: vec![[0, 1, 2]], positions: vec![Vec3::ZERO; 2], ..Mesh::default() };
    let error = refused(parts(Geometry::Mesh(broken), 0, None, Vec::new()));
    assert_eq!(error.to_string(), "shape 'it': triangle 0 names vertex 2, but the mesh has 2 vertices");
    let uneven = Mesh { normals: Some(vec![Vec3::Z]), positions: vec![Vec3::ZERO; 2], ..Mesh::default() };
    assert!(matches!(
        refused(parts(Geometry::Mesh(uneven), 0, None, Vec::new())),
        SceneError::Shape { source: ShapeError::Uneven { .. }, .. }
    ));
}

#[test]
fn impossible_shapes_and_emitters_are_refused() {
    let stretched = Affine3A::from_scale(Vec3::new(2.0, 1.0, 1.0));
    let sheared = Affine3A::from_mat3(glam::Mat3::from_cols(Vec3::X, Vec3::new(0.5, 1.0, 0.0), Vec3::Z));
    assert_eq!(Sphere::new(Vec3::ZERO, 1.0, stretched, false).err(), Some(ShapeError::NotASphere));
    assert_eq!(Sphere::new(Vec3::ZERO, 0.0, Affine3A::IDENTITY, false).err(), Some(ShapeError::NoExtent));
    assert_eq!(Sphere::new(Vec3::ZERO, f32::NAN, Affine3A::IDENTITY, false).err(), Some(ShapeError::NotFinite("to_world")));
    assert!(Disk::new(stretched, false).is_ok() && Disk::new(sheared, false).is_ok());
    assert_eq!(Cylinder::new(Vec3::ZERO, Vec3::Z, 1.0, stretched, false).err(), Some(ShapeError::NotACylinder));
    assert_eq!(Cylinder::new(Vec3::ZERO, Vec3::Z, 1.0, sheared, false).err(), Some(ShapeError::NotACylinder));
    assert_eq!(Cylinder::new(Vec3::Z, Vec3::Z, 1.0, Affine3A::IDENTITY, false).err(), Some(ShapeError::NoExtent));
    assert!(Cylinder::new(Vec3::ZERO, Vec3::Z, 1.0, Affine3A::from_scale(Vec3::new(2.0, 2.0, 5.0)), false).is_ok());
    assert!(matches!(Spot::new(Affine3A::IDENTITY, Rgb::WHITE, 10.0, 20.0), Err(EmitterError::SpotAngles { .. })));
    let pixels = vec![Rgb::WHITE; 4];
    assert!(matches!(Envmap::new(2, 3, pixels.clone(), 1.0, Affine3A::IDENTITY), Err(EmitterError::EnvmapSize { .. })));
    assert!(matches!(Envmap::new(2, 2, pixels.clone(), -1.0, Affine3A::IDENTITY), Err(EmitterError::EnvmapPixel { .. })));
    assert!(matches!(Envmap::new(2, 2, pixels, 1.0, stretched), Err(EmitterError::EnvmapTransform)));
}

#[test]
fn a_scene_knows_what_it_holds() {
    let ball = Geometry::Sphere(Sphere::new(Vec3::X, 0.5, Affine3A::IDENTITY, false).unwrap());
    let sky = Emitter::Constant(Constant { radiance: Rgb::WHITE });
    let scene = scene(vec![(square(), None), (ball, Some(Rgb::WHITE))], vec![sky]);
    assert_eq!(scene.counts(), SceneCounts { shapes: 2, triangles: 2, quadrics: 1, bsdfs: 1, emitters: 2 });
    assert_eq!(
        (scene.environment(), scene.shapes()[1].emitter, scene.shapes()[1].kind),
        (Some(EmitterId(1)), Some(EmitterId(0)), "sphere")
    );
    assert_eq!(scene.shapes()[1].primitives, 2..3);
    let hit = scene.intersect(&Ray::new(Vec3::new(1.0, 0.0, 3.0), -Vec3::Z)).unwrap();
    assert_eq!((hit.shape, hit.prim, hit.emitter), (ShapeId(1), 2, Some(EmitterId(0))));
    let (center, radius) = scene.bounding_sphere();
    let bounds = scene.bounds().unwrap();
    assert!(bounds.min.abs_diff_eq(Vec3::new(-1.0, -1.0, -0.5), 1e-6) && bounds.max.abs_diff_eq(Vec3::new(1.5, 1.0, 0.5), 1e-6));
    assert!(center.distance(bounds.max) <= radius && radius < 1.001 * center.distance(bounds.max));
    assert!(scene.memory().accelerator > 0 && scene.memory().surfaces >= 3 * 64);
    assert!((0..2).map(|i| scene.pick_probability(EmitterId(i))).sum::<f32>() > 0.999_999);
}

#[test]
fn a_lights_radiance_may_vary_over_it() {
    let checks = Checkerboard {
        color0: Texture::grey(4.0),
        color1: Texture::Constant(Rgb::new(0.0, 1.0, 2.0)),
        to_uv: Affine2::from_scale(Vec2::new(3.0, 2.0)),
    };
    let scene = Scene::build(parts(square(), 0, Some(Texture::Checkerboard(Box::new(checks))), Vec::new())).unwrap();
    let (mut numbers, mut means) = (stream(1500), [Mean::default(), Mean::default(), Mean::default()]);
    for _ in 0..20_000 {
        let sample = scene.sample_emission(numbers.next_1d(), pair(&mut numbers), pair(&mut numbers));
        for (c, mean) in means.iter_mut().enumerate() {
            mean.add(sample.map_or(0.0, |s| f64::from(s.flux[c])));
        }
        let from = Vec3::new(0.3, -0.2, 1.5);
        let Some(sample) = scene.sample_direct(from, numbers.next_1d(), pair(&mut numbers)) else { continue };
        let hit = scene.intersect(&Ray::new(from, sample.wi)).unwrap();
        let edge = (hit.uv * Vec2::new(6.0, 4.0)).to_array().map(|x| (x - x.round()).abs()).into_iter().fold(1.0, f32::min);
        assert!(edge < 1e-5 || scene.emitted(&hit, -sample.wi, from).radiance == sample.radiance, "{sample:?} {hit:?}");
    }
    for (c, mean) in means.iter().enumerate() {
        let expected = 4.0 * std::f64::consts::PI * [2.0, 2.5, 3.0][c];
        expect_mean("flux", mean, expected, 0.0, 3);
        assert!((f64::from(scene.power(EmitterId(0))[c]) / expected - 1.0).abs() < 5e-3, "{:?}", scene.power(EmitterId(0)));
    }
}
