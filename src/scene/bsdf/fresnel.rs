//! Fresnel terms for unpolarised light, and refraction.

use crate::math::Rgb;
use glam::{Vec3, Vec3A};

/// What happens at a smooth boundary between dielectrics.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// Share of light reflected, in [0, 1]; 1 under total internal reflection.
    pub reflectance: f32,
    /// Cosine of the refracted direction with the normal; its sign is opposite to the given direction's. 0 under total internal reflection.
    pub cos_transmitted: f32,
    /// Index of refraction on the far side over that on the given side.
    pub eta: f32,
}

/// Fresnel's equations for a direction whose cosine with the normal is `cos`, where the index of refraction below the normal over
/// that above is `eta` ([WALTER07 (22)], written as the mean of the two polarisations).
#[inline(always)]
pub fn dielectric(cos: f32, eta: f32) -> Interface {
    let eta = if cos >= 0.0 { eta } else { 1.0 / eta };
    let c = cos.abs();
    // Snell's law, times the squared index. The product form keeps the digits of a grazing cosine.
    let g2 = eta * eta - (1.0 - c) * (1.0 + c);
    if eta == 1.0 {
        return Interface { reflectance: 0.0, cos_transmitted: -cos, eta };
    }
    if g2 <= 0.0 || c <= 0.0 {
        return Interface { reflectance: 1.0, cos_transmitted: 0.0, eta };
    }
    let g = g2.sqrt();
    Interface { reflectance: mean_of_squares(c, g, eta), cos_transmitted: (g / eta).copysign(-cos), eta }
}

/// Share of light reflected where both cosines with the normal are known, each positive, and `eta` is the index on the far side over
/// that on the near side.
#[inline(always)]
pub fn reflectance(cos: f32, cos_transmitted: f32, eta: f32) -> f32 {
    mean_of_squares(cos, eta * cos_transmitted, eta)
}

/// The mean of both polarisations' reflectances; `g` is the index times the refracted cosine.
#[inline(always)]
fn mean_of_squares(c: f32, g: f32, eta: f32) -> f32 {
    // r_s = (c - g) / (c + g) and r_p = (g/eta - eta c) / (g/eta + eta c), over one denominator.
    let eta2_c = eta * eta * c;
    let (sum_s, sum_p) = (c + g, g + eta2_c);
    let inverse = 1.0 / (sum_s * sum_p);
    let (r_s, r_p) = ((c - g) * sum_p * inverse, (g - eta2_c) * sum_s * inverse);
    (0.5 * (r_s * r_s + r_p * r_p)).min(1.0)
}

/// Fresnel's equations for a metal of complex relative index `eta + i k`, at cosine `cos` in [0, 1], exactly (\[MOELLER07\]).
#[inline]
pub fn conductor(cos: f32, eta: Rgb, k: Rgb) -> Rgb {
    // What the equations say of it as well: a perfect mirror is worth no roots.
    if eta.is_black() { Rgb::WHITE } else { real_conductor(cos, eta, k) }
}

#[inline]
fn real_conductor(cos: f32, eta: Rgb, k: Rgb) -> Rgb {
    let (eta, k) = (Vec3A::from_array(eta.to_array()), Vec3A::from_array(k.to_array()));
    let cos2 = cos * cos;
    let sin2 = (1.0 - cos2).max(0.0);
    let difference = eta * eta - k * k - Vec3A::splat(sin2);
    let a2_plus_b2 = sqrt(difference * difference + 4.0 * eta * eta * k * k);
    let a = sqrt((0.5 * (a2_plus_b2 + difference)).max(Vec3A::ZERO));
    let (sum, cross) = (a2_plus_b2 + Vec3A::splat(cos2), 2.0 * cos * a);
    let r_s = quotient(sum - cross, sum + cross);
    let (sum_p, cross_p) = (a2_plus_b2 * cos2 + Vec3A::splat(sin2 * sin2), cross * sin2);
    let r_p = r_s * quotient(sum_p - cross_p, sum_p + cross_p);
    Rgb::from((0.5 * (r_s + r_p)).to_array())
}

