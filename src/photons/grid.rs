//! A hash grid over positions, built by counting sort in parallel; the positions lie in cell order, in vectors of eight.
//!
//! The grid holds positions alone and numbers them anew; what belongs to a position is brought into the same order by [`Order::gather`].

use super::cells::{Cells, NEAR, end_of_row};
use super::sort::sort;
use crate::math::eight::{Vec3x8, bits};
use crate::math::fetch;
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use wide::f32x8;

/// So many items before its turn an item's memory is asked for.
const AHEAD: usize = 16;

/// Which item stands at each place of a grid.
#[derive(Clone, Debug, Default)]
pub struct Order(Vec<u32>);

impl Order {
    /// Places there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// No place at all.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Numbers of the items, as they were given to [`Grid::build`], place by place.
    pub fn items(&self) -> &[u32] {
        &self.0
    }

    /// What belongs to the items, place by place; `item` is asked once for the number of each.
    pub fn gather<T: Send>(&self, item: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let mut gathered = Vec::new();
        self.gather_into(&mut gathered, |_| (), item);
        gathered
    }

    /// [`Order::gather`] in place of what `gathered` held; `ahead` is told of each number before its turn, to ask for the memory: items lie
    /// anywhere.
    pub fn gather_into<T: Send>(&self, gathered: &mut Vec<T>, ahead: impl Fn(usize) + Sync, item: impl Fn(usize) -> T + Sync) {
        let one = |(place, &i): (usize, &u32)| {
            if let Some(&later) = self.0.get(place + AHEAD) {
                ahead(later as usize);
            }
            item(i as usize)
        };
        if gathered.capacity() < self.len() {
            // What grows is doubled. The next ones are about as many; room that none of them takes costs nothing.
            *gathered = Vec::new();
            gathered.reserve_exact(self.len() + self.len() / 16);
        }
        self.0.par_iter().with_min_len(1 << 12).enumerate().map(one).collect_into_vec(gathered);
    }
}

/// Positions in cell order, with where each cell's run starts.
///
/// A row of cells along x is one contiguous run, or more where it leaves a region of eight. A query no wider than five cells meets no
/// collision (`cells` says why); in a wider one a position counts for the row it lies in alone, so none counts twice.
#[derive(Debug)]
pub struct Grid {
    lanes: Vec<Vec3x8>,
    count: usize,
    /// Bucket `b` holds the places `starts[b]..starts[b + 1]`.
    starts: Vec<u32>,
    cells: Cells,
}

/// Fewest positions whose memory is worth asking for ahead: smaller grids stay near the processor.
const LARGE: usize = 1 << 15;
/// Widest range of cells along an axis of a query in steps, and the most runs it has: as the range is narrower than a region, a row is two of
/// them at most.
const SHORT: i32 = 2;
const RUNS: usize = 8;
/// Vectors of positions that are asked for ahead in each run.
const FETCHED: usize = 4;
/// Places found that there is room for.
const HELD: usize = 32;

/// A query in steps, so that the memory of each can be asked for while there is other work: [`Grid::search`], [`Grid::approach`],
/// [`Grid::find`], [`Grid::visit`]. Used again and again.
#[derive(Clone, Debug, Default)]
pub struct Search {
    from: Vec3,
    radius: f32,
    /// First and last bucket of each run; after [`Grid::approach`] where its places begin and end.
    runs: [(u32, u32); RUNS],
    count: usize,
    /// Places found, as many as there is room for, and how many there are.
    places: [u32; HELD],
    found: usize,
    /// Wide queries, and those of small grids, do everything in the last step.
    stepwise: bool,
}

impl Grid {
    /// Side of the cells for queries of radius `radius`: a query touches one or two cells an axis, or three with the probability 0. Narrower
    /// cells mean more runs; wider ones more positions, which tells where a query finds a hundred.
    pub fn cell_for(radius: f32) -> f32 {
        3.0 * radius
    }

    /// Sorts `count` positions (at most 2^32 - 1) into cells of side `cell` (world units, positive). The order, and so that in which queries
    /// visit, depends on the positions and the side alone: rows by z, then y, cells by x, in a cell the order of the numbers.
    pub fn build(count: usize, position: impl Fn(usize) -> Vec3 + Sync, cell: f32) -> (Self, Order) {
        Self::with_buckets(count, position, cell, 2 * count)
    }

