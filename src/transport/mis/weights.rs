//! The recursion, and the weights at its ends.

use super::carried::{Carried, Edge, Emission, Scatter};
use super::heuristic::{MergeWeights, Sampling, Techniques};
use num_traits::{AsPrimitive, Float};

/// One end of a connection.
#[derive(Clone, Copy, Debug)]
pub struct Connector<'a, R> {
    /// What its vertex carries.
    pub carried: &'a Carried<R>,
    /// Density per steradian, at this vertex, of going back to its predecessor, had the walk come from the other end; survival included.
    pub rev: R,
    /// Density per area with which the other end's walk would have found this vertex; survival included.
    pub found: R,
}

/// Raised to a heuristic's exponent.
#[derive(Clone, Copy, Debug)]
enum Exponent<R> {
    One,
    Two,
    Other(R),
}

/// A heuristic made ready for one iteration; `R` is the precision that subpaths carry.
#[derive(Clone, Copy, Debug)]
pub struct Weights<R> {
    techniques: Techniques,
    merge_weights: MergeWeights,
    exponent: Exponent<R>,
    /// Light subpaths over a pixel's camera subpaths: the splats that compete with one sample of any other technique.
    splats: R,
    /// Merge area times light paths; 0 where no merge is evaluated.
    merge_samples: R,
}

