//! Many rays at once get what each would get alone, to the bit.

use super::{any_ray, direction, mixture, point, rng, shapes, triangles};
use glam::Vec3;
use isophote::scene::accel::{Accel, Bvh, Primitive};
use isophote::scene::ray::{RawHit, Ray};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

fn bits(hit: Option<RawHit>) -> Option<[u32; 4]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim])
}

/// Asks all at once and one by one; how many hit.
fn agree(bvh: &Bvh, rays: &[Ray]) -> usize {
    let never = Some(RawHit { t: -1.0, u: 0.0, v: 0.0, prim: 7 });
    let mut hits = vec![never; rays.len() + 1];
    let mut blocked = vec![true; rays.len()];
    bvh.closest_each(rays, &mut hits);
    bvh.occluded_each(rays, &mut blocked);
    for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked) {
        assert_eq!(bits(bvh.closest(ray)), bits(*hit), "{ray:?} among {}", rays.len());
        assert_eq!(bvh.occluded(ray), *blocked, "{ray:?} among {}", rays.len());
    }
    assert_eq!(hits[rays.len()], never, "beyond the rays nothing is written");
    hits.iter().flatten().count() - 1
}

/// Rays that a renderer never sends on purpose.
fn broken(rng: &mut Pcg64Mcg) -> Ray {
    let mut ray = any_ray(rng);
    match rng.random_range(0..7) {
        0 => ray.d = Vec3::ZERO,
        1 => ray.d[rng.random_range(0..3)] = f32::NAN,
        2 => ray.o[rng.random_range(0..3)] = f32::INFINITY,
        3 => ray.t_max = f32::NAN,
        4 => ray.t_max = 0.0,
        5 => ray.t_max = -1.0,
        _ => ray.d *= 1e-38,
    }
    ray
}

/// From one place into a cone, as camera and shadow rays go.
fn cone(count: usize, width: f32, rng: &mut Pcg64Mcg) -> Vec<Ray> {
    let (o, d) = (point(rng) * 1.5, direction(rng));
    (0..count).map(|_| Ray::new(o + point(rng) * 0.01, d + point(rng) * width)).collect()
}

#[test]
fn any_number_of_any_rays_in_any_tree() {
    let mut rng = rng(21);
    for count in [0, 1, 7, 30, 90, 1500] {
        for primitives in [
            mixture(count, &mut rng),
            (0..count).map(|_| Primitive::Triangle([point(&mut rng), point(&mut rng), point(&mut rng)])).collect(),
        ] {
            let bvh = Bvh::build(&primitives);
            let mut hits = 0;
            for length in (0..=40).chain([255, 256, 257, 600]) {
                let mut rays: Vec<_> = (0..length).map(|_| any_ray(&mut rng)).collect();
                hits += agree(&bvh, &rays);
                for ray in rays.iter_mut().step_by(3) {
                    *ray = broken(&mut rng);
                }
                agree(&bvh, &rays);
                for width in [0.01, 0.3, 2.0] {
                    hits += agree(&bvh, &cone(length, width, &mut rng));
                }
            }
            assert!(hits >= 10 * count.min(20), "{hits} hits of {count} primitives");
        }
    }
}

#[test]
fn coherent_rays_at_corners_and_edges() {
    let mut rng = rng(22);
    for rings in [4, 60] {
        let mesh = shapes::bumpy(Vec3::ZERO, 0.7, 0.2, rings, rings);
        let bvh = Bvh::build(&triangles(&mesh));
        for _ in 0..2000 {
            let o = point(&mut rng) * 0.2;
            let from = rng.random_range(0..mesh.triangles.len());
            let rays: Vec<_> = (0..40)
                .map(|i| {
                    let [a, b, _] = mesh.triangles[(from + i / 2) % mesh.triangles.len()].map(|i| mesh.corners[i as usize]);
                    let at = if i % 2 == 0 { a } else { a.lerp(b, rng.random()) };
                    Ray::new(o, at - o)
                })
                .collect();
            assert_eq!(agree(&bvh, &rays), rays.len(), "a ray from inside leaks");
        }
    }
}