#[inline(always)]
fn sqrt(v: Vec3A) -> Vec3A {
    Vec3A::new(v.x.sqrt(), v.y.sqrt(), v.z.sqrt())
}

/// `a / b`, and 1 where both vanish: grazing incidence on an index-matched boundary, whose limit is a matter of definition.
#[inline(always)]
fn quotient(a: Vec3A, b: Vec3A) -> Vec3A {
    Vec3A::select(b.cmpgt(Vec3A::ZERO), a / b, Vec3A::ONE)
}

/// The direction that `w` refracts to at a facet of normal `h`, given the cosine and the relative index of [`dielectric`] for `w . h`.
#[inline(always)]
pub fn refract(w: Vec3, h: Vec3, at: &Interface) -> Vec3 {
    (h * (w.dot(h) / at.eta + at.cos_transmitted) - w / at.eta).normalize_or_zero()
}

/// Share of diffuse light that a smooth boundary of relative index `eta` (far side over near side) reflects.
///
/// Rational fits, as Mitsuba has them: for `eta < 1` \[EGAN73\], else \[DEON11\]; within 0.6 % of the integral for indices up to 2.5.
pub fn diffuse_reflectance(eta: f32) -> f32 {
    let inverse = 1.0 / eta;
    if eta < 1.0 {
        (-1.4399 * eta + 0.7099) * eta + 0.6681 + 0.0636 * inverse
    } else {
        const C: [f32; 6] = [-1.36881, 4.98554, -7.80989, 6.75335, -3.4793, 0.919317];
        C.iter().fold(0.0, |sum, c| sum * inverse + c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_of_a_boundary_reflect_the_same_share() {
        for eta in [0.5f32, 1.33, 1.5, 2.4] {
            for i in 1..100 {
                let cos = i as f32 / 100.0;
                let front = dielectric(cos, eta);
                assert!((0.0..=1.0).contains(&front.reflectance));
                if front.reflectance < 1.0 {
                    let back = dielectric(front.cos_transmitted, eta);
                    // A rounding of the refracted cosine moves a grazing one by far more.
                    let tolerance = 1e-6 / cos;
                    assert!((front.reflectance - back.reflectance).abs() < 8.0 * tolerance, "{eta} {cos}");
                    assert!((back.cos_transmitted - cos).abs() < tolerance, "{eta} {cos}");
                    assert!((front.eta * back.eta - 1.0).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn known_values() {
        assert!((dielectric(1.0, 1.5).reflectance - 0.04).abs() < 1e-6);
        assert_eq!(dielectric(0.3, 1.0).reflectance, 0.0);
        // Beyond the critical angle, acos(sqrt(1 - 1/1.5^2)) = 41.8 degrees.
        assert_eq!(dielectric(-0.74, 1.5).reflectance, 1.0);
        assert!(dielectric(-0.75, 1.5).reflectance < 1.0);
        // Eta 0, k 1: a perfect mirror at every angle, the material "none".
        for i in 0..=10 {
            let mirrors = [conductor, real_conductor].map(|fresnel| fresnel(i as f32 / 10.0, Rgb::BLACK, Rgb::WHITE));
            assert_eq!(mirrors, [Rgb::WHITE; 2]);
        }
        // A metal without absorption is a dielectric.
        for i in 1..=10 {
            let cos = i as f32 / 10.0;
            let (metal, glass) = (conductor(cos, Rgb::splat(1.5), Rgb::BLACK).r(), dielectric(cos, 1.5).reflectance);
            assert!((metal - glass).abs() < 1e-5, "{cos}: {metal} {glass}");
        }
        assert!(conductor(0.0, Rgb::WHITE, Rgb::BLACK).is_finite());
    }
}
