//! Distributions of microfacet normals: density, shadowing and sampling.
//!
//! Normals and directions are unit vectors in the shading frame. Normals lie above the surface (z > 0); directions may lie on either
//! side where a function says so.

use super::beckmann;
use crate::math::elementary::{exp_negative, sin_cos_turns};
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// The family of the distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MicrofacetKind {
    /// Gaussian slopes ([WALTER07 (25)]).
    Beckmann,
    /// Trowbridge and Reitz's, with longer tails ([WALTER07 (33)]).
    Ggx,
}

/// How normals are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NormalSampling {
    /// Those seen from the given direction, in proportion to what is seen of them (\[HEITZ14V\]).
    Visible,
    /// All of them, in proportion to their projected area.
    All,
}

/// A distribution of microfacet normals.
#[derive(Clone, Copy, Debug)]
pub struct Microfacet {
    /// The family.
    pub kind: MicrofacetKind,
    /// Roughness along the frame's first tangent (for Beckmann the root mean square slope times sqrt(2)); at least [`MIN_ALPHA`].
    pub alpha_u: f32,
    /// Roughness along the frame's second tangent; at least [`MIN_ALPHA`].
    pub alpha_v: f32,
    /// How normals are drawn.
    pub sampling: NormalSampling,
}

/// `G1(w)/|w.z|` of a direction, the share of facets that it sees over its cosine; finite at grazing angles.
#[derive(Clone, Copy, Debug)]
pub struct Shadowing {
    /// As values use it: for Beckmann, \[WALTER07\]'s rational fit (27), as Mitsuba has it.
    pub value: f32,
    /// As the density of visible normals needs it, so that the density integrates to one: for Beckmann the exact function. The fit is
    /// off by up to 0.35 %.
    pub exact: f32,
}

/// The smoothest surface that 32-bit arithmetic bears; Mitsuba raises smaller values to it.
pub const MIN_ALPHA: f32 = 1e-4;

/// Below this cosine a facet counts as seen edge on: densities per steradian, up to `1/(pi MIN_ALPHA^2 EDGE_ON)`, stay finite.
pub(super) const EDGE_ON: f32 = 1e-20;

impl Microfacet {
    /// Roughness as [`super::Lobes`] counts it.
    #[inline(always)]
    pub fn roughness(&self) -> f32 {
        (self.alpha_u * self.alpha_v).sqrt()
    }

    /// Do the two tangents differ?
    pub fn anisotropic(&self) -> bool {
        self.alpha_u != self.alpha_v
    }

    /// The same distribution with both roughnesses multiplied.
    #[inline(always)]
    pub(super) fn scaled(&self, factor: f32) -> Self {
        Self { alpha_u: self.alpha_u * factor, alpha_v: self.alpha_v * factor, ..*self }
    }

    /// `D(h)`, area of microfacets per steradian of normals and per unit of macroscopic area, for `h.z > 0`.
    #[inline(always)]
    pub fn d(&self, h: Vec3) -> f32 {
        let inverse = 1.0 / (self.alpha_u * self.alpha_v);
        let (x, y, cos2) = (h.x * self.alpha_v * inverse, h.y * self.alpha_u * inverse, h.z * h.z);
        let slope2 = x * x + y * y;
        let d = match self.kind {
            MicrofacetKind::Beckmann => {
                let inverse_cos2 = 1.0 / cos2;
                FRAC_1_PI * inverse * exp_negative(-slope2 * inverse_cos2) * (inverse_cos2 * inverse_cos2)
            }
            MicrofacetKind::Ggx => FRAC_1_PI * inverse / ((slope2 + cos2) * (slope2 + cos2)),
        };
        // Mitsuba's cut-off; it also turns the 0/0 of a normal in the tangent plane into 0.
        if d * h.z > 1e-20 { d } else { 0.0 }
    }

    /// Length of the direction's tangential part after stretching by the roughness: `alpha |tan| = stretched / |z|`.
    #[inline(always)]
    fn stretched(&self, w: Vec3) -> f32 {
        let (x, y) = (w.x * self.alpha_u, w.y * self.alpha_v);
        (x * x + y * y).sqrt()
    }

