//! Meshes made on the spot, shared by the ray tests and the ray benchmark.

use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Corners and triangles; neighbours share corners.
#[derive(Clone, Default)]
pub(crate) struct Mesh {
    pub(crate) corners: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Mesh {
    pub(crate) fn add(&mut self, other: &Mesh) {
        let base = self.corners.len() as u32;
        self.corners.extend(&other.corners);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
    }

    pub(crate) fn quad(&mut self, corners: [Vec3; 4]) {
        self.add(&Mesh { corners: corners.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]] });
    }

    /// The corners of each triangle.
    pub(crate) fn soup(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|i| self.corners[i as usize]))
    }
}

/// A closed sphere-like mesh of `2 * around * (rings - 1)` triangles with a bumpy radius, star-shaped about `center`.
pub(crate) fn bumpy(center: Vec3, radius: f32, bump: f32, rings: u32, around: u32) -> Mesh {
    let at = |ring: u32, step: u32| {
        let theta = PI * ring as f32 / rings as f32;
        let phi = TAU * (step % around) as f32 / around as f32;
        let (st, ct) = theta.sin_cos();
        let (sp, cp) = phi.sin_cos();
        let coarse = (5.0 * phi).sin() * (4.0 * theta).cos() * st;
        let fine = (23.0 * phi).cos() * (19.0 * theta).sin() * st;
        center + radius * (1.0 + bump * (coarse + 0.3 * fine)) * Vec3::new(st * cp, st * sp, ct)
    };
    let mut mesh = Mesh::default();
    mesh.corners.push(at(0, 0));
    for ring in 1..rings {
        mesh.corners.extend((0..around).map(|step| at(ring, step)));
    }
    mesh.corners.push(at(rings, 0));
    let south = mesh.corners.len() as u32 - 1;
    let id = |ring: u32, step: u32| 1 + (ring - 1) * around + step % around;
    for step in 0..around {
        mesh.triangles.push([0, id(1, step), id(1, step + 1)]);
        mesh.triangles.push([south, id(rings - 1, step + 1), id(rings - 1, step)]);
        for ring in 1..rings - 1 {
            let quad = [id(ring, step), id(ring + 1, step), id(ring + 1, step + 1), id(ring, step + 1)];
            mesh.triangles.push([quad[0], quad[1], quad[2]]);
            mesh.triangles.push([quad[0], quad[2], quad[3]]);
        }
    }
    mesh
}

/// A closed box of 12 triangles, with shared corners.
pub(crate) fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let corner = |i: u32| {
        let pick = |bit: u32, axis: usize| {
            if i >> bit & 1 == 0 { min[axis] } else { max[axis] }
        };
        Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
    };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        corners: (0..8).map(corner).collect(),
        triangles: faces.iter().flat_map(|f: &[u32; 4]| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).collect(),
    }
}
