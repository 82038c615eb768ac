//! How much light a rough dielectric boundary lets through.

use super::microfacet::{Microfacet, MicrofacetKind, NormalSampling, reflect};
use super::{beckmann, fresnel};
use crate::math::warp;
use glam::{Vec2, Vec3};

/// Entries of the table: cosines 0, 1/63, ..., 1.
const ENTRIES: usize = 64;

/// The stand-in for a cosine of 0, where the integrals are limits.
const SMALLEST_COS: f32 = 1e-6;

/// Hemispherical transmittance of a rough boundary against the cosine of the direction, and the share of diffuse light that its inside
/// reflects, both as Mitsuba defines them.
#[derive(Clone, Debug)]
pub(super) struct CoatTransmittance {
    table: [f32; ENTRIES],
    /// Share of diffuse light from inside that is reflected: twice the table's mean of reflectance times cosine.
    pub(super) internal_reflectance: f32,
    /// `2 * integral of T(cos) cos d(cos)`: mean transmittance of diffuse light from outside.
    pub(super) mean_external: f32,
}

impl CoatTransmittance {
    /// Integrates the transmittance into a medium of relative index `eta`, for an isotropic distribution.
    pub(super) fn new(distribution: &Microfacet, eta: f32) -> Self {
        let distribution = Microfacet { sampling: NormalSampling::Visible, ..*distribution };
        let cos = |i: usize| (i as f32 / (ENTRIES - 1) as f32).max(SMALLEST_COS);
        let nodes = |relative: f32| gauss_legendre(if relative > 1.0 { 32 } else { 128 });
        let (outer, inner) = (nodes(eta), nodes(1.0 / eta));
        let table = std::array::from_fn(|i| share(&distribution, &outer, cos(i), eta, Through::Transmitted));
        let reflected = |i: usize| share(&distribution, &inner, cos(i), 1.0 / eta, Through::Reflected) * cos(i);
        let internal_reflectance = 2.0 * (0..ENTRIES).map(reflected).sum::<f32>() / ENTRIES as f32;
        let mean_external = 2.0 * (0..ENTRIES).map(|i| table[i] * cos(i)).sum::<f32>() / ENTRIES as f32;
        Self { table, internal_reflectance, mean_external }
    }

    /// Transmittance at a cosine in [0, 1], linear between entries.
    #[inline(always)]
    pub(super) fn at(&self, cos: f32) -> f32 {
        let x = cos * (ENTRIES - 1) as f32;
        let i = (x as usize).min(ENTRIES - 2);
        let t = x - i as f32;
        self.table[i] * (1.0 - t) + self.table[i + 1] * t
    }
}

/// Which light to count.
#[derive(Clone, Copy, PartialEq)]
enum Through {
    Reflected,
    Transmitted,
}

/// Share of the light from cosine `cos` that a boundary of relative index `eta` reflects or transmits, once.
///
/// The square of random numbers that visible normals are drawn with is integrated by a product rule: 32 nodes a side from outside, 128
/// from inside, where total reflection makes a kink. For long-tailed slopes the former is off by up to 4e-4. It is Mitsuba's rule,
/// kept because its error is part of the material's definition; the tables then agree to 1e-5.
fn share(distribution: &Microfacet, nodes: &[(f32, f32)], cos: f32, eta: f32, through: Through) -> f32 {
    let w = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let alpha = distribution.alpha_u;
    let stretched = Vec3::new(alpha * w.x, 0.0, w.z).normalize();
    let mut sum = 0.0f64;
    for &(along, weight_along) in nodes {
        let slope = match distribution.kind {
            MicrofacetKind::Beckmann => beckmann::visible_slope(stretched.z, stretched.x, along),
            MicrofacetKind::Ggx => 0.0,
        };
        // The other coordinate is symmetric: half of it counts twice.
        for &(across, weight_across) in nodes.iter().filter(|n| n.0 < 0.5) {
            let h = match distribution.kind {
                MicrofacetKind::Beckmann => Vec3::new(-slope * alpha, beckmann::gaussian_slope(across) * alpha, 1.0).normalize(),
                MicrofacetKind::Ggx => projected_ggx_normal(alpha, stretched, Vec2::new(across, along)),
            };
            let interface = fresnel::dielectric(w.dot(h), eta);
            let (other, share) = match through {
                Through::Reflected => (reflect(w, h), interface.reflectance),
                Through::Transmitted => (-fresnel::refract(w, h, &interface), 1.0 - interface.reflectance),
            };
            if other.z > 0.0 && share > 0.0 {
                sum += f64::from(2.0 * weight_along * weight_across * share * distribution.shadowing(other).value * other.z);
            }
        }
    }
    sum as f32
}

