//! Rays that leave a surface do not meet it again, at any scale and anywhere.

use super::kit::{pair, scene, stream};
use crate::math::{Frame, warp};
use crate::samplers::Stream;
use crate::scene::Scene;
use crate::scene::ray::Ray;
use crate::scene::shape::{Cylinder, Disk, Geometry, Mesh, Sphere};
use glam::{Affine3A, Quat, Vec2, Vec3};

const RAYS: usize = 100_000;

/// Every shape under a map.
fn shapes(map: Affine3A) -> Vec<(&'static str, Geometry)> {
    let corners = [Vec3::new(-1.0, -0.4, 0.2), Vec3::new(0.9, -0.8, -0.3), Vec3::new(0.1, 1.0, 0.4)];
    let triangle = Mesh { positions: corners.map(|p| map.transform_point3(p)).to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
    vec![
        ("triangle", Geometry::Mesh(triangle)),
        ("rectangle", Geometry::Mesh(Mesh::rectangle(map, false))),
        ("cube", Geometry::Mesh(Mesh::cube(map, false))),
        ("sphere", Geometry::Sphere(Sphere::new(Vec3::ZERO, 1.0, map, false).unwrap())),
        ("disk", Geometry::Disk(Disk::new(map, false).unwrap())),
        ("cylinder", Geometry::Cylinder(Cylinder::new(Vec3::new(0.0, 0.0, -1.0), Vec3::Z, 0.7, map, false).unwrap())),
    ]
}

/// Maps at every scale, near the origin and a thousand times the scale away from it.
fn maps() -> Vec<(f32, Affine3A)> {
    let turn = Quat::from_axis_angle(Vec3::new(0.3, -0.8, 0.5).normalize(), 0.9);
    let mut maps = Vec::new();
    for scale in [1e-3f32, 1.0, 1e3] {
        for away in [Vec3::ZERO, Vec3::new(1000.0, -700.0, 400.0)] {
            maps.push((scale, Affine3A::from_scale_rotation_translation(Vec3::splat(scale), turn, away * scale)));
        }
    }
    maps
}

/// A ray towards the shape from all around it.
fn towards(numbers: &mut crate::samplers::UniformStream, map: &Affine3A) -> Ray {
    let from = warp::sphere(pair(numbers)) * 3.0;
    let to = warp::sphere(pair(numbers)) * numbers.next_1d();
    let (from, to) = (map.transform_point3(from), map.transform_point3(to));
    Ray::new(from, (to - from).normalize())
}

#[test]
fn rays_that_leave_a_convex_surface_outwards_meet_nothing() {
    let mut case = 0;
    for (scale, map) in maps() {
        for (name, geometry) in shapes(map) {
            case += 1;
            let mut numbers = stream(200 + case);
            let flat = matches!(name, "triangle" | "rectangle" | "disk");
            let scene = scene(vec![(geometry, None)], Vec::new());
            let (mut left, mut met, mut first) = (0, 0, None);
            for _ in 0..RAYS / 6 {
                let Some(hit) = scene.intersect(&towards(&mut numbers, &map)) else { continue };
                let mut local = warp::cosine_hemisphere(pair(&mut numbers));
                // A third of them grazing.
                if numbers.next_1d() < 0.33 {
                    local = (local * Vec3::new(1.0, 1.0, 1e-4)).normalize();
                }
                if flat && numbers.next_1d() < 0.5 {
                    local.z = -local.z;
                }
                let d = Frame::from_normal(hit.end.n_g).to_world(local);
                left += 1;
                if let Some(again) = scene.intersect(&hit.end.ray(d)) {
                    met += 1;
                    first.get_or_insert((hit, d, again));
                }
            }
            assert!(left > RAYS / 60, "{name} at scale {scale}: only {left} rays");
            assert_eq!(met, 0, "{name} at scale {scale}, {map:?}: {met} of {left} rays met it again, first {first:?}");
        }
    }
}

#[test]
fn rays_inside_a_hollow_cross_it() {
    let mut case = 0;
    for (scale, map) in maps() {
        let radius = scale;
        for (name, geometry) in shapes(map).into_iter().filter(|(name, _)| matches!(*name, "cube" | "sphere")) {
            case += 1;
            let mut numbers = stream(300 + case);
            let scene = scene(vec![(geometry, None)], Vec::new());
            let center = Vec3::from(map.translation);
            let (mut stuck, mut escaped, mut blocked) = (0, 0, 0);
            let n = RAYS / 10;
            for _ in 0..n {
                let start = scene.intersect(&Ray::new(center, warp::sphere(pair(&mut numbers)))).unwrap();
                let d = Frame::from_normal(-start.end.n_g).to_world(warp::cosine_hemisphere(pair(&mut numbers)));
                match scene.intersect(&start.end.ray(d)) {
                    None => escaped += 1,
                    Some(far) => {
                        let cos = -d.dot(start.end.n_g);
                        // A sphere's chord is exactly 2 r cos; in a cube the other faces may be near, but the same plane may not be.
                        let shortest = if name == "sphere" { radius * cos } else { 0.0 };
                        let same_face = name == "cube" && far.end.n_g.dot(start.end.n_g) > 0.9;
                        stuck += usize::from(same_face || far.t < shortest);
                        blocked += usize::from(!same_face && scene.occluded(&start.end, &far.end) && cos > 1e-3);
                    }
                }
            }
            assert_eq!((stuck, escaped, blocked), (0, 0, 0), "{name} at scale {scale}, {map:?}: of {n} rays (stuck, escaped, blocked)");
        }
    }
}

/// How far a point on the unit cube is from the cube's nearest edge, in units of the cube.
fn from_edge(map: &Affine3A, p: Vec3) -> f32 {
    let mut local = map.inverse().transform_point3(p).abs().to_array();
    local.sort_by(f32::total_cmp);
    1.0 - local[1]
}

#[test]
fn points_on_different_walls_see_each_other() {
    let mut case = 0;
    for (scale, map) in maps() {
        for (name, geometry) in shapes(map).into_iter().filter(|(name, _)| matches!(*name, "cube" | "sphere")) {
            case += 1;
            let mut numbers = stream(400 + case);
            let scene: Scene = scene(vec![(geometry, None)], Vec::new());
            let center = Vec3::from(map.translation);
            let mut wall = || scene.intersect(&Ray::new(center, warp::sphere(pair(&mut numbers)))).unwrap();
            let (mut pairs, mut blocked) = (0, 0);
            for _ in 0..RAYS / 10 {
                let (a, b) = (wall(), wall());
                let d = (b.end.p - a.end.p).normalize();
                // Within one wall a segment lies in the surface: no light goes there. A point nearer to the next wall than its own error
                // may lie beyond it.
                let one_wall = name == "cube" && a.end.n_g.dot(b.end.n_g) > 0.9;
                let on_edge = name == "cube" && [a, b].iter().any(|h| from_edge(&map, h.end.p) * scale < 4.0 * h.end.offset);
                if one_wall || on_edge || a.end.n_g.dot(d).abs() < 1e-3 || b.end.n_g.dot(d).abs() < 1e-3 {
                    continue;
                }
                pairs += 1;
                blocked += usize::from(scene.occluded(&a.end, &b.end));
            }
            assert_eq!(blocked, 0, "{name} at scale {scale}: {blocked} of {pairs} pairs are blocked");
        }
    }
}

#[test]
fn a_hit_lies_on_its_surface_within_its_bound() {
    for (case, (scale, map)) in maps().into_iter().enumerate() {
        let mut numbers = stream(500 + case as u64);
        for (name, geometry) in shapes(map) {
            let scene = scene(vec![(geometry, None)], Vec::new());
            for _ in 0..2000 {
                let ray = towards(&mut numbers, &map);
                let Some(hit) = scene.intersect(&ray) else { continue };
                assert!((hit.end.n_g.length() - 1.0).abs() < 1e-6 && (hit.frame.n.length() - 1.0).abs() < 1e-6, "{name}");
                assert_eq!(hit.frame.n, hit.end.n_g, "{name}: flat and analytic shapes shade as they are");
                // The exact distance to a sphere's surface; flat ones by how a ray from either side is stopped.
                if name == "sphere" {
                    let center = Vec3::from(map.translation).as_dvec3();
                    let off = (hit.end.p.as_dvec3().distance(center) - f64::from(scale)).abs();
                    // The radius itself is rounded once.
                    assert!(
                        off <= f64::from(hit.end.offset) + f64::from(scale) * 1e-6,
                        "{name} at {scale}: off by {off}, bound {}",
                        hit.end.offset
                    );
                }
                let along = ray.o + ray.d * hit.t;
                let bound = 1e-6 * (ray.o.abs().max_element() + hit.t) + hit.end.offset * 4.0;
                assert!(along.distance(hit.end.p) < 8.0 * bound, "{name} at {scale}: {} against {along}", hit.end.p);
                // Next to the surface, and no further than a few ulp of the position.
                let reach = hit.end.p.abs().max_element().max(scale);
                assert!(hit.end.offset <= 4e-6 * reach, "{name} at {scale}: offset {}", hit.end.offset);
            }
        }
    }
}

#[test]
fn normals_that_cancel_fall_back_to_the_geometry() {
    let mut mesh = Mesh::rectangle(Affine3A::IDENTITY, false);
    mesh.normals = Some(vec![Vec3::X, -Vec3::X, Vec3::X, -Vec3::X]);
    let scene = scene(vec![(Geometry::Mesh(mesh), None)], Vec::new());
    let mut numbers = stream(600);
    for _ in 0..1000 {
        let p = pair(&mut numbers) * 2.0 - Vec2::ONE;
        let hit = scene.intersect(&Ray::new(p.extend(1.0), -Vec3::Z)).unwrap();
        assert!((hit.frame.n.length() - 1.0).abs() < 1e-5, "{hit:?}");
    }
}
