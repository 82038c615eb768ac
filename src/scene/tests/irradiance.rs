//! Light that arrives: by direct sampling, by rays that happen on lights, by photons that land, and by formula.

use super::kit::{Mean, expect_mean, expect_same, pair, scene, stream};
use super::sampling::lit;
use crate::math::{Frame, Rgb, warp};
use crate::samplers::Stream;
use crate::scene::Scene;
use crate::scene::emitter::{Constant, Directional, Emitter, EmitterKind, Envmap, Point, Spot};
use crate::scene::hit::Endpoint;
use crate::scene::ray::Ray;
use crate::scene::shape::{Disk, Geometry, Mesh, Sphere};
use glam::{Affine3A, Quat, Vec3};
use std::f64::consts::PI;

/// Above a point at the origin, facing down.
fn above(height: f32, side: f32) -> Affine3A {
    Affine3A::from_scale_rotation_translation(
        Vec3::splat(side),
        Quat::from_axis_angle(Vec3::X, std::f32::consts::PI),
        Vec3::new(0.0, 0.0, height),
    )
}

/// One estimate of the irradiance at `at` on the side of `n` by direct sampling, red channel.
fn direct(scene: &Scene, at: &Endpoint, n: Vec3, numbers: &mut impl Stream) -> f64 {
    let (pick, u) = (numbers.next_1d(), numbers.next_2d().into());
    let Some(sample) = scene.sample_direct(at.p, pick, u) else { return 0.0 };
    let cos = n.dot(sample.wi);
    if cos <= 0.0 || !scene.visible(at, &sample) {
        return 0.0;
    }
    f64::from(sample.radiance.r() * cos / sample.pdf.0)
}

#[test]
fn direct_sampling_finds_analytic_irradiances() {
    let alone = |geometry| scene(vec![(geometry, Some(Rgb::splat(2.0)))], Vec::new());
    let far = |emitter| {
        scene(vec![(Geometry::Sphere(Sphere::new(-3.0 * Vec3::Z, 1.0, Affine3A::IDENTITY, false).unwrap()), None)], vec![emitter])
    };
    let sphere = |center: Vec3, radius: f32| Geometry::Sphere(Sphere::new(center, radius, Affine3A::IDENTITY, false).unwrap());
    // Irradiance below the centre of a parallel square of half side a at height h: four times that below a corner.
    let square = |a: f64, h: f64| {
        let (x, root) = (a / h, (1.0 + (a / h).powi(2)).sqrt());
        4.0 * 2.0 * (x / root * (x / root).atan())
    };
    let cases: Vec<(&str, Scene, f64)> = vec![
        (
            "point",
            far(Emitter::Point(Point { position: Vec3::new(1.0, 0.0, 2.0), intensity: Rgb::splat(2.0) })),
            2.0 * 2.0 / 5f64.powf(1.5),
        ),
        ("directional", far(Emitter::Directional(Directional::new(Vec3::new(0.0, 3.0, -4.0), Rgb::splat(2.0)).unwrap())), 1.6),
        ("sphere", alone(sphere(Vec3::new(1.0, 0.0, 2.0), 0.5)), 2.0 * PI * 0.25 / 5.0 * 2.0 / 5f64.sqrt()),
        ("tiny sphere far away", alone(sphere(Vec3::new(0.0, 0.0, 1e4), 1e-2)), 2.0 * PI * 1e-12),
        ("sphere almost touching", alone(sphere(Vec3::new(0.0, 0.0, 1.0001), 1.0)), 2.0 * PI / (1.0001f64 * 1.0001)),
        ("rectangle", alone(Geometry::Mesh(Mesh::rectangle(above(1.5, 0.8), false))), square(0.8, 1.5)),
        ("disk", alone(Geometry::Disk(Disk::new(above(1.5, 0.8), false).unwrap())), 2.0 * PI * 0.64 / (0.64 + 2.25)),
        ("constant", far(Emitter::Constant(Constant { radiance: Rgb::splat(2.0) })), 2.0 * PI),
    ];
    let tests = cases.len();
    for (case, (name, scene, expected)) in cases.into_iter().enumerate() {
        let mut numbers = stream(1200 + case as u64);
        let mut mean = Mean::default();
        let at = Endpoint::free(Vec3::ZERO);
        (0..50_000).for_each(|_| mean.add(direct(&scene, &at, Vec3::Z, &mut numbers)));
        expect_mean(name, &mean, expected, 1e-5, tests);
    }
}

