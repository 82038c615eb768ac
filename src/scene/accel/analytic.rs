//! Spheres, disks and cylinders: solved in f64, where an f32 origin and direction leave no rounding to fear.

use super::triangle::Best;
use glam::{DAffine3, DVec3, Vec3};

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
