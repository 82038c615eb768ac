//! Spheres, disks and cylinders as described: a map from a unit shape.

use super::ShapeError;
use super::surface::{Asked, SurfacePoint};
use crate::math::elementary::turns;
use crate::math::{Frame, warp};
use crate::scene::accel::Primitive;
use crate::scene::hit::Endpoint;
use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec2, Vec3, Vec3A};
use std::f64::consts::{PI, TAU};

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
        // The columns' lengths are equal up to rounding.
        let m = self.to_world.matrix3;
        (m.x_axis.length() + m.y_axis.length() + m.z_axis.length()) / 3.0
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
    let volume = double(to_world).matrix3.determinant();
    let cube = f64::from(m.x_axis.length()) * f64::from(m.y_axis.length()) * f64::from(m.z_axis.length());
    // A map that keeps less than rounding leaves of its columns' volume has no inverse worth the name.
    if volume.abs() <= f64::from(f32::EPSILON) * cube {
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

/// A map in double precision.
fn double(map: &Affine3A) -> DAffine3 {
    let m = map.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|c| Vec3::from(c).as_dvec3());
    DAffine3 { matrix3: DMat3::from_cols(columns[0], columns[1], columns[2]), translation: Vec3::from(map.translation).as_dvec3() }
}

/// A sphere, disk or cylinder as hits and samples need it, in f64: what is left of the error is the rounding of the result.
#[derive(Clone, Debug)]
pub(in crate::scene) struct Quadric {
    kind: Kind,
    /// The unit shape to world, and back.
    to_world: DAffine3,
    to_object: DAffine3,
    /// The normal is turned against the unit shape's outward (upward) one.
    flipped: bool,
    primitive: Primitive,
}

/// The unit shape.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// World-space centre and radius: exactly the accelerator's.
    Sphere {
        center: DVec3,
        radius: f64,
    },
    Disk,
    Cylinder,
}

impl Quadric {
    pub(super) fn sphere(sphere: &Sphere) -> Self {
        let (center, radius) = (sphere.center(), sphere.radius());
        let kind = Kind::Sphere { center: center.as_dvec3(), radius: f64::from(radius) };
        Self::new(kind, &sphere.to_world, sphere.inward, Primitive::Sphere { center, radius })
    }

    pub(super) fn disk(disk: &Disk) -> Self {
        Self::new(Kind::Disk, &disk.to_world, disk.flip_normals, Primitive::Disk { to_world: disk.to_world })
    }

    pub(super) fn cylinder(cylinder: &Cylinder) -> Self {
        Self::new(Kind::Cylinder, &cylinder.to_world, cylinder.flip_normals, Primitive::Cylinder { to_world: cylinder.to_world })
    }

    fn new(kind: Kind, to_world: &Affine3A, flipped: bool, primitive: Primitive) -> Self {
        let to_world = double(to_world);
        Self { kind, to_world, to_object: to_world.inverse(), flipped, primitive }
    }

    pub(super) fn primitive(&self) -> Primitive {
        self.primitive
    }

    /// Centre and radius, if it is a sphere whose normals point outwards.
    #[inline]
    pub(in crate::scene) fn outward_sphere(&self) -> Option<(DVec3, f64)> {
        match self.kind {
            Kind::Sphere { center, radius } if !self.flipped => Some((center, radius)),
            _ => None,
        }
    }

    /// Area, world units squared.
    pub(super) fn area(&self) -> f64 {
        let m = self.to_world.matrix3;
        match self.kind {
            Kind::Sphere { radius, .. } => 4.0 * PI * radius * radius,
            Kind::Disk => PI * m.x_axis.cross(m.y_axis).length(),
            Kind::Cylinder => PI * (m.x_axis.length() + m.y_axis.length()) * m.z_axis.length(),
        }
    }

    /// The surface at the point nearest to `near`, which is on it up to rounding, with what is asked.
    pub(super) fn surface(&self, near: DVec3, asked: Asked) -> (SurfacePoint, Frame) {
        let (end, local) = match self.kind {
            Kind::Sphere { center, radius } => {
                let outward = (near - center).normalize_or(DVec3::Z);
                let local = if asked.tangents || asked.uv { self.in_object_space(outward) } else { outward };
                (self.on_sphere(center, radius, outward), local)
            }
            Kind::Disk => {
                let local = self.to_object.transform_point3(near).with_z(0.0);
                (self.at(local), local)
            }
            Kind::Cylinder => {
                let local = self.to_object.transform_point3(near);
                let local = local.truncate().normalize_or(glam::DVec2::X).extend(local.z);
                (self.at(local), local)
            }
        };
        let n = end.n_g;
        let frame = if asked.tangents { Frame::from_normal_and_tangent(n, self.dp_du(local)) } else { Frame::from_normal(n) };
        (SurfacePoint { end, n_s: n, uv: if asked.uv { self.uv(local) } else { Vec2::ZERO } }, frame)
    }

