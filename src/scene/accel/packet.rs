//! Eight rays side by side, one triangle or one box at a time.
//!
//! A single ray asks four triangles at once and spends most of its time finding out where to go next. Eight rays in the lanes of one vector
//! share that: a box is opened if any of them may meet it. What a lane computes for a triangle is operation for operation what `Tri8`
//! computes for a ray alone, so the answers are the same bits. Woop's test orders the axes by the ray's largest one; the rays of a packet
//! share that axis, so that no lane needs an order of its own. `batch.rs` sees to it, and decides whether a packet is worth it.

use super::analytic::{Analytic, Shape, eight_through_sphere};
use super::node::{ANALYTIC, EMPTY, LEAF, Node};
use super::probe::{FLATTEST, NEXT, PAD};
use super::triangle::{Best, DOUBTFUL, Tri8};
use super::{Bvh, DEEP, RawHit, Ray};
use glam::{DVec3, Vec3};
use std::cell::Cell;
use wide::{f32x8, u32x8};

/// Rays a packet holds.
pub(super) const LANES: usize = 8;
/// A packet puts all children on the stack before it takes one back: one entry more than a single ray needs.
const ENTRIES: usize = 2 * DEEP;

thread_local! {
    /// Where each ray enters what is still to be visited, NaN for those that miss it.
    static STACK: [Cell<(f32x8, u32)>; ENTRIES] = const { [const { Cell::new((f32x8::ZERO, EMPTY)) }; ENTRIES] };
}

/// Eight rays ready for the tree: the numbers of eight `Probe`s. `K` is the axis of the largest direction component of all of them.
pub(super) struct Packet<const K: usize> {
    /// Origin, negated.
    minus_o: [f32x8; 3],
    /// Scaled direction.
    d: [f32x8; 3],
    /// What takes a scaled `t` to an outer one.
    from_scaled: f32x8,
    /// Scaled `t_max`. NaN, which no comparison accepts, where no hit is possible.
    t_max: f32x8,
    inv: [f32x8; 3],
    /// `t = plane * inv + lower` for the lower plane of an axis, moved towards a ray that enters by it and away from one that leaves.
    lower: [f32x8; 3],
    /// The same for the upper plane.
    upper: [f32x8; 3],
    shear_x: f32x8,
    shear_y: f32x8,
}

/// The best hits so far, `t` in the scaled directions.
struct Bests {
    t: f32x8,
    u: f32x8,
    v: f32x8,
    prim: u32x8,
}

/// The axis of the largest direction component, of equally large ones the last. Any axis for a direction with a NaN.
#[inline(always)]
pub(super) fn largest_axis(d: Vec3) -> usize {
    let a = d.abs();
    let z_largest = usize::from(a.z >= a.x) & usize::from(a.z >= a.y);
    2 * z_largest + (usize::from(a.y >= a.x) & (z_largest ^ 1))
}

impl<const K: usize> Packet<K> {
    const I: usize = NEXT[K][0];
    const J: usize = NEXT[K][1];

    /// `Probe::new`, eight times.
    #[inline(always)]
    pub(super) fn new(rays: [&Ray; LANES], reach: f32) -> Self {
        let o = [rays.map(|r| r.o.x), rays.map(|r| r.o.y), rays.map(|r| r.o.z)].map(f32x8::new);
        let d = [rays.map(|r| r.d.x), rays.map(|r| r.d.y), rays.map(|r| r.d.z)].map(f32x8::new);
        let t_max = f32x8::new(rays.map(|r| r.t_max));
        let sign = f32x8::splat(-0.0);
        let largest = d[0].abs().fast_max(d[1].abs()).fast_max(d[2].abs());
        let far = o[0].abs().fast_max(o[1].abs()).fast_max(o[2].abs());
        let sum = o[0] + o[1] + o[2] + d[0] + d[1] + d[2];
        let exponent: u32x8 = largest.to_bits() >> 23u32;
        let e = exponent.max(u32x8::splat(2)).min(u32x8::splat(252));
        let to_unit = f32x8::from_bits((u32x8::splat(254) - e) << 23u32);
        let from_unit = f32x8::from_bits(e << 23u32);
        let t_max = t_max * from_unit;
        let possible = sum.abs().simd_lt(f32x8::splat(f32::INFINITY)) & largest.simd_gt(f32x8::ZERO) & t_max.simd_gt(f32x8::ZERO);
        let floor = (largest * to_unit * f32x8::splat(FLATTEST)).fast_max(f32x8::splat(f32::MIN_POSITIVE));
        let minus_o = o.map(|o| o ^ sign);
        let d = d.map(|d| d * to_unit);
        let inv = d.map(|d| f32x8::ONE / (d.abs().fast_max(floor) | (d & sign)));
        let pad = f32x8::splat(PAD) * (far + f32x8::splat(reach));
        // With the sign of the inverse the shift is right on both sides: a ray that goes down enters by the upper plane.
        let lower = [0, 1, 2].map(|k| minus_o[k] * inv[k] - pad * inv[k]);
        let upper = [0, 1, 2].map(|k| minus_o[k] * inv[k] + pad * inv[k]);
        Self {
            minus_o,
            d,
            from_scaled: to_unit,
            t_max: possible.select(t_max, f32x8::splat(f32::NAN)),
            inv,
            lower,
            upper,
            shear_x: d[Self::I] * inv[K],
            shear_y: d[Self::J] * inv[K],
        }
    }