    fn with_buckets(count: usize, position: impl Fn(usize) -> Vec3 + Sync, cell: f32, buckets: usize) -> (Self, Order) {
        let cells = Cells::new(cell, buckets);
        let sorted = sort(count, cells.buckets(), |i| cells.bucket(cells.of(position(i))));
        let eight = |numbers: &[u32]| {
            let mut lanes = [[f32::NAN; 8]; 3];
            for (lane, &i) in numbers.iter().enumerate() {
                let p = position(i as usize);
                [lanes[0][lane], lanes[1][lane], lanes[2][lane]] = [p.x, p.y, p.z];
            }
            Vec3x8::new(&lanes)
        };
        let lanes = sorted.order.par_chunks(8).with_min_len(1 << 9).map(eight).collect();
        (Self { lanes, count, starts: sorted.starts, cells }, Order(sorted.order))
    }

    /// Positions kept.
    pub fn len(&self) -> usize {
        self.count
    }

    /// No position at all.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The position at a place.
    #[inline(always)]
    pub fn position(&self, place: usize) -> Vec3 {
        let (lanes, lane) = (&self.lanes[place / 8], place & 7);
        Vec3::new(lanes.x.as_array()[lane], lanes.y.as_array()[lane], lanes.z.as_array()[lane])
    }

    /// Calls `visit` with the place of every position closer than `radius` to `p` and its squared distance, each exactly once, in an order
    /// that depends on the positions and the cells' side alone. Allocates nothing.
    #[inline]
    pub fn query(&self, p: Vec3, radius: f32, mut visit: impl FnMut(usize, f32)) {
        let (low, high) = self.box_of(p, radius);
        let (from, radius2) = (Vec3x8::splat(p), f32x8::splat(radius * radius));
        if high.wrapping_sub(low).cmplt(IVec3::splat(NEAR)).all() {
            self.each_run(low, high, |_, buckets| self.visit_run(self.places(buckets), from, radius2, &mut visit));
        } else {
            self.each_run(low, high, |[first, last], buckets| {
                self.visit_run(self.places(buckets), from, radius2, &mut |place, distance2| {
                    let cell = self.cells.of(self.position(place));
                    if cell.cmpge(first).all() && cell.cmple(last).all() {
                        visit(place, distance2);
                    }
                });
            });
        }
    }

    /// The first and the last cell along each axis that a query touches.
    #[inline(always)]
    fn box_of(&self, p: Vec3, radius: f32) -> (IVec3, IVec3) {
        // Differences, squares, sums and floors round monotonically: what rounding finds closer than the radius, it finds inside this box too.
        let reach = Vec3::splat(radius);
        (self.cells.of(p - reach), self.cells.of(p + reach))
    }

    /// Begins a query in steps: asks for the memory that says where the runs lie.
    #[inline(always)]
    pub fn search(&self, search: &mut Search, p: Vec3, radius: f32) {
        (search.from, search.radius, search.stepwise) = (p, radius, false);
        if self.count < LARGE {
            return;
        }
        let (low, high) = self.box_of(p, radius);
        if high.wrapping_sub(low).cmplt(IVec3::splat(SHORT)).all() {
            (search.stepwise, search.count) = (true, 0);
            self.each_run(low, high, |_, buckets| {
                fetch(&self.starts[buckets.0 as usize]);
                search.runs[search.count & (RUNS - 1)] = buckets;
                search.count += 1;
            });
        }
    }

    /// The second step: asks for the positions in the runs.
    #[inline(always)]
    pub fn approach(&self, search: &mut Search) {
        if !search.stepwise {
            return;
        }
        let mut kept = 0;
        for run in 0..search.count.min(RUNS) {
            let (start, end) = self.places(search.runs[run]);
            if start < end {
                search.runs[kept] = (start as u32, end as u32);
                kept += 1;
                for eight in &self.lanes[start / 8..end.div_ceil(8).min(start / 8 + FETCHED)] {
                    fetch(eight);
                    fetch(&eight.z);
                }
            }
        }
        search.count = kept;
    }

    /// The places of the buckets from the first to the last.
    #[inline(always)]
    fn places(&self, (first, last): (u32, u32)) -> (usize, usize) {
        (self.starts[first as usize] as usize, self.starts[last as usize + 1] as usize)
    }

