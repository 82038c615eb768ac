//! The ray accelerator: against brute force, for cracks, under scaling, and on input nobody would write.

mod cracks;
mod limits;
mod many;
mod oracle;
mod scaling;
mod shapes;

use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};
use isophote::scene::accel::{Accel, Bvh, Primitive};
use isophote::scene::ray::Ray;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f32::consts::TAU;

pub(crate) fn rng(seed: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed)
}

/// Uniform in `[-1, 1]^3`.
pub(crate) fn point(rng: &mut Pcg64Mcg) -> Vec3 {
    Vec3::new(rng.random(), rng.random(), rng.random()) * 2.0 - 1.0
}

pub(crate) fn direction(rng: &mut Pcg64Mcg) -> Vec3 {
    let z = 2.0 * rng.random::<f32>() - 1.0;
    let (s, c) = (TAU * rng.random::<f32>()).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * c, r * s, z)
}

pub(crate) fn triangles(mesh: &shapes::Mesh) -> Vec<Primitive> {
    mesh.soup().map(Primitive::Triangle).collect()
}

pub(crate) fn any_map(rng: &mut Pcg64Mcg) -> Affine3A {
    let turn = Mat3A::from_quat(Quat::from_axis_angle(direction(rng), TAU * rng.random::<f32>()));
    let stretch = (point(rng) * 0.5 + 0.6) * 0.5;
    let mut shear = Mat3A::IDENTITY;
    shear.x_axis.y = rng.random::<f32>() - 0.5;
    Affine3A { matrix3: turn * shear * Mat3A::from_diagonal(stretch), translation: Vec3A::from(point(rng)) }
}

pub(crate) fn mixture(count: usize, rng: &mut Pcg64Mcg) -> Vec<Primitive> {
    let one = |rng: &mut Pcg64Mcg| match rng.random_range(0..4) {
        0 => Primitive::Triangle([point(rng), point(rng), point(rng)]),
        1 => Primitive::Sphere { center: point(rng), radius: 0.02 + 0.3 * rng.random::<f32>() },
        2 => Primitive::Disk { to_world: any_map(rng) },
        _ => Primitive::Cylinder { to_world: any_map(rng) },
    };
    (0..count).map(|_| one(rng)).collect()
}

/// Rays of every habit: any length of direction, some parallel to axes or planes, some cut short.
pub(crate) fn any_ray(rng: &mut Pcg64Mcg) -> Ray {
    let mut d = direction(rng) * (4.0 * rng.random::<f32>() - 2.0).exp();
    for axis in 0..3 {
        if rng.random_range(0..6) == 0 && d.abs().max_element() > d[axis].abs() {
            d[axis] = if rng.random() { 0.0 } else { -0.0 };
        }
    }
    let t_max = if rng.random() { f32::INFINITY } else { 2.0 * rng.random::<f32>() };
    Ray { o: point(rng) * 1.5, d, t_max }
}

#[test]
fn triangle_soups_as_brute_force_has_them() {
    let mut rng = rng(1);
    for (count, size) in [(1, 1.0), (3, 0.5), (9, 1.0), (60, 0.4), (400, 0.1), (400, 1.0)] {
        let soup: Vec<_> = (0..count)
            .map(|_| {
                let at = point(&mut rng);
                Primitive::Triangle([(); 3].map(|()| at + size * point(&mut rng)))
            })
            .collect();
        let bvh = Bvh::build(&soup);
        for _ in 0..20_000 {
            oracle::check(&soup, &bvh, &any_ray(&mut rng));
        }
    }
}

#[test]
fn mixtures_as_brute_force_has_them() {
    let mut rng = rng(2);
    for count in [1, 2, 7, 30, 200] {
        let primitives = mixture(count, &mut rng);
        let bvh = Bvh::build(&primitives);
        assert_eq!(bvh.primitives(), count);
        for _ in 0..20_000 {
            oracle::check(&primitives, &bvh, &any_ray(&mut rng));
        }
    }
}

#[test]
fn tessellated_ball_as_brute_force_has_it() {
    let mut rng = rng(3);
    let ball = triangles(&shapes::bumpy(Vec3::new(0.1, -0.2, 0.3), 0.8, 0.1, 12, 15));
    let bvh = Bvh::build(&ball);
    for _ in 0..30_000 {
        oracle::check(&ball, &bvh, &any_ray(&mut rng));
    }
}

#[test]
fn the_same_list_gives_the_same_tree() {
    let mut rng = rng(4);
    let primitives = mixture(3000, &mut rng);
    let (a, b) = (Bvh::build(&primitives), Bvh::build(&primitives));
    assert_eq!((a.memory(), a.bounds()), (b.memory(), b.bounds()));
    for _ in 0..20_000 {
        let ray = any_ray(&mut rng);
        assert_eq!(a.closest(&ray), b.closest(&ray));
    }
}