    #[inline(always)]
    fn origin(&self, lane: usize) -> Vec3 {
        -Vec3::new(self.minus_o[0].as_array()[lane], self.minus_o[1].as_array()[lane], self.minus_o[2].as_array()[lane])
    }

    #[inline(always)]
    fn direction(&self, lane: usize) -> Vec3 {
        Vec3::new(self.d[0].as_array()[lane], self.d[1].as_array()[lane], self.d[2].as_array()[lane])
    }

    /// Which rays may meet a child's box before `t_max`, and where each enters.
    #[inline(always)]
    fn meet(&self, node: Node<'_>, child: usize, t_max: f32x8) -> (f32x8, f32x8) {
        let slab = |k: usize| {
            let [lower, upper] = node.planes(k, child);
            let lower = f32x8::splat(lower).mul_add(self.inv[k], self.lower[k]);
            let upper = f32x8::splat(upper).mul_add(self.inv[k], self.upper[k]);
            (lower.fast_min(upper), lower.fast_max(upper))
        };
        let (x, y, z) = (slab(0), slab(1), slab(2));
        let enter = x.0.fast_max(y.0).fast_max(z.0.fast_max(f32x8::ZERO));
        // Last, since of a NaN and a number the second counts: a ray that is done enters nothing.
        let leave = x.1.fast_min(y.1).fast_min(z.1).fast_min(t_max);
        (enter.simd_le(leave), enter)
    }

    /// Which of the active rays hit triangle `n` of a leaf with `0 < t <= t_max`, and `t`, `u`, `v`: the operations of `Tri8::eight`.
    #[inline(always)]
    fn hits(&self, leaf: Tri8<'_>, n: usize, active: f32x8, t_max: f32x8) -> Option<(f32x8, [f32x8; 3])> {
        let moved = |corner: usize| {
            let at = |k: usize| f32x8::splat(leaf.coordinate(corner, k, n)) + self.minus_o[k];
            let z = at(K);
            (self.shear_x.mul_neg_add(z, at(Self::I)), self.shear_y.mul_neg_add(z, at(Self::J)), z)
        };
        let (ax, ay, az) = moved(0);
        let (bx, by, bz) = moved(1);
        let (cx, cy, cz) = moved(2);
        let a = cx * by - cy * bx;
        let b = ax * cy - ay * cx;
        let c = bx * ay - by * ax;
        let zero = f32x8::ZERO;
        let inside = (a.fast_min(b).fast_min(c).simd_ge(zero) | a.fast_max(b).fast_max(c).simd_le(zero)) & active;
        if !inside.any() {
            return None;
        }
        // No way out before the end: which of the rays inside are near enough can be foretold by nobody.
        let scale = f32x8::ONE / (a + b + c);
        let (w, u, v) = (a * scale, b * scale, c * scale);
        let depth = w * az + u * bz + v * cz;
        let t = depth * self.inv[K];
        let most = |a: f32x8, b: f32x8, c: f32x8| a.abs().fast_max(b.abs()).fast_max(c.abs());
        let deep = most(az, bz, cz);
        let large = deep.fast_max(most(ax, bx, cx)).fast_max(most(ay, by, cy));
        let weight = large * large * scale.abs() * f32x8::splat(DOUBTFUL);
        let doubtful = inside & depth.abs().simd_le(weight * deep);
        let t = if doubtful.any() { self.exactly(leaf, n, doubtful.to_bitmask(), t) } else { t };
        Some((inside & t.simd_gt(zero) & t.simd_le(t_max), [t, u, v]))
    }

