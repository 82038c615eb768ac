//! Paths at diffuse surfaces, eight in the lanes of a vector: the commonest vertex, done without branches.
//!
//! It draws the same random numbers as a vertex of any other material and computes the same bits from them; materials whose lobes differ
//! from lane to lane would not fit, and neither would lights that are not points uniform by area. Those go one by one.

use super::block::{Unshadowed, Walk};
use super::power_heuristic;
use crate::math::Rgb;
use crate::math::eight::{self, Lanes, Vec3x8};
use crate::samplers::Stream;
use crate::scene::emitter::LightPoint;
use crate::scene::hit::{Endpoint8, Hit, segment_lane};
use crate::scene::ray::Ray;
use crate::scene::texture::Texture;
use crate::transport::walk::CEILING;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;
use wide::f32x8;

/// Eight paths at diffuse surfaces, with all that one vertex asks of the random numbers and of the light.
#[derive(Clone, Default)]
#[repr(align(64))]
struct Eight {
    walk: [u32; 8],
    p: [Lanes; 3],
    n_g: [Lanes; 3],
    n_s: [Lanes; 3],
    offset: Lanes,
    /// 1 or -1: times a local z it is positive where the surface reflects.
    side: Lanes,
    reflectance: [Lanes; 3],
    throughput: [Lanes; 3],
    eta: Lanes,
    u_direction: [Lanes; 2],
    /// For roulette; drawn where there is any.
    u_survival: Lanes,
    light_p: [Lanes; 3],
    light_n_g: [Lanes; 3],
    light_n_s: [Lanes; 3],
    light_offset: Lanes,
    light_pdf: Lanes,
    light_pick: Lanes,
    radiance: [Lanes; 3],
}

/// A reflectance still to be looked up: the texels have been asked for and are on their way.
struct Pending<'a> {
    place: usize,
    texture: &'a Texture,
    uv: Vec2,
}

/// The paths of a block that are at diffuse surfaces.
pub(super) struct Diffuse<'a> {
    eights: Vec<Eight>,
    count: usize,
    pending: Vec<Pending<'a>>,
}

/// Writes one lane.
#[inline(always)]
fn set(lanes: &mut [Lanes; 3], lane: usize, v: Vec3) {
    for (lanes, v) in lanes.iter_mut().zip(v.to_array()) {
        lanes[lane & 7] = v;
    }
}

impl<'a> Diffuse<'a> {
    /// Room for this many paths.
    pub(super) fn new(width: usize) -> Self {
        Self { eights: vec![Eight::default(); width.div_ceil(8)], count: 0, pending: Vec::with_capacity(width) }
    }

    /// No path.
    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.pending.clear();
    }

    /// A path that met a surface of this reflectance, and its random numbers there. The light's point comes from `light`.
    #[inline(always)]
    pub(super) fn push<F>(
        &mut self,
        (number, walk): (u32, &mut Walk<F>),
        hit: &Hit,
        (texture, side): (&'a Texture, f32),
        roulette: bool,
        light: impl FnOnce(f32, Vec2) -> Option<LightPoint>,
    ) {
        let place = self.count;
        let Some(eight) = self.eights.get_mut(place / 8) else { return };
        self.count += 1;
        let lane = place % 8;
        match texture {
            Texture::Constant(c) => set(&mut eight.reflectance, lane, Vec3::from(c.to_array())),
            _ => {
                texture.prefetch(hit.uv);
                self.pending.push(Pending { place, texture, uv: hit.uv });
            }
        }
        eight.walk[lane] = number;
        set(&mut eight.p, lane, hit.end.p);
        set(&mut eight.n_g, lane, hit.end.n_g);
        set(&mut eight.n_s, lane, hit.frame.n);
        eight.offset[lane] = hit.end.offset;
        eight.side[lane] = side;
        set(&mut eight.throughput, lane, Vec3::from(walk.throughput.to_array()));
        eight.eta[lane] = walk.eta;
        let u_pick = walk.stream.next_1d();
        let u_light = Vec2::from(walk.stream.next_2d());
        // A choice of lobes where there is one.
        walk.stream.next_1d();
        let [u, v] = walk.stream.next_2d();
        eight.u_direction[0][lane] = u;
        eight.u_direction[1][lane] = v;
        if roulette {
            eight.u_survival[lane] = walk.stream.next_1d();
        }
        let Some(light) = light(u_pick, u_light) else {
            eight.light_pdf[lane] = 0.0;
            return;
        };
        set(&mut eight.light_p, lane, light.end.p);
        set(&mut eight.light_n_g, lane, light.end.n_g);
        set(&mut eight.light_n_s, lane, light.n_s);
        eight.light_offset[lane] = light.end.offset;
        eight.light_pdf[lane] = light.pdf.0;
        eight.light_pick[lane] = light.pick;
        set(&mut eight.radiance, lane, Vec3::from(light.radiance.to_array()));
    }

    /// Looks up the reflectances that vary.
    pub(super) fn look_up(&mut self) {
        for Pending { place, texture, uv } in self.pending.drain(..) {
            let reflectance = texture.eval(uv);
            if let Some(eight) = self.eights.get_mut(place / 8) {
                set(&mut eight.reflectance, place % 8, Vec3::from(reflectance.to_array()));
            }
        }
    }

    /// Every eight with the number of lanes in use.
    #[inline(always)]
    fn in_use(&self) -> impl Iterator<Item = (&Eight, usize)> {
        self.eights.iter().enumerate().map_while(|(i, eight)| self.count.checked_sub(8 * i).filter(|n| *n > 0).map(|n| (eight, n.min(8))))
    }

    /// Next event estimation: what each light sample adds if nothing is in its way, and the ray that tells.
    pub(super) fn find_light(&self, mut found: impl FnMut(Unshadowed, Ray)) {
        for (eight, count) in self.in_use() {
            let (mask, value, (o, d)) = eight.light();
            let mut mask = eight::bits(mask, count);
            let (value, o, d) = (value.to_lanes(), o.to_lanes(), d.to_lanes());
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                let value = Rgb::from(Vec3x8::lane(&value, lane).to_array());
                found(Unshadowed { walk: eight.walk[lane], value }, segment_lane((&o, &d), lane));
            }
        }
    }

    /// BSDF sampling and, where asked for, Russian roulette: the paths that go on, and their next rays.
    pub(super) fn scatter<F>(&self, roulette: bool, walks: &mut [Walk<F>], live: &mut Vec<u32>, rays: &mut Vec<Ray>) {
        for (eight, count) in self.in_use() {
            let next = eight.scatter(roulette);
            let mut mask = eight::bits(next.goes_on, count);
            let (throughput, o, d) = (next.throughput.to_lanes(), next.o.to_lanes(), next.d.to_lanes());
            let pdf = next.pdf.to_array();
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                let walk = &mut walks[eight.walk[lane] as usize];
                walk.throughput = Rgb::from(Vec3x8::lane(&throughput, lane).to_array());
                walk.from = Vec3x8::lane(&eight.p, lane);
                walk.sampled_pdf = Some(pdf[lane]);
                live.push(eight.walk[lane]);
                rays.push(Ray::new(Vec3x8::lane(&o, lane), Vec3x8::lane(&d, lane)));
            }
        }
    }
}

