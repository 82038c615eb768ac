//! Shapes as a scene describes them: triangle meshes and analytic quadrics.
//!
//! What a ray meets is worked out in `surface`; this is the description that [`super::Scene::build`] consumes.

mod mesh;
pub(in crate::scene) mod quadric;
pub(super) mod surface;

pub use mesh::Mesh;
pub use quadric::{Cylinder, Disk, Sphere};

use super::BsdfId;
use super::texture::Texture;

/// A surface, its material and, if it shines, its radiance.
#[derive(Clone, Debug)]
pub struct Shape {
    /// What messages call it: its `id` in the scene file, or its kind and number.
    pub name: String,
    /// Where it is, in world space.
    pub geometry: Geometry,
    /// Its material, an index into [`super::SceneParts::bsdfs`].
    pub bsdf: BsdfId,
    /// Radiance it emits from the side of its shading normal (W/(m^2 sr)); `None` for a surface that does not shine.
    pub radiance: Option<Texture>,
}

/// The kinds of surface. Rectangles and cubes are meshes ([`Mesh::rectangle`], [`Mesh::cube`]).
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Triangles.
    Mesh(Mesh),
    /// A sphere.
    Sphere(Sphere),
    /// A flat disk or ellipse.
    Disk(Disk),
    /// An open cylinder.
    Cylinder(Cylinder),
}

impl Geometry {
    /// The kind's name.
    pub fn kind(&self) -> &'static str {
        match self {
            Geometry::Mesh(_) => "mesh",
            Geometry::Sphere(_) => "sphere",
            Geometry::Disk(_) => "disk",
            Geometry::Cylinder(_) => "cylinder",
        }
    }
}

/// A shape that cannot be rendered as described.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ShapeError {
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} names vertex {vertex}, but the mesh has {count} vertices")]
    NoSuchVertex {
        /// Number of the triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many there are.
        count: usize,
    },
    /// Normals or texture coordinates do not come one a vertex.
    #[error("the mesh has {positions} positions but {found} {what}: give one a vertex or none")]
    Uneven {
        /// Number of positions.
        positions: usize,
        /// Number found.
        found: usize,
        /// What they are.
        what: &'static str,
    },
    /// A number is infinite or not a number.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
    /// A sphere under shear or unequal scale.
    #[error("a sphere's to_world may rotate, move, mirror and scale equally, not shear or stretch: use a mesh for an ellipsoid")]
    NotASphere,
    /// A cylinder whose cross-section is no circle.
    #[error("a cylinder's to_world may scale its axis apart from its cross-section, not shear or flatten it: use a mesh instead")]
    NotACylinder,
    /// The map flattens the shape to nothing.
    #[error("the shape has no extent: to_world, or its radius or length, is zero")]
    NoExtent,
}
