//! Eight triangles side by side, tested without cracks between neighbours.
//!
//! \[WOOP\] S. Woop, C. Benthin, I. Wald: Watertight Ray/Triangle Intersection. JCGT 2(1), 2013.

use super::probe::Probe;
use super::slot::Slot;
use glam::{DVec3, Vec3};
use wide::f32x8;

/// Error of an edge function in units of the squared size of the triangle as seen from the origin: six roundings reach
/// each of its eight factors, two more its products; and all of that three times, once a corner.
pub(super) const DOUBTFUL: f32 = 64.0 / (1 << 24) as f32;

/// Up to eight triangles in a slot: row `3 corner + axis` holds a coordinate, row 9 the bits of the primitives' numbers. Absent ones are
/// NaN throughout and never hit.
#[derive(Clone, Copy)]
pub(super) struct Tri8<'a>(pub(super) &'a Slot);

/// The row of the primitives' numbers.
const NUMBERS: usize = 9;

/// What the eight lanes found; only lanes in the mask are meaningful.
pub(super) struct Eight {
    t: [f32; 8],
    u: [f32; 8],
    v: [f32; 8],
    doubtful: u32,
}

/// One hit, `t` in the probe's scaled direction.
#[derive(Clone, Copy)]
pub(super) struct Best {
    pub(super) t: f32,
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) prim: u32,
}

impl Best {
    /// Takes the nearer hit; of two equally near ones the lower number, so that the walk's order does not show.
    #[inline(always)]
    pub(super) fn improve(&mut self, t: f32, u: f32, v: f32, prim: u32) {
        if t < self.t || (t == self.t && prim < self.prim) {
            *self = Self { t, u, v, prim };
        }
    }
}

