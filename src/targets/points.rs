//! Measurement points of an iteration, found by the light vertices that fall into them.

use super::light_paths::LightVertex;
use crate::math::Rgb;
use crate::transport::merge::{accepts, merge};
use crate::transport::shading::SurfacePoint;
use disks::{Disk, DiskGrid};
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
        PI * self.radius * self.radius
    }
}

/// Path lengths that count, in edges from light to camera.
#[derive(Clone, Copy, Debug)]
pub struct DepthRange {
    /// Fewest.
    pub min: u32,
    /// Most.
    pub max: u32,
}

/// A light vertex inside a measurement point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Touch {
    /// Number of the vertex in its path.
    pub vertex: u32,
    /// Number of the measurement point.
    pub point: u32,
}

/// All measurement points of an iteration. 128 bytes a point, 32 for its disk and about 90 in the grid.
#[derive(Debug)]
pub struct Points<'a> {
    points: Vec<MeasurementPoint<'a>>,
    disks: Vec<Disk>,
    grid: DiskGrid,
    depths: DepthRange,
    threshold: f32,
}

impl<'a> Points<'a> {
    /// Sorts the points into a grid. `threshold` is the roughness from which lobes are measured at.
    pub fn new(points: Vec<MeasurementPoint<'a>>, depths: DepthRange, threshold: f32) -> Self {
        let disks: Vec<Disk> = points.iter().map(|m| Disk { n_g: m.point.end.n_g, n_s: m.point.frame.n, depth: m.depth }).collect();
        let grid = DiskGrid::build(points.iter().map(|m| (m.point.end.p, m.radius)));
        Self { points, disks, grid, depths, threshold }
    }

    /// The points, in pixel order.
    pub fn all(&self) -> &[MeasurementPoint<'a>] {
        &self.points
    }

    /// Calls `touched` with the number of every point that takes this light vertex, each once, in an order that depends on the points
    /// alone. The rule is that of the flux.
    #[inline]
    pub fn touched(&self, vertex: &LightVertex, mut touched: impl FnMut(u32)) {
        self.grid.containing(vertex.end.p, |index| {
            let disk = &self.disks[index as usize];
            let depth = disk.depth + vertex.depth;
            if depth >= self.depths.min && depth <= self.depths.max && accepts(disk.n_g, disk.n_s, vertex.end.n_g, vertex.wi) {
                touched(index);
            }
        });
    }

    /// What the light vertex adds to a point that takes it: flux times `f |wi.n_s|/|wi.n_g|`, not yet divided by the kernel size.
    #[inline]
    pub fn value(&self, point: u32, vertex: &LightVertex) -> Rgb {
        vertex.flux * merge(&self.points[point as usize].point, vertex.wi, self.threshold)
    }
}
