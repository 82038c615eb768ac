//! Named indices of refraction.

use crate::math::Rgb;

/// The index of refraction of a dielectric by Mitsuba's name for it.
pub fn dielectric(name: &str) -> Option<f32> {
    DIELECTRICS.iter().find(|(n, _)| *n == name).map(|(_, v)| *v)
}

/// Complex index of refraction `(eta, k)` of a conductor by Mitsuba's name for it.
pub fn conductor(name: &str) -> Option<(Rgb, Rgb)> {
    CONDUCTORS.iter().find(|(n, _, _)| *n == name).map(|(_, eta, k)| (*eta, *k))
}

/// Every name [`dielectric`] knows, with its index of refraction.
pub const DIELECTRICS: &[(&str, f32)] = &[("vacuum", 1.0)];

/// Every name [`conductor`] knows, with `eta` and `k`.
pub const CONDUCTORS: &[(&str, Rgb, Rgb)] = &[("none", Rgb::BLACK, Rgb::WHITE)];
