//! Many rays at once: which go together, and how.
//!
//! In a small tree any eight rays visit nearly the same leaves, so all go in packets, sorted by direction. In a larger one rays gain by
//! company only if they start close to each other and go nearly the same way: eight neighbours in the list form a packet if they do, and
//! otherwise each goes alone. What is decided here changes no answer.

use super::packet::{LANES, Packet, largest_axis};
use super::{Bvh, RawHit, Ray};
use glam::Vec3;

/// Rays sorted at once; their numbers fit a byte.
const BATCH: usize = 256;

/// Primitives of a small tree.
pub(super) const SMALL: usize = 160;

/// Rays that make a packet in a small tree.
const ENOUGH: usize = 3;

/// How far apart two rays of a packet in a larger tree may point, in units of the largest direction component.
const WAY: f32 = 0.25;

/// How far apart they may start, in units of the scene's longest side.
const START: f32 = 0.05;

/// What is asked of each ray.
trait Question {
    type Answer: Copy;
    fn alone(bvh: &Bvh, ray: &Ray) -> Self::Answer;
    fn together<const K: usize>(bvh: &Bvh, p: &Packet<K>, rays: [&Ray; LANES]) -> [Self::Answer; LANES];
}

struct Closest;

impl Question for Closest {
    type Answer = Option<RawHit>;

    #[inline(always)]
    fn alone(bvh: &Bvh, ray: &Ray) -> Option<RawHit> {
        bvh.find_closest(ray)
    }

    #[inline(always)]
    fn together<const K: usize>(bvh: &Bvh, p: &Packet<K>, rays: [&Ray; LANES]) -> [Option<RawHit>; LANES] {
        p.closest(bvh, rays)
    }
}

struct Any;

impl Question for Any {
    type Answer = bool;

    #[inline(always)]
    fn alone(bvh: &Bvh, ray: &Ray) -> bool {
        bvh.find_any(ray)
    }

    #[inline(always)]
    fn together<const K: usize>(bvh: &Bvh, p: &Packet<K>, _: [&Ray; LANES]) -> [bool; LANES] {
        let blocked = p.any(bvh);
        std::array::from_fn(|lane| blocked >> lane & 1 != 0)
    }
}

/// The numbers of up to `BATCH` rays by largest axis, on each axis by octant, and where each axis ends.
#[inline(always)]
fn by_direction(rays: &[Ray]) -> ([u8; BATCH], [usize; 3]) {
    let mut order = [0; BATCH];
    let mut ways = [0u8; BATCH];
    let mut next = [0usize; 32];
    for (way, ray) in ways.iter_mut().zip(rays) {
        *way = (largest_axis(ray.d) << 3 | octant(ray.d)) as u8;
        next[*way as usize & 31] += 1;
    }
    let mut sum = 0;
    for place in &mut next {
        (*place, sum) = (sum, sum + *place);
    }
    for (n, way) in ways.iter().enumerate().take(rays.len()) {
        let place = &mut next[*way as usize & 31];
        order[*place & (BATCH - 1)] = n as u8;
        *place += 1;
    }
    (order, [next[7], next[15], next[23]])
}

/// The signs of a direction, as bits.
#[inline(always)]
fn octant(d: Vec3) -> usize {
    let sign = |x: f32| (x.to_bits() >> 31) as usize;
    sign(d.x) << 2 | sign(d.y) << 1 | sign(d.z)
}

/// Do eight rays start close to each other and go nearly the same way? If so, their largest axis.
#[inline(always)]
fn together(rays: &[Ray], start: f32) -> Option<usize> {
    let [first, others @ ..] = rays else {
        return None;
    };
    let (axis, way) = (largest_axis(first.d), first.d.abs().max_element() * WAY);
    // The first neighbour already tells most strangers.
    let near = |r: &Ray| (r.d - first.d).abs().max_element() <= way && (r.o - first.o).abs().max_element() <= start;
    (rays.len() == LANES && others.iter().all(|r| near(r) && largest_axis(r.d) == axis)).then_some(axis)
}

impl Bvh {
    #[inline(always)]
    fn packet<Q: Question>(&self, rays: [&Ray; LANES], axis: usize) -> [Q::Answer; LANES] {
        match axis {
            0 => Q::together(self, &Packet::<0>::new(rays, self.reach), rays),
            1 => Q::together(self, &Packet::<1>::new(rays, self.reach), rays),
            _ => Q::together(self, &Packet::<2>::new(rays, self.reach), rays),
        }
    }

    /// Up to `BATCH` rays by direction, in packets.
    #[inline(always)]
    fn grouped<Q: Question>(&self, rays: &[Ray], answers: &mut [Q::Answer]) {
        let (order, ends) = by_direction(rays);
        let mut start = 0;
        for (axis, end) in ends.into_iter().enumerate() {
            for group in order[start..end].chunks(LANES) {
                if group.len() < ENOUGH {
                    for &n in group {
                        answers[n as usize] = Q::alone(self, &rays[n as usize]);
                    }
                    continue;
                }
                // Lanes to spare do what the first does.
                let eight = std::array::from_fn(|i| &rays[*group.get(i).unwrap_or(&group[0]) as usize]);
                for (&n, answer) in group.iter().zip(self.packet::<Q>(eight, axis)) {
                    answers[n as usize] = answer;
                }
            }
            start = end;
        }
    }

    /// All rays in their order, in packets where neighbours go together.
    #[inline(always)]
    fn in_turn<Q: Question>(&self, rays: &[Ray], answers: &mut [Q::Answer], start: f32) {
        for (rays, answers) in rays.chunks(LANES).zip(answers.chunks_mut(LANES)) {
            if let Some(axis) = together(rays, start) {
                answers.copy_from_slice(&self.packet::<Q>(std::array::from_fn(|i| &rays[i]), axis));
                continue;
            }
            for (ray, answer) in rays.iter().zip(answers) {
                *answer = Q::alone(self, ray);
            }
        }
    }

    /// Of two lengths the shorter counts.
    #[inline(always)]
    fn each<Q: Question>(&self, rays: &[Ray], answers: &mut [Q::Answer]) {
        let count = rays.len().min(answers.len());
        let (rays, answers) = (&rays[..count], &mut answers[..count]);
        if self.primitives > SMALL {
            let start = self.bounds.map_or(0.0, |b| (b.max - b.min).max_element()) * START;
            return self.in_turn::<Q>(rays, answers, start);
        }
        for (rays, answers) in rays.chunks(BATCH).zip(answers.chunks_mut(BATCH)) {
            self.grouped::<Q>(rays, answers);
        }
    }

    /// See [`super::Accel::closest_each`].
    pub(super) fn each_closest(&self, rays: &[Ray], hits: &mut [Option<RawHit>]) {
        self.each::<Closest>(rays, hits);
    }

    /// See [`super::Accel::occluded_each`].
    pub(super) fn each_any(&self, rays: &[Ray], blocked: &mut [bool]) {
        self.each::<Any>(rays, blocked);
    }
}
