//! From a binary tree to the eight-wide one.
//!
//! \[YLITIE\] H. Ylitie, T. Karras, S. Laine: Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs.
//! HPG 2017. Which binary nodes become wide ones, and which subtrees one leaf, is the choice of least expected cost.

use super::Bounds;
use super::batch::SMALL;
use super::node::{ANALYTIC, EMPTY, LEAF, Node};
use super::slot::Slot;
use super::triangle::Tri8;
use glam::Vec3;

/// What opening a wide node costs against testing one leaf.
const NODE_COST: f32 = 1.0;
const LEAF_COST: f32 = 0.8;
/// Triangles a leaf holds.
const WIDTH: u32 = 8;
/// The same in a tree that packets of rays walk, which test triangles one by one.
const NARROW: u32 = 4;

/// A binary tree with one primitive a leaf. The root is node 0.
pub(super) struct Binary {
    pub(super) nodes: Vec<Split>,
}

/// A node of it: children `a` and `b`, or with `b == NO_CHILD` the leaf of item `a`.
#[derive(Clone, Copy)]
pub(super) struct Split {
    pub(super) bounds: Bounds,
    pub(super) a: u32,
    pub(super) b: u32,
}

pub(super) const NO_CHILD: u32 = u32::MAX;

/// An item of the tree: its number in the caller's list, and its corners if it is a triangle.
#[derive(Clone, Copy)]
pub(super) enum Item {
    Triangle(u32, [Vec3; 3]),
    /// Place in the list of analytic shapes.
    Analytic(u32),
}

/// What the walk needs.
pub(super) struct Wide {
    pub(super) slots: Vec<Slot>,
    pub(super) root: u32,
    pub(super) stack: usize,
}

fn half_area(b: &Bounds) -> f32 {
    let e = b.max - b.min;
    e.x * e.y + e.y * e.z + e.z * e.x
}

/// Least cost of a subtree when it may take up to 1, 2, .. 7 slots of its parent.
#[derive(Clone, Copy)]
struct Costs {
    slots: [f32; 7],
    /// Triangles below; more than `WIDTH` if it cannot be one leaf.
    triangles: u32,
    leaf: bool,
}

impl Binary {
    fn children(&self, n: u32) -> Option<[u32; 2]> {
        let node = &self.nodes[n as usize];
        (node.b != NO_CHILD).then_some([node.a, node.b])
    }

