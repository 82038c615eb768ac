//! Both densities of a pair of directions, with a Russian roulette that both ends of a path can compute.
//!
//! Weights of bidirectional methods need every density a second time, from the other end of the path. A roulette that asks how long the walk is,
//! or what its throughput is, cannot tell. This one asks the surface and the two directions alone: a walk survives with the share
//! of light that its scattering keeps, `f cos / pdf` (largest component), at most [`CEILING`]. So a density times its survival is
//!
//! ```text
//! min(CEILING pdf, max(f) cos)
//! ```
//!
//! which needs no walk that drew it. Light that goes into a denser medium is not lost, though its radiance shrinks: for walks from the camera
//! `f cos` is multiplied by the squared relative index. The adjoint factor of shading normals has no part in it.

use super::mis::Scatter;
use super::shading::{SurfacePoint, sides_agree};
use crate::math::{Rgb, warp};
use crate::scene::bsdf::{Lobes, Mode};
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Largest survival, so that light caught in lossless glass or between mirrors ends too: after fifty events on average.
pub const CEILING: f32 = 0.98;

/// A direction that a surface point is asked about: its value, and the densities from both ends.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    /// `f(wi -> wo)` over all lobes that are no deltas, without cosine.
    pub f: Rgb,
    /// Density per steradian of the direction, for the walk that came here; survival included.
    pub fwd: f32,
    /// Density per steradian of the direction this walk came from, for one that comes along the direction asked about; survival included.
    pub rev: f32,
}

/// A walk goes on.
#[derive(Clone, Copy, Debug)]
pub struct Onward {
    /// Unit direction.
    pub d: Vec3,
    /// Factor on the throughput: `f cos / pdf`, the adjoint factor in importance mode, over the survival.
    pub weight: Rgb,
    /// Densities in the form weights ask for.
    pub scatter: Scatter<f32>,
}

impl SurfacePoint<'_> {
    /// What the point says about going along the unit direction `w`; `None` where it does not scatter there.
    #[inline(always)]
    pub fn meet(&self, mode: Mode, w: Vec3) -> Option<Met> {
        match self.lambertian {
            Some((reflectance, side)) => self.meet_lambertian(reflectance, side, mode, w),
            None => self.meet_any(mode, w),
        }
    }

    /// [`SurfacePoint::meet`] where light is reflected alike in all directions.
    #[inline(always)]
    fn meet_lambertian(&self, reflectance: Rgb, side: f32, mode: Mode, w: Vec3) -> Option<Met> {
        let (given, sampled) = (self.given_local.z, w.dot(self.frame.n));
        // `sides_agree`, with one product already there.
        if !(w.dot(self.end.n_g) * sampled > 0.0 && sampled * side > 0.0) {
            return None;
        }
        let f = reflectance * FRAC_1_PI;
        let pdfs = [sampled, given].map(|z| warp::cosine_hemisphere_pdf(z * side).0);
        let (fwd, rev) = with_survival(mode, f.max_component(), pdfs, 1.0, [sampled, given]);
        Some(Met { f, fwd, rev })
    }

    /// [`SurfacePoint::meet`] of any material.
    #[inline(never)]
    fn meet_any(&self, mode: Mode, w: Vec3) -> Option<Met> {
        if !sides_agree(w, self.end.n_g, self.frame.n) {
            return None;
        }
        let (given, sampled) = (self.given_local, self.frame.to_local(w));
        let (f, pdfs) = self.bsdf.eval_pdfs(self.uv, given, sampled, mode, Lobes::All);
        if f.is_black() {
            return None;
        }
        let (fwd, rev) = with_survival(mode, f.max_component(), pdfs, self.square_index(given, sampled), [sampled.z, given.z]);
        Some(Met { f, fwd, rev })
    }

    /// The next direction of a walk; `None` where it ends: absorbed, sides that disagree, or the roulette lost. Coordinates are in [0, 1).
    #[inline(never)]
    pub fn scatter(&self, mode: Mode, u_lobe: f32, u: Vec2, u_survive: f32) -> Option<Onward> {
        match self.lambertian {
            Some((reflectance, side)) => self.scatter_lambertian(reflectance, side, mode, u, u_survive),
            None => self.scatter_any(mode, u_lobe, u, u_survive),
        }
    }

    /// [`SurfacePoint::scatter`] where light is reflected alike in all directions: the roulette is known before the direction.
    #[inline(always)]
    fn scatter_lambertian(&self, reflectance: Rgb, side: f32, mode: Mode, u: Vec2, u_survive: f32) -> Option<Onward> {
        let largest = reflectance.max_component();
        let survival = largest.min(CEILING);
        if u_survive >= survival {
            return None;
        }
        let w = warp::cosine_hemisphere(u);
        let d = self.frame.to_world(Vec3::new(w.x, w.y, w.z * side));
        if !sides_agree(d, self.end.n_g, self.frame.n) {
            return None;
        }
        let given = self.given_local.z * side;
        let pdfs = [w.z, given].map(|z| warp::cosine_hemisphere_pdf(z).0);
        let (fwd, rev) = with_survival(mode, largest * pdfs[0] / w.z, pdfs, 1.0, [w.z, given]);
        Some(Onward { d, weight: reflectance * (self.weight_adjoint(mode, d) / survival), scatter: Scatter::rough(fwd, rev) })
    }

    /// [`SurfacePoint::scatter`] of any material.
    #[inline(always)]
    fn scatter_any(&self, mode: Mode, u_lobe: f32, u: Vec2, u_survive: f32) -> Option<Onward> {
        let (s, d) = self.draw(mode, Lobes::All, u_lobe, u)?;
        let index2 = if s.delta { s.eta * s.eta } else { self.square_index(self.given_local, s.w) };
        let largest = s.weight.max_component();
        let kept = match mode {
            Mode::Radiance => largest * index2,
            Mode::Importance => largest,
        };
        let survival = kept.min(CEILING);
        if u_survive >= survival {
            return None;
        }
        let scatter = if s.delta {
            let (fwd, rev) = (s.pdf_fwd * survival, (CEILING * s.pdf_rev).min(kept * s.pdf_fwd));
            match s.eta {
                1.0 => Scatter::reflection(fwd, rev),
                eta => Scatter::refraction(fwd, rev, self.given_local.z.abs(), s.w.z.abs(), eta),
            }
        } else {
            // What a value would be, from the weight.
            let value = largest * s.pdf_fwd / s.w.z.abs();
            let (fwd, rev) = with_survival(mode, value, [s.pdf_fwd, s.pdf_rev], index2, [s.w.z, self.given_local.z]);
            Scatter::rough(fwd, rev)
        };
        Some(Onward { d, weight: s.weight * (self.weight_adjoint(mode, d) / survival), scatter })
    }

    /// The adjoint factor, which walks from the light have.
    #[inline(always)]
    fn weight_adjoint(&self, mode: Mode, d: Vec3) -> f32 {
        match mode {
            Mode::Radiance => 1.0,
            Mode::Importance => self.adjoint(d),
        }
    }

    /// The squared index of refraction on `sampled`'s side over that on `given`'s.
    #[inline(always)]
    fn square_index(&self, given: Vec3, sampled: Vec3) -> f32 {
        if given.z * sampled.z > 0.0 {
            return 1.0;
        }
        let index = self.bsdf.relative_index(given, sampled);
        index * index
    }
}

