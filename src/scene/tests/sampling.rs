//! Samples of light are distributed as their densities say, and both ways of asking for a density agree.

use super::kit::{Mean, expect_counts, expect_mean, pair, scene, stream};
use crate::math::{Frame, Rgb};
use crate::samplers::Stream;
use crate::scene::Scene;
use crate::scene::emitter::{Constant, Directional, Emitter, EmitterKind, Envmap, Point, Spot};
use crate::scene::hit::Hit;
use crate::scene::ray::Ray;
use crate::scene::shape::{Cylinder, Disk, Geometry, Mesh, Sphere};
use glam::{Affine3A, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

const LIGHT: Rgb = Rgb::new(1.0, 2.0, 3.0);

/// An image with a bright spot, a black half row and noise.
fn image(width: usize, height: usize) -> Vec<Rgb> {
    let mut numbers = stream(700);
    let mut pixels: Vec<Rgb> = (0..width * height).map(|_| LIGHT * numbers.next_1d()).collect();
    pixels[width * (height / 3) + width / 4] = Rgb::new(80.0, 60.0, 40.0);
    for pixel in &mut pixels[width * (height / 2)..width * (height / 2) + width / 2] {
        *pixel = Rgb::BLACK;
    }
    pixels
}

/// A rotation.
fn turn() -> Affine3A {
    Affine3A::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.8)
}

/// An octahedron with normals that point away from its centre: they differ from the faces' by up to 55 degrees.
fn smooth_octahedron(map: Affine3A) -> Mesh {
    let corners = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    Mesh {
        positions: corners.map(|p| map.transform_point3(p)).to_vec(),
        normals: Some(corners.map(|p| map.transform_vector3(p).normalize()).to_vec()),
        triangles: vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]],
        ..Mesh::default()
    }
}

fn sphere(center: Vec3, radius: f32, inward: bool) -> Geometry {
    Geometry::Sphere(Sphere::new(center, radius, Affine3A::IDENTITY, inward).unwrap())
}

/// Lit scenes, each with the point of view from which direct sampling is tested. Every light is seen whole.
pub(super) fn lit() -> Vec<(&'static str, Scene, Vec3)> {
    let down = Affine3A::from_translation(Vec3::new(0.4, 0.2, 1.5)) * Affine3A::from_axis_angle(Vec3::X, 2.6);
    let shine = |geometry| scene(vec![(geometry, Some(LIGHT))], Vec::new());
    let distant = |emitter| scene(vec![(sphere(Vec3::ZERO, 0.3, false), None)], vec![emitter]);
    let env = |to_world| Emitter::Envmap(Envmap::new(9, 6, image(9, 6), 1.5, to_world).unwrap());
    let p0 = Vec3::new(0.1, -0.2, 0.0);
    vec![
        ("rectangle", shine(Geometry::Mesh(Mesh::rectangle(down, false))), p0),
        ("rectangle flipped", shine(Geometry::Mesh(Mesh::rectangle(down, true))), Vec3::new(0.3, 0.4, 3.0)),
        ("rectangle mirrored", shine(Geometry::Mesh(Mesh::rectangle(down * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)), false))), p0),
        ("cube", shine(Geometry::Mesh(Mesh::cube(down * Affine3A::from_scale(Vec3::new(0.5, 0.3, 0.4)), false))), p0),
        ("octahedron", shine(Geometry::Mesh(smooth_octahedron(down))), p0),
        ("disk", shine(Geometry::Disk(Disk::new(down * Affine3A::from_scale(Vec3::new(1.0, 0.6, 1.0)), false).unwrap())), p0),
        ("cylinder", shine(Geometry::Cylinder(Cylinder::new(Vec3::ZERO, Vec3::Z, 0.5, down, false).unwrap())), p0),
        ("cylinder from inside", shine(Geometry::Cylinder(Cylinder::new(-Vec3::Z, Vec3::Z, 1.0, turn(), true).unwrap())), p0),
        ("sphere", shine(sphere(Vec3::new(0.4, 0.2, 1.5), 0.8, false)), p0),
        ("sphere nearby", shine(sphere(Vec3::new(0.0, 0.0, 1.01), 1.0, false)), Vec3::ZERO),
        ("sphere from inside", shine(sphere(Vec3::ZERO, 1.0, true)), p0),
        ("constant", distant(Emitter::Constant(Constant { radiance: LIGHT })), Vec3::new(0.0, 0.0, 0.5)),
        ("envmap", distant(env(Affine3A::IDENTITY)), Vec3::new(0.0, 0.0, 0.5)),
        ("envmap turned", distant(env(turn())), Vec3::new(0.0, 0.0, 0.5)),
        (
            "several",
            scene(
                vec![
                    (Geometry::Mesh(Mesh::rectangle(down, false)), Some(Rgb::splat(3.0))),
                    (sphere(Vec3::new(0.0, -1.5, 0.0), 0.4, false), Some(LIGHT)),
                ],
                vec![Emitter::Constant(Constant { radiance: Rgb::splat(0.3) })],
            ),
            p0,
        ),
    ]
}

