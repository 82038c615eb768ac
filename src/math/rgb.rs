//! Linear colour.

use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Index, Mul, MulAssign, Sub};

/// Three linear Rec. 709 components; a radiance, a flux, a reflectance or a throughput by context.
///
/// Not clamped anywhere: components may exceed one, and gradients may be negative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(into = "[f32; 3]", from = "[f32; 3]")]
pub struct Rgb(Vec3);

impl Rgb {
    /// No light.
    pub const BLACK: Rgb = Rgb(Vec3::ZERO);
    /// One in every component.
    pub const WHITE: Rgb = Rgb(Vec3::ONE);

    /// From three components.
    #[inline(always)]
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Rgb(Vec3::new(r, g, b))
    }
    /// The same value in every component.
    #[inline(always)]
    pub const fn splat(v: f32) -> Self {
        Rgb(Vec3::splat(v))
    }
    /// Red component.
    #[inline(always)]
    pub fn r(self) -> f32 {
        self.0.x
    }
    /// Green component.
    #[inline(always)]
    pub fn g(self) -> f32 {
        self.0.y
    }
    /// Blue component.
    #[inline(always)]
    pub fn b(self) -> f32 {
        self.0.z
    }
    /// Rec. 709 luminance.
    #[inline(always)]
    pub fn luminance(self) -> f32 {
        self.0.dot(Vec3::new(0.212_671, 0.715_160, 0.072_169))
    }
    /// Largest component.
    #[inline(always)]
    pub fn max_component(self) -> f32 {
        self.0.max_element()
    }
    /// Mean of the components.
    #[inline(always)]
    pub fn mean(self) -> f32 {
        (self.0.x + self.0.y + self.0.z) * (1.0 / 3.0)
    }
    /// All components are exactly zero.
    #[inline(always)]
    pub fn is_black(self) -> bool {
        self.0 == Vec3::ZERO
    }
    /// No component is infinite or NaN.
    #[inline(always)]
    pub fn is_finite(self) -> bool {
        self.0.is_finite()
    }
    /// The function applied to each component.
    pub fn map(self, mut f: impl FnMut(f32) -> f32) -> Self {
        Rgb::new(f(self.0.x), f(self.0.y), f(self.0.z))
    }
    /// Components as an array, in the order red, green, blue.
    #[inline(always)]
    pub fn to_array(self) -> [f32; 3] {
        self.0.to_array()
    }
    /// Linear interpolation: `self` at 0, `other` at 1.
    #[inline(always)]
    pub fn lerp(self, other: Rgb, t: f32) -> Rgb {
        Rgb(self.0 * (1.0 - t) + other.0 * t)
    }
    /// Quotient of each component; 0 where the divisor is 0.
    pub fn over(self, o: Rgb) -> Self {
        let quotient = |a: f32, b: f32| if b == 0.0 { 0.0 } else { a / b };
        Rgb::new(quotient(self.r(), o.r()), quotient(self.g(), o.g()), quotient(self.b(), o.b()))
    }
    /// Square root of each component.
    pub fn sqrt(self) -> Self {
        self.map(f32::sqrt)
    }
    /// Every component raised to at least `v`.
    pub fn at_least(self, v: f32) -> Self {
        Rgb(self.0.max(Vec3::splat(v)))
    }
}

impl From<[f32; 3]> for Rgb {
    fn from(v: [f32; 3]) -> Self {
        Rgb(Vec3::from_array(v))
    }
}
impl From<Rgb> for [f32; 3] {
    fn from(v: Rgb) -> Self {
        v.to_array()
    }
}
impl Add for Rgb {
    type Output = Rgb;
    #[inline(always)]
    fn add(self, o: Rgb) -> Rgb {
        Rgb(self.0 + o.0)
    }
}
impl Sub for Rgb {
    type Output = Rgb;
    #[inline(always)]
    fn sub(self, o: Rgb) -> Rgb {
        Rgb(self.0 - o.0)
    }
}
impl Mul for Rgb {
    type Output = Rgb;
    #[inline(always)]
    fn mul(self, o: Rgb) -> Rgb {
        Rgb(self.0 * o.0)
    }
}
impl Mul<f32> for Rgb {
    type Output = Rgb;
    #[inline(always)]
    fn mul(self, o: f32) -> Rgb {
        Rgb(self.0 * o)
    }
}
impl Mul<Rgb> for f32 {
    type Output = Rgb;
    #[inline(always)]
    fn mul(self, o: Rgb) -> Rgb {
        Rgb(o.0 * self)
    }
}
impl Div<f32> for Rgb {
    type Output = Rgb;
    #[inline(always)]
    fn div(self, o: f32) -> Rgb {
        Rgb(self.0 / o)
    }
}
impl Div for Rgb {
    type Output = Rgb;
    #[inline(always)]
    fn div(self, o: Rgb) -> Rgb {
        Rgb(self.0 / o.0)
    }
}
impl AddAssign for Rgb {
    #[inline(always)]
    fn add_assign(&mut self, o: Rgb) {
        self.0 += o.0;
    }
}
impl MulAssign for Rgb {
    #[inline(always)]
    fn mul_assign(&mut self, o: Rgb) {
        self.0 *= o.0;
    }
}
impl MulAssign<f32> for Rgb {
    #[inline(always)]
    fn mul_assign(&mut self, o: f32) {
        self.0 *= o;
    }
}
impl Sum for Rgb {
    fn sum<I: Iterator<Item = Rgb>>(iter: I) -> Rgb {
        iter.fold(Rgb::BLACK, Add::add)
    }
}
impl Index<usize> for Rgb {
    type Output = f32;
    fn index(&self, i: usize) -> &f32 {
        &self.0[i]
    }
}
