//! Light subpaths as a function of primary sample space.

use crate::math::Rgb;
use crate::samplers::{LightPathSpace, Stream};
use crate::scene::Scene;
use crate::scene::bsdf::{Lobes, Mode};
use crate::scene::hit::Endpoint;
use crate::transport::walk::{Roulette, Start, Step, Tally, walk};
use glam::{Vec2, Vec3};

/// Light that arrives at a surface: what targets ask of a vertex of a light subpath, whoever traced it.
pub trait Arrival {
    /// Position and geometric normal.
    fn end(&self) -> &Endpoint;
    /// Unit direction towards where the light came from.
    fn wi(&self) -> Vec3;
    /// Edges from the light.
    fn depth(&self) -> u32;
}

/// A traced light subpath that targets look at.
pub trait Arrivals {
    /// What its vertices are.
    type Vertex: Arrival;
    /// Those that may count, in the order of travel.
    fn vertices(&self) -> &[Self::Vertex];
    /// What tracing it cost.
    fn tally(&self) -> &Tally;
}

/// A vertex of a light subpath where density can be estimated: its material has a lobe rougher than the threshold.
#[derive(Clone, Copy, Debug)]
pub struct LightVertex {
    /// Position and geometric normal.
    pub end: Endpoint,
    /// Unit direction towards where the light came from.
    pub wi: Vec3,
    /// Flux that arrives, of the path alone: its mean over paths is the power that arrives here.
    pub flux: Rgb,
    /// Edges from the light.
    pub depth: u32,
}

impl Arrival for LightVertex {
    #[inline(always)]
    fn end(&self) -> &Endpoint {
        &self.end
    }
    #[inline(always)]
    fn wi(&self) -> Vec3 {
        self.wi
    }
    #[inline(always)]
    fn depth(&self) -> u32 {
        self.depth
    }
}

/// A traced light subpath; a buffer that is filled again and again.
#[derive(Clone, Debug, Default)]
pub struct LightPath {
    /// Vertices in the order of travel.
    pub vertices: Vec<LightVertex>,
    /// What tracing it cost.
    pub tally: Tally,
}

impl Arrivals for LightPath {
    type Vertex = LightVertex;
    #[inline(always)]
    fn vertices(&self) -> &[LightVertex] {
        &self.vertices
    }
    #[inline(always)]
    fn tally(&self) -> &Tally {
        &self.tally
    }
}

/// All light subpaths of a scene.
#[derive(Clone, Copy)]
pub struct LightPaths<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Vertices whose roughest lobe is smoother than this are passed through but not kept; 0 keeps whatever is not a delta.
    pub roughness_threshold: f32,
    /// Most edges from the light to a kept vertex.
    pub max_depth: u32,
    /// Russian roulette's ceiling starts at this many edges.
    pub rr_depth: u32,
}

impl LightPathSpace for LightPaths<'_> {
    type Path = LightPath;

    /// Coordinates: one for the choice of emitter, two for the position, two for the direction, then those of
    /// [`walk`].
    fn trace<S: Stream>(&self, stream: &mut S, path: &mut LightPath) {
        path.vertices.clear();
        path.tally = Tally::default();
        let u_emitter = stream.next_1d();
        let u_position = Vec2::from(stream.next_2d());
        let u_direction = Vec2::from(stream.next_2d());
        let Some(emission) = self.scene.sample_emission(u_emitter, u_position, u_direction) else { return };
        if emission.flux.is_black() {
            return;
        }
        let start = Start { ray: emission.end.ray(emission.d), throughput: emission.flux, length: 0.0 };
        let LightPath { vertices, tally } = path;
        let roulette = Roulette { depth: self.rr_depth };
        walk(self.scene, Mode::Importance, start, roulette, stream, tally, |vertex, _, _| {
            let Some(point) = &vertex.point else { return Step::Stop };
            if Lobes::Rough(self.roughness_threshold).admit(point.bsdf.max_roughness()) {
                let (end, wi) = (point.end, point.given);
                vertices.push(LightVertex { end, wi, flux: vertex.throughput, depth: vertex.depth });
            }
            if vertex.depth >= self.max_depth { Step::Stop } else { Step::Scatter(Lobes::All, 1.0) }
        });
    }

    /// Rung 0 alone: targets that aim at something are spaces of their own.
    fn targets(&self, _path: &LightPath, values: &mut [f64]) {
        assert!(values.len() == 1, "this space knows the uniform target only");
        values[0] = 1.0;
    }
}
