//! Degenerate lists, rays that are none, and the ends of every range.

use crate::{any_map, direction, oracle, point, rng, shapes, triangles};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use isophote::scene::accel::{Accel, Bvh, Primitive};
use isophote::scene::ray::Ray;

const UNIT: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

fn down(x: f32, y: f32) -> Ray {
    Ray::new(Vec3::new(x, y, 2.0), Vec3::NEG_Z)
}

#[test]
fn nothing_and_one() {
    let none = Bvh::build(&[]);
    assert_eq!((none.primitives(), none.memory(), none.bounds()), (0, 0, None));
    assert!(none.closest(&down(0.2, 0.2)).is_none() && !none.occluded(&down(0.2, 0.2)));
    let one = Bvh::build(&[Primitive::Triangle(UNIT)]);
    let hit = one.closest(&down(0.25, 0.5)).unwrap();
    assert_eq!((hit.t, hit.u, hit.v, hit.prim), (2.0, 0.25, 0.5, 0));
    assert!(one.closest(&down(0.75, 0.5)).is_none());
    let bounds = one.bounds().unwrap();
    assert_eq!((bounds.min, bounds.max), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    assert!(one.memory() > 0 && one.primitives() == 1);
}

#[test]
fn t_max_is_inclusive_and_zero_is_not() {
    let bvh = Bvh::build(&[Primitive::Triangle(UNIT), sphere(Vec3::new(5.25, 0.25, 0.0), 1.0)]);
    for (x, t) in [(0.25, 2.0f32), (5.25, 1.0)] {
        let cut = |t_max: f32| {
            let ray = Ray { t_max, ..down(x, 0.25) };
            assert_eq!(bvh.occluded(&ray), bvh.closest(&ray).is_some());
            bvh.occluded(&ray)
        };
        assert!(cut(t) && cut(f32::INFINITY) && cut(t.next_up()));
        assert!(!cut(t.next_down()) && !cut(0.0) && !cut(-1.0) && !cut(f32::NAN) && !cut(-f32::INFINITY));
    }
    let on = Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::NEG_Z);
    assert!(bvh.closest(&on).is_none());
    let above = Ray::new(Vec3::new(0.25, 0.25, f32::MIN_POSITIVE), Vec3::NEG_Z);
    assert_eq!(bvh.closest(&above).unwrap().t, f32::MIN_POSITIVE);
}

fn sphere(center: Vec3, radius: f32) -> Primitive {
    Primitive::Sphere { center, radius }
}

#[test]
fn what_cannot_be_hit_is_left_out_and_numbers_stay() {
    let nan = Vec3::new(f32::NAN, 0.0, 0.0);
    let flat = Affine3A { matrix3: Mat3A::from_diagonal(Vec3::new(1.0, 0.0, 1.0)), translation: Vec3A::ZERO };
    let list = [
        Primitive::Triangle([Vec3::ZERO, nan, Vec3::X]),
        Primitive::Triangle([Vec3::ZERO, Vec3::X, Vec3::X * 2.0]),
        Primitive::Triangle([Vec3::ONE; 3]),
        Primitive::Triangle([Vec3::ZERO, Vec3::X, Vec3::splat(f32::INFINITY)]),
        sphere(Vec3::ZERO, 0.0),
        sphere(Vec3::ZERO, -1.0),
        sphere(nan, 1.0),
        sphere(Vec3::ZERO, f32::NAN),
        Primitive::Disk { to_world: flat },
        Primitive::Cylinder { to_world: flat },
        Primitive::Triangle(UNIT),
    ];
    let bvh = Bvh::build(&list);
    assert_eq!(bvh.primitives(), 1);
    assert_eq!(bvh.closest(&down(0.25, 0.25)).unwrap().prim, 10);
    assert_eq!(Bvh::build(&list[..10]).primitives(), 0);
}

#[test]
fn of_coincident_triangles_the_first_is_hit() {
    for count in [2, 5, 1000, 3000] {
        let bvh = Bvh::build(&vec![Primitive::Triangle(UNIT); count]);
        assert_eq!(bvh.primitives(), count);
        assert_eq!(bvh.closest(&down(0.3, 0.3)).unwrap().prim, 0);
        assert!(bvh.closest(&down(0.8, 0.8)).is_none());
    }
}