    /// Which of the active rays hit a sphere with `0 < t <= t_max`, and the first such `t`.
    #[inline(always)]
    fn hits_sphere(&self, center: DVec3, radius2: f64, active: f32x8, t_max: f32x8) -> Option<(f32x8, f32x8)> {
        let both = eight_through_sphere(self.minus_o, self.d, center, radius2)?;
        let [near, far] = both.map(|t| t.simd_gt(f32x8::ZERO) & t.simd_le(t_max) & active);
        Some((near | far, near.select(both[0], both[1])))
    }

    #[cold]
    #[inline(never)]
    fn exactly(&self, leaf: Tri8<'_>, n: usize, mask: u32, mut t: f32x8) -> f32x8 {
        let plane = leaf.plane(n);
        for lane in lanes(mask) {
            let t = &mut t.as_mut_array()[lane];
            *t = plane.exactly(self.origin(lane), self.direction(lane), *t);
        }
        t
    }

    /// The walk: largest child first, whatever its distance; to sort children for eight rays costs more than it saves.
    #[inline(always)]
    fn walk<F: Found<K>>(&self, bvh: &Bvh, mut found: F) -> F {
        // By value, in and out: as long as nobody has its address, it can stay in registers.
        STACK.with(move |stack| {
            let mut top = 0;
            let mut at = bvh.root;
            // The rays whose own box test led here. One that only comes along in its lane must find nothing: seen exactly edge-on, a
            // triangle may claim a ray that passes beside it, and alone the ray would never have asked.
            let mut active = found.until().simd_gt(f32x8::ZERO);
            if at == EMPTY {
                return found;
            }
            loop {
                if at & LEAF == 0 {
                    let node = bvh.node(at);
                    for i in 0..8 {
                        let child = node.child(i);
                        if child == EMPTY {
                            break;
                        }
                        let (mask, enter) = self.meet(node, i, found.until());
                        if bvh.large {
                            if !mask.any() {
                                continue;
                            }
                            bvh.fetch(child);
                        }
                        // Written in any case in a small tree: whether a box is met by one of eight rays that do not go together is hard to
                        // foretell.
                        stack[top & (ENTRIES - 1)].set((mask.select(enter, f32x8::splat(f32::NAN)), child));
                        top += usize::from(mask.any());
                    }
                } else if at & ANALYTIC == 0 {
                    found.leaf(self, active, bvh.leaf(at));
                } else {
                    found = found.analytic(self, active, &bvh.analytic[(at & !(LEAF | ANALYTIC)) as usize]);
                }
                loop {
                    if top == 0 {
                        return found;
                    }
                    top -= 1;
                    let (enter, child) = stack[top & (ENTRIES - 1)].get();
                    // A child of which a ray has found something nearer, or anything at all, is not worth opening for it.
                    active = enter.simd_le(found.until());
                    if active.any() {
                        at = child;
                        break;
                    }
                }
            }
        })
    }

    /// The closest hit of each ray.
    #[inline(always)]
    pub(super) fn closest(&self, bvh: &Bvh, rays: [&Ray; LANES]) -> [Option<RawHit>; LANES] {
        let best = Bests { t: self.t_max, u: f32x8::ZERO, v: f32x8::ZERO, prim: u32x8::splat(EMPTY) };
        let best = self.walk(bvh, best);
        let t = (best.t * self.from_scaled).to_array();
        let (u, v, prim) = (best.u.to_array(), best.v.to_array(), best.prim.to_array());
        std::array::from_fn(|i| {
            let hit = prim[i] != EMPTY && t[i] > 0.0 && t[i] <= rays[i].t_max;
            hit.then_some(RawHit { t: t[i], u: u[i], v: v[i], prim: prim[i] })
        })
    }