/// Density and radiance along `d` by the other way: what a ray that goes there finds. Hidden lights show as whatever hides them.
fn along(scene: &Scene, from: Vec3, d: Vec3) -> (f32, Rgb, Option<Hit>) {
    let hit = scene.intersect(&Ray::new(from, d));
    let found = hit.as_ref().map_or_else(|| scene.escaped(d), |hit| scene.emitted(hit, -d, from));
    (found.pdf_direct.0, found.radiance, hit)
}

#[test]
fn direct_samples_follow_their_density() {
    const N: usize = 60_000;
    let (rings, turns) = (16, 32);
    let scenes = lit();
    let count = scenes.len();
    for (case, (name, scene, from)) in scenes.into_iter().enumerate() {
        let mut numbers = stream(800 + case as u64);
        let mut counts = vec![0u64; rings * turns];
        let cell = |d: Vec3| {
            let ring = ((d.z + 1.0) * 0.5 * rings as f32) as usize;
            let turn = ((d.y.atan2(d.x) / TAU + 1.0).fract() * turns as f32) as usize;
            ring.min(rings - 1) * turns + turn.min(turns - 1)
        };
        let (mut compared, mut hidden) = (0, 0);
        for _ in 0..N {
            let Some(sample) = scene.sample_direct(from, numbers.next_1d(), pair(&mut numbers)) else { continue };
            let (pdf, radiance, hit) = along(&scene, from, sample.wi);
            // What a light hides of itself or of another is not in the density of rays.
            if hit.as_ref().is_some_and(|h| h.t <= sample.distance * 0.999) || (hit.is_some() && sample.kind == EmitterKind::Infinite) {
                hidden += 1;
                continue;
            }
            counts[cell(sample.wi)] += 1;
            // At the very edge rounding decides whether the ray meets the light.
            if !radiance.is_black() && hit.is_some() == (sample.kind == EmitterKind::Surface) {
                compared += 1;
                // On a curved surface under a grazing view, a rounding of the ray moves the hit by its inverse cosine.
                let on_surface = 4e-7 / sample.cos_light.powi(2);
                // Near an image's pole a rounding of the direction is much of the sine that the density is divided by.
                let bound = 5e-3 + if sample.kind == EmitterKind::Infinite { 2e-5 * pdf } else { on_surface };
                assert!((pdf / sample.pdf.0 - 1.0).abs() < bound, "{name}: sampled with {}, found with {pdf}: {sample:?}", sample.pdf.0);
                let error = (radiance - sample.radiance).map(f32::abs).max_component();
                assert!(error <= 2e-2 * radiance.max_component(), "{name}: sampled {:?}, found {radiance:?}", sample.radiance);
            }
        }
        assert!(compared + hidden > N / 20, "{name}: only {compared} were compared");
        // The density of a round light sampled by area has no bound at its outline, which no lattice can integrate; that its positions
        // are even and its densities those of the rays is tested all the same.
        if name == "cylinder" {
            continue;
        }
        let area = 4.0 * f64::from(PI) / (rings * turns) as f64;
        let density = |i: usize, part: u32| {
            // A lattice that no edge of a light runs along.
            let lattice = |step: f64| ((f64::from(part) + 0.5) * step).fract() as f32;
            let x = ((i % turns) as f32 + lattice(0.754_877_666_246_692_7)) / turns as f32;
            let z = ((i / turns) as f32 + lattice(0.569_840_290_998_053_2)) / rings as f32 * 2.0 - 1.0;
            let (sin, cos) = (TAU * x).sin_cos();
            let r = (1.0 - z * z).sqrt();
            f64::from(along(&scene, from, Vec3::new(r * cos, r * sin, z)).0)
        };
        let mean = |i: usize, parts: u32| (0..parts).map(|part| density(i, part)).sum::<f64>() / f64::from(parts);
        let expected: Vec<f64> = (0..rings * turns)
            .map(|i| {
                let (low, high) = (0..400).map(|part| density(i, part)).fold((f64::MAX, 0.0), |(a, b), x| (x.min(a), x.max(b)));
                // A light's edge runs through the cell, or nearly.
                let parts = if high > 1.5 * low { 16_000 } else { 400 };
                mean(i, parts) * area * N as f64
            })
            .collect();
        expect_counts(name, &counts, &expected, count);
    }
}

