//! Which photon counts at which surface point, and what it adds there: one rule for flux, targets and statistics.

use super::shading::{SurfacePoint, sides_agree};
use crate::math::Rgb;
use crate::scene::bsdf::Lobes;
use glam::Vec3;

/// The largest angle between the normals of a photon and of a measurement point that takes it: 60 degrees. It keeps light from the other
/// side of thin objects and from around corners; what it removes near a corner is part of the radius' bias.
const NORMAL_COSINE: f32 = 0.5;

/// Does a photon on a surface of normal `photon_n_g` that came from `wi` count at a point of geometric normal `n_g` and shading normal
/// `n_s`, if it lies within the point's radius? What is refused here is zero in [`merge`], so a sampler whose target asks this rule aims at
/// everything that carries flux.
#[inline(always)]
pub fn accepts(n_g: Vec3, n_s: Vec3, photon_n_g: Vec3, wi: Vec3) -> bool {
    photon_n_g.dot(n_g) >= NORMAL_COSINE && sides_agree(wi, n_g, n_s)
}

/// What one accepted photon inside the disk adds per unit of flux: `f |wi.n_s|/|wi.n_g|`, per steradian.
#[inline]
pub fn merge(at: &SurfacePoint<'_>, wi: Vec3, threshold: f32) -> Rgb {
    let local = at.frame.to_local(wi);
    let ratio = local.z.abs() / wi.dot(at.end.n_g).abs();
    at.bsdf.eval(at.uv, local, at.given_local, Lobes::Rough(threshold)) * ratio
}

/// `|wi.n_s|/|wi.n_g|`: photons arrive per geometric area, so the shading cosine enters as a ratio ([VEACH 5.3]).
#[inline(always)]
pub fn cosine_ratio(at: &SurfacePoint<'_>, wi: Vec3) -> f32 {
    (wi.dot(at.frame.n) / wi.dot(at.end.n_g)).abs()
}
