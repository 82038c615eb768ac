//! What a ray meets: the surface at a hit, and points sampled on it.
//!
//! A hit reads one cache line for a flat triangle and two for one with normals or texture coordinates: [`Record`] and [`Attributes`]
//! hold copies, not indices.

use super::quadric::Quadric;
use super::{Geometry, Mesh};
use crate::math::{Frame, warp};
use crate::scene::accel::Primitive;
use crate::scene::hit::{Endpoint, Hit};
use crate::scene::ray::{RawHit, Ray};
use crate::scene::{BsdfId, EmitterId, ShapeId};
use glam::{Vec2, Vec3};

/// Bound on the relative error of `n` roundings in sequence ([PBRT 6.8.1]).
pub(super) const fn gamma(n: u32) -> f32 {
    let e = n as f32 * (f32::EPSILON / 2.0);
    e / (1.0 - e)
}

/// A primitive as a hit needs it; quadrics keep theirs in a table of their own.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Record {
    corners: [Vec3; 3],
    n_g: Vec3,
    /// Bound on the distance between an interpolated point and the triangle's plane.
    offset: f32,
    shape: u32,
    /// Kind in the two highest bits, index of its detail below.
    detail: u32,
}

/// No normals, no texture coordinates.
const PLAIN: u32 = 0;
/// Texture coordinates, shaded flat.
const FLAT: u32 = 1 << 30;
/// Normals to interpolate.
const SMOOTH: u32 = 2 << 30;
/// Not a triangle.
const QUADRIC: u32 = 3 << 30;
/// The kind's bits.
const KIND: u32 = 3 << 30;
/// Most primitives there may be.
pub(in crate::scene) const MOST: usize = 1 << 30;

/// What varies over a triangle.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Attributes {
    normals: [Vec3; 3],
    uvs: [Vec2; 3],
}

/// Texture coordinates of a triangle that has none: its barycentric weights.
const BARYCENTRIC: [Vec2; 3] = [Vec2::ZERO, Vec2::X, Vec2::Y];

/// What a hit asks of its shape.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Owner {
    pub(in crate::scene) bsdf: BsdfId,
    pub(in crate::scene) emitter: Option<EmitterId>,
    pub(in crate::scene) asked: Asked,
}

/// What a shape's material and light ask of a hit beside its position and normals.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Asked {
    /// The frame's tangent follows `dp/du`.
    pub(in crate::scene) tangents: bool,
    /// Texture coordinates.
    pub(in crate::scene) uv: bool,
}

/// A point chosen on a surface.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct SurfacePoint {
    pub(in crate::scene) end: Endpoint,
    /// Shading normal.
    pub(in crate::scene) n_s: Vec3,
    pub(in crate::scene) uv: Vec2,
}

/// Every primitive of a scene, in the accelerator's order.
#[derive(Debug, Default)]
pub(in crate::scene) struct Surfaces {
    records: Vec<Record>,
    attributes: Vec<Attributes>,
    quadrics: Vec<Quadric>,
    owners: Vec<Owner>,
}

impl Surfaces {
    /// Adds a shape's primitives, here and to the accelerator's list.
    pub(in crate::scene) fn push(&mut self, geometry: &Geometry, owner: Owner, primitives: &mut Vec<Primitive>) {
        let shape = self.owners.len() as u32;
        self.owners.push(owner);
        let quadric = match geometry {
            Geometry::Mesh(mesh) => {
                self.records.reserve(mesh.triangles.len());
                primitives.reserve(mesh.triangles.len());
                for triangle in &mesh.triangles {
                    self.push_triangle(mesh, triangle.map(|i| i as usize), shape, primitives);
                }
                return;
            }
            Geometry::Sphere(s) => Quadric::sphere(s),
            Geometry::Disk(d) => Quadric::disk(d),
            Geometry::Cylinder(c) => Quadric::cylinder(c),
        };
        let detail = QUADRIC | self.quadrics.len() as u32;
        self.records.push(Record { corners: [Vec3::ZERO; 3], n_g: Vec3::ZERO, offset: 0.0, shape, detail });
        primitives.push(quadric.primitive());
        self.quadrics.push(quadric);
    }