#[test]
fn an_images_density_integrates_to_one() {
    for size in [(9, 6), (2, 2), (32, 16)] {
        let pixels = image(size.0, size.1);
        let map = Emitter::Envmap(Envmap::new(size.0, size.1, pixels, 1.0, turn()).unwrap());
        let scene = scene(vec![(sphere(Vec3::ZERO, 1.0, false), None)], vec![map]);
        let (columns, rows) = (size.0 * 24, (size.1 - 1) * 48);
        let (mut total, mut light) = (0.0f64, [0.0f64; 3]);
        for i in 0..columns * rows {
            let phi = TAU * ((i % columns) as f32 + 0.5) / columns as f32;
            let theta = PI * ((i / columns) as f32 + 0.5) / rows as f32;
            let d = Vec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
            let found = scene.escaped(turn().transform_vector3(d));
            assert!(found.pdf_direct.0 > 0.0 || found.radiance.is_black(), "{size:?}: no density at {d}");
            let weight = f64::from(theta.sin()) * f64::from(TAU) * f64::from(PI) / (columns * rows) as f64;
            total += f64::from(found.pdf_direct.0) * weight;
            for (c, light) in light.iter_mut().enumerate() {
                *light += f64::from(found.radiance[c]) * weight;
            }
        }
        assert!((total - 1.0).abs() < 1e-3, "{size:?}: {total}");
        let (power, radius) = (scene.power(crate::scene::EmitterId(0)), scene.bounding_sphere().1);
        for (c, light) in light.iter().enumerate() {
            let expected = light * f64::from(PI * radius * radius);
            assert!((f64::from(power[c]) / expected - 1.0).abs() < 1e-3, "{size:?}: power {power:?}, expected {expected}");
        }
    }
}

/// Every emitter alone, and all together.
fn powered() -> Vec<(&'static str, Scene)> {
    let mut list: Vec<_> = lit().into_iter().map(|(name, scene, _)| (name, scene)).collect();
    let place = Affine3A::from_translation(Vec3::new(0.3, 0.1, 1.0)) * turn();
    let alone = |emitter: Emitter| scene(vec![(sphere(Vec3::ZERO, 0.3, false), None)], vec![emitter]);
    let spot = |cutoff, beam| Emitter::Spot(Spot::new(place, LIGHT, cutoff, beam).unwrap());
    let point = Emitter::Point(Point { position: Vec3::ONE, intensity: LIGHT });
    let directional = Emitter::Directional(Directional::new(Vec3::new(0.3, 0.2, -1.0), LIGHT).unwrap());
    list.push(("point", alone(point.clone())));
    list.push(("spot", alone(spot(40.0, 25.0))));
    list.push(("spot without falloff", alone(spot(100.0, 100.0))));
    list.push(("narrow spot", alone(spot(0.5, 0.0))));
    list.push(("directional", alone(directional.clone())));
    let dark = Emitter::Point(Point { position: Vec3::ONE, intensity: Rgb::BLACK });
    let rectangle = Geometry::Mesh(Mesh::rectangle(place, false));
    list.push(("all", scene(vec![(rectangle, Some(LIGHT))], vec![dark, point, spot(30.0, 10.0), directional])));
    list
}