    /// The third step: finds the positions, and calls `found` with the place of each.
    #[inline(always)]
    pub fn find(&self, search: &mut Search, found: impl Fn(usize)) {
        if !search.stepwise {
            return;
        }
        let (from, radius2) = (Vec3x8::splat(search.from), f32x8::splat(search.radius * search.radius));
        let (held, mut count) = (&mut search.places, 0);
        for &(start, end) in &search.runs[..search.count.min(RUNS)] {
            self.visit_run((start as usize, end as usize), from, radius2, &mut |place, _| {
                found(place);
                held[count & (HELD - 1)] = place as u32;
                count += 1;
            });
        }
        search.found = count;
    }

    /// The last step: calls `visit` with the places of all positions closer than the radius, the same as [`Grid::query`] and in the same order.
    #[inline(always)]
    pub fn visit(&self, search: &Search, mut visit: impl FnMut(usize)) {
        if search.stepwise && search.found <= HELD {
            search.places[..search.found].iter().for_each(|&place| visit(place as usize));
        } else {
            self.query(search.from, search.radius, |place, _| visit(place));
        }
    }

    /// The cells from `low` to `high`, run by run: the first and the last cell, and their buckets.
    #[inline(always)]
    fn each_run(&self, low: IVec3, high: IVec3, mut of_run: impl FnMut([IVec3; 2], (u32, u32))) {
        let mut z = low.z;
        loop {
            let mut y = low.y;
            loop {
                let row = self.cells.row(y, z);
                let mut x = low.x;
                loop {
                    let last = end_of_row(x).min(high.x);
                    let bucket = row.bucket(x);
                    of_run([IVec3::new(x, y, z), IVec3::new(last, y, z)], (bucket, bucket + (last - x) as u32));
                    if last >= high.x {
                        break;
                    }
                    x = last + 1;
                }
                if y >= high.y {
                    break;
                }
                y += 1;
            }
            if z >= high.z {
                break;
            }
            z += 1;
        }
    }

