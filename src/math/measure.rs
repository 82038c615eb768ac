//! Probability densities that carry their measure in the type; conversions have one home.

use std::ops::{Add, Div, Mul};

macro_rules! density {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f32);

        impl Mul<f32> for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, k: f32) -> Self {
                Self(self.0 * k)
            }
        }
        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                Self(self.0 + o.0)
            }
        }
        impl Div for $name {
            type Output = f32;
            #[inline(always)]
            fn div(self, o: Self) -> f32 {
                self.0 / o.0
            }
        }
    };
}

density! {
    /// Density per steradian (no projected-solid-angle cosine). Zero or more; a delta lobe has none and answers 0.
    ///
    /// ```compile_fail,E0308
    /// let a: isophote::math::AreaPdf = isophote::math::SolidAnglePdf(0.5);
    /// ```
    SolidAnglePdf
}

density! {
    /// Density per unit surface area, in inverse squared world units.
    AreaPdf
}

impl SolidAnglePdf {
    /// The density on a surface at squared distance `distance2`, whose normal makes `cos` with the direction.
    #[inline(always)]
    pub fn to_area(self, cos: f32, distance2: f32) -> AreaPdf {
        AreaPdf(self.0 * cos.abs() / distance2)
    }
}

impl AreaPdf {
    /// The density of directions towards a surface point at squared distance `distance2` seen under `cos`; infinite at grazing angles.
    #[inline(always)]
    pub fn to_solid_angle(self, cos: f32, distance2: f32) -> SolidAnglePdf {
        SolidAnglePdf(self.0 * distance2 / cos.abs())
    }
}
