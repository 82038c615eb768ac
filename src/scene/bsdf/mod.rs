//! Materials. A bidirectional scattering distribution function is a value, a density and a way to sample it.
//!
//! **Directions** are unit vectors in the shading frame (z along the shading normal) and both point away from the surface.
//! `wi` points towards the light and `wo` towards the eye, whichever of the two a walk came from; a function that does not care
//! about light and eye speaks of `given` (where the walk came from) and `sampled` (where it goes).
//!
//! **Values** are `f(wi -> wo)` for radiance, without a cosine: refraction carries its `(eta_i/eta_t)^2` by the roles of the two
//! directions, so light-side walks need no other function ([VEACH 5.2]), only the adjoint factor for shading normals
//! (`transport`). Delta lobes have no value and no density: they exist in [`Bsdf::sample`] alone.

use crate::math::Rgb;
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};
use twosided::turned;

/// What is carried along a walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The walk started at the camera: `given` is `wo`, `sampled` is `wi`.
    Radiance,
    /// The walk started at a light: `given` is `wi`, `sampled` is `wo`.
    Importance,
}

impl Mode {
    /// `(wi, wo)` of a walk's `(given, sampled)`.
    #[inline(always)]
    pub fn roles(self, given: Vec3, sampled: Vec3) -> (Vec3, Vec3) {
        match self {
            Mode::Radiance => (sampled, given),
            Mode::Importance => (given, sampled),
        }
    }
}

/// Which lobes of a material take part, by roughness: diffuse 1, microfacet `sqrt(alpha_u alpha_v)`, Phong `sqrt(2/(n+2))`, delta 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lobes {
    /// Every lobe.
    All,
    /// Lobes that are not deltas and whose roughness is at least this.
    Rough(f32),
    /// What [`Lobes::Rough`] with the same number leaves: rougher lobes are out, deltas are in.
    Smooth(f32),
}

impl Lobes {
    /// Does a lobe of this roughness take part? `0` means a delta.
    #[inline(always)]
    pub fn admit(self, roughness: f32) -> bool {
        match self {
            Lobes::All => true,
            Lobes::Rough(threshold) => roughness > 0.0 && roughness >= threshold,
            Lobes::Smooth(threshold) => roughness <= 0.0 || roughness < threshold,
        }
    }
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// The sampled direction.
    pub w: Vec3,
    /// `f |cos(w)| / pdf_fwd`, in the mode asked for, over the lobes asked for; finite and not negative.
    pub weight: Rgb,
    /// Density of `w` given the other direction, over the lobes asked for: per steradian, or for a delta lobe its probability.
    pub pdf_fwd: f32,
    /// The same with the roles exchanged: density of the given direction, had the walk come from `w`.
    pub pdf_rev: f32,
    /// The direction comes from a delta lobe.
    pub delta: bool,
    /// Roughness of the lobe sampled, see [`Lobes`].
    pub roughness: f32,
    /// Index of refraction on the sampled side over that on the given side; 1 for reflection and null transmission.
    pub eta: f32,
}

/// The delta lobe that joins two directions, as [`Bsdf::delta`] finds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeltaLobe {
    /// Probability with which a walk that came from the given direction chooses it: what [`BsdfSample::pdf_fwd`] would be.
    pub probability: f32,
    /// Share of the light from the given direction that goes this way: the sample's weight in importance mode times the probability.
    pub value: Rgb,
    /// As [`BsdfSample::eta`].
    pub eta: f32,
}

impl DeltaLobe {
    /// The same lobe where a walk comes to it with this probability, and this share of the light.
    #[inline]
    fn part(self, probability: f32, share: f32) -> Self {
        Self { probability: self.probability * probability, value: self.value * share, ..self }
    }
}

/// Are two unit directions one but for the rounding of the points they were found from? 3 mrad.
#[inline]
fn same_direction(a: Vec3, b: Vec3) -> bool {
    a.distance_squared(b) < 1e-5
}

/// The mirror image of a direction.
#[inline]
fn mirrored(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, -w.y, w.z)
}

impl BsdfSample {
    /// Itself, or nothing if it carries nothing: the walk ends there.
    #[inline(always)]
    fn if_not_black(self) -> Option<Self> {
        if self.weight.is_black() { None } else { Some(self) }
    }
}