    /// Whether anything is on each ray, as bits.
    #[inline(always)]
    pub(super) fn any(&self, bvh: &Bvh) -> u32 {
        self.walk(bvh, Stopped { t_max: self.t_max, blocked: f32x8::ZERO }).blocked.to_bitmask()
    }
}

/// The lanes of a mask.
#[inline(always)]
fn lanes(mask: u32) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |lane| mask >> lane & 1 != 0)
}

/// What a walk is after.
trait Found<const K: usize>: Sized {
    /// How far each ray is still of interest; NaN for one that is done.
    fn until(&self) -> f32x8;
    fn leaf(&mut self, p: &Packet<K>, active: f32x8, leaf: Tri8<'_>);
    fn analytic(self, p: &Packet<K>, active: f32x8, shape: &Analytic) -> Self;
}

impl Bests {
    /// [`Best::improve`] for the rays of the mask, whose `t` is at most the best one's: of equally near hits the lower number wins.
    #[inline(always)]
    fn improve(&mut self, hit: f32x8, [t, u, v]: [f32x8; 3], prim: u32) {
        let prim = u32x8::splat(prim);
        let better = hit & (t.simd_lt(self.t) | f32x8::from_bits(prim.simd_lt(self.prim)));
        self.t = better.select(t, self.t);
        self.u = better.select(u, self.u);
        self.v = better.select(v, self.v);
        self.prim = better.to_bits().select(prim, self.prim);
    }
}

impl<const K: usize> Found<K> for Bests {
    #[inline(always)]
    fn until(&self) -> f32x8 {
        self.t
    }

    #[inline(always)]
    fn leaf(&mut self, p: &Packet<K>, active: f32x8, leaf: Tri8<'_>) {
        for n in 0..leaf.count() {
            if let Some((hit, [t, u, v])) = p.hits(leaf, n, active, self.t) {
                self.improve(hit, [t, u, v], leaf.number(n));
            }
        }
    }

    #[inline(never)]
    fn analytic(mut self, p: &Packet<K>, active: f32x8, shape: &Analytic) -> Self {
        if let Shape::Sphere { center, radius2 } = shape.shape {
            if let Some((hit, t)) = p.hits_sphere(center, radius2, active, self.t) {
                self.improve(hit, [t, f32x8::ZERO, f32x8::ZERO], shape.prim);
            }
            return self;
        }
        for lane in lanes(active.to_bitmask()) {
            let (t, u, v) = (&mut self.t.as_mut_array()[lane], &mut self.u.as_mut_array()[lane], &mut self.v.as_mut_array()[lane]);
            let prim = &mut self.prim.as_mut_array()[lane];
            let mut best = Best { t: *t, u: *u, v: *v, prim: *prim };
            shape.closest(p.origin(lane), p.direction(lane), &mut best);
            (*t, *u, *v, *prim) = (best.t, best.u, best.v, best.prim);
        }
        self
    }
}

/// Which rays have met anything.
struct Stopped {
    t_max: f32x8,
    blocked: f32x8,
}

impl<const K: usize> Found<K> for Stopped {
    #[inline(always)]
    fn until(&self) -> f32x8 {
        self.t_max
    }

    #[inline(always)]
    fn leaf(&mut self, p: &Packet<K>, active: f32x8, leaf: Tri8<'_>) {
        for n in 0..leaf.count() {
            if let Some((hit, _)) = p.hits(leaf, n, active, self.t_max) {
                self.blocked |= hit;
                // All bits set is a NaN: this ray is done.
                self.t_max |= hit;
            }
        }
    }

    #[inline(never)]
    fn analytic(mut self, p: &Packet<K>, active: f32x8, shape: &Analytic) -> Self {
        if let Shape::Sphere { center, radius2 } = shape.shape {
            if let Some((hit, _)) = p.hits_sphere(center, radius2, active, self.t_max) {
                self.blocked |= hit;
                self.t_max |= hit;
            }
            return self;
        }
        for lane in lanes(active.to_bitmask()) {
            let t_max = &mut self.t_max.as_mut_array()[lane];
            if shape.occluded(p.origin(lane), p.direction(lane), *t_max) {
                *t_max = f32::NAN;
                self.blocked.as_mut_array()[lane] = f32::from_bits(u32::MAX);
            }
        }
        self
    }
}
