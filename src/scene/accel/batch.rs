//! Many rays at once: which go together, and how.
//!
//! In a small tree any eight rays visit nearly the same leaves: rays are taken 256 at a time and grouped by their largest axis, as a packet
//! needs it. In a larger one only rays that start close to each other and go nearly the same way gain by company: eight neighbours in the
//! list form a packet if they do, and otherwise each goes alone.

use super::packet::{LANES, Packet, largest_axis};
use super::{Bvh, RawHit, Ray};

/// Rays sorted at once; their numbers fit a byte.
const BATCH: usize = 256;

/// How far apart two rays of a packet in a larger tree may point, in units of the largest direction component.
const WAY: f32 = 0.25;

/// How far apart they may start, in units of the scene's largest coordinate.
const START: f32 = 0.05;

/// Leaves of a small tree.
const SMALL: usize = 24;

/// Fewer rays than this go alone.
const LEAST: usize = 3;

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

/// Do eight rays start close to each other and go nearly the same way? If so, their largest axis.
#[inline(always)]
fn together(rays: &[Ray], reach: f32) -> Option<usize> {
    let [first, others @ ..] = rays else {
        return None;
    };
    let (way, start) = (first.d.abs().max_element() * WAY, reach * START);
    let near = |r: &Ray| (r.d - first.d).abs().max_element() <= way && (r.o - first.o).abs().max_element() <= start;
    // The first neighbour already tells most strangers.
    let axis = largest_axis(first.d);
    (rays.len() == LANES && others.iter().all(near) && others.iter().all(|r| largest_axis(r.d) == axis)).then_some(axis)
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

    /// For a small tree: all rays in packets.
    #[inline(always)]
    fn each_grouped<Q: Question>(&self, rays: &[Ray], answers: &mut [Q::Answer]) {
        for (rays, answers) in rays.chunks(BATCH).zip(answers.chunks_mut(BATCH)) {
            let (order, ends) = by_axis(rays);
            let mut start = 0;
            for (axis, end) in ends.into_iter().enumerate() {
                for group in order[start..end].chunks(LANES) {
                    if group.len() < LEAST {
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
    }

    /// For a large tree: packets where neighbours go together.
    #[inline(always)]
    fn each_in_turn<Q: Question>(&self, rays: &[Ray], answers: &mut [Q::Answer]) {
        for (rays, answers) in rays.chunks(LANES).zip(answers.chunks_mut(LANES)) {
            if let Some(axis) = together(rays, self.reach) {
                answers.copy_from_slice(&self.packet::<Q>(std::array::from_fn(|i| &rays[i]), axis));
                continue;
            }
            for (ray, answer) in rays.iter().zip(answers) {
                *answer = Q::alone(self, ray);
            }
        }
    }

    #[inline(always)]
    fn each<Q: Question>(&self, rays: &[Ray], answers: &mut [Q::Answer]) {
        let count = rays.len().min(answers.len());
        let (rays, answers) = (&rays[..count], &mut answers[..count]);
        if self.triangles.len() + self.analytic.len() <= SMALL {
            self.each_grouped::<Q>(rays, answers);
        } else {
            self.each_in_turn::<Q>(rays, answers);
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
