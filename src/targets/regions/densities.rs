//! From statistics of regions to one density a leaf.

use super::Regions;

/// How fine the regions are that a target reads its densities from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refinement {
    /// A cut through the tree, from the root on: a region gives way to its children once each of them has enough paths and a small enough error
    /// ([STF 4.2]). A region that no path ever reached takes its parent's density.
    Cut {
        /// Fewest light paths that contributed to each child.
        paths: f64,
        /// Largest difference of the halves over their mean in each child.
        error: f64,
    },
    /// Every leaf, its density shrunk towards its parent's by what the parent leads to expect: with a gamma prior of this many paths' strength.
    Blend {
        /// Strength of the parent's density, in paths.
        strength: f64,
    },
}

impl Regions {
    /// Densities of the leaves under uniform sampling, per world unit squared, and the number of regions they come from. Empty before any
    /// path contributed anywhere.
    pub fn densities(&mut self, refinement: Refinement) -> (Vec<f64>, usize) {
        match self.nodes[0].density() {
            Some(root) if root > 0.0 => match refinement {
                Refinement::Cut { paths, error } => self.cut(paths, error, root),
                Refinement::Blend { strength } => (self.blend(strength, root), self.leaves()),
            },
            _ => (Vec::new(), 0),
        }
    }

    fn cut(&mut self, paths: f64, error: f64, root: f64) -> (Vec<f64>, usize) {
        let mut of_node = vec![root; self.nodes.len()];
        let mut regions = 1;
        for node in 0..self.nodes.len() {
            let Some(children) = self.tree.children(node) else { continue };
            // A region below the cut is not looked at; once refined, always refined.
            let above = self.tree.parent(node).is_none_or(|parent| self.nodes[parent].split);
            let enough = |child: usize| self.nodes[child].paths >= paths && self.nodes[child].error() < error;
            let split = above && (self.nodes[node].split || children.iter().all(|&child| enough(child)));
            self.nodes[node].split = split;
            regions += usize::from(split);
            for child in children {
                let own = self.nodes[child].density().filter(|density| *density > 0.0);
                of_node[child] = if split { own.unwrap_or(of_node[node]) } else { of_node[node] };
            }
        }
        (self.at_leaves(&of_node), regions)
    }

    /// A child of parent density `D` and kernel size `s` expects `n = n_parent s/s_parent` paths if it is like its parent. The estimate `psi/s`
    /// counts as that many, the parent's density as `strength`: `(strength D + n psi/s) / (strength + n)`. It has no threshold, follows
    /// the leaf's own statistics once these are good, and never falls to zero.
    fn blend(&self, strength: f64, root: f64) -> Vec<f64> {
        let mut of_node = vec![root; self.nodes.len()];
        for node in 0..self.nodes.len() {
            let Some(children) = self.tree.children(node) else { continue };
            let parent = self.nodes[node];
            for child in children {
                let own = self.nodes[child];
                of_node[child] = match own.density() {
                    Some(density) if parent.size > 0.0 => {
                        let expected = (parent.paths * own.size / parent.size).max(own.paths);
                        (strength * of_node[node] + expected * density) / (strength + expected)
                    }
                    _ => of_node[node],
                };
            }
        }
        self.at_leaves(&of_node)
    }

    fn at_leaves(&self, of_node: &[f64]) -> Vec<f64> {
        (0..self.leaves()).map(|leaf| of_node[self.tree.node_of_leaf(leaf)]).collect()
    }
}
