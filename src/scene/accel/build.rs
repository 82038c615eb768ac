//! From primitives to a binary tree. The only file that names obvhs.

use super::analytic::{Analytic, Shape};
use super::node::EMPTY;
use super::tree::{Binary, Item, NO_CHILD, Split};
use super::{Bounds, Bvh, DEEP, Primitive};
use glam::{Affine3A, DAffine3, DVec3, Vec3};
use obvhs::aabb::Aabb;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Bytes of a tree that a processor's second cache holds, with room for what else a renderer touches.
const NEAR_CACHE: usize = 256 << 10;

pub(super) fn build(primitives: &[Primitive]) -> Bvh {
    let mut items = Vec::with_capacity(primitives.len());
    let mut boxes = Vec::with_capacity(primitives.len());
    let mut analytic = Vec::new();
    for (number, primitive) in primitives.iter().enumerate() {
        let number = number as u32;
        let Some(bounds) = bounds(primitive) else {
            continue;
        };
        let shape = match primitive {
            Primitive::Triangle(corners) => {
                items.push(Item::Triangle(number, *corners));
                boxes.push(bounds);
                continue;
            }
            Primitive::Sphere { center, radius } => Shape::Sphere { center: center.as_dvec3(), radius2: f64::from(*radius).powi(2) },
            Primitive::Disk { to_world } => Shape::Disk { to_object: exact(to_world).inverse() },
            Primitive::Cylinder { to_world } => Shape::Cylinder { to_object: exact(to_world).inverse() },
        };
        items.push(Item::Analytic(analytic.len() as u32));
        boxes.push(bounds);
        analytic.push(Analytic { shape, prim: number });
    }
    analytic.shrink_to_fit();
    let Some(all) = boxes.iter().copied().reduce(union) else {
        return Bvh { slots: Vec::new(), analytic, root: EMPTY, reach: 0.0, bounds: None, primitives: 0, large: false };
    };
    let mut wide = by_area(&boxes).widen(&items);
    if wide.stack > DEEP {
        // Only a degenerate list gets here; a balanced tree over 2^30 items is 30 deep at most, and 7 * 30 < DEEP.
        wide = by_halves(&boxes).widen(&items);
    }
    let large = size_of_val(&wide.slots[..]) > NEAR_CACHE;
    let reach = all.min.abs().max(all.max.abs());
    Bvh {
        slots: wide.slots,
        analytic,
        root: wide.root,
        reach: reach.x.max(reach.y).max(reach.z),
        bounds: Some(all),
        primitives: items.len(),
        large,
    }
}

fn union(a: Bounds, b: Bounds) -> Bounds {
    Bounds { min: a.min.min(b.min), max: a.max.max(b.max) }
}

/// By expected cost: locally-ordered clustering, then reinsertion, as obvhs's medium preset has them. One primitive a
/// leaf: which subtrees become leaves is decided together with the wide nodes.
fn by_area(boxes: &[Bounds]) -> Binary {
    let aabbs: Vec<_> = boxes.iter().map(|b| Aabb::new(b.min.into(), b.max.into())).collect();
    let mut tree = PlocBuilder::with_capacity(aabbs.len()).build(
        PlocSearchDistance::Medium,
        &aabbs,
        (0..aabbs.len() as u32).collect(),
        SortPrecision::U64,
        3,
    );
    let mut optimizer = ReinsertionOptimizer::default();
    for share in [0.05, 0.1] {
        optimizer.run(&mut tree, share, None);
    }
    let split = |n: &Bvh2Node| {
        let (a, b) =
            if n.is_leaf() { (tree.primitive_indices[n.first_index as usize], NO_CHILD) } else { (n.first_index, n.first_index + 1) };
        let bounds = Bounds { min: n.aabb.min.into(), max: n.aabb.max.into() };
        Split { bounds, a, b }
    };
    Binary { nodes: tree.nodes.iter().map(split).collect() }
}

