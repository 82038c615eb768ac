//! Units do not matter: no length is built in.

use crate::{any_ray, direction, mixture, point, rng, shapes, triangles};
use glam::{Affine3A, Vec3};
use isophote::scene::accel::{Accel, Bvh, Primitive};
use isophote::scene::ray::Ray;

fn scaled(primitive: &Primitive, s: f32) -> Primitive {
    let scale = |m: &Affine3A| Affine3A { matrix3: m.matrix3 * s, translation: m.translation * s };
    match primitive {
        Primitive::Triangle(corners) => Primitive::Triangle(corners.map(|c| c * s)),
        Primitive::Sphere { center, radius } => Primitive::Sphere { center: *center * s, radius: radius * s },
        Primitive::Disk { to_world } => Primitive::Disk { to_world: scale(to_world) },
        Primitive::Cylinder { to_world } => Primitive::Cylinder { to_world: scale(to_world) },
    }
}

#[test]
fn powers_of_two_change_no_bit() {
    let mut rng = rng(9);
    let primitives = mixture(200, &mut rng);
    let rays: Vec<_> = (0..5000).map(|_| any_ray(&mut rng)).collect();
    let plain = Bvh::build(&primitives);
    for exponent in [-30, -17, -3, 1, 12, 30] {
        let s = 2f32.powi(exponent);
        let larger: Vec<_> = primitives.iter().map(|p| scaled(p, s)).collect();
        let larger = Bvh::build(&larger);
        for ray in &rays {
            let here = plain.closest(ray);
            let moved = Ray { o: ray.o * s, d: ray.d, t_max: ray.t_max * s };
            let there = larger.closest(&moved);
            assert_eq!(here.map(|h| (h.t * s, h.u, h.v, h.prim)), there.map(|h| (h.t, h.u, h.v, h.prim)));
            let longer = Ray { o: ray.o, d: ray.d * s, t_max: ray.t_max / s };
            let there = plain.closest(&longer);
            assert_eq!(here.map(|h| (h.t / s, h.u, h.v, h.prim)), there.map(|h| (h.t, h.u, h.v, h.prim)));
            assert_eq!(here.is_some(), plain.occluded(&longer));
        }
    }
}

#[test]
fn millimetres_and_kilometres_are_alike() {
    let ball = shapes::bumpy(Vec3::new(0.4, 0.1, 0.2), 1.0, 0.15, 40, 50);
    let plain = Bvh::build(&triangles(&ball));
    for s in [1e-3f32, 1e3] {
        let mut rng = rng(10);
        let mut larger = ball.clone();
        larger.corners.iter_mut().for_each(|c| *c *= s);
        let larger = Bvh::build(&triangles(&larger));
        let (mut differ, mut far) = (0, 0);
        for _ in 0..50_000 {
            let ray = Ray::new(point(&mut rng) * 2.0, direction(&mut rng));
            let here = plain.closest(&ray);
            let there = larger.closest(&Ray::new(ray.o * s, ray.d));
            match (here, there) {
                (Some(a), Some(b)) => far += u32::from((a.t * s - b.t).abs() > 1e-4 * b.t.max(s)),
                (a, b) => differ += u32::from(a.is_some() != b.is_some()),
            }
        }
        assert!(differ <= 2 && far <= 10, "x {s}: {differ} differ, {far} elsewhere");
    }
}