    /// Node numbers, parents before children.
    fn order(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.nodes.len());
        order.push(0);
        let mut next = 0;
        while next < order.len() {
            if let Some(both) = self.children(order[next]) {
                order.extend(both);
            }
            next += 1;
        }
        order
    }

    /// Best split of `slots` slots (2 to 8) between two children: cost and how many the first gets.
    fn share(costs: &[Costs], [a, b]: [u32; 2], slots: usize) -> (f32, usize) {
        let (a, b) = (&costs[a as usize].slots, &costs[b as usize].slots);
        let mut best = (f32::INFINITY, 1);
        for first in 1..slots {
            let cost = a[first - 1] + b[slots - first - 1];
            if cost < best.0 {
                best = (cost, first);
            }
        }
        best
    }

    fn costs(&self, items: &[Item]) -> Vec<Costs> {
        let width = if items.len() > SMALL { WIDTH } else { NARROW };
        let none = Costs { slots: [0.0; 7], triangles: 1, leaf: true };
        let mut costs = vec![none; self.nodes.len()];
        for &n in self.order().iter().rev() {
            let area = half_area(&self.nodes[n as usize].bounds);
            let Some(both) = self.children(n) else {
                let triangle = matches!(items[self.nodes[n as usize].a as usize], Item::Triangle(..));
                costs[n as usize] = Costs { slots: [area * LEAF_COST; 7], triangles: if triangle { 1 } else { WIDTH + 1 }, ..none };
                continue;
            };
            let triangles = both.iter().map(|&c| costs[c as usize].triangles).sum::<u32>().min(WIDTH + 1);
            let inside = Self::share(&costs, both, 8).0;
            let as_node = area * NODE_COST + inside;
            let as_leaf = area * LEAF_COST;
            let leaf = triangles <= width && as_leaf <= as_node;
            let mut slots = [if leaf { as_leaf } else { as_node }; 7];
            for i in 1..7 {
                slots[i] = slots[i - 1].min(Self::share(&costs, both, i + 1).0);
            }
            costs[n as usize] = Costs { slots, triangles, leaf };
        }
        costs
    }

    /// The subtrees that fill the `slots` slots given to `n`.
    fn fill(&self, costs: &[Costs], n: u32, slots: usize, out: &mut Vec<u32>) {
        let mut todo = vec![(n, slots)];
        while let Some((n, slots)) = todo.pop() {
            let own = &costs[n as usize].slots;
            let mut slots = slots;
            while slots > 1 && own[slots - 1] == own[slots - 2] {
                slots -= 1;
            }
            match self.children(n) {
                Some(both) if slots > 1 => {
                    let (_, first) = Self::share(costs, both, slots);
                    todo.push((both[1], slots - first));
                    todo.push((both[0], first));
                }
                _ => out.push(n),
            }
        }
    }

    fn analytic(&self, items: &[Item], n: u32) -> Option<u32> {
        match (self.children(n), items.get(self.nodes[n as usize].a as usize)) {
            (None, Some(Item::Analytic(place))) => Some(*place),
            _ => None,
        }
    }

    fn gather(&self, items: &[Item], n: u32, out: &mut Vec<(u32, [Vec3; 3])>) {
        let mut todo = vec![n];
        while let Some(n) = todo.pop() {
            match self.children(n) {
                Some([a, b]) => todo.extend([b, a]),
                None => {
                    if let Item::Triangle(number, corners) = items[self.nodes[n as usize].a as usize] {
                        out.push((number, corners));
                    }
                }
            }
        }
    }

    /// Collapses the tree. The children of a node lie side by side, subtrees follow depth first.
    pub(super) fn widen(&self, items: &[Item]) -> Wide {
        let costs = self.costs(items);
        let mut slots = Vec::new();
        // Where the nodes are, parents before children.
        let mut nodes = Vec::new();
        let mut kids = Vec::with_capacity(8);
        let mut leaf = Vec::with_capacity(WIDTH as usize);
        // A subtree that becomes a node, and its place.
        let mut todo = Vec::new();
        let mut place = |n: u32, slots: &mut Vec<Slot>, todo: &mut Vec<(u32, usize)>| {
            if let Some(place) = self.analytic(items, n) {
                LEAF | ANALYTIC | place
            } else if costs[n as usize].leaf {
                leaf.clear();
                self.gather(items, n, &mut leaf);
                slots.push(Tri8::slot(&leaf));
                LEAF | (slots.len() - 1) as u32
            } else {
                slots.push(Tri8::slot(&[]));
                todo.push((n, slots.len() - 1));
                (slots.len() - 1) as u32
            }
        };
        let root = place(0, &mut slots, &mut todo);
        while let Some((n, me)) = todo.pop() {
            kids.clear();
            if let Some(both) = self.children(n) {
                let (_, first) = Self::share(&costs, both, 8);
                self.fill(&costs, both[0], first, &mut kids);
                self.fill(&costs, both[1], 8 - first, &mut kids);
            }
            // The walk for any hit takes the last child first: the largest is likeliest to stop the ray.
            kids.sort_by(|&a, &b| {
                let area = |n: u32| half_area(&self.nodes[n as usize].bounds);
                area(a).total_cmp(&area(b))
            });
            let mut planes = [[[f32::INFINITY, f32::NEG_INFINITY]; 8]; 3];
            let mut child = [EMPTY; 8];
            for (lane, &kid) in kids.iter().enumerate() {
                let b = &self.nodes[kid as usize].bounds;
                for (axis, planes) in planes.iter_mut().enumerate() {
                    planes[lane] = [b.min[axis], b.max[axis]];
                }
                child[lane] = place(kid, &mut slots, &mut todo);
            }
            nodes.push(me);
            slots[me] = Node::slot(planes, child);
        }
        slots.shrink_to_fit();
        let stack = stack_needed(&slots, &nodes);
        Wide { slots, root, stack }
    }
}

/// Most entries a walk can hold at once, whatever order it takes the children in. `nodes` are the places of the nodes, parents first.
fn stack_needed(slots: &[Slot], nodes: &[usize]) -> usize {
    let mut needed = vec![0usize; slots.len()];
    for &n in nodes.iter().rev() {
        let children = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| Node(&slots[n]).child(i));
        let present = children.iter().filter(|&&c| c != EMPTY);
        let count = present.clone().count();
        let deepest = present.filter(|&&c| c & LEAF == 0).map(|&c| needed[c as usize]).max().unwrap_or(0);
        needed[n] = count.saturating_sub(1) + deepest;
    }
    nodes.first().map_or(0, |&n| needed[n])
}