/// Densities of the direction sampled and of the one given, with survival: `value` is the largest component of `f`, `index2` the squared index
/// on the sampled side over that on the given side, `cosines` those of the sampled and the given direction with the shading normal.
#[inline(always)]
pub(super) fn with_survival(mode: Mode, value: f32, pdfs: [f32; 2], index2: f32, cosines: [f32; 2]) -> (f32, f32) {
    let (sampled, given) = (value * cosines[0].abs(), value * cosines[1].abs());
    // The walk from the camera gains the index of the side it goes to over that of the side it came from.
    let (kept_fwd, kept_rev) = match mode {
        Mode::Radiance => (sampled * index2, given),
        Mode::Importance => (sampled, given / index2),
    };
    ((CEILING * pdfs[0]).min(kept_fwd), (CEILING * pdfs[1]).min(kept_rev))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Frame;
    use crate::samplers::{Key, Purpose, Stream};
    use crate::scene::bsdf::{Bsdf, diffuse::Diffuse, twosided::TwoSided};
    use crate::scene::hit::Endpoint;
    use crate::scene::texture::{Checkerboard, Texture};
    use glam::Affine2;

    /// A constant reflectance answers like a texture of one colour, which is asked like any material: to the last bit, in both walks, on both
    /// sides, where normals are bent.
    #[test]
    fn a_constant_reflectance_answers_like_any_material() {
        let constant = || Texture::Constant(Rgb::new(0.2, 0.7, 0.4));
        let board = || Texture::Checkerboard(Box::new(Checkerboard { color0: constant(), color1: constant(), to_uv: Affine2::IDENTITY }));
        let diffuse = |reflectance| Bsdf::Diffuse(Diffuse { reflectance });
        let twosided = |reflectance| Bsdf::TwoSided(TwoSided { front: Box::new(diffuse(reflectance)), back: None });
        let mut s = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
        let (mut met, mut scattered, mut ended) = (0, 0, 0);
        for (constant, textured) in [(diffuse(constant()), diffuse(board())), (twosided(constant()), twosided(board()))] {
            for _ in 0..2000 {
                let [n_g, bend, given, w] = std::array::from_fn(|_| warp::sphere(Vec2::from(s.next_2d())));
                let n_s = (n_g + 0.5 * bend).normalize();
                if !sides_agree(given, n_g, n_s) {
                    continue;
                }
                let (end, frame) = (Endpoint { n_g, ..Endpoint::free(Vec3::ONE) }, Frame::from_normal(n_s));
                let [quick, slow] = [&constant, &textured].map(|b| SurfacePoint::seen_from(given, b, end, frame, Vec2::ZERO));
                let reflects = matches!(constant, Bsdf::TwoSided(_)) || given.dot(n_s) > 0.0;
                assert_eq!((quick.lambertian.is_some(), slow.lambertian.is_some()), (reflects, false));
                let (u_lobe, u, u_survive) = (s.next_1d(), Vec2::from(s.next_2d()), s.next_1d());
                for mode in [Mode::Radiance, Mode::Importance] {
                    let (a, b) = (quick.meet(mode, w), slow.meet(mode, w));
                    assert_eq!(format!("{a:?}"), format!("{b:?}"));
                    let (c, d) = (quick.scatter(mode, u_lobe, u, u_survive), slow.scatter(mode, u_lobe, u, u_survive));
                    assert_eq!(format!("{c:?}"), format!("{d:?}"));
                    met += usize::from(a.is_some());
                    scattered += usize::from(c.is_some());
                    ended += usize::from(c.is_none());
                }
            }
        }
        assert!(met > 1000 && scattered > 1000 && ended > 1000, "{met}, {scattered}, {ended}");
    }
}