    /// A point, uniform by area.
    pub(super) fn sample(&self, u: Vec2) -> SurfacePoint {
        let local = match self.kind {
            Kind::Sphere { .. } => {
                let z = 1.0 - 2.0 * f64::from(u.x);
                let (sin, cos) = (TAU * f64::from(u.y)).sin_cos();
                let r = (1.0 - z * z).max(0.0).sqrt();
                DVec3::new(r * cos, r * sin, z)
            }
            Kind::Disk => warp::disk(u).as_dvec2().extend(0.0),
            Kind::Cylinder => {
                let (sin, cos) = (TAU * f64::from(u.x)).sin_cos();
                DVec3::new(cos, sin, f64::from(u.y))
            }
        };
        let end = self.at(local);
        SurfacePoint { end, n_s: end.n_g, uv: self.uv(local) }
    }

    /// The point of an outward sphere in this unit direction from its centre; `None` for any other shape.
    #[inline]
    pub(in crate::scene) fn in_direction(&self, outward: DVec3) -> Option<Endpoint> {
        let (center, radius) = self.outward_sphere()?;
        Some(self.on_sphere(center, radius, outward))
    }

    /// Texture coordinates of a sphere there.
    pub(in crate::scene) fn uv_in_direction(&self, outward: DVec3) -> Vec2 {
        self.uv(self.in_object_space(outward))
    }

    /// The direction from a sphere's centre as its object space has it.
    fn in_object_space(&self, outward: DVec3) -> DVec3 {
        self.to_object.transform_vector3(outward).normalize_or(DVec3::Z)
    }

    /// The point of a sphere in this unit direction from its centre.
    fn on_sphere(&self, center: DVec3, radius: f64, outward: DVec3) -> Endpoint {
        endpoint(center + outward * radius, self.facing(outward))
    }

    /// The normal to an outward (upward) one.
    fn facing(&self, outward: DVec3) -> Vec3 {
        if self.flipped { -outward } else { outward }.as_vec3()
    }

    /// The point at a position of the unit shape.
    fn at(&self, local: DVec3) -> Endpoint {
        let m = self.to_world.matrix3;
        let (p, n) = match self.kind {
            Kind::Sphere { center, radius } => {
                let outward = self.to_world.transform_vector3(local).normalize_or(DVec3::Z);
                return self.on_sphere(center, radius, outward);
            }
            Kind::Disk => {
                // Upward under the inverse transpose: a mirroring map does not turn it, as in Mitsuba.
                let up = m.x_axis.cross(m.y_axis).normalize_or(DVec3::Z);
                (self.to_world.transform_point3(local), up * 1f64.copysign(up.dot(m.z_axis)))
            }
            Kind::Cylinder => {
                let outward = self.to_world.transform_vector3(local.with_z(0.0));
                (self.to_world.transform_point3(local), outward.normalize_or(DVec3::Z))
            }
        };
        endpoint(p, self.facing(n))
    }

    /// Texture coordinates at a position of the unit shape, as Mitsuba has them.
    fn uv(&self, local: DVec3) -> Vec2 {
        let turn = turns(local.y, local.x);
        let azimuth = (if turn < 0.0 { turn + 1.0 } else { turn }) as f32;
        match self.kind {
            Kind::Sphere { .. } => Vec2::new(azimuth, (2.0 * turns(local.truncate().length(), local.z)) as f32),
            Kind::Disk => Vec2::new(local.truncate().length() as f32, azimuth),
            Kind::Cylinder => Vec2::new(azimuth, local.z as f32),
        }
    }

    /// Direction in which the first texture coordinate grows; zero at a sphere's poles.
    fn dp_du(&self, local: DVec3) -> Vec3 {
        let along = match self.kind {
            Kind::Disk => local.truncate().normalize_or(glam::DVec2::X).extend(0.0),
            Kind::Sphere { .. } | Kind::Cylinder => DVec3::new(-local.y, local.x, 0.0),
        };
        self.to_world.transform_vector3(along).as_vec3()
    }
}

/// A point on a quadric of this unit normal.
#[inline(always)]
fn endpoint(p: DVec3, n: Vec3) -> Endpoint {
    let p = p.as_vec3();
    // Half an ulp in each coordinate, and as much again for the normal's own rounding; the f64 work adds nothing at this scale.
    Endpoint { p, n_g: n, offset: f32::EPSILON * p.abs().dot(n.abs()) }
}
