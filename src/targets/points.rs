//! Measurement points of an iteration, found by the light vertices that fall into them.

use super::aim::Aim;
use super::light_paths::{Arrival, LightVertex};
use crate::math::Rgb;
use crate::math::fetch;
use crate::transport::merge::{accepts, merge};
use crate::transport::shading::SurfacePoint;
use disks::{DiskGrid, Lookup};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;

mod disks;

/// Where a camera subpath measures: the first vertex whose event is at a rough lobe.
#[derive(Clone, Copy, Debug)]
pub struct MeasurementPoint<'a> {
    /// The surface there, `given` towards the camera.
    pub point: SurfacePoint<'a>,
    /// Throughput of the camera subpath on arrival, divided by the probability of measuring here.
    pub throughput: Rgb,
    /// Camera edges to here.
    pub depth: u32,
    /// Length of the camera subpath times the pixel's size on the unit plane, world units.
    pub footprint: f32,
    /// Row-major number of the pixel.
    pub pixel: u32,
    /// Radius of the density estimate, world units.
    pub radius: f32,
}

impl MeasurementPoint<'_> {
    /// Kernel size `s_k = pi r_k^2`, world units squared.
    pub fn kernel_size(&self) -> f32 {
        kernel_size(self.radius)
    }
}

/// Kernel size of a radius.
pub(super) fn kernel_size(radius: f32) -> f32 {
    PI * radius * radius
}

/// Path lengths that count, in edges from light to camera.
#[derive(Clone, Copy, Debug)]
pub struct DepthRange {
    /// Fewest.
    pub min: u32,
    /// Most.
    pub max: u32,
}

impl DepthRange {
    /// Does a path of so many edges count?
    #[inline]
    pub fn contains(&self, edges: u32) -> bool {
        self.min <= edges && edges <= self.max
    }
}

/// A light vertex inside a measurement point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Touch {
    /// Number of the vertex in its path.
    pub vertex: u32,
    /// Number of the measurement point.
    pub point: u32,
}

/// What decides whether a light vertex inside a point's radius counts, and what it is worth: apart from the rest of the point, because a chain
/// asks this far more often than it deposits.
#[derive(Clone, Copy, Debug)]
struct Disk {
    /// Unit geometric normal.
    n_g: Vec3,
    /// Unit shading normal.
    n_s: Vec3,
    /// Camera edges.
    depth: u32,
    aim: Aim,
}

/// Memory of a search, used again and again.
#[derive(Clone, Debug, Default)]
pub struct Search {
    lookups: Vec<Lookup>,
}

/// All measurement points of an iteration. 128 bytes a point, 40 for its disk and about 120 in the grid.
#[derive(Debug)]
pub struct Points<'a> {
    points: Vec<MeasurementPoint<'a>>,
    disks: Vec<Disk>,
    grid: DiskGrid,
    depths: DepthRange,
    threshold: f32,
}

/// Where measurement points lie.
#[derive(Debug)]
pub struct PointGrid(DiskGrid);

impl PointGrid {
    /// Sorts points into a grid.
    pub fn build(points: &[MeasurementPoint<'_>]) -> Self {
        let balls: Vec<(Vec3, f32)> = points.par_iter().map(|m| (m.point.end.p, m.radius)).collect();
        Self(DiskGrid::build(&balls))
    }
}

impl<'a> Points<'a> {
    /// Points with their grid and their targets, in their order. `threshold` is the roughness from which lobes are measured at.
    pub fn new(points: Vec<MeasurementPoint<'a>>, PointGrid(grid): PointGrid, aims: &[Aim], depths: DepthRange, threshold: f32) -> Self {
        let disk = |(m, aim): (&MeasurementPoint<'_>, &Aim)| Disk { n_g: m.point.end.n_g, n_s: m.point.frame.n, depth: m.depth, aim: *aim };
        let disks = points.par_iter().zip(aims).map(disk).collect();
        Self { points, disks, grid, depths, threshold }
    }

    /// The points, in pixel order.
    pub fn all(&self) -> &[MeasurementPoint<'a>] {
        &self.points
    }

    /// Targets and region of a point.
    #[inline(always)]
    pub fn aim(&self, point: u32) -> &Aim {
        &self.disks[point as usize].aim
    }

    /// Pairs of a path's vertices and the points that take them, each once, in an order that depends on path and points alone; what
    /// `touches` held is replaced. The rule is that of the flux.
    #[inline]
    pub fn touched<V: Arrival>(&self, vertices: &[V], search: &mut Search, touches: &mut Vec<Touch>) {
        touches.clear();
        self.grid.containing(vertices.iter().map(|v| v.end().p), &mut search.lookups, |vertex, point| {
            fetch(&self.disks[point as usize]);
            touches.push(Touch { vertex, point });
        });
        touches.retain(|touch| {
            let (disk, vertex) = (&self.disks[touch.point as usize], &vertices[touch.vertex as usize]);
            let depth = disk.depth + vertex.depth();
            depth >= self.depths.min && depth <= self.depths.max && accepts(disk.n_g, disk.n_s, vertex.end().n_g, vertex.wi())
        });
    }

    /// Asks for the point ahead of [`Points::value`].
    #[inline(always)]
    pub fn fetch(&self, point: u32) {
        let at = &self.points[point as usize].point;
        fetch(&at.bsdf);
        fetch(&at.given);
    }

    /// What the light vertex adds to a point that takes it: flux times `f |wi.n_s|/|wi.n_g|`, not yet divided by the kernel size.
    #[inline]
    pub fn value(&self, point: u32, vertex: &LightVertex) -> Rgb {
        vertex.flux * merge(&self.points[point as usize].point, vertex.wi, self.threshold)
    }
}
