//! Closed meshes let nothing out.

use crate::shapes::{Mesh, bumpy, cuboid};
use crate::{direction, point, rng, triangles};
use glam::Vec3;
use isophote::scene::accel::{Accel, Bvh, Primitive};
use isophote::scene::ray::Ray;
use rand::RngExt;
use rayon::prelude::*;

/// Closed meshes with a point inside, and how far from it the inside reaches for certain.
fn closed() -> Vec<(Mesh, Vec3, f32)> {
    let far = Vec3::new(900.0, -20.0, 55.0);
    let at = Vec3::new(0.3, 0.7, -0.2);
    vec![
        (bumpy(at, 1.0, 0.15, 60, 70), at, 0.6),
        (bumpy(far, 1.0, 0.1, 30, 40), far, 0.5),
        (bumpy(at, 1.0, 0.0, 3, 3), at, 0.05),
        (bumpy(Vec3::ZERO, 1.0, 0.0, 200, 4), Vec3::ZERO, 0.4),
        (cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)), Vec3::new(0.5, 1.0, 1.5), 0.5),
        (cuboid(Vec3::splat(-1e-3), Vec3::new(1e3, 1e-3, 1e-3)), Vec3::splat(2e-4), 2e-4),
    ]
}

fn leaks(mesh: usize, rays: u64, seed: u64) -> u64 {
    let (mesh, at, inside) = closed().swap_remove(mesh);
    let bvh = Bvh::build(&triangles(&mesh));
    let batches = rays.div_ceil(100_000);
    let batch = |batch: u64| {
        let mut rng = rng(seed.wrapping_mul(1 << 32) + batch);
        let mut missed = 0;
        for _ in 0..100_000 {
            let ray = Ray::new(at + point(&mut rng) * inside * 0.57, direction(&mut rng));
            missed += u64::from(bvh.closest(&ray).is_none());
        }
        missed
    };
    (0..batches).into_par_iter().map(batch).sum()
}

#[test]
fn random_rays_do_not_leak() {
    for mesh in 0..closed().len() {
        assert_eq!(leaks(mesh, 200_000, 5), 0, "mesh {mesh}");
    }
}

/// The long form of the above: `cargo test --release --test rays -- --ignored`.
#[test]
#[ignore = "half a minute to three"]
fn slow_hundred_million_random_rays_do_not_leak() {
    let count = closed().len();
    for mesh in 0..count {
        assert_eq!(leaks(mesh, 100_000_000 / count as u64 + 1, 6), 0, "mesh {mesh}");
    }
}

#[test]
fn rays_at_corners_and_edges_do_not_leak() {
    let mut rng = rng(7);
    for (n, (mesh, at, inside)) in closed().into_iter().enumerate() {
        let bvh = Bvh::build(&triangles(&mesh));
        let mut leaks = 0;
        for i in 0..100_000 {
            let t = mesh.triangles[rng.random_range(0..mesh.triangles.len())];
            let t = t.map(|i| mesh.corners[i as usize]);
            let target = if i % 2 == 0 { t[0] } else { t[0].lerp(t[1], rng.random()) };
            let o = at + point(&mut rng) * inside * 0.57;
            leaks += u32::from(bvh.closest(&Ray::new(o, target - o)).is_none());
        }
        assert_eq!(leaks, 0, "mesh {n}");
    }
}