/// A visible normal by the projected area of the stretched hemisphere (\[HEITZ18\]): the map whose quadrature Mitsuba uses, not the one
/// that directions are sampled with. `w`, stretched, lies in the xz plane.
fn projected_ggx_normal(alpha: f32, w: Vec3, u: Vec2) -> Vec3 {
    let p = warp::disk(u);
    let s = 0.5 * (1.0 + w.z);
    let y = (1.0 - s) * (1.0 - p.x * p.x).max(0.0).sqrt() + s * p.y;
    let along = (1.0 - p.x * p.x - y * y).max(0.0).sqrt();
    let h = Vec3::Y * p.x + Vec3::Y.cross(w) * -y + w * along;
    Vec3::new(alpha * h.x, alpha * h.y, h.z.max(0.0)).normalize_or(Vec3::Z)
}

/// Nodes and weights on [0, 1] that integrate polynomials of degree `2n - 1` exactly ([NR07 4.6]).
fn gauss_legendre(n: usize) -> Vec<(f32, f32)> {
    (0..n)
        .map(|i| {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut derivative = 1.0;
            for _ in 0..16 {
                let (mut p, mut before) = (1.0, 0.0);
                for k in 0..n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0), p);
                }
                derivative = n as f64 * (x * p - before) / (x * x - 1.0);
                x -= p / derivative;
            }
            ((0.5 * (1.0 + x)) as f32, (1.0 / ((1.0 - x * x) * derivative * derivative)) as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_integrates_polynomials() {
        let rule = gauss_legendre(8);
        for power in 0..16 {
            let integral: f64 = rule.iter().map(|&(x, w)| f64::from(w) * f64::from(x).powi(power)).sum();
            assert!((integral - 1.0 / f64::from(power + 1)).abs() < 1e-6, "x^{power}: {integral}");
        }
    }

    /// Against the gold values of Mitsuba's tables.
    #[test]
    fn tables_agree_with_mitsuba() {
        let gold: serde_json::Value = serde_json::from_str(include_str!("../../../tests/oracle/bsdf_values.json")).unwrap();
        for table in gold["rough_tables"].as_array().unwrap() {
            let kind = if table["distribution"] == "ggx" { MicrofacetKind::Ggx } else { MicrofacetKind::Beckmann };
            let alpha = table["alpha"].as_f64().unwrap() as f32;
            let eta = table["eta"].as_f64().unwrap() as f32;
            let coat = CoatTransmittance::new(&Microfacet { kind, alpha_u: alpha, alpha_v: alpha, sampling: NormalSampling::Visible }, eta);
            for (i, t) in table["external_transmittance"].as_array().unwrap().iter().enumerate() {
                let (ours, theirs) = (coat.table[i], t.as_f64().unwrap() as f32);
                assert!((ours - theirs).abs() < 2e-5, "{kind:?} alpha {alpha} eta {eta} entry {i}: {ours}, Mitsuba {theirs}");
            }
            let (ours, theirs) = (coat.internal_reflectance, table["internal_reflectance"].as_f64().unwrap() as f32);
            assert!((ours - theirs).abs() < 2e-5, "{kind:?} alpha {alpha} eta {eta} from inside: {ours}, Mitsuba {theirs}");
        }
    }
}
