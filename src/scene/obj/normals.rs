//! Vertex normals of meshes that bring none.

use glam::{DVec3, Vec3};

/// Unit vertex normals: the faces' unit normals weighted by their angle at the vertex (\[TW98\]), as Mitsuba computes them; and the number of
/// vertices where they cancel, which take the normal of one of their faces. A vertex without a face gets +z.
pub(super) fn angle_weighted(positions: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<Vec3>, usize) {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    let mut any = vec![Vec3::Z; positions.len()];
    let mut touched = vec![false; positions.len()];
    for triangle in triangles {
        let corners = triangle.map(|i| positions[i as usize].as_dvec3());
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        for (i, vertex) in triangle.iter().enumerate() {
            let vertex = *vertex as usize;
            let (a, b) = (corners[(i + 1) % 3] - corners[i], corners[(i + 2) % 3] - corners[i]);
            sums[vertex] += normal * a.cross(b).length().atan2(a.dot(b));
            any[vertex] = normal.as_vec3();
            touched[vertex] = true;
        }
    }
    let mut undefined = 0;
    let normals = sums.iter().enumerate().map(|(vertex, sum)| {
        // The weights are angles of order one: what is left below this is the rounding of a sum that cancels.
        if sum.length() > 1e-9 {
            return sum.normalize().as_vec3();
        }
        undefined += usize::from(touched[vertex]);
        any[vertex]
    });
    (normals.collect(), undefined)
}