    fn push_triangle(&mut self, mesh: &Mesh, vertices: [usize; 3], shape: u32, primitives: &mut Vec<Primitive>) {
        let corners = vertices.map(|i| mesh.positions[i]);
        let sign = if mesh.flip_normals { -1.0 } else { 1.0 };
        let mut n_g = geometric_normal(corners) * sign;
        let normals = mesh.normals.as_ref().map(|n| vertices.map(|i| n[i] * sign));
        // A mirroring transform turns the winding and not the vertex normals; what the surface does follows the latter, so the
        // geometric normal takes their side: only then does "the sides disagree" speak of interpolation and not of a file's winding.
        if normals.is_some_and(|n| (n[0] + n[1] + n[2]).dot(n_g) < 0.0) {
            n_g = -n_g;
        }
        // Normals that say no more than the geometry, up to rounding, are left out.
        let normals = normals.filter(|n| !n.iter().all(|n| n.dot(n_g) > 1.0 - 4.0 * f32::EPSILON));
        let uvs = mesh.uvs.as_ref().map(|t| vertices.map(|i| t[i]));
        let kind = match (&normals, &uvs) {
            (Some(_), _) => SMOOTH,
            (None, Some(_)) => FLAT,
            (None, None) => PLAIN,
        };
        let detail = kind | self.attributes.len() as u32;
        if kind != PLAIN {
            self.attributes.push(Attributes { normals: normals.unwrap_or([n_g; 3]), uvs: uvs.unwrap_or(BARYCENTRIC) });
        }
        // The error of b0 p0 + b1 p1 + b2 p2 grows with the sum of |b_i p_i| ([PBRT 6.8.5]), which is at most the largest |p_i|.
        let largest = corners[0].abs().max(corners[1].abs()).max(corners[2].abs());
        let offset = gamma(7) * largest.dot(n_g.abs());
        self.records.push(Record { corners, n_g, offset, shape, detail });
        primitives.push(Primitive::Triangle(corners));
    }

    /// How many primitives there are so far.
    pub(in crate::scene) fn len(&self) -> usize {
        self.records.len()
    }

    /// How many of them are not triangles.
    pub(in crate::scene) fn quadrics(&self) -> usize {
        self.quadrics.len()
    }

    /// Bytes on the heap.
    pub(in crate::scene) fn memory(&self) -> usize {
        self.records.capacity() * size_of::<Record>()
            + self.attributes.capacity() * size_of::<Attributes>()
            + self.quadrics.capacity() * size_of::<Quadric>()
            + self.owners.capacity() * size_of::<Owner>()
    }

    /// The material of a shape.
    #[inline(always)]
    pub(in crate::scene) fn bsdf(&self, shape: ShapeId) -> BsdfId {
        self.owners[shape.0 as usize].bsdf
    }

    /// Works out the surface where `ray` met a primitive.
    #[inline(always)]
    pub(in crate::scene) fn hit(&self, ray: &Ray, raw: &RawHit) -> Hit {
        let record = &self.records[raw.prim as usize];
        let owner = &self.owners[record.shape as usize];
        let (point, frame) = if record.detail & KIND == QUADRIC {
            // Part by part, so that triangles' hits need not go through the memory that this call writes to.
            let (SurfacePoint { end: Endpoint { p, n_g, offset }, n_s, uv }, Frame { s, t, n }) =
                self.on_quadric(record, ray, raw.t, owner.asked);
            (SurfacePoint { end: Endpoint { p, n_g, offset }, n_s, uv }, Frame { s, t, n })
        } else {
            let point = self.point(record, raw.u, raw.v);
            let Frame { s, t, n } =
                if owner.asked.tangents { self.tangent_frame(record, point.n_s) } else { Frame::from_normal(point.n_s) };
            let frame = Frame { s, t, n };
            (point, frame)
        };
        Hit { t: raw.t, end: point.end, frame, uv: point.uv, prim: raw.prim, shape: ShapeId(record.shape), emitter: owner.emitter }
    }

    /// Does the shape of the primitive that was met shine?
    #[inline(always)]
    pub(in crate::scene) fn shines(&self, raw: &RawHit) -> bool {
        self.owners[self.records[raw.prim as usize].shape as usize].emitter.is_some()
    }