impl<R: Float + 'static> Weights<R> {
    /// For one iteration.
    pub fn new(sampling: &Sampling) -> Self
    where
        f64: AsPrimitive<R>,
    {
        let beta = sampling.heuristic.beta();
        // In f64: a small radius squared times the number of paths may pass through what f32 cannot hold.
        let merge_samples = if sampling.techniques.merges { sampling.merge_area() * sampling.light_paths } else { 0.0 };
        Self {
            techniques: sampling.techniques,
            merge_weights: sampling.heuristic.merges(),
            exponent: match beta {
                1.0 => Exponent::One,
                2.0 => Exponent::Two,
                _ => Exponent::Other(beta.as_()),
            },
            splats: (sampling.light_paths / sampling.camera_paths).as_(),
            merge_samples: merge_samples.as_(),
        }
    }

    /// [`Carried::share`] of a vertex where a merge is evaluated and finds `photons` on average (positive; asked for where
    /// [`Heuristic::asks_density`](super::Heuristic::asks_density)). A vertex where none is evaluated has share 0.
    /// Shares stay as they are if the set has no merges: an emitter hit asks for them.
    #[inline(always)]
    pub fn share(&self, photons: R) -> R {
        match self.merge_weights {
            MergeWeights::Balance | MergeWeights::Power => R::one(),
            MergeWeights::VcmPlus | MergeWeights::VcmStar => photons.recip(),
        }
    }

    #[inline(always)]
    fn power(&self, x: R) -> R {
        match self.exponent {
            Exponent::One => x,
            Exponent::Two => x * x,
            Exponent::Other(beta) => x.powf(beta),
        }
    }

    /// 1 or 0.
    #[inline(always)]
    fn on(flag: bool) -> R {
        if flag { R::one() } else { R::zero() }
    }

    /// What a path's merges have in common beside their shares, raised to the exponent: `shares` sums over the whole path, `mergeable` counts.
    #[inline(always)]
    fn common(&self, shares: R, mergeable: R) -> R {
        match self.merge_weights {
            MergeWeights::VcmStar if mergeable > R::zero() => self.power(self.merge_samples * mergeable / shares),
            _ => self.power(self.merge_samples),
        }
    }

    /// The first vertex of a light subpath. `edge` leads to it from the light; `share` is the vertex's own.
    #[inline]
    pub fn from_light(&self, emission: &Emission<R>, edge: Edge<R>, share: R) -> Carried<R> {
        let density = emission.sampled * edge.ahead;
        let connections = Self::on(self.techniques.connections);
        Carried {
            last: connections * self.power(emission.direct / density),
            connections: connections * self.power(edge.back / density),
            share,
            edges: 1,
            ..Self::nothing()
        }
    }

    /// The first vertex of a camera subpath. `pixel` is the density per steradian with which the camera makes rays through one given pixel.
    #[inline]
    pub fn from_camera(&self, pixel: R, edge: Edge<R>, share: R) -> Carried<R> {
        let splats = self.splats * Self::on(self.techniques.light_tracing);
        Carried { last: self.power(splats / (pixel * edge.ahead)), share, edges: 1, ..Self::nothing() }
    }

    /// The vertex after `from`: the walk went on by `scatter` along `edge`; `share` is the new vertex's own.
    #[inline]
    pub fn extend(&self, from: &Carried<R>, scatter: Scatter<R>, edge: Edge<R>, share: R) -> Carried<R> {
        let density = scatter.fwd * edge.ahead;
        let step = self.power(edge.back / density);
        let back = self.power(scatter.rev);
        // At a delta there is no connection across this edge, none across the edge before, and no merge, whatever other lobes the surface has.
        let (last, here, share_here) = if scatter.delta {
            (R::zero(), R::zero(), R::zero())
        } else {
            (Self::on(self.techniques.connections) * self.power(density.recip()), from.last, from.share)
        };
        Carried {
            last,
            connections: step * (here + back * from.connections),
            merges: step * (self.power(share_here) + back * from.merges),
            share,
            shares: from.shares + share_here,
            mergeable: from.mergeable + Self::on(share_here > R::zero()),
            edges: from.edges + 1,
        }
    }

    #[inline(always)]
    fn nothing() -> Carried<R> {
        let zero = R::zero();
        Carried { last: zero, connections: zero, merges: zero, share: zero, shares: zero, mergeable: zero, edges: 0 }
    }

    /// All techniques on the far side of `end` over the connection that ends there.
    #[inline(always)]
    fn beyond(&self, end: &Connector<'_, R>, common: R) -> R {
        let Carried { last, connections, merges, share, .. } = *end.carried;
        let back = self.power(end.rev);
        self.power(end.found) * (last + back * connections + common * (self.power(share) + back * merges))
    }

    /// The sum of shares and the count, the vertex itself included.
    #[inline(always)]
    fn so_far(carried: &Carried<R>) -> (R, R) {
        (carried.shares + carried.share, carried.mergeable + Self::on(carried.share > R::zero()))
    }

    /// Weight of a connection between two interior vertices; 0 if the set has none.
    #[inline]
    pub fn connection(&self, light: &Connector<'_, R>, camera: &Connector<'_, R>) -> R {
        if !self.techniques.connections {
            return R::zero();
        }
        let (light_shares, light_count) = Self::so_far(light.carried);
        let (camera_shares, camera_count) = Self::so_far(camera.carried);
        let common = self.common(light_shares + camera_shares, light_count + camera_count);
        (R::one() + self.beyond(light, common) + self.beyond(camera, common)).recip()
    }

    /// Weight of next event estimation at a camera vertex; 0 if the set has none. `emission` is that of the light sample had the light sent
    /// it, `edge` leads from the light to the vertex. `fwd` is the density per steradian with which scattering at the vertex goes to the
    /// light (for a light that no walk finds it is not asked), `rev` that of going back to the vertex's predecessor from the light.
    #[inline]
    pub fn next_event(&self, camera: &Carried<R>, emission: &Emission<R>, edge: Edge<R>, fwd: R, rev: R) -> R {
        if !self.techniques.connections {
            return R::zero();
        }
        let (shares, count) = Self::so_far(camera);
        let hit = self.power(fwd * edge.back / emission.direct);
        let found = emission.sampled * edge.ahead / emission.direct;
        (R::one() + hit + self.beyond(&Connector { carried: camera, rev, found }, self.common(shares, count))).recip()
    }

    /// Weight of an emitter hit. `camera` is what the camera subpath carries **at the light**, extended to it as to any vertex, with share
    /// 0; `emission` that of the light, had it sent this path.
    #[inline]
    pub fn emitter_hit(&self, camera: &Carried<R>, emission: &Emission<R>) -> R {
        if camera.edges == 1 {
            return R::one();
        }
        let Carried { last, connections, merges, shares, mergeable, .. } = *camera;
        if !self.techniques.connections {
            // What is carried without connections is a splat and nothing else.
            return Self::on(!(mergeable > R::zero() || connections > R::zero()));
        }
        let earlier = connections + self.common(shares, mergeable) * merges;
        (R::one() + self.power(emission.direct) * last + self.power(emission.sampled) * earlier).recip()
    }

    /// Weight of a light vertex connected to the camera; 0 if the set has no light tracing. [`Connector::found`] is the density for **one
    /// pixel**: the camera's per steradian, times the edge's factor.
    #[inline]
    pub fn splat(&self, light: &Connector<'_, R>) -> R {
        if !self.techniques.light_tracing {
            return R::zero();
        }
        let (shares, count) = Self::so_far(light.carried);
        let one = Connector { found: light.found / self.splats, ..*light };
        (R::one() + self.beyond(&one, self.common(shares, count))).recip()
    }

    /// Weight of a merge; 0 if the set has none, or where the camera's vertex has share 0. `light_rev` is the density per steradian of going from
    /// here to the light vertex's predecessor, for a walk that came from the camera's side, and `camera_rev` that of going to the camera
    /// vertex's predecessor from the light's side; survival included in both.
    ///
    /// The two vertices lie up to a radius apart. The share is the camera vertex's, so that a path weighs the same whichever photon
    /// is looked at.
    #[inline]
    pub fn merge(&self, light: &Carried<R>, light_rev: R, camera: &Carried<R>, camera_rev: R) -> R {
        if !(self.techniques.merges && camera.share > R::zero()) {
            return R::zero();
        }
        let share = camera.share;
        let common = self.common(light.shares + camera.shares + share, light.mergeable + camera.mergeable + R::one());
        let side = |c: &Carried<R>, rev: R| c.last + self.power(rev) * (c.connections + common * c.merges);
        let others = (side(light, light_rev) + side(camera, camera_rev)) / (common * self.power(share));
        (R::one() + others).recip()
    }
}