#[test]
fn the_mean_flux_is_the_power() {
    let scenes = powered();
    let tests = 3 * scenes.len();
    for (case, (name, scene)) in scenes.into_iter().enumerate() {
        // Interpolated normals hide a part of this light, which its power does not know.
        if name == "octahedron" {
            continue;
        }
        let mut numbers = stream(900 + case as u64);
        let mut means = [Mean::default(), Mean::default(), Mean::default()];
        for _ in 0..20_000 {
            let sample = scene.sample_emission(numbers.next_1d(), pair(&mut numbers), pair(&mut numbers));
            let flux = sample.map_or(Rgb::BLACK, |s| s.flux);
            for (c, mean) in means.iter_mut().enumerate() {
                mean.add(f64::from(flux[c]));
            }
        }
        let power: Rgb = (0..scene.emitters().len()).map(|i| scene.power(crate::scene::EmitterId(i as u32))).sum();
        for (c, mean) in means.iter().enumerate() {
            expect_mean(&format!("{name}, channel {c}"), mean, f64::from(power[c]), 1e-4, tests);
        }
    }
}

#[test]
fn emission_covers_position_and_direction_evenly() {
    const N: usize = 40_000;
    let scenes = powered();
    let tests = scenes.len();
    for (case, (name, scene)) in scenes.into_iter().enumerate() {
        if matches!(name, "several" | "all" | "octahedron" | "cube") || name.starts_with("envmap") {
            continue;
        }
        let mut numbers = stream(1000 + case as u64);
        let cells = 4;
        let bin = |x: f32| ((x * cells as f32) as usize).min(cells - 1);
        let mut counts = vec![0u64; cells.pow(4)];
        let (center, radius) = scene.bounding_sphere();
        let mut n = 0;
        for _ in 0..N {
            let Some(sample) = scene.sample_emission(numbers.next_1d(), pair(&mut numbers), pair(&mut numbers)) else { continue };
            let azimuth = |v: Vec2| (v.y.atan2(v.x) / TAU + 1.0).fract();
            // --- four numbers that are uniform and independent if position and direction are
            let around = Frame::from_normal(match sample.kind {
                EmitterKind::Surface => sample.end.n_g,
                _ => Vec3::Z,
            });
            let local = around.to_local(sample.d);
            let direction = match sample.kind {
                EmitterKind::Surface => Vec2::new(local.z * local.z, azimuth(local.truncate())),
                EmitterKind::DeltaDirection => Vec2::ZERO,
                _ if name.contains("spot") => {
                    let axis = turn().transform_vector3(Vec3::Z);
                    let whole = if name == "spot" {
                        40.0
                    } else if name == "narrow spot" {
                        0.5
                    } else {
                        100.0f32
                    };
                    let local = Frame::from_normal(axis).to_local(sample.d);
                    let share = (0.5 * local.truncate().length().atan2(local.z)).sin() / (0.5 * whole.to_radians()).sin();
                    Vec2::new(share * share, azimuth(local.truncate()))
                }
                _ => Vec2::new(0.5 * (local.z + 1.0), azimuth(local.truncate())),
            };
            let position = match sample.kind {
                EmitterKind::Surface => {
                    let out = sample.end.n_g * 0.05;
                    let Some(hit) = scene.intersect(&Ray::new(sample.end.p + out, -out)) else { continue };
                    let (uv, pdf) = (hit.uv, scene.emission_pdf(&hit, sample.d));
                    assert!((pdf.position.0 / sample.pdf_position.0 - 1.0).abs() < 1e-4, "{name}: {pdf:?} {sample:?}");
                    assert!((pdf.direction.0 - sample.pdf_direction.0).abs() < 1e-3, "{name}: {pdf:?} {sample:?}");
                    match name.split(' ').next() {
                        Some("sphere") => Vec2::new(uv.x, 0.5 * (1.0 + (PI * uv.y).cos())),
                        Some("disk") => Vec2::new(uv.x * uv.x, uv.y),
                        _ => uv,
                    }
                }
                EmitterKind::DeltaPosition => Vec2::ZERO,
                EmitterKind::DeltaDirection | EmitterKind::Infinite => {
                    let on_disk = Frame::from_normal(sample.d).to_local(sample.end.p - center) / radius;
                    assert!((on_disk.z + 1.0).abs() < 1e-3, "{name}: {on_disk}");
                    Vec2::new(on_disk.truncate().length_squared(), azimuth(on_disk.truncate()))
                }
            };
            n += 1;
            counts[((bin(position.x) * cells + bin(position.y)) * cells + bin(direction.x)) * cells + bin(direction.y)] += 1;
        }
        assert!(n > N / 2, "{name}: only {n}");
        let live = counts.iter().filter(|&&c| c > 0).count();
        assert!(live == 16 || live == 256, "{name}: {live} cells are reached");
        let expected: Vec<f64> = counts.iter().map(|&c| if c > 0 || live == 256 { n as f64 / live as f64 } else { 0.0 }).collect();
        expect_counts(name, &counts, &expected, tests);
    }
}