impl Tri8<'_> {
    pub(super) fn slot(triangles: &[(u32, [Vec3; 3])]) -> Slot {
        let absent = (0, [Vec3::NAN; 3]);
        let eight: [_; 8] = std::array::from_fn(|lane| triangles.get(lane).copied().unwrap_or(absent));
        let mut rows = [f32x8::ZERO; 10];
        for (row, coordinates) in rows.iter_mut().take(9).enumerate() {
            *coordinates = f32x8::new(eight.map(|(_, corners)| corners[row / 3][row % 3]));
        }
        rows[NUMBERS] = f32x8::new(eight.map(|(number, _)| f32::from_bits(number)));
        Slot { rows }
    }

    /// Which lanes the ray hits with `0 < t <= t_max`, as bits; of a lane marked doubtful `t` is still to be found exactly. Its f32 value
    /// must not even turn it down, or which of two triangles around the origin wins would depend on which was met first.
    #[inline(always)]
    fn eight(self, p: &Probe, t_max: f32) -> Option<(u32, Eight)> {
        let [x, y, z] = p.axis.map(|k| k & 3);
        // Corners relative to the origin, sheared so that the ray is the z axis. Neighbours share corners, not edges:
        // the same corner gives the same numbers in both.
        let minus_o = p.minus_origin.map(f32x8::splat);
        let (shear_x, shear_y) = (f32x8::splat(p.shear_x), f32x8::splat(p.shear_y));
        let rows = &self.0.rows;
        let moved = |corner: usize| {
            let z = rows[3 * corner + z] + minus_o[2];
            let x = shear_x.mul_neg_add(z, rows[3 * corner + x] + minus_o[0]);
            let y = shear_y.mul_neg_add(z, rows[3 * corner + y] + minus_o[1]);
            (x, y, z)
        };
        let (ax, ay, az) = moved(0);
        let (bx, by, bz) = moved(1);
        let (cx, cy, cz) = moved(2);
        // Products first, rounded, then the difference: rounding is monotonic, so a sign is never wrong, only zero at
        // worst, and a shared edge walked the other way gives exactly the negative. A fused multiply-add breaks both.
        let a = cx * by - cy * bx;
        let b = ax * cy - ay * cx;
        let c = bx * ay - by * ax;
        let zero = f32x8::ZERO;
        let inside = a.fast_min(b).fast_min(c).simd_ge(zero) | a.fast_max(b).fast_max(c).simd_le(zero);
        if inside.to_bitmask() == 0 {
            return None;
        }
        // A triangle seen edge-on has sum 0 and NaN here, which no comparison below accepts.
        let scale = f32x8::ONE / (a + b + c);
        let (w, u, v) = (a * scale, b * scale, c * scale);
        let depth = w * az + u * bz + v * cz;
        let t = depth * f32x8::splat(p.inv_z);
        // Where the depth is below its own error: that of a weight, times the corners' depth.
        let most = |a: f32x8, b: f32x8, c: f32x8| a.abs().fast_max(b.abs()).fast_max(c.abs());
        let deep = most(az, bz, cz);
        let large = deep.fast_max(most(ax, bx, cx)).fast_max(most(ay, by, cy));
        let weight = large * large * scale.abs() * f32x8::splat(DOUBTFUL);
        let doubtful = depth.abs().simd_le(weight * deep);
        let hit = inside & (doubtful | (t.simd_gt(zero) & t.simd_le(f32x8::splat(t_max))));
        let mask = hit.to_bitmask();
        (mask != 0).then(|| {
            let eight = Eight { t: t.to_array(), u: u.to_array(), v: v.to_array(), doubtful: doubtful.to_bitmask() };
            (mask, eight)
        })
    }

    #[inline(always)]
    pub(super) fn closest(self, p: &Probe, best: &mut Best) {
        let Some((mut mask, eight)) = self.eight(p, best.t) else {
            return;
        };
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            let mut t = eight.t[lane];
            if eight.doubtful >> lane & 1 != 0 {
                t = self.exactly(p.o, p.d, lane, t);
                if t.is_nan() || t <= 0.0 {
                    continue;
                }
            }
            best.improve(t, eight.u[lane], eight.v[lane], self.number(lane));
        }
    }

    #[inline(always)]
    pub(super) fn occluded(self, p: &Probe, t_max: f32) -> bool {
        let Some((mask, eight)) = self.eight(p, t_max) else {
            return false;
        };
        if mask & !eight.doubtful != 0 {
            return true;
        }
        (0..8).any(|lane| {
            mask >> lane & 1 != 0 && {
                let t = self.exactly(p.o, p.d, lane, eight.t[lane]);
                t > 0.0 && t <= t_max
            }
        })
    }

    /// The number of the triangle in a lane.
    #[inline(always)]
    pub(super) fn number(self, lane: usize) -> u32 {
        self.0.bits(NUMBERS, lane)
    }

    /// One coordinate of a corner of the triangle in a lane.
    #[inline(always)]
    pub(super) fn coordinate(self, corner: usize, axis: usize, lane: usize) -> f32 {
        self.0.rows[3 * corner + axis].as_array()[lane & 7]
    }

    /// How many triangles there are; they fill the first lanes.
    #[inline(always)]
    pub(super) fn count(self) -> usize {
        let x = self.0.rows[0];
        x.simd_eq(x).to_bitmask().count_ones() as usize
    }

    #[inline(always)]
    fn at(self, corner: usize, lane: usize) -> DVec3 {
        let [x, y, z] = [0, 1, 2].map(|axis: usize| f64::from(self.coordinate(corner, axis, lane)));
        DVec3::new(x, y, z)
    }

    /// `t` by the triangle's plane in f64, where the f32 result is below its own error: an origin moved off the surface
    /// by a few ulp must not see it again, and must not miss the neighbour in a corner either.
    #[cold]
    #[inline(never)]
    fn exactly(self, o: Vec3, d: Vec3, lane: usize, t: f32) -> f32 {
        self.plane(lane).exactly(o, d, t)
    }

    /// The plane of the triangle in a lane.
    #[inline(always)]
    pub(super) fn plane(self, lane: usize) -> Plane {
        let a = self.at(0, lane);
        Plane { a, n: (self.at(1, lane) - a).cross(self.at(2, lane) - a) }
    }
}

/// A triangle's plane, in f64.
pub(super) struct Plane {
    a: DVec3,
    n: DVec3,
}

impl Plane {
    /// See [`Tri8::exactly`].
    #[inline(always)]
    pub(super) fn exactly(&self, o: Vec3, d: Vec3, t: f32) -> f32 {
        let along = self.n.dot(d.as_dvec3());
        if along == 0.0 {
            return t;
        }
        let ahead = self.n.dot(self.a - o.as_dvec3());
        // Most often the ray leaves this triangle: that needs no quotient.
        if (ahead > 0.0) != (along > 0.0) { 0.0 } else { (ahead / along) as f32 }
    }
}