#[test]
fn rays_that_leave_a_surface() {
    let mut rng = rng(23);
    for rings in [4, 60] {
        let mesh = shapes::bumpy(Vec3::ZERO, 0.7, 0.2, rings, rings);
        let bvh = Bvh::build(&triangles(&mesh));
        for _ in 0..2000 {
            let start = cone(64, 0.1, &mut rng);
            let next: Vec<_> =
                start.iter().filter_map(|ray| bvh.closest(ray).map(|hit| Ray::new(ray.o + ray.d * hit.t, direction(&mut rng)))).collect();
            agree(&bvh, &next);
        }
    }
}

#[test]
fn of_coincident_triangles_the_first_wins() {
    let mut rng = rng(24);
    for copies in [2, 5, 40] {
        let three: Vec<_> = (0..3).map(|_| Primitive::Triangle([point(&mut rng), point(&mut rng), point(&mut rng)])).collect();
        let all: Vec<_> = (0..copies).flat_map(|_| three.iter().copied()).collect();
        let bvh = Bvh::build(&all);
        for _ in 0..200 {
            let rays: Vec<_> = (0..64).map(|_| any_ray(&mut rng)).collect();
            agree(&bvh, &rays);
            let mut hits = [None; 64];
            bvh.closest_each(&rays, &mut hits);
            assert!(hits.iter().flatten().all(|h| h.prim < 3), "a copy won over the first");
        }
    }
}

/// A triangle seen exactly edge-on may claim a ray that passes beside it. Alone this ray never asks the triangle, whose box it misses; in
/// company of rays that do it must not either.
#[test]
fn a_ray_finds_nothing_where_others_lead_it() {
    let v = Vec3::new;
    let list = [
        [v(1.0, -1.0, 1.0), v(0.0, 0.0, 0.5), v(0.0, 0.5, -1.0)],
        [v(0.0, 0.0, -1.0), v(-0.5, 1.0, 1.0), v(0.0, -0.5, 0.5)],
        [v(0.5, 0.0, -0.5), v(1.0, -0.5, 0.0), v(-0.5, 1.0, -0.5)],
        [v(-0.5, -0.5, 0.5), v(1.0, 0.0, -0.5), v(0.5, 1.0, 0.5)],
        [v(-1.0, 1.0, 0.5), v(0.0, 0.5, 0.5), v(0.5, 0.0, -0.5)],
        [v(-0.5, 0.5, 1.0), v(-1.0, 0.5, 0.0), v(0.5, 0.5, -1.0)],
        [v(0.0, -0.5, 0.5), v(0.0, 0.0, 1.0), v(0.0, -0.5, 0.0)],
        [v(-0.5, 1.0, 0.0), v(0.0, 0.0, -0.5), v(-1.0, 1.0, 0.0)],
        [v(0.0, 0.5, -0.5), v(-0.5, 0.5, 0.5), v(0.0, -1.0, 0.0)],
        [v(-0.5, 0.0, -0.5), v(0.0, 1.0, 0.5), v(0.0, 0.5, -1.0)],
        [v(-0.5, -1.0, 1.0), v(-1.0, 0.5, -0.5), v(-0.5, -1.0, -1.0)],
        [v(0.5, 0.5, 0.5), v(-0.5, 1.0, -0.5), v(0.5, 1.0, 0.0)],
    ];
    let bvh = Bvh::build(&list.map(Primitive::Triangle));
    let beside = Ray::new(v(-0.5, -0.5, 1.0), v(-1.0, 1.0, -1.5));
    assert_eq!(bvh.closest(&beside), None);
    let mut rng = rng(26);
    for _ in 0..100 {
        let mut rays = vec![beside; 8];
        for ray in &mut rays[1..] {
            let at = v(0.17, 0.83, 0.0) + point(&mut rng) * 0.1;
            ray.d = beside.d + point(&mut rng) * 0.3;
            ray.o = at - ray.d;
        }
        agree(&bvh, &rays);
    }
}

#[test]
fn of_two_lengths_the_shorter_counts() {
    let mut rng = rng(25);
    let bvh = Bvh::build(&mixture(20, &mut rng));
    let rays: Vec<_> = (0..20).map(|_| any_ray(&mut rng)).collect();
    let (mut hits, mut blocked) = ([None; 9], [false; 9]);
    bvh.closest_each(&rays, &mut hits);
    bvh.occluded_each(&rays, &mut blocked);
    for i in 0..9 {
        assert_eq!(bits(bvh.closest(&rays[i])), bits(hits[i]));
        assert_eq!(bvh.occluded(&rays[i]), blocked[i]);
    }
}
