//! Triangle meshes.

use super::ShapeError;
use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec3A};

/// Triangles over shared vertices, in world space. The geometric normal of `[a, b, c]` is `(b - a) x (c - a)`.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// World-space positions.
    pub positions: Vec<Vec3>,
    /// Unit normals in world space, one a vertex; `None` shades with the geometric normal.
    pub normals: Option<Vec<Vec3>>,
    /// Texture coordinates, one a vertex; `None` uses the barycentric weights of the second and third vertex, as Mitsuba does.
    pub uvs: Option<Vec<Vec2>>,
    /// Vertex numbers.
    pub triangles: Vec<[u32; 3]>,
    /// Turns the geometric and the shading normals around.
    pub flip_normals: bool,
}

impl Mesh {
    /// Mitsuba's `rectangle`: `[-1, 1]^2` in the plane z = 0 with normal +z, `uv = (x + 1, y + 1)/2`, under `to_world`.
    ///
    /// A mirroring `to_world` turns the winding, and so the geometric normal, but not the shading normal: so does Mitsuba.
    pub fn rectangle(to_world: Affine3A, flip_normals: bool) -> Self {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let mut mesh = Mesh { normals: Some(Vec::new()), uvs: Some(Vec::new()), flip_normals, ..Mesh::default() };
        mesh.push_quad(
            &to_world,
            corners.map(|(x, y)| Vec3::new(x, y, 0.0)),
            Vec3::Z,
            corners.map(|(x, y)| Vec2::new(x + 1.0, y + 1.0) / 2.0),
        );
        mesh
    }

    /// Mitsuba's `cube`: `[-1, 1]^3` with outward normals and one unit square of texture a face, under `to_world`.
    pub fn cube(to_world: Affine3A, flip_normals: bool) -> Self {
        let mut mesh = Mesh { normals: Some(Vec::new()), uvs: Some(Vec::new()), flip_normals, ..Mesh::default() };
        // Each face's corner at uv = (0, 0), and the axes along which u and v run from there (measured on Mitsuba 3.9.1).
        let faces = [
            (Vec3::new(-1.0, -1.0, -1.0), Vec3::Z, Vec3::X),
            (Vec3::new(1.0, 1.0, 1.0), -Vec3::X, -Vec3::Z),
            (Vec3::new(1.0, -1.0, 1.0), Vec3::Y, -Vec3::Z),
            (Vec3::new(-1.0, -1.0, 1.0), Vec3::Y, Vec3::X),
            (Vec3::new(-1.0, -1.0, -1.0), Vec3::Y, Vec3::Z),
            (Vec3::new(-1.0, 1.0, -1.0), -Vec3::Y, Vec3::X),
        ];
        for (corner, u, v) in faces {
            // The face's centre is the outward normal.
            let normal = corner + u + v;
            let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
            let mut corners = uvs.map(|t| corner + 2.0 * t.x * u + 2.0 * t.y * v);
            let mut uvs = uvs;
            if u.cross(v).dot(normal) < 0.0 {
                corners.swap(1, 3);
                uvs.swap(1, 3);
            }
            mesh.push_quad(&to_world, corners, normal, uvs);
        }
        mesh
    }

    /// Appends two triangles; corners run around the face.
    fn push_quad(&mut self, to_world: &Affine3A, corners: [Vec3; 4], normal: Vec3, uvs: [Vec2; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners.map(|p| to_world.transform_point3(p)));
        let normal = transform_normal(to_world, normal);
        self.normals.get_or_insert_default().extend([normal; 4]);
        self.uvs.get_or_insert_default().extend(uvs);
        self.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i: u32| first + i)));
    }

    /// Every index has its vertex, every vertex its attributes, and all numbers are finite.
    pub(in crate::scene) fn check(&self) -> Result<(), ShapeError> {
        let positions = self.positions.len();
        let even = |found: Option<usize>, what| match found {
            Some(found) if found != positions => Err(ShapeError::Uneven { positions, found, what }),
            _ => Ok(()),
        };
        even(self.normals.as_ref().map(Vec::len), "normals")?;
        even(self.uvs.as_ref().map(Vec::len), "texture coordinates")?;
        for (number, triangle) in self.triangles.iter().enumerate() {
            if let Some(&vertex) = triangle.iter().find(|&&v| v as usize >= positions) {
                return Err(ShapeError::NoSuchVertex { triangle: number, vertex, count: positions });
            }
        }
        if !self.positions.iter().all(|p| p.is_finite()) {
            return Err(ShapeError::NotFinite("a vertex position"));
        }
        if !self.normals.iter().flatten().all(|n| n.is_finite()) {
            return Err(ShapeError::NotFinite("a vertex normal"));
        }
        if !self.uvs.iter().flatten().all(|t| t.is_finite()) {
            return Err(ShapeError::NotFinite("a texture coordinate"));
        }
        Ok(())
    }
}

/// The unit normal `normal` of a surface, after `to_world` moved the surface: the inverse transpose, whatever its handedness.
pub(super) fn transform_normal(to_world: &Affine3A, normal: Vec3) -> Vec3 {
    // The cofactor matrix is the inverse transpose times the determinant, and exists even where the inverse does not.
    let Mat3A { x_axis: x, y_axis: y, z_axis: z } = to_world.matrix3;
    let cofactors = Mat3A::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let sign = 1.0f32.copysign(to_world.matrix3.determinant());
    Vec3::from(cofactors * Vec3A::from(normal) * sign).normalize_or_zero()
}
