//! Spheres, disks and cylinders: solved in f64, where an f32 origin and direction leave no rounding to fear.

use super::triangle::Best;
use glam::{DAffine3, DVec3, Vec3};
use wide::{f32x8, f64x4};

/// One shape and its number.
#[derive(Clone)]
pub(super) struct Analytic {
    pub(super) shape: Shape,
    pub(super) prim: u32,
}

/// Disks and cylinders are met in object space; `t` means the same there.
#[derive(Clone)]
pub(super) enum Shape {
    Sphere { center: DVec3, radius2: f64 },
    Disk { to_object: DAffine3 },
    Cylinder { to_object: DAffine3 },
}

/// Both roots of `a t^2 + 2 h t + c = 0`, the smaller first. The caller knows a better way to `h^2 - a c`.
#[inline(always)]
fn roots(a: f64, h: f64, c: f64, discriminant: f64) -> Option<[f64; 2]> {
    if !(discriminant >= 0.0 && a > 0.0) {
        return None;
    }
    // The root without cancellation first, the other by the product of both.
    let q = -(h + discriminant.sqrt().copysign(h));
    let (r, s) = (q / a, if q == 0.0 { 0.0 } else { c / q });
    Some([r.min(s), r.max(s)])
}

impl Analytic {
    /// Hands `found` each crossing in order along the ray until it says stop.
    #[inline(always)]
    fn crossings(&self, o: Vec3, d: Vec3, mut found: impl FnMut(f64) -> bool) {
        let (o, d) = (o.as_dvec3(), d.as_dvec3());
        match &self.shape {
            Shape::Sphere { center, radius2 } => {
                let o = o - *center;
                let (a, h, c) = (d.dot(d), o.dot(d), o.dot(o) - radius2);
                // By the distance of the line from the centre: h^2 - a c would lose it for a small sphere far away.
                let off = o - d * (h / a);
                let discriminant = a * (radius2 - off.dot(off));
                if let Some([near, far]) = roots(a, h, c, discriminant) {
                    let _ = found(near) || found(far);
                }
            }
            Shape::Disk { to_object } => {
                let (o, d) = (to_object.transform_point3(o), to_object.transform_vector3(d));
                let t = -o.z / d.z;
                let (x, y) = (o.x + t * d.x, o.y + t * d.y);
                if x * x + y * y <= 1.0 {
                    found(t);
                }
            }
            Shape::Cylinder { to_object } => {
                let (o, d) = (to_object.transform_point3(o), to_object.transform_vector3(d));
                let (a, h) = (d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y);
                let c = o.x * o.x + o.y * o.y - 1.0;
                let across = o.x * d.y - o.y * d.x;
                if let Some(both) = roots(a, h, c, a - across * across) {
                    for t in both {
                        let z = o.z + t * d.z;
                        if (0.0..=1.0).contains(&z) && found(t) {
                            break;
                        }
                    }
                }
            }
        }
    }

    #[inline(never)]
    pub(super) fn closest(&self, o: Vec3, d: Vec3, best: &mut Best) {
        self.crossings(o, d, |t| {
            let t = t as f32;
            let hit = t > 0.0 && t <= best.t;
            if hit {
                best.improve(t, 0.0, 0.0, self.prim);
            }
            hit
        });
    }

    #[inline(never)]
    pub(super) fn occluded(&self, o: Vec3, d: Vec3, t_max: f32) -> bool {
        let mut hit = false;
        self.crossings(o, d, |t| {
            let t = t as f32;
            hit |= t > 0.0 && t <= t_max;
            hit
        });
        hit
    }
}

/// Where eight lines cross a sphere, the nearer crossing first; NaN where one passes it by. `None` if all do. Operation for operation what a
/// ray alone is told.
#[inline(always)]
pub(super) fn eight_through_sphere(minus_o: [f32x8; 3], d: [f32x8; 3], center: DVec3, radius2: f64) -> Option<[f32x8; 2]> {
    let (low, high) = (FourLines::new::<0>(minus_o, d, center, radius2), FourLines::new::<4>(minus_o, d, center, radius2));
    if !(low.discriminant.simd_ge(f64x4::ZERO) | high.discriminant.simd_ge(f64x4::ZERO)).any() {
        return None;
    }
    let ([a, b], [c, d]) = (low.roots(), high.roots());
    let single = |low: f64x4, high: f64x4| {
        let ([a, b, c, d], [e, f, g, h]) = (low.to_array(), high.to_array());
        f32x8::new([a, b, c, d, e, f, g, h].map(|t| t as f32))
    };
    Some([single(a, c), single(b, d)])
}

/// Four lines and the equation `a t^2 + 2 h t + c = 0` of each.
struct FourLines {
    a: f64x4,
    h: f64x4,
    c: f64x4,
    /// `h^2 - a c`, by the distance of the line from the centre.
    discriminant: f64x4,
}

impl FourLines {
    /// The lanes from `FIRST` on.
    #[inline(always)]
    fn new<const FIRST: usize>(minus_o: [f32x8; 3], d: [f32x8; 3], center: DVec3, radius2: f64) -> Self {
        let four = |v: f32x8| {
            let v = v.to_array();
            f64x4::new([f64::from(v[FIRST]), f64::from(v[FIRST + 1]), f64::from(v[FIRST + 2]), f64::from(v[FIRST + 3])])
        };
        let from = |minus_o: f32x8, center: f64| -four(minus_o) - f64x4::splat(center);
        let o = [from(minus_o[0], center.x), from(minus_o[1], center.y), from(minus_o[2], center.z)];
        let d = [four(d[0]), four(d[1]), four(d[2])];
        let dot = |p: [f64x4; 3], q: [f64x4; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let radius2 = f64x4::splat(radius2);
        let (a, h, c) = (dot(d, d), dot(o, d), dot(o, o) - radius2);
        let along = h / a;
        let off = [o[0] - d[0] * along, o[1] - d[1] * along, o[2] - d[2] * along];
        Self { a, h, c, discriminant: a * (radius2 - dot(off, off)) }
    }

    /// Both roots, the smaller first, as [`roots`] has them; the root of a negative discriminant makes them NaN.
    #[inline(always)]
    fn roots(&self) -> [f64x4; 2] {
        let sign = f64x4::splat(-0.0);
        let root = self.discriminant.sqrt();
        let q = -(self.h + (root.abs() | (self.h & sign)));
        let (r, s) = (q / self.a, q.simd_eq(f64x4::ZERO).select(f64x4::ZERO, self.c / q));
        [r.fast_min(s), r.fast_max(s)]
    }
}