#[test]
fn rays_find_what_direct_sampling_finds() {
    let scenes = lit();
    let tests = 2 * scenes.len();
    for (case, (name, scene, from)) in scenes.iter().enumerate() {
        let mut numbers = stream(1300 + case as u64);
        let at = Endpoint::free(*from);
        for n in [Vec3::Z, -Vec3::Y] {
            let frame = Frame::from_normal(n);
            let (mut by_light, mut by_ray) = (Mean::default(), Mean::default());
            for _ in 0..30_000 {
                by_light.add(direct(scene, &at, n, &mut numbers));
                let d = frame.to_world(warp::cosine_hemisphere(pair(&mut numbers)));
                let found = match scene.intersect(&Ray::new(*from, d)) {
                    Some(hit) => scene.emitted(&hit, -d, *from),
                    None => scene.escaped(d),
                };
                by_ray.add(f64::from(found.radiance.r()) * PI);
            }
            if by_light.value() > 0.0 || by_ray.value() > 0.0 {
                expect_same(&format!("{name}, facing {n}"), &by_light, &by_ray, tests);
            }
        }
    }
}

/// Scenes with a receiver, shape 0: a square of side 1 facing up around the origin.
fn with_receiver() -> Vec<(&'static str, Scene)> {
    let receiver = || (Geometry::Mesh(Mesh::rectangle(Affine3A::from_scale(Vec3::splat(0.5)), false)), None);
    let blocker = || (Geometry::Sphere(Sphere::new(Vec3::new(0.2, 0.0, 0.5), 0.2, Affine3A::IDENTITY, false).unwrap()), None);
    let light = Rgb::splat(2.0);
    let shine = |geometry| scene(vec![receiver(), (geometry, Some(light)), blocker()], Vec::new());
    let lit_by = |emitters| scene(vec![receiver(), blocker()], emitters);
    let place = above(1.2, 0.5) * Affine3A::from_rotation_y(0.4);
    let octahedron = || {
        let corners = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        Mesh {
            positions: corners.map(|p| place.transform_point3(p)).to_vec(),
            normals: Some(corners.map(|p| place.transform_vector3(p).normalize()).to_vec()),
            triangles: vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]],
            ..Mesh::default()
        }
    };
    let pixels: Vec<Rgb> = (0..8 * 5).map(|i| Rgb::splat(((i * 37) % 11) as f32)).collect();
    let spot = Spot::new(Affine3A::from_translation(Vec3::new(0.0, 0.3, 1.5)) * Affine3A::from_axis_angle(Vec3::X, 2.8), light, 35.0, 10.0);
    let directional = Emitter::Directional(Directional::new(Vec3::new(0.2, 0.3, -1.0), light).unwrap());
    let point = Emitter::Point(Point { position: Vec3::new(0.3, 0.1, 0.9), intensity: light });
    vec![
        ("rectangle", shine(Geometry::Mesh(Mesh::rectangle(place, false)))),
        ("sphere", shine(Geometry::Sphere(Sphere::new(Vec3::ZERO, 1.0, place, false).unwrap()))),
        ("disk", shine(Geometry::Disk(Disk::new(place, false).unwrap()))),
        ("octahedron", shine(Geometry::Mesh(octahedron()))),
        ("point", lit_by(vec![point.clone()])),
        ("spot", lit_by(vec![Emitter::Spot(spot.unwrap())])),
        ("directional", lit_by(vec![directional.clone()])),
        ("constant", lit_by(vec![Emitter::Constant(Constant { radiance: light })])),
        ("envmap", lit_by(vec![Emitter::Envmap(Envmap::new(8, 5, pixels, 0.5, Affine3A::from_rotation_x(0.7)).unwrap())])),
        ("several", lit_by(vec![point, directional, Emitter::Constant(Constant { radiance: Rgb::splat(0.2) })])),
    ]
}

#[test]
fn photons_bring_what_direct_sampling_finds() {
    let scenes = with_receiver();
    let tests = scenes.len();
    for (case, (name, scene)) in scenes.iter().enumerate() {
        let mut numbers = stream(1400 + case as u64);
        let (mut by_light, mut by_photon) = (Mean::default(), Mean::default());
        for _ in 0..60_000 {
            // --- the receiver's mean irradiance; its area is 1
            let p = (pair(&mut numbers) - 0.5).extend(1.0);
            if let Some(hit) = scene.intersect(&Ray::new(p.with_z(1e-3), -Vec3::Z)) {
                by_light.add(direct(scene, &hit.end, Vec3::Z, &mut numbers));
            }
            // --- the flux that lands on it
            let sample = scene.sample_emission(numbers.next_1d(), pair(&mut numbers), pair(&mut numbers));
            let landed = sample.and_then(|s| {
                let hit = scene.intersect(&s.end.ray(s.d))?;
                (hit.shape.0 == 0 && s.d.z < 0.0).then_some(f64::from(s.flux.r()))
            });
            by_photon.add(landed.unwrap_or(0.0));
        }
        assert!(by_light.value() > 0.0, "{name}");
        expect_same(name, &by_light, &by_photon, tests);
    }
    let kinds: Vec<EmitterKind> = scenes.iter().flat_map(|(_, s)| s.emitters().iter().map(Emitter::kind)).collect();
    assert!(
        [EmitterKind::Surface, EmitterKind::DeltaPosition, EmitterKind::DeltaDirection, EmitterKind::Infinite]
            .iter()
            .all(|k| kinds.contains(k))
    );
}
