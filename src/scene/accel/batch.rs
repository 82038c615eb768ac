//! Many rays at once: which go together, and how.
//!
//! Rays are taken 256 at a time and put in groups with the same largest axis, as a packet needs it. Whatever a group then does, its rays
//! are made ready together, which costs a third of making them ready one by one.

use super::packet::{LANES, Packet, largest_axis};
use super::{Bvh, RawHit, Ray};

/// Rays sorted at once; their numbers fit a byte.
const BATCH: usize = 256;

/// Leaves up to which any eight rays share a walk: in so small a tree they visit nearly the same leaves anyway.
const SMALL: usize = 24;

/// Fewer rays than this go alone.
const LEAST: usize = 3;

/// What is asked of each ray.
trait Question {
    type Answer: Copy;
    fn alone(bvh: &Bvh, ray: &Ray) -> Self::Answer;
    fn ready<const K: usize>(bvh: &Bvh, p: &Packet<K>, lane: usize, ray: &Ray) -> Self::Answer;
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
    fn ready<const K: usize>(bvh: &Bvh, p: &Packet<K>, lane: usize, ray: &Ray) -> Option<RawHit> {
        bvh.find_closest_ready(&p.probe(lane)?, ray)
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
    fn ready<const K: usize>(bvh: &Bvh, p: &Packet<K>, lane: usize, ray: &Ray) -> bool {
        p.probe(lane).is_some_and(|p| bvh.find_any_ready(&p, ray))
    }

    #[inline(always)]
    fn together<const K: usize>(bvh: &Bvh, p: &Packet<K>, _: [&Ray; LANES]) -> [bool; LANES] {
        let blocked = p.any(bvh);
        std::array::from_fn(|lane| blocked >> lane & 1 != 0)
    }
}

/// The numbers of up to `BATCH` rays by largest axis, and where each axis ends.
#[inline(always)]
fn by_axis(rays: &[Ray]) -> ([u8; BATCH], [usize; 3]) {
    let mut order = [0; BATCH];
    let mut axes = [0u8; BATCH];
    let mut counts = [0usize; 4];
    for (axis, ray) in axes.iter_mut().zip(rays) {
        *axis = largest_axis(ray.d) as u8;
        counts[*axis as usize & 3] += 1;
    }
    let mut next = [0, counts[0], counts[0] + counts[1], 0];
    for (n, axis) in axes.iter().enumerate().take(rays.len()) {
        let place = &mut next[*axis as usize & 3];
        order[*place & (BATCH - 1)] = n as u8;
        *place += 1;
    }
    (order, [next[0], next[1], next[2]])
}

impl Bvh {
    #[inline(always)]
    fn group<Q: Question, const K: usize>(&self, rays: &[Ray], numbers: &[u8], answers: &mut [Q::Answer]) {
        for group in numbers.chunks(LANES) {
            if group.len() < LEAST {
                for &n in group {
                    answers[n as usize] = Q::alone(self, &rays[n as usize]);
                }
                continue;
            }
            let group_rays: [&Ray; LANES] = std::array::from_fn(|i| &rays[*group.get(i).unwrap_or(&group[0]) as usize]);
            let p = Packet::<K>::new(group_rays, self.reach);
            if self.triangles.len() <= SMALL || p.coherent(self.reach) {
                for (&n, answer) in group.iter().zip(Q::together(self, &p, group_rays)) {
                    answers[n as usize] = answer;
                }
            } else {
                for (lane, &n) in group.iter().enumerate() {
                    answers[n as usize] = Q::ready(self, &p, lane, &rays[n as usize]);
                }
            }
        }
    }

    #[inline(always)]
    fn each<Q: Question>(&self, rays: &[Ray], answers: &mut [Q::Answer]) {
        let count = rays.len().min(answers.len());
        for (rays, answers) in rays[..count].chunks(BATCH).zip(answers.chunks_mut(BATCH)) {
            let (order, [x, y, z]) = by_axis(rays);
            self.group::<Q, 0>(rays, &order[..x], answers);
            self.group::<Q, 1>(rays, &order[x..y], answers);
            self.group::<Q, 2>(rays, &order[y..z], answers);
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