/// Every material. Adding one touches its own file, this list and one line of the loader's table.
#[derive(Clone, Debug)]
pub enum Bsdf {
    /// Lambertian reflection from the front.
    Diffuse(diffuse::Diffuse),
    /// The same material (or another one) on the back as well.
    TwoSided(twosided::TwoSided),
    /// Smooth glass with an inside and an outside.
    Dielectric(dielectric::Dielectric),
    /// A smooth pane, both of whose faces are this surface.
    ThinDielectric(thindielectric::ThinDielectric),
    /// Smooth metal.
    Conductor(conductor::Conductor),
    /// Metal with a microfacet surface.
    RoughConductor(roughconductor::RoughConductor),
    /// Glass with a microfacet surface.
    RoughDielectric(roughdielectric::RoughDielectric),
    /// A diffuse base under a smooth dielectric coat.
    Plastic(plastic::Plastic),
    /// A diffuse base under a microfacet dielectric coat.
    RoughPlastic(Box<roughplastic::RoughPlastic>),
    /// A weighted sum of two materials.
    Blend(blend::Blend),
    /// A material with holes.
    Mask(mask::Mask),
    /// The energy-conserving Phong model.
    Phong(phong::Phong),
}

macro_rules! dispatch {
    ($self:expr, $b:ident => $call:expr) => {
        match $self {
            Bsdf::Diffuse($b) => $call,
            Bsdf::TwoSided($b) => $call,
            Bsdf::Dielectric($b) => $call,
            Bsdf::ThinDielectric($b) => $call,
            Bsdf::Conductor($b) => $call,
            Bsdf::RoughConductor($b) => $call,
            Bsdf::RoughDielectric($b) => $call,
            Bsdf::Plastic($b) => $call,
            Bsdf::RoughPlastic($b) => $call,
            Bsdf::Blend($b) => $call,
            Bsdf::Mask($b) => $call,
            Bsdf::Phong($b) => $call,
        }
    };
}

/// What every material says whose lobes are all deltas: no value, no density.
macro_rules! all_deltas {
    () => {
        #[inline(always)]
        pub(super) fn eval(&self, _uv: Vec2, _wi: Vec3, _wo: Vec3, _lobes: Lobes) -> Rgb {
            Rgb::BLACK
        }

        #[inline(always)]
        pub(super) fn pdf(&self, _uv: Vec2, _given: Vec3, _sampled: Vec3, _lobes: Lobes) -> f32 {
            0.0
        }

        #[inline(always)]
        pub(super) fn eval_pdf(&self, _uv: Vec2, _given: Vec3, _sampled: Vec3, _mode: Mode, _lobes: Lobes) -> (Rgb, f32) {
            (Rgb::BLACK, 0.0)
        }

        pub(super) fn admitted_by(&self, lobes: Lobes) -> bool {
            lobes.admit(0.0)
        }

        pub(super) fn max_roughness(&self) -> f32 {
            0.0
        }

        pub(super) fn anisotropic(&self) -> bool {
            false
        }
    };
}

/// What every material says that has no delta lobe.
macro_rules! no_delta {
    () => {
        #[inline]
        pub(super) fn delta(&self, _uv: Vec2, _given: Vec3, _sampled: Vec3) -> Option<super::DeltaLobe> {
            None
        }
    };
}

impl Bsdf {
    /// `f(wi -> wo)` for radiance, without cosine, over the non-delta lobes among `lobes`.
    #[inline]
    pub fn eval(&self, uv: Vec2, wi: Vec3, wo: Vec3, lobes: Lobes) -> Rgb {
        dispatch!(self, b => b.eval(uv, wi, wo, lobes))
    }