    /// Shadowing of a direction, above the surface or below. The facet must be seen from its front.
    #[inline(always)]
    pub fn shadowing(&self, w: Vec3) -> Shadowing {
        let (cos, s) = (w.z.abs(), self.stretched(w));
        match self.kind {
            MicrofacetKind::Ggx => {
                let value = 2.0 / (cos + (cos * cos + s * s).sqrt());
                Shadowing { value, exact: value }
            }
            MicrofacetKind::Beckmann => {
                Shadowing { value: beckmann::fitted_g1_over_cos(cos, s), exact: beckmann::exact_g1_over_cos(cos, s) }
            }
        }
    }

    /// Density per steradian of drawing the normal `h` for a direction above the surface whose shadowing is `g` and whose cosine with
    /// the normal is `cos_h > 0`; `d` is `D(h)`.
    #[inline(always)]
    pub fn pdf(&self, g: Shadowing, h: Vec3, cos_h: f32, d: f32) -> f32 {
        match self.sampling {
            NormalSampling::Visible => d * g.exact * cos_h,
            NormalSampling::All => d * h.z,
        }
    }

    /// Density per steradian of the direction that a direction is reflected to at the facet `h`; arguments as for [`Microfacet::pdf`].
    #[inline(always)]
    pub fn reflection_pdf(&self, g: Shadowing, h: Vec3, cos_h: f32, d: f32) -> f32 {
        match self.sampling {
            NormalSampling::Visible => 0.25 * d * g.exact,
            // A facet seen from its back reflects nothing, and one seen edge on would have a density beyond what numbers hold.
            NormalSampling::All if cos_h > EDGE_ON => 0.25 * d * h.z / cos_h,
            NormalSampling::All => 0.0,
        }
    }

    /// A normal drawn for the direction `w` above the surface. It may face away from `w` if all normals are drawn.
    #[inline]
    pub fn sample(&self, w: Vec3, u: Vec2) -> Vec3 {
        match (self.sampling, self.kind) {
            (NormalSampling::All, kind) => {
                // Both distributions of slopes are circles stretched by the roughness.
                let radius = match kind {
                    MicrofacetKind::Beckmann => (-(-u.x).ln_1p()).sqrt(),
                    MicrofacetKind::Ggx => (u.x / (1.0 - u.x)).sqrt(),
                };
                let (sin, cos) = sin_cos_turns(u.y);
                Vec3::new(self.alpha_u * radius * cos, self.alpha_v * radius * sin, 1.0).normalize()
            }
            (NormalSampling::Visible, MicrofacetKind::Ggx) => self.sample_visible_ggx(w, u),
            (NormalSampling::Visible, MicrofacetKind::Beckmann) => self.sample_visible_beckmann(w, u),
        }
    }

    /// The visible part of a stretched sphere is, seen in the mirror, a spherical cap: \[DUPUY23\].
    #[inline(always)]
    fn sample_visible_ggx(&self, w: Vec3, u: Vec2) -> Vec3 {
        let stretched = Vec3::new(w.x * self.alpha_u, w.y * self.alpha_v, w.z).normalize();
        let (sin_phi, cos_phi) = sin_cos_turns(u.x);
        let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
        let sin = (1.0 - z * z).max(0.0).sqrt();
        let h = Vec3::new(sin * cos_phi, sin * sin_phi, z) + stretched;
        Vec3::new(h.x * self.alpha_u, h.y * self.alpha_v, h.z.max(0.0)).normalize_or(Vec3::Z)
    }

    #[inline(always)]
    fn sample_visible_beckmann(&self, w: Vec3, u: Vec2) -> Vec3 {
        let stretched = Vec3::new(w.x * self.alpha_u, w.y * self.alpha_v, w.z).normalize();
        let sin = stretched.truncate().length();
        let along = if sin > 0.0 { stretched.truncate() / sin } else { Vec2::X };
        // Slopes of a surface of roughness 1, first along the direction, then across it; turned and stretched back.
        let slope = Vec2::new(beckmann::visible_slope(stretched.z, sin, u.x), beckmann::gaussian_slope(u.y));
        let slope = Vec2::new(along.x * slope.x - along.y * slope.y, along.y * slope.x + along.x * slope.y);
        Vec3::new(-slope.x * self.alpha_u, -slope.y * self.alpha_v, 1.0).normalize()
    }
}

/// The mirror image of `w` about `h`.
#[inline(always)]
pub(super) fn reflect(w: Vec3, h: Vec3) -> Vec3 {
    (h * (2.0 * w.dot(h)) - w).normalize()
}
