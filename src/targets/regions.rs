//! Regions that keep photon densities from iteration to iteration, and the cut through them that a target uses.
//!
//! [STF 4.1, 4.2]: regions are the nodes of a tree over space or over the image. Each keeps an estimate of the density of photons under uniform
//! sampling, from all iterations; a target reads it at the cut through the tree, or blended from the root down.

use glam::Vec3;
use tree::Tree;

mod densities;
mod tree;

pub use densities::Refinement;

/// What an iteration's light paths told about the leaves, in one half of the ensembles.
#[derive(Clone, Debug, Default)]
pub struct Half {
    /// Sum over the leaf's measurement points of the estimated probability that a uniform path reaches them: `psi_i` [STF (6), (7)].
    pub psi: Vec<f64>,
    /// Light paths that contributed to the leaf.
    pub paths: Vec<f64>,
}

/// Regions with their statistics.
#[derive(Clone, Debug)]
pub struct Regions {
    tree: Tree,
    /// One for each node of the tree, root first.
    nodes: Vec<Statistics>,
}

/// What a node remembers, summed over the iterations in which it held measurement points.
#[derive(Clone, Copy, Debug, Default)]
struct Statistics {
    /// Sum of `psi` in each half of the ensembles; the estimate is their mean.
    psi: [f64; 2],
    /// Sum of kernel sizes, world units squared.
    size: f64,
    /// Light paths that contributed, of both halves.
    paths: f64,
    /// Refined: its children stand for it.
    split: bool,
}

impl Statistics {
    /// Photon density under uniform sampling, per world unit squared; `None` before any measurement point.
    ///
    /// Pooled: `sum psi / sum s`, the iterations weighted by their kernel sizes. [STF (8), (10)] weight iterations equally, `mean of psi/s`, which
    /// is noisier where few measurement points fall into a region.
    fn density(&self) -> Option<f64> {
        (self.size > 0.0).then(|| 0.5 * (self.psi[0] + self.psi[1]) / self.size)
    }

    /// `|odd - even|` over their mean ([STF 4.2], by halves of the ensembles: successive states of a chain are no independent halves).
    fn error(&self) -> f64 {
        let mean = 0.5 * (self.psi[0] + self.psi[1]);
        if mean > 0.0 { (self.psi[0] - self.psi[1]).abs() / mean } else { f64::INFINITY }
    }
}

impl Regions {
    /// Regions of space: a kd-tree by median splits of the longest side over a pilot's measurement points, at most fifteen deep.
    pub fn spatial(pilot: Vec<Vec3>) -> Self {
        Self::over(Tree::median(pilot))
    }

    /// Regions of the image: its longer side halved in turn, so that two levels are one of a quadtree's, down to two pixels.
    pub fn image(width: usize, height: usize) -> Self {
        Self::over(Tree::halves(width, height))
    }

    fn over(tree: Tree) -> Self {
        let nodes = vec![Statistics::default(); tree.len()];
        Self { tree, nodes }
    }

    /// Leaves: what [`Half`]'s lists have a place for.
    pub fn leaves(&self) -> usize {
        self.tree.leaves()
    }

    /// The leaf of a place: a position in space, or the centre of a pixel with z = 0. Places outside belong to the nearest leaf by the
    /// tree's comparisons.
    pub fn leaf(&self, place: Vec3) -> u32 {
        self.tree.leaf(place)
    }

    /// Adds an iteration: kernel sizes per leaf of its measurement points, and what the two halves of its ensembles found. Each half is an
    /// estimate by itself. Regions without measurement points learn nothing.
    pub fn add(&mut self, sizes: &[f64], halves: [&Half; 2]) {
        // Leaves first, then up: a child's number is larger than its parent's.
        let mut added = vec![Statistics::default(); self.nodes.len()];
        for (leaf, &size) in sizes.iter().enumerate() {
            added[self.tree.node_of_leaf(leaf)] = Statistics {
                psi: [halves[0].psi[leaf], halves[1].psi[leaf]],
                size,
                paths: halves[0].paths[leaf] + halves[1].paths[leaf],
                split: false,
            };
        }
        for node in (0..added.len()).rev() {
            let of_node = added[node];
            if let Some(parent) = self.tree.parent(node) {
                let sum = &mut added[parent];
                sum.psi[0] += of_node.psi[0];
                sum.psi[1] += of_node.psi[1];
                sum.size += of_node.size;
                sum.paths += of_node.paths;
            }
            if of_node.size > 0.0 {
                let total = &mut self.nodes[node];
                total.psi[0] += of_node.psi[0];
                total.psi[1] += of_node.psi[1];
                total.size += of_node.size;
                total.paths += of_node.paths;
            }
        }
    }
}

#[cfg(test)]
mod tests;
