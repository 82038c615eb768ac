//! A binary tree of boxes over points.

use glam::Vec3;

/// Most splits from the root to a leaf.
pub(super) const DEPTH: u32 = 15;

/// Fewest pilot points in a leaf: four pixels' worth. Smaller regions would meet no measurement point in most iterations.
const LEAF_POINTS: usize = 16;

/// Fewest points on a side for a task of its own.
const TASK_POINTS: usize = 4096;

#[derive(Clone, Copy, Debug)]
struct Node {
    parent: u32,
    /// First of two children side by side, and the plane between them; or the number of the leaf.
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Split { first: u32, axis: u8, at: f32 },
    Leaf(u32),
}

/// Nodes, parents before children, root first.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    leaves: Vec<u32>,
}

impl Tree {
    /// Median splits of the longest side of the points' box.
    pub(super) fn median(mut points: Vec<Vec3>) -> Self {
        Self::of_points(&mut points, DEPTH)
    }

    fn of_points(points: &mut [Vec3], depth: u32) -> Self {
        let mut tree = Self::only_root();
        let low = points.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let extent = points.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max) - low;
        let axis = if extent.x >= extent.y && extent.x >= extent.z { 0 } else { 1 + usize::from(extent.z > extent.y) };
        // Points all in one place cannot be told apart by a plane.
        if depth == 0 || points.len() < 2 * LEAF_POINTS || extent[axis] <= 0.0 {
            tree.close(0);
            return tree;
        }
        let middle = points.len() / 2;
        let at = points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis])).1[axis];
        // What equals the plane goes left, as `leaf` asks.
        let left = partition(points, |p| p[axis] <= at);
        if left == points.len() {
            tree.close(0);
            return tree;
        }
        let (below, above) = points.split_at_mut(left);
        let of = |points| Self::of_points(points, depth - 1);
        let (below, above) = if middle < TASK_POINTS { (of(below), of(above)) } else { rayon::join(|| of(below), || of(above)) };
        let first = tree.open(0, axis as u8, at);
        tree.graft(first, &below);
        tree.graft(first + 1, &above);
        tree
    }

    fn only_root() -> Self {
        Self { nodes: vec![Node { parent: 0, kind: Kind::Leaf(0) }], leaves: Vec::new() }
    }

    /// A leaf that is no leaf yet becomes the other tree.
    fn graft(&mut self, place: u32, other: &Tree) {
        let (nodes, leaves) = (self.nodes.len() as u32, self.leaves.len() as u32);
        let number = |node: u32| if node == 0 { place } else { nodes + node - 1 };
        let kind = |kind| match kind {
            Kind::Split { first, axis, at } => Kind::Split { first: number(first), axis, at },
            Kind::Leaf(leaf) => Kind::Leaf(leaves + leaf),
        };
        self.nodes[place as usize].kind = kind(other.nodes[0].kind);
        self.nodes.extend(other.nodes[1..].iter().map(|node| Node { parent: number(node.parent), kind: kind(node.kind) }));
        self.leaves.extend(other.leaves.iter().map(|node| number(*node)));
    }

    /// Halves of the longer side of an image.
    pub(super) fn halves(width: usize, height: usize) -> Self {
        let mut tree = Self::only_root();
        tree.split_pixels(0, [0, 0], [width, height], DEPTH);
        tree
    }

    fn split_pixels(&mut self, node: u32, low: [usize; 2], high: [usize; 2], depth: u32) {
        let extent = [high[0] - low[0], high[1] - low[1]];
        let axis = usize::from(extent[1] > extent[0]);
        if depth == 0 || extent[axis] <= 2 {
            return self.close(node);
        }
        let middle = low[axis] + extent[axis] / 2;
        let first = self.open(node, axis as u8, middle as f32);
        let (mut inner_high, mut inner_low) = (high, low);
        inner_high[axis] = middle;
        inner_low[axis] = middle;
        self.split_pixels(first, low, inner_high, depth - 1);
        self.split_pixels(first + 1, inner_low, high, depth - 1);
    }

    fn close(&mut self, node: u32) {
        self.nodes[node as usize].kind = Kind::Leaf(self.leaves.len() as u32);
        self.leaves.push(node);
    }

    fn open(&mut self, node: u32, axis: u8, at: f32) -> u32 {
        let first = self.nodes.len() as u32;
        self.nodes[node as usize].kind = Kind::Split { first, axis, at };
        self.nodes.extend([Node { parent: node, kind: Kind::Leaf(0) }; 2]);
        first
    }

    /// Nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Leaves.
    pub(super) fn leaves(&self) -> usize {
        self.leaves.len()
    }

    /// The node of a leaf.
    pub(super) fn node_of_leaf(&self, leaf: usize) -> usize {
        self.leaves[leaf] as usize
    }

    /// The parent; `None` for the root.
    pub(super) fn parent(&self, node: usize) -> Option<usize> {
        (node > 0).then(|| self.nodes[node].parent as usize)
    }

    /// The two children, if any.
    pub(super) fn children(&self, node: usize) -> Option<[usize; 2]> {
        match self.nodes[node].kind {
            Kind::Split { first, .. } => Some([first as usize, first as usize + 1]),
            Kind::Leaf(_) => None,
        }
    }

    /// The leaf a place falls into; on a plane it goes left.
    #[inline]
    pub(super) fn leaf(&self, place: Vec3) -> u32 {
        let mut node = 0;
        loop {
            match self.nodes[node].kind {
                Kind::Split { first, axis, at } => node = first as usize + usize::from(place[usize::from(axis)] > at),
                Kind::Leaf(leaf) => return leaf,
            }
        }
    }
}

/// Brings what passes the test to the front and counts it.
fn partition(points: &mut [Vec3], test: impl Fn(&Vec3) -> bool) -> usize {
    let mut count = 0;
    for i in 0..points.len() {
        if test(&points[i]) {
            points.swap(i, count);
            count += 1;
        }
    }
    count
}
