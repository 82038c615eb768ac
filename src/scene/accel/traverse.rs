//! The walk through the tree: once for the closest hit, once for any.

use super::node::{ANALYTIC, EMPTY, LEAF, Node};
use super::probe::Probe;
use super::triangle::{Best, Tri8};
use super::{Bvh, DEEP, RawHit, Ray};
use std::cell::Cell;

thread_local! {
    /// What is still to be visited. Kept with the thread, since clearing a fresh one costs more than a short walk.
    static STACK: [Cell<u64>; DEEP] = const { [const { Cell::new(0) }; DEEP] };
}

/// Entry distance above, child below: as both are non-negative, entries sort as integers.
#[inline(always)]
fn entry(t: f32, child: u32) -> u64 {
    u64::from(t.to_bits()) << 32 | u64::from(child)
}

/// The probe as something that must be loaded anew: the compiler would otherwise hold all of it in registers from step to step, where
/// boxes and triangles leave no room, and every leaf would put it away and fetch it back.
#[inline(always)]
fn in_memory(p: &Probe) -> &Probe {
    std::hint::black_box(p)
}

impl Bvh {
    /// Starts fetching a child that will be visited soon.
    #[inline(always)]
    pub(super) fn fetch(&self, child: u32) {
        if !self.large {
            return;
        }
        // Of an analytic shape the place of something else: no harm, and no branch.
        if let Some(slot) = self.slots.get((child & !LEAF) as usize) {
            slot.fetch();
        }
    }

    /// An inner node.
    #[inline(always)]
    pub(super) fn node(&self, at: u32) -> Node<'_> {
        Node(&self.slots[at as usize])
    }

    /// A leaf of triangles.
    #[inline(always)]
    pub(super) fn leaf(&self, at: u32) -> Tri8<'_> {
        Tri8(&self.slots[(at & !LEAF) as usize])
    }

    /// See [`super::Accel::closest`].
    #[inline(always)]
    pub(super) fn find_closest(&self, ray: &Ray) -> Option<RawHit> {
        STACK.with(|stack| self.closest_on(stack, &Probe::new(ray, self.reach)?, ray))
    }

    #[inline(always)]
    fn closest_on(&self, stack: &[Cell<u64>; DEEP], p: &Probe, ray: &Ray) -> Option<RawHit> {
        let mut best = Best { t: ray.t_max * p.to_scaled, u: 0.0, v: 0.0, prim: EMPTY };
        let mut top = 0;
        let mut at = self.root;
        if at == EMPTY || best.t.is_nan() || best.t <= 0.0 {
            return None;
        }
        loop {
            let p = in_memory(p);
            if at & LEAF == 0 {
                let node = self.node(at);
                let (mut mask, enter) = node.meet(p, best.t);
                if mask != 0 {
                    let enter = enter.as_array();
                    let i = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    if mask == 0 {
                        at = node.child(i);
                        continue;
                    }
                    let j = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    let (a, b) = (entry(enter[i], node.child(i)), entry(enter[j], node.child(j)));
                    self.fetch(node.child(i));
                    self.fetch(node.child(j));
                    let mut nearest = a.min(b);
                    stack[top & (DEEP - 1)].set(a.max(b));
                    let base = top;
                    top += 1;
                    while mask != 0 {
                        let i = mask.trailing_zeros() as usize & 7;
                        mask &= mask - 1;
                        let next = entry(enter[i], node.child(i));
                        self.fetch(node.child(i));
                        let farther = next.max(nearest);
                        nearest = next.min(nearest);
                        let mut k = top;
                        while k > base && stack[k - 1].get() < farther {
                            stack[k].set(stack[k - 1].get());
                            k -= 1;
                        }
                        stack[k].set(farther);
                        top += 1;
                    }
                    at = nearest as u32;
                    continue;
                }
            } else if at & ANALYTIC == 0 {
                self.leaf(at).closest(p, &mut best);
            } else {
                self.analytic[(at & !(LEAF | ANALYTIC)) as usize].closest(p.o, p.d, &mut best);
            }
            // A child entered no sooner than the best hit is not worth opening; equally near ones are, for the tie.
            loop {
                if top == 0 {
                    return self.report(p, ray, best);
                }
                top -= 1;
                let next = stack[top & (DEEP - 1)].get();
                if f32::from_bits((next >> 32) as u32) <= best.t {
                    at = next as u32;
                    break;
                }
            }
        }
    }

    #[inline(always)]
    fn report(&self, p: &Probe, ray: &Ray, best: Best) -> Option<RawHit> {
        // The scaling is by a power of two; it can only lose bits, and the promise on t, at the ends of the range.
        let t = best.t * p.from_scaled;
        (best.prim != EMPTY && t > 0.0 && t <= ray.t_max).then_some(RawHit { t, u: best.u, v: best.v, prim: best.prim })
    }

    /// See [`super::Accel::occluded`].
    #[inline(always)]
    pub(super) fn find_any(&self, ray: &Ray) -> bool {
        STACK.with(|stack| Probe::new(ray, self.reach).is_some_and(|p| self.any_on(stack, &p, ray)))
    }

    #[inline(always)]
    fn any_on(&self, stack: &[Cell<u64>; DEEP], p: &Probe, ray: &Ray) -> bool {
        let t_max = ray.t_max * p.to_scaled;
        let mut top = 0;
        let mut at = self.root;
        if at == EMPTY || t_max.is_nan() || t_max <= 0.0 {
            return false;
        }
        loop {
            let p = in_memory(p);
            if at & LEAF == 0 {
                let node = self.node(at);
                let (mut mask, _) = node.meet(p, t_max);
                if mask != 0 {
                    loop {
                        at = node.child(mask.trailing_zeros() as usize & 7);
                        mask &= mask - 1;
                        self.fetch(at);
                        if mask == 0 {
                            break;
                        }
                        stack[top & (DEEP - 1)].set(u64::from(at));
                        top += 1;
                    }
                    continue;
                }
            } else if at & ANALYTIC == 0 {
                if self.leaf(at).occluded(p, t_max) {
                    return true;
                }
            } else if self.analytic[(at & !(LEAF | ANALYTIC)) as usize].occluded(p.o, p.d, t_max) {
                return true;
            }
            if top == 0 {
                return false;
            }
            top -= 1;
            at = stack[top & (DEEP - 1)].get() as u32;
        }
    }
}
