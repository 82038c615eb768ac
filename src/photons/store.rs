//! What light left at surfaces, in the order of a grid.

use super::grid::{Grid, Search};
use crate::math::{Rgb, fetch};
use glam::Vec3;

/// A photon but for its position: flux that arrived at a surface point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Unit geometric normal there.
    pub n_g: Vec3,
    /// Unit direction towards the light, world space.
    pub wi: Vec3,
    /// Flux carried (a path's, not yet divided by the number of paths), times its weight within its stratum.
    pub flux: Rgb,
    /// Path edges from the light to here.
    pub depth: u16,
    /// The sampler's stratum that drew the path.
    pub stratum: u16,
}

/// Items at positions: the grid that finds them, and the items in its order.
#[derive(Debug)]
pub struct Store<T> {
    grid: Grid,
    items: Vec<T>,
}

impl<T: Send> Store<T> {
    /// Sorts `count` items, whose positions and contents are asked for by number, into cells of side `cell`: see [`Grid::build`]. `items` is the
    /// memory of an older store ([`Store::into_items`]) or nothing; `ahead` is told of items before they are asked for: see
    /// [`Order::gather_into`](super::Order::gather_into).
    pub fn build_in(
        mut items: Vec<T>,
        count: usize,
        position: impl Fn(usize) -> Vec3 + Sync,
        ahead: impl Fn(usize) + Sync,
        item: impl Fn(usize) -> T + Sync,
        cell: f32,
    ) -> Self {
        let (grid, order) = Grid::build(count, position, cell);
        order.gather_into(&mut items, ahead, item);
        Self { grid, items }
    }
}

impl<T> Store<T> {
    /// The grid of the positions.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The memory of the items, for the next store.
    pub fn into_items(self) -> Vec<T> {
        self.items
    }

    /// The items in the grid's order.
    pub fn items(&self) -> &[T] {
        &self.items
    }

    /// Calls `visit` with every item closer than `radius` to `p` and its squared distance: see [`Grid::query`].
    #[inline]
    pub fn query(&self, p: Vec3, radius: f32, mut visit: impl FnMut(&T, f32)) {
        self.grid.query(p, radius, |place, distance2| visit(&self.items[place], distance2));
    }

    /// [`Grid::find`], asking for the items found.
    #[inline(always)]
    pub fn find(&self, search: &mut Search) {
        self.grid.find(search, |place| fetch(&self.items[place]));
    }

    /// [`Grid::visit`] with the items.
    #[inline(always)]
    pub fn visit(&self, search: &Search, mut visit: impl FnMut(&T)) {
        self.grid.visit(search, |place| visit(&self.items[place]));
    }
}
