//! Brute force in f64. It gives bounds instead of a value: f32 input leaves some answers open.

use glam::{Affine3A, DAffine3, DVec3, Vec3};
use isophote::scene::accel::{Accel, Bvh, Primitive};
use isophote::scene::ray::{RawHit, Ray};

/// The closest hit lies in `[earliest, latest]`; infinity stands for a miss.
#[derive(Debug)]
pub(crate) struct Bracket {
    earliest: f64,
    latest: f64,
}

impl Bracket {
    fn none() -> Self {
        Self { earliest: f64::INFINITY, latest: f64::INFINITY }
    }

    /// Some hit at `t` give or take `error`; `sure` if no rounding can undo it.
    fn add(&mut self, t: f64, error: f64, sure: bool, t_max: f64) {
        if t + error > 0.0 && t - error <= t_max {
            self.earliest = self.earliest.min(t - error);
            if sure && t - error > 0.0 && t + error <= t_max {
                self.latest = self.latest.min(t + error);
            }
        }
    }

    fn holds(&self, hit: Option<RawHit>) -> bool {
        let t = hit.map_or(f64::INFINITY, |h| f64::from(h.t));
        self.earliest <= t && t <= self.latest
    }
}

fn exact(m: &Affine3A) -> DAffine3 {
    DAffine3::from_cols(m.matrix3.x_axis.as_dvec3(), m.matrix3.y_axis.as_dvec3(), m.matrix3.z_axis.as_dvec3(), m.translation.as_dvec3())
}

fn quadratic(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let disc = b * b - 4.0 * a * c;
    (disc >= 0.0).then(|| [-1.0, 1.0].map(|s| (-b + s * disc.sqrt()) / (2.0 * a)))
}

pub(crate) fn bracket(primitives: &[Primitive], ray: &Ray) -> Bracket {
    let (o, d, t_max) = (ray.o.as_dvec3(), ray.d.as_dvec3(), f64::from(ray.t_max));
    let mut all = Bracket::none();
    for primitive in primitives {
        match primitive {
            Primitive::Triangle(corners) => {
                let [a, b, c] = corners.map(Vec3::as_dvec3);
                let (p, q) = (b - a, c - a);
                let n = p.cross(q);
                let along = n.dot(d);
                if along == 0.0 {
                    continue;
                }
                let t = n.dot(a - o) / along;
                let x = o + d * t - a;
                let u = x.cross(q).dot(n) / n.dot(n);
                let v = p.cross(x).dot(n) / n.dot(n);
                let margin = u.min(v).min(1.0 - u - v);
                // How far the f32 arithmetic may move the plane, and that as seen along the ray.
                let reach = [a, b, c, o].map(|x| x.abs().max_element());
                let moved = 4e-6 * reach.into_iter().fold(0.0, f64::max);
                let slant = n.length() * d.length() / along.abs();
                let error = moved * slant / d.length();
                let height = n.length() / p.length().max(q.length()).max((p - q).length());
                let fuzzy = 4.0 * moved * slant / height;
                if margin > -fuzzy {
                    all.add(t, error, margin > fuzzy, t_max);
                }
            }
            Primitive::Sphere { center, radius } => {
                let (o, r) = (o - center.as_dvec3(), f64::from(*radius));
                let roots = quadratic(d.dot(d), 2.0 * o.dot(d), o.dot(o) - r * r);
                for t in roots.into_iter().flatten() {
                    all.add(t, 1e-6 * t.abs() + 1e-9, true, t_max);
                }
            }
            Primitive::Disk { to_world } => {
                let back = exact(to_world).inverse();
                let (o, d) = (back.transform_point3(o), back.transform_vector3(d));
                let t = -o.z / d.z;
                let x: DVec3 = o + d * t;
                let margin = 1.0 - x.truncate().length();
                if margin > -1e-9 {
                    all.add(t, 1e-6 * t.abs() + 1e-9, margin > 1e-9, t_max);
                }
            }
            Primitive::Cylinder { to_world } => {
                let back = exact(to_world).inverse();
                let (o, d) = (back.transform_point3(o), back.transform_vector3(d));
                let (o2, d2) = (o.truncate(), d.truncate());
                let roots = quadratic(d2.dot(d2), 2.0 * o2.dot(d2), o2.dot(o2) - 1.0);
                for t in roots.into_iter().flatten() {
                    let z = o.z + t * d.z;
                    let margin = z.min(1.0 - z);
                    if margin > -1e-9 {
                        all.add(t, 1e-6 * t.abs() + 1e-9, margin > 1e-9, t_max);
                    }
                }
            }
        }
    }
    all
}

/// Holds both questions against brute force.
pub(crate) fn check(primitives: &[Primitive], bvh: &Bvh, ray: &Ray) {
    let hit = bvh.closest(ray);
    let truth = bracket(primitives, ray);
    assert!(truth.holds(hit), "{ray:?}: {hit:?} is not in {truth:?}");
    assert_eq!(bvh.occluded(ray), hit.is_some(), "{ray:?}: {hit:?}");
    if let Some(hit) = hit {
        assert!(hit.t > 0.0 && hit.t <= ray.t_max, "{ray:?}: {hit:?}");
        // The primitive named is the one hit, there.
        let named = &primitives[hit.prim as usize];
        let own = bracket(std::slice::from_ref(named), ray);
        let near = f64::from(hit.t);
        assert!(own.earliest.is_finite(), "{ray:?}: {hit:?} but {own:?}");
        if let Primitive::Triangle([a, b, c]) = named {
            let x = ray.o + ray.d * hit.t;
            let y = *a + (*b - *a) * hit.u + (*c - *a) * hit.v;
            let reach = x.abs().max_element().max(ray.o.abs().max_element());
            let slack = 1e-5 * reach.max(a.abs().max_element());
            let n = (*b - *a).cross(*c - *a).as_dvec3().normalize();
            let slant = n.dot(ray.d.as_dvec3().normalize()).abs();
            let apart = x.as_dvec3().distance(y.as_dvec3());
            assert!(apart * slant <= f64::from(slack), "{ray:?}: {hit:?} {near}: {x} is not {y}");
        }
    }
}
