//! The scenes of the ray benchmark and the rays a renderer would shoot in them.

use crate::shapes::{Mesh, bumpy, cuboid};
use glam::Vec3;
use isophote::scene::accel::{Accel, Bvh};
use isophote::scene::ray::Ray;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f32::consts::TAU;
use std::io::{self, Write};

/// Rays of one kind.
pub(crate) struct Set {
    pub(crate) name: &'static str,
    /// Any hit instead of the closest.
    pub(crate) any: bool,
    pub(crate) rays: Vec<Ray>,
}

/// A scene with its rays, as both sides read it.
pub(crate) struct Workload {
    mesh: Mesh,
    pub(crate) sets: Vec<Set>,
}

const SIDE: u32 = 768;
const AT_MOST: usize = 700_000;

/// A room of `[0, 1]^3` open towards -y, with two boxes (32 triangles) or eight bumpy balls in it.
pub(crate) fn scene(name: &str) -> Option<Mesh> {
    let v = Vec3::new;
    let mut room = Mesh::default();
    room.quad([v(0., 0., 0.), v(1., 0., 0.), v(1., 1., 0.), v(0., 1., 0.)]);
    room.quad([v(0., 0., 1.), v(0., 1., 1.), v(1., 1., 1.), v(1., 0., 1.)]);
    room.quad([v(0., 1., 0.), v(1., 1., 0.), v(1., 1., 1.), v(0., 1., 1.)]);
    room.quad([v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 1.), v(0., 0., 1.)]);
    room.quad([v(1., 0., 0.), v(1., 0., 1.), v(1., 1., 1.), v(1., 1., 0.)]);
    room.quad([v(0.35, 0.35, 0.999), v(0.65, 0.35, 0.999), v(0.65, 0.65, 0.999), v(0.35, 0.65, 0.999)]);
    let rings = match name {
        "32" => {
            for (a, b) in [(v(0.2, 0.5, 0.), v(0.45, 0.75, 0.6)), (v(0.55, 0.2, 0.), v(0.8, 0.45, 0.3))] {
                let mut block = cuboid(a, b);
                block.triangles.drain(0..2);
                room.add(&block);
            }
            return Some(room);
        }
        "70k" => 66,
        "1m" => 250,
        _ => return None,
    };
    for i in 0..8u32 {
        let at = |bit: u32| if i >> bit & 1 == 0 { 0.27 } else { 0.73 };
        room.add(&bumpy(v(at(0), at(1), at(2)), 0.19, 0.15, rings, rings));
    }
    Some(room)
}

impl Workload {
    pub(crate) fn new(name: &str, mesh: Mesh, bvh: &Bvh) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let corners: Vec<_> = mesh.soup().collect();
        let mut primary = Vec::new();
        for tile in 0..(SIDE / 8).pow(2) {
            let (x0, y0) = (tile % (SIDE / 8) * 8, tile / (SIDE / 8) * 8);
            for i in 0..64 {
                let x = ((x0 + i % 8) as f32 + 0.5) / SIDE as f32 - 0.5;
                let y = ((y0 + i / 8) as f32 + 0.5) / SIDE as f32 - 0.5;
                primary.push(Ray::new(Vec3::new(0.5, -1.2, 0.5), Vec3::new(x, 1.2, y).normalize()));
            }
        }
        let (mut bounce, mut shadow) = (Vec::new(), Vec::new());
        let mut current = primary.clone();
        for depth in 1..=3 {
            let mut next = Vec::new();
            for ray in &current {
                let Some(hit) = bvh.closest(ray) else {
                    continue;
                };
                let [a, b, c] = corners[hit.prim as usize];
                let n = (b - a).cross(c - a).normalize();
                let n = if n.dot(ray.d) > 0.0 { -n } else { n };
                let o = ray.o + ray.d * hit.t + n * 1e-5;
                next.push(Ray::new(o, cosine(n, &mut rng)));
                let light = Vec3::new(0.35 + 0.3 * rng.random::<f32>(), 0.35 + 0.3 * rng.random::<f32>(), 0.9985);
                if depth >= 2 {
                    shadow.push(Ray { o, d: light - o, t_max: 0.9999 });
                }
            }
            if depth >= 2 {
                bounce.extend_from_slice(&next);
            }
            current = next;
        }
        // Depth 2 and 3 half and half; within each the order is that of the image, as a renderer would have it.
        for rays in [&mut bounce, &mut shadow] {
            let step = rays.len().div_ceil(AT_MOST).max(1);
            *rays = rays.iter().step_by(step).copied().collect();
        }
        let mut sets = vec![
            Set { name: "primary", any: false, rays: primary },
            Set { name: "bounce", any: false, rays: bounce },
            Set { name: "shadow", any: true, rays: shadow },
        ];
        if name == "70k" {
            sets.push(Set { name: "edges", any: false, rays: edges(&mesh, &mut rng) });
        }
        Self { mesh, sets }
    }

    pub(crate) fn write(&self, to: &mut impl Write) -> io::Result<()> {
        let mut put = |words: &[u32]| words.iter().try_for_each(|w| to.write_all(&w.to_ne_bytes()));
        put(&[self.mesh.corners.len() as u32, self.mesh.triangles.len() as u32, self.sets.len() as u32])?;
        for c in &self.mesh.corners {
            put(&c.to_array().map(f32::to_bits))?;
        }
        for t in &self.mesh.triangles {
            put(t)?;
        }
        for set in &self.sets {
            put(&[u32::from(set.any), set.rays.len() as u32])?;
            for r in &set.rays {
                put(&r.o.to_array().map(f32::to_bits))?;
                put(&r.d.to_array().map(f32::to_bits))?;
                put(&[r.t_max.to_bits()])?;
            }
        }
        to.flush()
    }
}

/// Rays from inside the last ball, aimed as exactly as f32 allows at its corners and at points of its edges. Each hits.
fn edges(mesh: &Mesh, rng: &mut Pcg64Mcg) -> Vec<Ray> {
    let ball = &mesh.triangles[mesh.triangles.len() / 8 * 7 + 8..];
    let center = Vec3::splat(0.73);
    (0..1_000_000)
        .map(|i| {
            let t = ball[rng.random_range(0..ball.len())].map(|i| mesh.corners[i as usize]);
            let at = if i % 2 == 0 { t[0] } else { t[0].lerp(t[1], rng.random()) };
            let mut random = || Vec3::new(rng.random(), rng.random(), rng.random());
            let o = center + (random() - 0.5) * 0.08;
            let d = at - o;
            // The wall behind would stop a ray that leaked.
            Ray { o, d, t_max: 1.0 + 1e-3 }
        })
        .collect()
}

fn cosine(n: Vec3, rng: &mut Pcg64Mcg) -> Vec3 {
    let (x, y) = n.any_orthonormal_pair();
    let (r2, phi) = (rng.random::<f32>(), TAU * rng.random::<f32>());
    let r = r2.sqrt();
    x * (r * phi.cos()) + y * (r * phi.sin()) + n * (1.0 - r2).max(1e-6).sqrt()
}
