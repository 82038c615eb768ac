//! Spheres, disks and cylinders as described: a map from a unit shape.

use super::ShapeError;
use crate::math::Frame;
use glam::{Affine3A, DAffine3, DMat3, Mat3A, Vec3, Vec3A};

/// How far a column's length or angle may be from what a similarity has: the rounding of a product of a few f32 matrices.
const SIMILARITY: f64 = 1e-4;

/// All points at distance `radius` from `center`; texture coordinates are `(azimuth/2pi, polar angle/pi)` around the axes of `to_world`.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Unit sphere to world: rotation, equal scale, translation.
    pub(super) to_world: Affine3A,
    /// The geometric and shading normals point inwards.
    pub(super) inward: bool,
}

impl Sphere {
    /// The sphere of this centre and radius in an object space that `to_world` maps to world.
    ///
    /// A mirroring `to_world` (or a negative radius) turns the normals as `flip_normals` does: so does Mitsuba.
    pub fn new(center: Vec3, radius: f32, to_world: Affine3A, flip_normals: bool) -> Result<Self, ShapeError> {
        let to_world = to_world * Affine3A::from_translation(center) * Affine3A::from_scale(Vec3::splat(radius));
        let [x, y, z] = columns(&to_world)?;
        if !(similar(x, y) && similar(y, z) && similar(z, x)) {
            return Err(ShapeError::NotASphere);
        }
        let mirrored = to_world.matrix3.determinant() < 0.0;
        Ok(Self { to_world, inward: flip_normals != mirrored })
    }

    /// World-space centre.
    pub fn center(&self) -> Vec3 {
        self.to_world.translation.into()
    }

    /// World-space radius.
    pub fn radius(&self) -> f32 {
        // Cube root of the volume's ratio: equal for all columns up to rounding.
        let m = self.to_world.matrix3;
        ((m.x_axis.length() + m.y_axis.length() + m.z_axis.length()) / 3.0).abs()
    }
}

/// The unit disk `x^2 + y^2 <= 1, z = 0` under an affine map, normal +z; texture coordinates are `(radius, azimuth/2pi)`.
#[derive(Clone, Copy, Debug)]
pub struct Disk {
    pub(super) to_world: Affine3A,
    pub(super) flip_normals: bool,
}

impl Disk {
    /// The unit disk under `to_world`, which may stretch it to an ellipse.
    pub fn new(to_world: Affine3A, flip_normals: bool) -> Result<Self, ShapeError> {
        columns(&to_world)?;
        Ok(Self { to_world, flip_normals })
    }
}

/// An open cylinder with outward normals; texture coordinates are `(azimuth/2pi, height)`.
#[derive(Clone, Copy, Debug)]
pub struct Cylinder {
    /// The unit cylinder `x^2 + y^2 = 1, 0 <= z <= 1` to world.
    pub(super) to_world: Affine3A,
    pub(super) flip_normals: bool,
}

impl Cylinder {
    /// The cylinder of this radius around the segment from `p0` to `p1` in an object space that `to_world` maps to world.
    pub fn new(p0: Vec3, p1: Vec3, radius: f32, to_world: Affine3A, flip_normals: bool) -> Result<Self, ShapeError> {
        let axis = p1 - p0;
        let length = axis.length();
        if !length.is_normal() {
            return Err(ShapeError::NoExtent);
        }
        let frame = Frame::from_normal(axis / length);
        let object = Affine3A {
            matrix3: Mat3A::from_cols((frame.s * radius).into(), (frame.t * radius).into(), axis.into()),
            translation: p0.into(),
        };
        let to_world = to_world * object;
        let [x, y, z] = columns(&to_world)?;
        if !(similar(x, y) && orthogonal(y, z) && orthogonal(z, x)) {
            return Err(ShapeError::NotACylinder);
        }
        Ok(Self { to_world, flip_normals })
    }
}

/// The three columns of a map that is finite and not singular.
fn columns(to_world: &Affine3A) -> Result<[Vec3A; 3], ShapeError> {
    if !to_world.is_finite() {
        return Err(ShapeError::NotFinite("to_world"));
    }
    let m = to_world.matrix3;
    let volume = DMat3::from(DAffine3::from_mat4(glam::Mat4::from(*to_world).as_dmat4()).matrix3).determinant();
    let cube = f64::from(m.x_axis.length()) * f64::from(m.y_axis.length()) * f64::from(m.z_axis.length());
    // A map that keeps less than rounding leaves of its columns' volume has no inverse worth the name.
    if !(volume.abs() > f64::from(f32::EPSILON) * cube) {
        return Err(ShapeError::NoExtent);
    }
    Ok([m.x_axis, m.y_axis, m.z_axis])
}

/// Two columns of one length and at right angles.
fn similar(a: Vec3A, b: Vec3A) -> bool {
    let (a2, b2) = (f64::from(a.length_squared()), f64::from(b.length_squared()));
    orthogonal(a, b) && (a2 - b2).abs() <= 2.0 * SIMILARITY * a2.max(b2)
}

/// Two columns at right angles.
fn orthogonal(a: Vec3A, b: Vec3A) -> bool {
    f64::from(a.dot(b)).abs() <= SIMILARITY * f64::from(a.length()) * f64::from(b.length())
}