/// A list whose tree is a chain: each primitive lies in what the others leave free.
#[test]
fn chains_do_not_overflow_the_stack() {
    let spheres: Vec<_> = (0..1500).map(|i| 1.06f32.powi(i - 750)).map(|s| sphere(Vec3::splat(s), 0.02 * s)).collect();
    let bvh = Bvh::build(&spheres);
    let mut rng = rng(11);
    for (number, s) in spheres.iter().enumerate() {
        let Primitive::Sphere { center, radius } = s else { unreachable!() };
        let o = *center + 1.5 * radius * direction(&mut rng);
        let hit = bvh.closest(&Ray::new(o, *center - o)).unwrap();
        assert!(hit.prim == number as u32 && (hit.t - 1.0 / 3.0).abs() < 1e-2, "{number}: {hit:?}");
    }
    for nested in [1000, 3000] {
        let rings: Vec<_> = (1..=nested).map(|i| sphere(Vec3::ZERO, i as f32)).collect();
        let bvh = Bvh::build(&rings);
        let hit = bvh.closest(&Ray::new(Vec3::new(0.1, 0.0, 0.0), Vec3::ONE)).unwrap();
        assert_eq!(hit.prim, 0);
        let from_outside = Ray::new(Vec3::X * (nested as f32 + 9.0), Vec3::NEG_X);
        assert_eq!(bvh.closest(&from_outside).unwrap().prim, nested - 1);
    }
}

#[test]
fn rays_that_are_none_miss() {
    let mut primitives = triangles(&shapes::bumpy(Vec3::ZERO, 1.0, 0.1, 20, 20));
    primitives.push(sphere(Vec3::ZERO, 0.1));
    primitives.push(Primitive::Cylinder { to_world: any_map(&mut rng(12)) });
    let bvh = Bvh::build(&primitives);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let mut v = Vec3::new(0.1, 0.2, 0.3);
            v[axis] = bad;
            for ray in [Ray::new(v, Vec3::X), Ray::new(Vec3::ZERO, v), Ray::new(v, v)] {
                assert!(bvh.closest(&ray).is_none() && !bvh.occluded(&ray), "{ray:?}");
            }
        }
    }
    let still = Ray::new(Vec3::ZERO, Vec3::ZERO);
    assert!(bvh.closest(&still).is_none() && !bvh.occluded(&still));
}

#[test]
fn directions_of_any_length() {
    let ball = triangles(&shapes::bumpy(Vec3::ZERO, 1.0, 0.1, 20, 20));
    let bvh = Bvh::build(&ball);
    let mut rng = rng(13);
    for _ in 0..10_000 {
        let (o, d) = (point(&mut rng) * 0.3, direction(&mut rng));
        let t = bvh.closest(&Ray::new(o, d)).unwrap().t;
        for length in [1e-36f32, 1e-20, 1e20, 1e36] {
            let hit = bvh.closest(&Ray::new(o, d * length)).unwrap();
            assert!((hit.t * length / t - 1.0).abs() < 1e-3, "{o} {d} {length}: {hit:?} {t}");
        }
    }
}

#[test]
fn denormal_components_are_almost_zero() {
    let ball = triangles(&shapes::bumpy(Vec3::ZERO, 1.0, 0.1, 20, 20));
    let bvh = Bvh::build(&ball);
    let mut rng = rng(14);
    for _ in 0..800 {
        let o = point(&mut rng) * 0.3;
        for small in [0.0, -0.0, 1e-45, -1e-45, 1e-39, -1e-30, 1e-20, 1e-10] {
            oracle::check(&ball, &bvh, &Ray::new(o, Vec3::new(small, 1.0, -small)));
            oracle::check(&ball, &bvh, &Ray::new(o, Vec3::new(-0.3, small, 0.8)));
        }
    }
}

/// A unit sphere ten kilometres off: hits are as good as f32 positions allow, and an origin moved outwards by that
/// much does not see the sphere it left.
#[test]
fn spheres_far_from_the_origin() {
    let mut rng = rng(15);
    for at in [Vec3::ZERO, Vec3::new(1e4, 0.0, 0.0), Vec3::new(-3e3, 8e3, 5e3)] {
        let bvh = Bvh::build(&[sphere(at, 1.0)]);
        let ulp = 4.0 * f32::EPSILON * (at.length() + 1.0);
        for _ in 0..50_000 {
            let o = at + 5.0 * direction(&mut rng);
            let d = at + 0.99 * direction(&mut rng) - o;
            let hit = bvh.closest(&Ray::new(o, d)).unwrap();
            let x = o.as_dvec3() + d.as_dvec3() * f64::from(hit.t);
            let off = x.distance(at.as_dvec3()) - 1.0;
            assert!(off.abs() < 1e-6, "{o} {d}: off by {off}");
            let n = (x - at.as_dvec3()).normalize().as_vec3();
            let mut away = direction(&mut rng);
            away *= away.dot(n).signum();
            let outside = Ray::new(x.as_vec3() + n * ulp, away);
            assert!(bvh.closest(&outside).is_none(), "{outside:?}");
            let inside = Ray::new(x.as_vec3() - n * ulp, -away);
            let through = bvh.closest(&inside).unwrap().t;
            let chord = 2.0 * away.dot(n);
            assert!((through - chord).abs() < 30.0 * ulp / chord.max(ulp.sqrt()) + 30.0 * ulp, "{inside:?}");
        }
    }
}