#[test]
fn a_light_samples_emission_density_is_that_of_the_ray() {
    for (case, (name, scene, from)) in lit().into_iter().enumerate() {
        let mut numbers = stream(1100 + case as u64);
        let mut compared = 0;
        for _ in 0..2000 {
            let Some(sample) = scene.sample_direct(from, numbers.next_1d(), pair(&mut numbers)) else { continue };
            let ours = scene.emission_pdf_direct(&sample);
            let theirs = match scene.intersect(&Ray::new(from, sample.wi)) {
                Some(hit) if hit.emitter == Some(sample.emitter) && (hit.t / sample.distance - 1.0).abs() < 1e-3 => {
                    scene.emission_pdf(&hit, -sample.wi)
                }
                None if sample.kind == EmitterKind::Infinite => scene.emission_pdf_escaped(sample.wi),
                _ => continue,
            };
            if theirs.direction.0 == 0.0 {
                continue;
            }
            compared += 1;
            assert!((ours.position.0 / theirs.position.0 - 1.0).abs() < 1e-4, "{name}: {ours:?} {theirs:?}");
            let error = (ours.direction.0 - theirs.direction.0).abs();
            assert!(error < 2e-3 * (1.0 + theirs.direction.0), "{name}: {ours:?} {theirs:?}");
        }
        assert!(compared > 100, "{name}: only {compared}");
    }
}

#[test]
fn a_scene_without_light_gives_none() {
    let dark = Emitter::Point(Point { position: Vec3::ONE, intensity: Rgb::BLACK });
    for (shapes, emitters) in [
        (Vec::new(), Vec::new()),
        (vec![(sphere(Vec3::ZERO, 1.0, false), Some(Rgb::BLACK))], vec![dark]),
        (Vec::new(), vec![Emitter::Constant(Constant { radiance: LIGHT })]),
    ] {
        let scene = scene(shapes, emitters);
        assert!(scene.sample_direct(Vec3::ZERO, 0.5, Vec2::splat(0.5)).is_none());
        assert!(scene.sample_emission(0.5, Vec2::splat(0.5), Vec2::splat(0.5)).is_none());
        let escaped = scene.escaped(Vec3::Z);
        assert!(escaped.pdf_direct.0 == 0.0 && escaped.radiance.is_finite());
        assert_eq!(scene.emission_pdf_escaped(Vec3::Z).position.0, 0.0);
        if let Some(hit) = scene.intersect(&Ray::new(Vec3::new(0.0, 0.0, 3.0), -Vec3::Z)) {
            assert_eq!(scene.emitted(&hit, Vec3::Z, Vec3::new(0.0, 0.0, 3.0)).pdf_direct.0, 0.0);
        }
    }
}
