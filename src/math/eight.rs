//! Eight of everything side by side, one in each lane of a vector: vectors, warps and frames for work that is the same for many paths.
//!
//! Operation for operation what the forms for one compute, so a lane holds the same bits.

use super::elementary::sin_cos_eighth;
use super::warp::LOWEST_COSINE2;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_4};
use std::ops::{Add, Mul, Neg, Sub};
use wide::f32x8;

/// One number of each of eight paths, as memory holds them.
pub type Lanes = [f32; 8];

/// The sign's bit alone.
const SIGN: f32x8 = f32x8::splat(-0.0);

/// Eight vectors.
#[derive(Clone, Copy, Debug)]
pub struct Vec3x8 {
    /// First components.
    pub x: f32x8,
    /// Second components.
    pub y: f32x8,
    /// Third components.
    pub z: f32x8,
}

impl Vec3x8 {
    /// From memory, component by component.
    #[inline(always)]
    pub fn new(lanes: &[Lanes; 3]) -> Self {
        Self { x: f32x8::new(lanes[0]), y: f32x8::new(lanes[1]), z: f32x8::new(lanes[2]) }
    }

    /// The same vector in every lane.
    #[inline(always)]
    pub fn splat(v: Vec3) -> Self {
        Self { x: f32x8::splat(v.x), y: f32x8::splat(v.y), z: f32x8::splat(v.z) }
    }

    /// To memory, component by component.
    #[inline(always)]
    pub fn to_lanes(self) -> [Lanes; 3] {
        [self.x.to_array(), self.y.to_array(), self.z.to_array()]
    }

    /// The function applied to each component.
    #[inline(always)]
    pub fn map(self, f: impl Fn(f32x8) -> f32x8) -> Self {
        Self { x: f(self.x), y: f(self.y), z: f(self.z) }
    }

    /// The function applied to each component of two vectors.
    #[inline(always)]
    pub fn zip(self, o: Self, f: impl Fn(f32x8, f32x8) -> f32x8) -> Self {
        Self { x: f(self.x, o.x), y: f(self.y, o.y), z: f(self.z, o.z) }
    }

    /// Inner products.
    #[inline(always)]
    pub fn dot(self, o: Self) -> f32x8 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Largest components.
    #[inline(always)]
    pub fn max_element(self) -> f32x8 {
        self.x.fast_max(self.y).fast_max(self.z)
    }

    /// The vector of one lane of [`Vec3x8::to_lanes`].
    #[inline(always)]
    pub fn lane(lanes: &[Lanes; 3], lane: usize) -> Vec3 {
        Vec3::new(lanes[0][lane & 7], lanes[1][lane & 7], lanes[2][lane & 7])
    }
}

impl Add for Vec3x8 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        self.zip(o, |a, b| a + b)
    }
}

impl Sub for Vec3x8 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        self.zip(o, |a, b| a - b)
    }
}

impl Mul for Vec3x8 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.zip(o, |a, b| a * b)
    }
}

impl Mul<f32x8> for Vec3x8 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: f32x8) -> Self {
        self.map(|a| a * k)
    }
}

impl Neg for Vec3x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| a ^ SIGN)
    }
}

/// `a` with the sign of `b`.
#[inline(always)]
pub fn copysign(a: f32x8, b: f32x8) -> f32x8 {
    a.abs() | (b & SIGN)
}

/// The lanes of a mask, the first `count` at most, as bits.
#[inline(always)]
pub fn bits(mask: f32x8, count: usize) -> u32 {
    mask.to_bitmask() & ((1u32 << count) - 1)
}

/// [`super::warp::cosine_hemisphere`] of eight.
#[inline(always)]
pub fn cosine_hemisphere(u: [f32x8; 2]) -> Vec3x8 {
    let [x, y] = u.map(|u| f32x8::splat(2.0) * u - f32x8::ONE);
    let wide = x.abs().simd_gt(y.abs());
    let (r, other) = (wide.select(x, y), wide.select(y, x));
    let (sin, cos) = sin_cos_eighth(f32x8::splat(FRAC_PI_4) * (other / r));
    // The centre, where the quotient is none.
    let off_centre = r.simd_ne(f32x8::ZERO);
    let (along, across) = ((r * cos) & off_centre, (r * sin) & off_centre);
    let (x, y) = (wide.select(along, across), wide.select(across, along));
    let z = (f32x8::ONE - (x * x + y * y)).fast_max(f32x8::splat(LOWEST_COSINE2)).sqrt();
    Vec3x8 { x, y, z }
}

/// [`super::warp::cosine_hemisphere_pdf`] of eight.
#[inline(always)]
pub fn cosine_hemisphere_pdf(cos: f32x8) -> f32x8 {
    cos.fast_max(f32x8::ZERO) * f32x8::splat(FRAC_1_PI)
}

/// Local directions to world, in [`super::Frame::from_normal`] of eight normals.
#[inline(always)]
pub fn to_world(n: Vec3x8, w: Vec3x8) -> Vec3x8 {
    let sign = copysign(f32x8::ONE, n.z);
    let a = f32x8::splat(-1.0) / (sign + n.z);
    let b = n.x * n.y * a;
    let s = Vec3x8 { x: f32x8::ONE + sign * n.x * n.x * a, y: sign * b, z: (sign ^ SIGN) * n.x };
    let t = Vec3x8 { x: b, y: sign + n.y * n.y * a, z: n.y ^ SIGN };
    s * w.x + t * w.y + n * w.z
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Frame, warp};
    use glam::Vec2;

    /// Bit for bit, centre, edges and diagonals of the square among them.
    #[test]
    fn eight_do_what_one_does() {
        let side = 24;
        let points: Vec<Vec2> = (0..side * side).map(|i| Vec2::new((i % side) as f32, (i / side) as f32) / side as f32).collect();
        let mut normals = vec![Vec3::X, -Vec3::X, Vec3::Y, Vec3::Z, -Vec3::Z, Vec3::new(0.6, -0.0, 0.8), Vec3::new(0.6, 0.8, -0.0)];
        normals.push(Vec3::new(1.0, -2.0, 0.5).normalize());
        for eight in points.chunks_exact(8) {
            let u = [f32x8::new(std::array::from_fn(|i| eight[i].x)), f32x8::new(std::array::from_fn(|i| eight[i].y))];
            let n = Vec3x8::new(&[0, 1, 2].map(|k| std::array::from_fn(|i| normals[i][k])));
            let w = cosine_hemisphere(u);
            let (local, pdf, world) = (w.to_lanes(), cosine_hemisphere_pdf(w.z).to_array(), to_world(n, w).to_lanes());
            for i in 0..8 {
                let one = warp::cosine_hemisphere(eight[i]);
                assert_eq!(Vec3x8::lane(&local, i), one, "{}", eight[i]);
                assert_eq!(pdf[i], warp::cosine_hemisphere_pdf(one.z).0);
                assert_eq!(Vec3x8::lane(&world, i), Frame::from_normal(normals[i]).to_world(one), "{}", normals[i]);
            }
        }
    }
}