    /// The surface of a quadric where a ray met it.
    #[inline(never)]
    fn on_quadric(&self, record: &Record, ray: &Ray, t: f32, asked: Asked) -> (SurfacePoint, Frame) {
        self.quadrics[(record.detail & !KIND) as usize].surface(ray.o.as_dvec3() + f64::from(t) * ray.d.as_dvec3(), asked)
    }

    /// The point of a triangle with these weights of the second and third corner.
    #[inline(always)]
    fn point(&self, record: &Record, u: f32, v: f32) -> SurfacePoint {
        let w = 1.0 - u - v;
        let [a, b, c] = record.corners;
        let end = Endpoint { p: a * w + b * u + c * v, n_g: record.n_g, offset: record.offset };
        let kind = record.detail & KIND;
        if kind == PLAIN {
            return SurfacePoint { end, n_s: record.n_g, uv: Vec2::new(u, v) };
        }
        let Attributes { normals, uvs } = &self.attributes[(record.detail & !KIND) as usize];
        let uv = uvs[0] * w + uvs[1] * u + uvs[2] * v;
        let n_s = if kind == SMOOTH {
            let n = normals[0] * w + normals[1] * u + normals[2] * v;
            // Opposite normals may cancel; there the geometry is all there is.
            n.try_normalize().unwrap_or(record.n_g)
        } else {
            record.n_g
        };
        SurfacePoint { end, n_s, uv }
    }

    /// The frame of a triangle whose material wants tangents.
    #[inline(never)]
    fn tangent_frame(&self, record: &Record, n_s: Vec3) -> Frame {
        Frame::from_normal_and_tangent(n_s, self.dp_du(record))
    }

    /// How a triangle's position moves with the first texture coordinate; the first edge where that is not defined, as Mitsuba has it.
    fn dp_du(&self, record: &Record) -> Vec3 {
        let [a, b, c] = record.corners;
        let (ab, ac) = (b - a, c - a);
        if record.detail & KIND == PLAIN {
            return ab;
        }
        let uvs = &self.attributes[(record.detail & !KIND) as usize].uvs;
        let (uv_ab, uv_ac) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
        let determinant = uv_ab.perp_dot(uv_ac);
        if determinant == 0.0 { ab } else { (ab * uv_ac.y - ac * uv_ab.y) / determinant }
    }

    /// Area of a primitive, world units squared.
    pub(in crate::scene) fn area(&self, prim: usize) -> f64 {
        let record = &self.records[prim];
        if record.detail & KIND == QUADRIC {
            return self.quadrics[(record.detail & !KIND) as usize].area();
        }
        let [a, b, c] = record.corners.map(|p| p.as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    }

    /// A point of a primitive, uniform by area; `u` in `[0, 1)^2`.
    #[inline(always)]
    pub(in crate::scene) fn sample(&self, prim: usize, u: Vec2) -> SurfacePoint {
        let record = &self.records[prim];
        if record.detail & KIND == QUADRIC {
            let SurfacePoint { end: Endpoint { p, n_g, offset }, n_s, uv } = self.sample_quadric(record, u);
            return SurfacePoint { end: Endpoint { p, n_g, offset }, n_s, uv };
        }
        let b = warp::triangle(u);
        self.point(record, b.x, b.y)
    }

    #[inline(never)]
    fn sample_quadric(&self, record: &Record, u: Vec2) -> SurfacePoint {
        self.quadrics[(record.detail & !KIND) as usize].sample(u)
    }

    /// The sphere that a primitive is, if it is one.
    #[inline]
    pub(in crate::scene) fn as_quadric(&self, prim: usize) -> Option<&Quadric> {
        let detail = self.records[prim].detail;
        (detail & KIND == QUADRIC).then(|| &self.quadrics[(detail & !KIND) as usize])
    }
}

/// `(b - a) x (c - a)` as a unit vector, in f64 because thin triangles cancel; zero for a triangle without area.
fn geometric_normal(corners: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    (b - a).cross(c - a).normalize_or_zero().as_vec3()
}
