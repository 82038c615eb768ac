//! Distributions of microfacet normals.

/// The family of the distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MicrofacetKind {
    /// Gaussian slopes.
    Beckmann,
    /// Trowbridge and Reitz's, with longer tails.
    Ggx,
}

/// How normals are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NormalSampling {
    /// Those seen from the given direction, in proportion to what is seen of them.
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

/// The smoothest surface that 32-bit arithmetic bears; Mitsuba raises smaller values to it.
pub const MIN_ALPHA: f32 = 1e-4;