/// The next directions of eight paths.
struct Next {
    goes_on: f32x8,
    throughput: Vec3x8,
    pdf: f32x8,
    o: Vec3x8,
    d: Vec3x8,
}

impl Eight {
    #[inline(always)]
    fn end(&self) -> Endpoint8 {
        Endpoint8 { p: Vec3x8::new(&self.p), n_g: Vec3x8::new(&self.n_g), offset: f32x8::new(self.offset) }
    }

    /// `Area::sample_direct` from here, [`crate::transport::shading::SurfacePoint::eval_pdf`], and the weight: which lanes gain anything, how
    /// much, and the origins and directions of the rays to the lights.
    #[inline(always)]
    fn light(&self) -> (f32x8, Vec3x8, (Vec3x8, Vec3x8)) {
        let zero = f32x8::ZERO;
        let here = self.end();
        let light = Endpoint8 { p: Vec3x8::new(&self.light_p), n_g: Vec3x8::new(&self.light_n_g), offset: f32x8::new(self.light_offset) };
        let to_light = light.p - here.p;
        let cos_light = light.n_g.dot(-to_light);
        let faces = cos_light.simd_gt(zero) & Vec3x8::new(&self.light_n_s).dot(-to_light).simd_gt(zero);
        let distance2 = to_light.dot(to_light);
        let nearness = f32x8::ONE / distance2.sqrt();
        let wi = to_light * nearness;
        let pdf = f32x8::new(self.light_pdf) * distance2 / (cos_light * nearness) * f32x8::new(self.light_pick);
        let z = wi.dot(Vec3x8::new(&self.n_s));
        let turned = z * f32x8::new(self.side);
        let reflects = (wi.dot(here.n_g) * z).simd_gt(zero) & turned.simd_gt(zero);
        let f = Vec3x8::new(&self.reflectance) * f32x8::splat(FRAC_1_PI);
        let not_black = f.x.simd_ne(zero) | f.y.simd_ne(zero) | f.z.simd_ne(zero);
        let weight = power_heuristic(pdf, eight::cosine_hemisphere_pdf(turned));
        let value = Vec3x8::new(&self.throughput) * f * Vec3x8::new(&self.radiance) * (z.abs() * weight / pdf);
        (faces & reflects & not_black, value, here.segment(&light))
    }

    /// [`crate::transport::shading::SurfacePoint::sample`] of a diffuse surface, and roulette.
    #[inline(always)]
    fn scatter(&self, roulette: bool) -> Next {
        let zero = f32x8::ZERO;
        let here = self.end();
        let n_s = Vec3x8::new(&self.n_s);
        let local = eight::cosine_hemisphere(self.u_direction.map(f32x8::new));
        let pdf = eight::cosine_hemisphere_pdf(local.z);
        let d = eight::to_world(n_s, Vec3x8 { z: local.z * f32x8::new(self.side), ..local });
        let agree = (d.dot(here.n_g) * d.dot(n_s)).simd_gt(zero);
        let throughput = Vec3x8::new(&self.throughput) * Vec3x8::new(&self.reflectance);
        let (survives, throughput) = if roulette {
            let eta = f32x8::new(self.eta);
            let survival = (throughput.max_element() * eta * eta).fast_min(f32x8::splat(CEILING));
            (f32x8::new(self.u_survival).simd_lt(survival), throughput * (f32x8::ONE / survival))
        } else {
            (throughput.x.simd_ne(zero) | throughput.y.simd_ne(zero) | throughput.z.simd_ne(zero), throughput)
        };
        Next { goes_on: agree & survives, throughput, pdf, o: here.toward(d), d }
    }
}
