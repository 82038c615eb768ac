//! What a subpath carries, and the numbers a step of it is made of.

use num_traits::Float;

/// What a vertex of a subpath knows of the techniques that would have split the path before it. Made by [`Weights`](super::Weights).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Carried<R> {
    /// Samples of the connection across the edge that led here over the density of this vertex: `dVCM` of \[VCM-TR\].
    pub last: R,
    /// Earlier connections, up to the density of going back: `dVC` of \[VCM-TR\] without merges.
    pub connections: R,
    /// Earlier merges, by share.
    pub merges: R,
    /// What a merge at this vertex counts for, before what is common to all merges of a path; 0 where none is evaluated.
    pub share: R,
    /// The sum of shares at the vertices before.
    pub shares: R,
    /// How many of the vertices before may merge; a whole number.
    pub mergeable: R,
    /// Edges walked; 1 at the first vertex after the light or the camera.
    pub edges: u32,
}

/// Factors that turn densities per steradian at one end of an edge into densities per area at the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge<R> {
    /// For a density at the end that is left: `cos / distance^2`, the cosine at the end arrived at.
    pub ahead: R,
    /// For a density at the end arrived at: `cos / distance^2`, the cosine at the end that is left. 0 if no walk can find that end.
    pub back: R,
}

impl<R: Float> Edge<R> {
    /// Between two surface points: absolute cosines of the edge with the **geometric** normals at the end left and at the end arrived at,
    /// and the squared length. The camera takes part with any cosine: nothing asks for the density of finding a pinhole.
    #[inline(always)]
    pub fn between(cos_left: R, cos_arrived: R, distance2: R) -> Self {
        Self { ahead: cos_arrived / distance2, back: cos_left / distance2 }
    }

    /// From a light at a position without area (point, spot).
    #[inline(always)]
    pub fn from_position(cos_arrived: R, distance2: R) -> Self {
        Self { ahead: cos_arrived / distance2, back: R::zero() }
    }

    /// From a light in a single direction at infinity: the density that goes ahead is per area of the disk of emission.
    #[inline(always)]
    pub fn from_direction(cos_arrived: R) -> Self {
        Self { ahead: cos_arrived, back: R::zero() }
    }

    /// From a light all around: as [`Edge::from_direction`], and going back is measured in steradians.
    #[inline(always)]
    pub fn from_environment(cos_arrived: R) -> Self {
        Self { ahead: cos_arrived, back: R::one() }
    }

    /// The same edge walked the other way, as when the camera's walk finds a light.
    #[inline(always)]
    pub fn reversed(self) -> Self {
        Self { ahead: self.back, back: self.ahead }
    }
}

/// How a walk went on at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter<R> {
    /// Density per steradian of the direction taken, survival in roulette included; for a delta a probability, see
    /// [`Scatter::refraction`].
    pub fwd: R,
    /// Density per steradian of the direction the walk came from, had it come the other way, with the survival that it would have had then.
    pub rev: R,
    /// From a delta lobe.
    pub delta: bool,
}

impl<R: Float> Scatter<R> {
    /// At a rough lobe.
    #[inline(always)]
    pub fn rough(fwd: R, rev: R) -> Self {
        Self { fwd, rev, delta: false }
    }

    /// At a mirror, with the probability of the event (the choice of the lobe and the survival) and that of its reverse.
    #[inline(always)]
    pub fn reflection(fwd: R, rev: R) -> Self {
        Self { fwd, rev, delta: true }
    }

    /// At a smooth boundary, with the same probabilities, the absolute cosines with the **shading** normal that refraction went by, and
    /// `eta`, the index of refraction on the side gone to over that on the side come from.
    ///
    /// A bundle of directions that crosses changes its solid angle: `eta^2 cos_sampled d omega_sampled = cos_given d omega_given`. The
    /// deltas of the two directions of travel are thus worth different amounts; in \[VCM-TR\] they count as equal, which keeps the
    /// weights' sum but is not the balance heuristic behind glass.
    #[inline(always)]
    pub fn refraction(fwd: R, rev: R, cos_given: R, cos_sampled: R, eta: R) -> Self {
        // d omega_sampled / d omega_given
        let spread = cos_given / (eta * eta * cos_sampled);
        Self { fwd: fwd / spread, rev, delta: true }
    }
}

/// Densities at the light, the choice of emitter included in each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission<R> {
    /// Of the whole emission: position times direction.
    pub sampled: R,
    /// Of this position as next event estimation at `x_1` chooses it, in the light's own measure: per area on a surface, per steradian all
    /// around, the choice's probability alone for a light that is a single position or direction.
    pub direct: R,
}