    /// Visits those of the places `start..end` that are closer than the root of `radius2`.
    #[inline(always)]
    fn visit_run(&self, (start, end): (usize, usize), from: Vec3x8, radius2: f32x8, visit: &mut impl FnMut(usize, f32)) {
        if start == end {
            return;
        }
        let mut place = start & !7;
        while place < end {
            let between = self.lanes[place / 8] - from;
            let distance2 = between.dot(between);
            let mut inside = bits(distance2.simd_lt(radius2), (end - place).min(8)) & (u32::MAX << start.saturating_sub(place));
            if inside != 0 {
                let distance2 = distance2.to_array();
                while inside != 0 {
                    let lane = inside.trailing_zeros() as usize;
                    visit(place + lane, distance2[lane & 7]);
                    inside &= inside - 1;
                }
            }
            place += 8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isophote_samplers::{Key, Purpose, Stream};

    fn points(count: usize, scale: f32) -> Vec<Vec3> {
        let mut s = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
        (0..count).map(|_| Vec3::new(s.next_1d() - 0.5, s.next_1d() - 0.5, 0.1 * s.next_1d()) * scale).collect()
    }

    /// Numbers of the points found, ascending.
    fn found(grid: &Grid, order: &Order, p: Vec3, radius: f32) -> Vec<u32> {
        let mut found = Vec::new();
        grid.query(p, radius, |place, distance2| {
            assert_eq!(distance2, grid.position(place).distance_squared(p));
            found.push(order.items()[place]);
        });
        found.sort_unstable();
        found
    }

    fn by_brute_force(points: &[Vec3], p: Vec3, radius: f32) -> Vec<u32> {
        (0..points.len() as u32).filter(|i| points[*i as usize].distance_squared(p) < radius * radius).collect()
    }

    #[test]
    fn queries_find_exactly_what_brute_force_finds() {
        for (scale, cell) in [(1.0, 0.02), (1.0, 0.3), (1000.0, 5.0), (1e-3, 1e-4)] {
            let points = points(5000, scale);
            let (grid, order) = Grid::build(points.len(), |i| points[i], cell);
            assert_eq!((grid.len(), order.len()), (points.len(), points.len()));
            assert_eq!(order.gather(|i| points[i]), (0..points.len()).map(|place| grid.position(place)).collect::<Vec<_>>());
            for &p in points.iter().step_by(25) {
                for radius in [0.3 * cell, cell, 1.9 * cell, 4.1 * cell] {
                    assert_eq!(
                        found(&grid, &order, p, radius),
                        by_brute_force(&points, p, radius),
                        "scale {scale}, cell {cell}, radius {radius}"
                    );
                }
            }
        }
    }

    /// One region of buckets for all of space, so that far cells share buckets: each position is visited once by queries of every width, and
    /// the buckets of a wide one do collide.
    #[test]
    fn buckets_that_collide_are_visited_once() {
        let points = points(3000, 40.0);
        let (grid, order) = Grid::with_buckets(points.len(), |i| points[i], 1.0, 1);
        let of_cell = |i: i32| grid.cells.bucket(IVec3::new(i % 10, i / 10 % 10, i / 100));
        let buckets: std::collections::BTreeSet<u32> = (0..1000).map(of_cell).collect();
        assert!(buckets.len() <= 512, "a thousand neighbours share buckets");
        for &p in points.iter().step_by(20) {
            for radius in [0.4, 1.0, 1.9, 2.6, 5.0, 12.0] {
                assert_eq!(found(&grid, &order, p, radius), by_brute_force(&points, p, radius), "radius {radius}");
            }
        }
    }

    /// Positions and boxes of queries that end at cells' borders, give or take a rounding.
    #[test]
    fn rounding_at_borders_loses_nothing() {
        let points: Vec<Vec3> = (0..4000).map(|i| Vec3::new(1.0 + i as f32 * 0.001, 0.0, 0.0)).collect();
        for cell in [0.001, 0.0013, 0.002] {
            let (grid, order) = Grid::build(points.len(), |i| points[i], cell);
            for &p in points.iter().step_by(7) {
                for radius in [0.000_999_9, 0.001, 0.001_000_1, 0.002, 0.003] {
                    assert_eq!(found(&grid, &order, p, radius), by_brute_force(&points, p, radius), "cell {cell}, radius {radius}");
                }
            }
        }
    }

    /// Rows by z, then y, cells by x, in a cell the order of the numbers: what sums over a query depend on.
    #[test]
    fn the_order_of_a_query_is_that_of_cells() {
        let points = points(4000, 1.0);
        for (cell, radius) in [(0.1, 0.05), (0.05, 0.11), (0.02, 0.1)] {
            let (grid, order) = Grid::build(points.len(), |i| points[i], cell);
            for &p in points.iter().step_by(50) {
                let mut visited = Vec::new();
                grid.query(p, radius, |place, _| {
                    let of = grid.cells.of(grid.position(place));
                    visited.push((of.z, of.y, of.x, order.items()[place]));
                });
                assert!(visited.is_sorted(), "cell {cell}, radius {radius}");
            }
        }
    }

    /// In steps a query visits what it visits at once, in the same order: few positions and more than there is room for, narrow and wide boxes,
    /// large grids and small ones.
    #[test]
    fn a_query_in_steps_is_the_query() {
        let (mut found_few, mut found_many, mut search) = (0, 0, Search::default());
        for (count, cell) in [(LARGE, 0.012), (LARGE, 0.06), (LARGE - 1, 0.06)] {
            let points = points(count, 1.0);
            let (grid, _) = Grid::build(points.len(), |i| points[i], cell);
            for &p in points.iter().step_by(211) {
                for radius in [0.1 * cell, 0.49 * cell, 1.7 * cell, 6.0 * cell] {
                    let (mut at_once, mut in_steps) = (Vec::new(), Vec::new());
                    grid.query(p, radius, |place, _| at_once.push(place));
                    grid.search(&mut search, p, radius);
                    grid.approach(&mut search);
                    grid.find(&mut search, |_| ());
                    grid.visit(&search, |place| in_steps.push(place));
                    assert_eq!(in_steps, at_once, "{count} positions, cell {cell}, radius {radius}");
                    let counted = if search.found > HELD { &mut found_many } else { &mut found_few };
                    *counted += usize::from(search.stepwise);
                }
            }
        }
        assert!(found_few > 100 && found_many > 10, "{found_few}, {found_many}");
    }

    #[test]
    fn an_empty_grid_answers_nothing() {
        let (grid, order) = Grid::build(0, |_| Vec3::ZERO, 1.0);
        assert!(grid.is_empty() && order.is_empty());
        grid.query(Vec3::ZERO, 10.0, |_, _| panic!("found something"));
    }
}