/// By halving the list along the widest spread of centres: worse to walk, but never deeper than the logarithm.
fn by_halves(boxes: &[Bounds]) -> Binary {
    let mut items: Vec<u32> = (0..boxes.len() as u32).collect();
    let blank = Split { bounds: boxes[0], a: 0, b: NO_CHILD };
    let mut nodes = vec![blank];
    let mut todo = vec![(0, 0..items.len())];
    while let Some((n, range)) = todo.pop() {
        let part = &mut items[range.clone()];
        let center = |i: &u32| boxes[*i as usize].min * 0.5 + boxes[*i as usize].max * 0.5;
        let first = boxes[part[0] as usize];
        let (mut bounds, mut low, mut high) = (first, Vec3::INFINITY, Vec3::NEG_INFINITY);
        for i in part.iter() {
            bounds = union(bounds, boxes[*i as usize]);
            (low, high) = (low.min(center(i)), high.max(center(i)));
        }
        let (a, b) = if part.len() == 1 {
            (part[0], NO_CHILD)
        } else {
            let axis = (high - low).max_position();
            let half = part.len() / 2;
            part.select_nth_unstable_by(half, |i, j| center(i)[axis].total_cmp(&center(j)[axis]).then(i.cmp(j)));
            let a = nodes.len();
            nodes.extend([blank; 2]);
            todo.push((a + 1, range.start + half..range.end));
            todo.push((a, range.start..range.start + half));
            (a as u32, a as u32 + 1)
        };
        nodes[n] = Split { bounds, a, b };
    }
    Binary { nodes }
}

fn exact(m: &Affine3A) -> DAffine3 {
    DAffine3::from_cols(m.matrix3.x_axis.as_dvec3(), m.matrix3.y_axis.as_dvec3(), m.matrix3.z_axis.as_dvec3(), m.translation.as_dvec3())
}

/// The f64 box, rounded outwards.
fn outwards(min: DVec3, max: DVec3) -> Bounds {
    let below = |x: f64| {
        if f64::from(x as f32) <= x { x as f32 } else { (x as f32).next_down() }
    };
    let above = |x: f64| -below(-x);
    Bounds { min: Vec3::new(below(min.x), below(min.y), below(min.z)), max: Vec3::new(above(max.x), above(max.y), above(max.z)) }
}

/// The box around a primitive; none if no ray can hit it (`Bvh` lists why).
fn bounds(primitive: &Primitive) -> Option<Bounds> {
    let bounds = match primitive {
        Primitive::Triangle([a, b, c]) => {
            let (p, q) = (b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3());
            if p.cross(q) == DVec3::ZERO {
                return None;
            }
            Bounds { min: a.min(*b).min(*c), max: a.max(*b).max(*c) }
        }
        Primitive::Sphere { center, radius } => {
            if radius.is_nan() || *radius <= 0.0 {
                return None;
            }
            let (c, r) = (center.as_dvec3(), DVec3::splat(f64::from(*radius)));
            outwards(c - r, c + r)
        }
        Primitive::Disk { to_world } => round(to_world, &[0.0])?,
        Primitive::Cylinder { to_world } => round(to_world, &[0.0, 1.0])?,
    };
    // `min` and `max` drop a NaN, so the corners are asked themselves.
    let corners = match primitive {
        Primitive::Triangle(corners) => corners.iter().all(|c| c.is_finite()),
        _ => true,
    };
    (corners && bounds.min.is_finite() && bounds.max.is_finite()).then_some(bounds)
}

/// The box around the unit circles at the given heights, under an affine map.
fn round(to_world: &Affine3A, heights: &[f64]) -> Option<Bounds> {
    let m = exact(to_world);
    if !m.inverse().is_finite() {
        return None;
    }
    // The circle's extent along a world axis is the length of that row's x and y part.
    let (x, y) = (m.matrix3.x_axis, m.matrix3.y_axis);
    let extent = (x * x + y * y).map(f64::sqrt);
    let center = |h: &f64| m.translation + m.matrix3.z_axis * *h;
    let (min, max) =
        heights.iter().map(center).fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), c| (min.min(c - extent), max.max(c + extent)));
    Some(outwards(min, max))
}
