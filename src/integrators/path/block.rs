//! Memory of the paths that one worker advances together.

use super::diffuse::Diffuse;
use crate::math::Rgb;
use crate::samplers::UniformStream;
use crate::scene::ray::{RawHit, Ray};
use crate::transport::shading::SurfacePoint;
use glam::Vec3;

/// A path between two of its vertices.
pub(super) struct Walk<F> {
    /// Its own random numbers.
    pub(super) stream: UniformStream,
    /// Share of the radiance met next that reaches the eye.
    pub(super) throughput: Rgb,
    /// Product of the relative indices of refraction passed.
    pub(super) eta: f32,
    /// Where the last direction left from.
    pub(super) from: Vec3,
    /// Density of the last direction; `None` where next event estimation could not have found it.
    pub(super) sampled_pdf: Option<f32>,
    /// Its class.
    pub(super) follow: F,
}

/// A path at one of its vertices.
pub(super) struct Arrival<'a> {
    /// The path.
    pub(super) walk: u32,
    /// The surface there.
    pub(super) point: SurfacePoint<'a>,
}

/// Light on its way to a vertex, if nothing is between.
pub(super) struct Unshadowed {
    /// The path.
    pub(super) walk: u32,
    /// What it adds to the path's sum.
    pub(super) value: Rgb,
}

/// Paths that advance together, one edge at a time. Lists keep their memory from block to block.
pub(super) struct Block<'a, F> {
    /// Every path, those that have ended too; one for each sample of the block.
    pub(super) walks: Vec<Walk<F>>,
    /// Numbers of the paths that go on.
    pub(super) live: Vec<u32>,
    /// The next ray of each of them.
    pub(super) rays: Vec<Ray>,
    /// What these rays met; as long as the block is wide.
    pub(super) hits: Vec<Option<RawHit>>,
    /// Where those paths are that met a surface to go on from.
    pub(super) arrivals: Vec<Arrival<'a>>,
    /// The others of them, if they are at diffuse surfaces.
    pub(super) diffuse: Diffuse<'a>,
    /// Light found from there.
    pub(super) lights: Vec<Unshadowed>,
    /// The ray towards each of them.
    pub(super) shadow_rays: Vec<Ray>,
    /// Whether something is on it; as long as the block is wide.
    pub(super) blocked: Vec<bool>,
}

impl<F> Block<'_, F> {
    /// Room for this many paths.
    pub(super) fn new(width: usize) -> Self {
        Self {
            walks: Vec::with_capacity(width),
            live: Vec::with_capacity(width),
            rays: Vec::with_capacity(width),
            hits: vec![None; width],
            arrivals: Vec::with_capacity(width),
            diffuse: Diffuse::new(width),
            lights: Vec::with_capacity(width),
            shadow_rays: Vec::with_capacity(width),
            blocked: vec![false; width],
        }
    }

    /// No path.
    pub(super) fn clear(&mut self) {
        self.walks.clear();
        self.live.clear();
        self.rays.clear();
    }

    /// A path that leaves the eye along `ray`.
    pub(super) fn push(&mut self, walk: Walk<F>, ray: Ray) {
        self.live.push(self.walks.len() as u32);
        self.walks.push(walk);
        self.rays.push(ray);
    }
}