/// A closed box of unit squares: every node boundary lies on the grid, and so do the rays.
#[test]
fn axis_parallel_rays_on_node_boundaries_do_not_leak() {
    let mut mesh = Mesh::default();
    let n = 12;
    for axis in 0..3 {
        for side in [0.0, n as f32] {
            for i in 0..n {
                for j in 0..n {
                    mesh.quad([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(p, q)| {
                        let mut x = Vec3::ZERO;
                        x[axis] = side;
                        x[(axis + 1) % 3] = (i + p) as f32;
                        x[(axis + 2) % 3] = (j + q) as f32;
                        x
                    }));
                }
            }
        }
    }
    for shift in [Vec3::ZERO, Vec3::new(1e3, -7.0, 0.1), Vec3::splat(-6.0)] {
        let mut moved = mesh.clone();
        moved.corners.iter_mut().for_each(|c| *c += shift);
        let bvh = Bvh::build(&triangles(&moved));
        for axis in 0..3 {
            for i in 1..n {
                for j in 1..n {
                    for zero in [0.0, -0.0, 1e-40, -1e-40, 1e-12] {
                        for (towards, nudge) in [(1.0, 0), (-1.0, 0), (1.0, 1), (-1.0, -1)] {
                            let mut o = Vec3::splat(5.25);
                            o[(axis + 1) % 3] = i as f32;
                            o[(axis + 2) % 3] = j as f32;
                            o += shift;
                            let x = &mut o[(axis + 1) % 3];
                            *x = match nudge {
                                1 => x.next_up(),
                                -1 => x.next_down(),
                                _ => *x,
                            };
                            let mut d = Vec3::splat(zero);
                            d[axis] = towards;
                            let ray = Ray::new(o, d);
                            assert!(bvh.closest(&ray).is_some() && bvh.occluded(&ray), "{ray:?}");
                        }
                    }
                }
            }
        }
    }
}

/// Origins as close to a corner of the mesh as f32 can put them still see the walls.
#[test]
fn origins_close_to_the_surface_do_not_leak() {
    let mut rng = rng(8);
    let bvh = Bvh::build(&triangles(&cuboid(Vec3::splat(3.0), Vec3::splat(4.0))));
    for _ in 0..300_000 {
        let mut o = point(&mut rng) * 0.5 + 3.5;
        for axis in 0..3 {
            for _ in 0..rng.random_range(0..4) {
                o[axis] = [3f32.next_up(), 4f32.next_down(), o[axis]][rng.random_range(0..3)];
            }
        }
        let ray = Ray::new(o, direction(&mut rng));
        assert!(bvh.closest(&ray).is_some(), "{ray:?}");
    }
}

/// An origin a few ulp off a triangle is on one side of it: it sees the triangle if and only if it looks towards it,
/// however flat it looks.
#[test]
fn sides_of_a_triangle_are_never_confused() {
    let mut rng = rng(16);
    for size in [1e-2f32, 1.0, 30.0] {
        for _ in 0..2000 {
            let at = point(&mut rng) * 2.0;
            let corners = [(); 3].map(|()| at + size * point(&mut rng));
            let bvh = Bvh::build(&[Primitive::Triangle(corners)]);
            let exact = corners.map(|c| c.as_dvec3());
            let n = (exact[1] - exact[0]).cross(exact[2] - exact[0]);
            let longest = (0..3).map(|i| exact[i].distance(exact[(i + 1) % 3])).fold(0.0, f64::max);
            let narrow = n.length() / longest;
            let n = n.normalize();
            let (u, v) = (0.1 + 0.3 * rng.random::<f32>(), 0.1 + 0.3 * rng.random::<f32>());
            let on = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
            for _ in 0..20 {
                let off = 8.0 * f32::EPSILON * on.abs().max_element() * (rng.random::<f32>() - 0.5);
                let o = on + n.as_vec3() * off;
                let height = n.dot(o.as_dvec3() - exact[0]);
                let flat = direction(&mut rng);
                let flat = flat - n.as_vec3() * flat.dot(n.as_vec3());
                let slope = 0.5 * (10.0 * (rng.random::<f32>() - 1.0)).exp2();
                let d = flat.normalize() + n.as_vec3() * slope * if rng.random() { 1.0 } else { -1.0 };
                let towards = -height * n.dot(d.as_dvec3());
                let way = height / n.dot(d.as_dvec3()) * d.as_dvec3().length();
                let hit = bvh.closest(&Ray::new(o, d));
                // Below 1e-11 the oracle itself is in doubt.
                if towards < -1e-11 {
                    assert!(hit.is_none(), "{corners:?} {o} {d}: {hit:?} at height {height}");
                } else if towards > 1e-11 && way.abs() < 0.05 * narrow {
                    assert!(hit.is_some(), "{corners:?} {o} {d}: none at height {height}");
                }
            }
        }
    }
}