    /// Density per steradian of `sampled` given `given`, over the non-delta lobes among `lobes`; includes the probability of choosing
    /// a non-delta lobe, so it integrates to at most 1.
    #[inline]
    pub fn pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, lobes: Lobes) -> f32 {
        dispatch!(self, b => b.pdf(uv, given, sampled, lobes))
    }

    /// The delta lobe that takes `given` to `sampled`, `None` if there is none: what [`Bsdf::sample`] over all lobes would report of it. Asked
    /// with the roles exchanged it tells of the way back. Directions count as joined within 3 mrad; of two lobes that both join them, the
    /// one that [`blend::Blend`] names first.
    pub fn delta(&self, uv: Vec2, given: Vec3, sampled: Vec3) -> Option<DeltaLobe> {
        dispatch!(self, b => b.delta(uv, given, sampled))
    }

    /// Index of refraction on `sampled`'s side over that on `given`'s side, by lobes that are no deltas; 1 on one side. Where materials of
    /// different indices are blended, that of the first that light passes.
    #[inline]
    pub fn relative_index(&self, given: Vec3, sampled: Vec3) -> f32 {
        if given.z * sampled.z > 0.0 {
            return 1.0;
        }
        match self {
            Bsdf::RoughDielectric(b) if given.z > 0.0 => b.eta,
            Bsdf::RoughDielectric(b) => 1.0 / b.eta,
            Bsdf::Mask(b) => b.nested.relative_index(given, sampled),
            Bsdf::Blend(b) if b.first.transmissive() => b.first.relative_index(given, sampled),
            Bsdf::Blend(b) => b.second.relative_index(given, sampled),
            _ => 1.0,
        }
    }

    /// The material that faces `w`, one wrapper taken off, and the side it is on: directions are [`twosided::turned`] to it.
    ///
    /// Here and not in the list of materials, so that a wrapped material is chosen from the list once.
    #[inline(always)]
    fn facing(&self, w: Vec3) -> (&Bsdf, f32) {
        match self {
            Bsdf::TwoSided(b) => b.facing(w),
            _ => (self, 1.0),
        }
    }

    /// The reflectance, where the side that faces a direction of this local z is [`diffuse`] and nothing else, and the side: a direction's
    /// local z times it is positive where the surface reflects.
    #[inline(always)]
    pub fn as_diffuse(&self, z: f32) -> Option<(&Texture, f32)> {
        match self.facing(Vec3::new(0.0, 0.0, z)) {
            (Bsdf::Diffuse(b), side) => Some((&b.reflectance, side)),
            _ => None,
        }
    }

    /// The reflectance on the side of a direction of this local z, and that side (1 or -1), where the material there is [`diffuse`] and nothing else,
    /// and the same everywhere; `None` too where it is black.
    #[inline(always)]
    pub fn as_lambertian(&self, z: f32) -> Option<(Rgb, f32)> {
        match self.as_diffuse(z)? {
            (Texture::Constant(reflectance), side) if z * side > 0.0 && !reflectance.is_black() => Some((*reflectance, side)),
            _ => None,
        }
    }

    /// [`Bsdf::eval`] and [`Bsdf::pdf`] at once, for a walk in `mode`: what next event estimation asks.
    #[inline(always)]
    pub fn eval_pdf(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        let (b, side) = self.facing(given);
        let (given, sampled) = (turned(given, side), turned(sampled, side));
        match b {
            Bsdf::Diffuse(b) => b.eval_pdf(uv, given, sampled, mode, lobes),
            _ => {
                let (f, pdf) = b.eval_pdf_any(uv, &given, &sampled, mode, lobes);
                (f, pdf)
            }
        }
    }

    /// [`Bsdf::eval_pdf`], and beside the density of `sampled` given `given` that with the roles exchanged, as [`Bsdf::pdf`] says it.
    #[inline(always)]
    pub fn eval_pdfs(&self, uv: Vec2, given: Vec3, sampled: Vec3, mode: Mode, lobes: Lobes) -> (Rgb, [f32; 2]) {
        let (b, side) = self.facing(given);
        let (given, sampled) = (turned(given, side), turned(sampled, side));
        match b {
            Bsdf::Diffuse(b) => {
                let (f, pdf) = b.eval_pdf(uv, given, sampled, mode, lobes);
                (f, [pdf, b.pdf(uv, sampled, given, lobes)])
            }
            _ => b.eval_pdfs_any(uv, &given, &sampled, mode, lobes),
        }
    }

    /// [`Bsdf::eval_pdfs`] out of line. Materials have an answer of their own where value and densities share what takes time.
    #[inline(never)]
    fn eval_pdfs_any(&self, uv: Vec2, given: &Vec3, sampled: &Vec3, mode: Mode, lobes: Lobes) -> (Rgb, [f32; 2]) {
        match self {
            Bsdf::RoughConductor(b) => b.eval_pdfs(uv, *given, *sampled, lobes),
            Bsdf::Phong(b) => b.eval_pdfs(uv, *given, *sampled, lobes),
            Bsdf::Blend(b) => b.eval_pdfs(uv, *given, *sampled, mode, lobes),
            b => {
                let (f, pdf) = dispatch!(b, b => b.eval_pdf(uv, *given, *sampled, mode, lobes));
                (f, [pdf, b.pdf(uv, *sampled, *given, lobes)])
            }
        }
    }

    /// [`Bsdf::eval_pdf`] out of line: the commonest material is worth a place in every loop, all of them are not.
    #[inline(never)]
    fn eval_pdf_any(&self, uv: Vec2, given: &Vec3, sampled: &Vec3, mode: Mode, lobes: Lobes) -> (Rgb, f32) {
        dispatch!(self, b => b.eval_pdf(uv, *given, *sampled, mode, lobes))
    }

    /// A direction drawn from the lobes asked for, deltas included; `None` where the walk ends (absorbed, or below the surface).
    /// `u_lobe` chooses the lobe, `u` the direction; each coordinate is in [0, 1).
    #[inline(always)]
    pub fn sample(&self, uv: Vec2, given: Vec3, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (b, side) = self.facing(given);
        let given = turned(given, side);
        let s = match b {
            Bsdf::Diffuse(b) => b.sample(uv, given, mode, lobes, u_lobe, u)?,
            _ => {
                // Part by part, so that the result of the case above need not go through the memory that this call writes to.
                let BsdfSample { w, weight, pdf_fwd, pdf_rev, delta, roughness, eta } = b.sample_any(uv, &given, mode, lobes, u_lobe, u)?;
                BsdfSample { w, weight, pdf_fwd, pdf_rev, delta, roughness, eta }
            }
        };
        Some(BsdfSample { w: turned(s.w, side), ..s })
    }

    /// [`Bsdf::sample`] out of line.
    #[inline(never)]
    fn sample_any(&self, uv: Vec2, given: &Vec3, mode: Mode, lobes: Lobes, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        dispatch!(self, b => b.sample(uv, *given, mode, lobes, u_lobe, u))
    }

    /// The share of light from `given` that the lobes asked for scatter on (mean over colour, in [0, 1]), exact or approximate: for
    /// choices only, which are divided by it. Zero only where [`Bsdf::sample`] always answers `None`.
    #[inline]
    pub fn albedo(&self, uv: Vec2, given: Vec3, lobes: Lobes) -> f32 {
        dispatch!(self, b => b.albedo(uv, given, lobes))
    }

    /// Does any lobe, on any side, pass the filter?
    #[inline]
    pub fn admitted_by(&self, lobes: Lobes) -> bool {
        dispatch!(self, b => b.admitted_by(lobes))
    }

    /// Roughness of the roughest lobe there is anywhere on the surface; 0 if all are deltas.
    #[inline(always)]
    pub fn max_roughness(&self) -> f32 {
        match self {
            Bsdf::Diffuse(b) => b.max_roughness(),
            Bsdf::TwoSided(b) => b.max_roughness(),
            _ => self.max_roughness_any(),
        }
    }

    /// Roughness of the roughest lobe there may be on the side that a direction of this local z comes from: 0 if all are deltas, or none is,
    /// as behind most materials that are not [`twosided`].
    #[inline(always)]
    pub fn max_roughness_from(&self, z: f32) -> f32 {
        match self {
            Bsdf::Diffuse(b) if z > 0.0 => b.max_roughness(),
            Bsdf::TwoSided(b) => b.max_roughness(),
            _ if z > 0.0 || !self.black_behind() => self.max_roughness_any(),
            _ => 0.0,
        }
    }

    /// Do deltas at most scatter what comes from behind?
    fn black_behind(&self) -> bool {
        match self {
            Bsdf::Diffuse(_) => true,
            Bsdf::TwoSided(_) => false,
            Bsdf::Mask(b) => b.nested.black_behind(),
            Bsdf::Blend(b) => b.first.black_behind() && b.second.black_behind(),
            b => !b.transmissive(),
        }
    }

    /// Fetches the texels that questions about this point will soon ask for: they come from far away, and there is other work until then.
    #[inline(always)]
    pub fn prefetch(&self, uv: Vec2) {
        if let Some(texture) = self.main_texture() {
            texture.prefetch(uv);
        }
    }

    /// The texture that nearly every question asks for.
    #[inline(always)]
    fn main_texture(&self) -> Option<&Texture> {
        let mut b = self;
        while let Bsdf::TwoSided(sides) = b {
            b = &sides.front;
        }
        match b {
            Bsdf::Diffuse(b) => Some(&b.reflectance),
            Bsdf::Plastic(b) => Some(b.diffuse_reflectance()),
            Bsdf::RoughPlastic(b) => Some(b.diffuse_reflectance()),
            Bsdf::Phong(b) => Some(&b.diffuse_reflectance),
            _ => None,
        }
    }

    /// [`Bsdf::max_roughness`] out of line.
    #[inline(never)]
    fn max_roughness_any(&self) -> f32 {
        dispatch!(self, b => b.max_roughness())
    }

    /// Is any lobe anisotropic, so that the frame's tangent must follow `dp/du`?
    pub fn anisotropic(&self) -> bool {
        dispatch!(self, b => b.anisotropic())
    }

    /// Can light pass through the surface? Such materials cannot be [`twosided`].
    pub fn transmissive(&self) -> bool {
        dispatch!(self, b => b.transmissive())
    }

    /// Does any answer depend on the texture coordinates?
    pub fn varies(&self) -> bool {
        dispatch!(self, b => b.varies())
    }
}

mod beckmann;
pub mod blend;
pub mod conductor;
pub mod dielectric;
pub mod diffuse;
pub mod fresnel;
pub mod ior;
pub mod mask;
pub mod microfacet;
pub mod phong;
pub mod plastic;
pub mod roughconductor;
pub mod roughdielectric;
pub mod roughplastic;
pub mod thindielectric;
mod transmittance;
pub mod twosided;

#[cfg(test)]
mod tests;
