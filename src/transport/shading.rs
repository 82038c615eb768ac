//! Scattering at a surface point in world space: shading normals, their adjoint factor, and the rule for sides that disagree.

use crate::math::{Frame, Rgb};
use crate::scene::bsdf::{Bsdf, BsdfSample, Lobes, Mode};
use crate::scene::hit::{Endpoint, Hit};
use glam::{Vec2, Vec3};

/// Does a direction lie on the same side of the surface by its geometric and by its shading normal?
///
/// The one rule for directions whose sides disagree, shared by every method and both walks: no light passes along them. Mitsuba's
/// `path` has no such rule, its `ptracer` has this one; `docs/shading-normals.md` lists where the choice moves an image and by how much.
#[inline(always)]
pub fn sides_agree(w: Vec3, n_g: Vec3, n_s: Vec3) -> bool {
    w.dot(n_g) * w.dot(n_s) > 0.0
}

/// A direction sampled at a surface point, in world space.
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// Unit direction of the next ray.
    pub d: Vec3,
    /// Factor on the throughput: `f cos / pdf`, with the adjoint factor in importance mode.
    pub weight: Rgb,
    /// Density of `d` per steradian, or its probability for a delta.
    pub pdf_fwd: f32,
    /// Density of the direction the walk came from, had it come along `d`.
    pub pdf_rev: f32,
    /// From a delta lobe.
    pub delta: bool,
    /// Roughness of the lobe, 0 for a delta.
    pub roughness: f32,
    /// Index of refraction on the sampled side over that on the given side.
    pub eta: f32,
}

/// A surface point reached by a walk, ready to scatter.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint<'a> {
    /// The material there.
    pub bsdf: &'a Bsdf,
    /// Where.
    pub end: Endpoint,
    /// Shading frame.
    pub frame: Frame,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Unit direction the walk came from, world space.
    pub given: Vec3,
    /// The same in the shading frame.
    pub given_local: Vec3,
    /// What [`Bsdf::as_lambertian`] says: many directions are asked about at one point, and of this material little is to be asked.
    pub(super) lambertian: Option<(Rgb, f32)>,
}

impl<'a> SurfacePoint<'a> {
    /// At a hit, for a ray that travelled along `d`. `None` where the sides of `-d` disagree: nothing scatters there.
    #[inline(always)]
    pub fn new(hit: &Hit, bsdf: &'a Bsdf, d: Vec3) -> Option<Self> {
        let given = -d;
        bsdf.prefetch(hit.uv);
        sides_agree(given, hit.end.n_g, hit.frame.n).then(|| Self::seen_from(given, bsdf, hit.end, hit.frame, hit.uv))
    }

    /// A point of that material, frame and texture coordinates, for a walk that came from the unit direction `given`, whose sides agree.
    #[inline(always)]
    pub fn seen_from(given: Vec3, bsdf: &'a Bsdf, end: Endpoint, frame: Frame, uv: Vec2) -> Self {
        let given_local = frame.to_local(given);
        Self { bsdf, end, frame, uv, given, given_local, lambertian: bsdf.as_lambertian(given_local.z) }
    }

    /// Roughness of the roughest lobe that light from where the walk came may meet; 0 where nothing but deltas, or nothing, scatters it.
    #[inline(always)]
    pub fn max_roughness(&self) -> f32 {
        self.bsdf.max_roughness_from(self.given_local.z)
    }

    /// `f(wi -> wo)` towards the world direction `w` and the density of `w`, over the lobes asked for and without any cosine; black
    /// where the sides of `w` disagree.
    #[inline(always)]
    pub fn eval_pdf(&self, w: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        if !sides_agree(w, self.end.n_g, self.frame.n) {
            return (Rgb::BLACK, 0.0);
        }
        self.bsdf.eval_pdf(self.uv, self.given_local, self.frame.to_local(w), mode, lobes)
    }

    /// A next direction. `None` where the walk ends: absorbed, or the sides of the sampled direction disagree.
    #[inline(always)]
    pub fn sample(&self, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<Scattered> {
        let (s, d) = self.draw(mode, lobes, u_lobe, u)?;
        let weight = match mode {
            Mode::Radiance => s.weight,
            Mode::Importance => s.weight * self.adjoint(d),
        };
        Some(Scattered { d, weight, pdf_fwd: s.pdf_fwd, pdf_rev: s.pdf_rev, delta: s.delta, roughness: s.roughness, eta: s.eta })
    }

    /// [`SurfacePoint::sample`] as the material says it, without the adjoint factor, and the world direction.
    #[inline(always)]
    pub(super) fn draw(&self, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<(BsdfSample, Vec3)> {
        let s = self.bsdf.sample(self.uv, self.given_local, mode, lobes, u_lobe, u)?;
        let d = self.frame.to_world(s.w);
        sides_agree(d, self.end.n_g, self.frame.n).then_some((s, d))
    }

    /// What a value `f` is multiplied by, for a walk that came from `given` and leaves along `d`: the cosine with the shading normal, and in
    /// importance mode [`SurfacePoint::adjoint`].
    #[inline(always)]
    pub fn cosine(&self, mode: Mode, d: Vec3) -> f32 {
        match mode {
            Mode::Radiance => d.dot(self.frame.n).abs(),
            Mode::Importance => (self.given_local.z * d.dot(self.end.n_g) / self.given.dot(self.end.n_g)).abs(),
        }
    }

    /// The adjoint factor of shading normals, `|wi.n_s| |wo.n_g| / (|wi.n_g| |wo.n_s|)`, for a light-side walk that came along `wi` =
    /// `given` and leaves along `wo` = `d`: the quotient of [VEACH 5.3]'s adjoint to the plain `f |wo.n_s|`. 1 where the normals are one.
    #[inline]
    pub fn adjoint(&self, d: Vec3) -> f32 {
        let (n_g, n_s) = (self.end.n_g, self.frame.n);
        let numerator = self.given_local.z * d.dot(n_g);
        let denominator = self.given.dot(n_g) * d.dot(n_s);
        (numerator / denominator).abs()
    }
}
