//! The walk through the tree: once for the closest hit, once for any.

use super::node::{ANALYTIC, EMPTY, LEAF};
use super::probe::Probe;
use super::triangle::Best;
use super::{Bvh, RawHit, Ray};

/// Entry distance above, child below: as both are non-negative, entries sort as integers.
#[inline(always)]
fn entry(t: f32, child: u32) -> u64 {
    u64::from(t.to_bits()) << 32 | u64::from(child)
}

impl Bvh {
    /// `STACK` must be at least `self.stack`.
    #[inline(always)]
    pub(super) fn closest_within<const STACK: usize>(&self, ray: &Ray) -> Option<RawHit> {
        let p = Probe::new(ray, self.reach)?;
        let mut best = Best {
            t: ray.t_max * p.to_scaled,
            u: 0.0,
            v: 0.0,
            prim: EMPTY,
        };
        let mut stack = [0u64; STACK];
        let mut top = 0;
        let mut at = self.root;
        if at == EMPTY || !(best.t > 0.0) {
            return None;
        }
        loop {
            if at & LEAF == 0 {
                let node = &self.nodes[at as usize];
                let (mut mask, enter) = node.meet(&p, best.t);
                if mask != 0 {
                    let enter = enter.as_array();
                    let i = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    if mask == 0 {
                        at = node.child[i];
                        continue;
                    }
                    let j = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    let (a, b) = (
                        entry(enter[i], node.child[i]),
                        entry(enter[j], node.child[j]),
                    );
                    let mut nearest = a.min(b);
                    stack[top] = a.max(b);
                    let base = top;
                    top += 1;
                    while mask != 0 {
                        let i = mask.trailing_zeros() as usize & 7;
                        mask &= mask - 1;
                        let next = entry(enter[i], node.child[i]);
                        let mut carried = next.max(nearest);
                        nearest = next.min(nearest);
                        let mut k = top;
                        while k > base && stack[k - 1] < carried {
                            stack[k] = stack[k - 1];
                            k -= 1;
                        }
                        std::mem::swap(&mut stack[k], &mut carried);
                        top += 1;
                    }
                    at = nearest as u32;
                    continue;
                }
            } else if at & ANALYTIC == 0 {
                self.triangles[(at & !LEAF) as usize].closest(&p, &mut best);
            } else {
                self.analytic[(at & !(LEAF | ANALYTIC)) as usize].closest(&p, &mut best);
            }
            // A child entered no sooner than the best hit is not worth opening; equally near ones are, for the tie.
            loop {
                if top == 0 {
                    return self.report(&p, ray, best);
                }
                top -= 1;
                let next = stack[top];
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
        (best.prim != EMPTY && t > 0.0 && t <= ray.t_max).then_some(RawHit {
            t,
            u: best.u,
            v: best.v,
            prim: best.prim,
        })
    }

    /// `STACK` must be at least `self.stack`.
    #[inline(always)]
    pub(super) fn occluded_within<const STACK: usize>(&self, ray: &Ray) -> bool {
        let Some(p) = Probe::new(ray, self.reach) else {
            return false;
        };
        let t_max = ray.t_max * p.to_scaled;
        let mut stack = [0u32; STACK];
        let mut top = 0;
        let mut at = self.root;
        if at == EMPTY || !(t_max > 0.0) {
            return false;
        }
        loop {
            if at & LEAF == 0 {
                let node = &self.nodes[at as usize];
                let (mut mask, _) = node.meet(&p, t_max);
                if mask != 0 {
                    loop {
                        at = node.child[mask.trailing_zeros() as usize & 7];
                        mask &= mask - 1;
                        if mask == 0 {
                            break;
                        }
                        stack[top] = at;
                        top += 1;
                    }
                    continue;
                }
            } else if at & ANALYTIC == 0 {
                if self.triangles[(at & !LEAF) as usize].occluded(&p, t_max) {
                    return true;
                }
            } else if self.analytic[(at & !(LEAF | ANALYTIC)) as usize].occluded(&p, t_max) {
                return true;
            }
            if top == 0 {
                return false;
            }
            top -= 1;
            at = stack[top];
        }
    }
}
