//! Build and query of the photon grid beside a k-d tree (`kiddo`) and a plain hash grid: `run.sh` beside this folder's manifest.
//!
//! A million points, on the walls of a box or gathered in bright curves on its floor; queries at places of the same density, in random
//! order and along a space-filling curve, as neighbouring pixels ask; radii that find 1, 10, 100 points on average. One thread, processor
//! time. Rounds alternate between the structures; medians over rounds.

mod plain;

use cpu_time::ProcessTime;
use glam::Vec3;
use isophote::photons::Grid;
use isophote::samplers::{Key, Purpose, Stream};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use plain::Plain;
use std::env;
use std::hint::black_box;

const POINTS: usize = 1_000_000;
const QUERIES: usize = 500_000;

/// A point on the walls of the box [-1, 1]^3.
fn on_walls(s: &mut impl Stream) -> Vec3 {
    let (u, v) = (2.0 * s.next_1d() - 1.0, 2.0 * s.next_1d() - 1.0);
    let side = if s.next_1d() < 0.5 { -1.0 } else { 1.0 };
    match (3.0 * s.next_1d()) as u32 {
        0 => Vec3::new(side, u, v),
        1 => Vec3::new(u, side, v),
        _ => Vec3::new(u, v, side),
    }
}

/// Four of five points near two curves on the floor, the nearer the more, as in a caustic.
fn in_caustics(s: &mut impl Stream) -> Vec3 {
    if s.next_1d() < 0.2 {
        return on_walls(s);
    }
    let turn = 6.0 * s.next_1d();
    let off = 0.1 * s.next_1d().powi(3);
    let radius = 0.5 * (1.0 - turn.cos().abs() * 0.6) - off;
    Vec3::new(radius * turn.cos(), -1.0, radius * turn.sin())
}

fn draw(count: usize, index: u64, make: fn(&mut isophote::samplers::UniformStream) -> Vec3) -> Vec<Vec3> {
    let mut s = Key { seed: 7, iteration: 0, index, purpose: Purpose::Test }.stream();
    (0..count).map(|_| make(&mut s)).collect()
}

/// Place along Morton's curve.
fn curve(p: Vec3) -> u64 {
    let spread = |x: f32| (0..21).fold(0u64, |sum, bit| sum | ((((x + 1.0) * 1e6) as u64 >> bit) & 1) << (3 * bit));
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

/// What a set of queries found: how many, and sums that tell whether they were the same.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Found {
    count: u64,
    numbers: u64,
}

impl Found {
    fn see(&mut self, number: u32) {
        self.count += 1;
        self.numbers += u64::from(number);
    }
}

fn timed<T>(what: impl FnOnce() -> T) -> (f64, T) {
    let start = ProcessTime::now();
    let result = what();
    (start.elapsed().as_secs_f64(), result)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The three structures over the same points.
struct Side {
    grid: Grid,
    order: isophote::photons::Order,
    plain: Plain,
    tree: ImmutableKdTree<f32, 3>,
}

impl Side {
    fn build(points: &[Vec3], arrays: &[[f32; 3]], radius: f32, seconds: &mut [Vec<f64>; 3]) -> Self {
        let cell = env::var("GRID_CELL").ok().and_then(|c| c.parse::<f32>().ok()).map_or(Grid::cell_for(radius), |c| c * radius);
        let (time, (grid, order)) = timed(|| Grid::build(points.len(), |i| points[i], cell));
        seconds[0].push(time);
        let (time, plain) = timed(|| Plain::build(points, radius));
        seconds[1].push(time);
        let (time, tree) = timed(|| ImmutableKdTree::new_from_slice(arrays).unwrap_or_else(|error| panic!("{error:?}")));
        seconds[2].push(time);
        Self { grid, order, plain, tree }
    }

    /// Nanoseconds a query, and what was found.
    fn query(&self, which: usize, queries: &[Vec3], radius: f32) -> (f64, Found) {
        let items = self.order.items();
        let (time, found) = timed(|| {
            let mut found = Found::default();
            let mut sum = 0.0;
            for &q in queries {
                match which {
                    0 => self.grid.query(q, radius, |place, d2| {
                        sum += d2;
                        found.see(items[place]);
                    }),
                    1 => self.plain.query(q, radius, |number, d2| {
                        sum += d2;
                        found.see(number);
                    }),
                    _ => self
                        .tree
                        .query(&q.to_array())
                        .within::<SquaredEuclidean<f32>>(radius * radius)
                        .unsorted()
                        .exclusive_boundaries()
                        .visit(|r| {
                            sum += r.distance;
                            found.see(r.item as u32);
                        }),
                }
            }
            black_box(sum);
            found
        });
        (time * 1e9 / queries.len() as f64, found)
    }
}

/// The radius within which the queries find `k` points on average.
fn radius_for(points: &[Vec3], queries: &[Vec3], k: f64) -> f32 {
    let (mut low, mut high) = (1e-5f32, 1.0f32);
    for _ in 0..24 {
        let radius = (low * high).sqrt();
        let (grid, _) = Grid::build(points.len(), |i| points[i], Grid::cell_for(radius));
        let mut count = 0u64;
        for q in queries.iter().step_by(500) {
            grid.query(*q, radius, |_, _| count += 1);
            if count as f64 > 2.0 * k * (queries.len() / 500) as f64 {
                break;
            }
        }
        let found = count as f64 / (queries.len() / 500) as f64;
        *(if found > k { &mut high } else { &mut low }) = radius;
    }
    (low * high).sqrt()
}

fn compare(name: &str, points: &[Vec3], queries: &[Vec3], k: f64, rounds: usize) {
    let arrays: Vec<[f32; 3]> = points.iter().map(|p| p.to_array()).collect();
    let radius = radius_for(points, queries, k);
    let mut sorted = queries.to_vec();
    sorted.sort_by_key(|p| curve(*p));
    let (mut build, mut random, mut near): ([Vec<f64>; 3], [Vec<f64>; 3], [Vec<f64>; 3]) = Default::default();
    let mut found = Found::default();
    for _ in 0..rounds {
        let side = Side::build(points, &arrays, radius, &mut build);
        let mut all = Vec::new();
        for which in 0..3 {
            for (queries, times) in [(queries, &mut random), (&sorted, &mut near)] {
                let (time, found) = side.query(which, queries, radius);
                times[which].push(time);
                all.push(found);
            }
        }
        found = all[0];
        assert!(all.iter().all(|other| *other == found), "the structures disagree: {all:?}");
    }
    for (which, structure) in ["grid", "27 cells", "kiddo"].iter().enumerate() {
        let [b, r, n] = [&build, &random, &near].map(|t| (median(t[which].clone()), median(t[which].clone()) / median(t[0].clone())));
        println!(
            "{name:<10} k {:6.1}  {structure:<9} build {:6.1} ms ({:5.2} x)  query at random {:7.0} ns ({:5.2} x)  in order {:7.0} ns ({:5.2} x)",
            found.count as f64 / queries.len() as f64,
            b.0 * 1e3,
            b.1,
            r.0,
            r.1,
            n.0,
            n.1
        );
    }
}

fn main() {
    let rounds = env::var("GRID_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(7);
    let sizes = env::var("GRID_FOUND").unwrap_or_else(|_| "1 10 100".into());
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap_or_else(|error| panic!("{error}"));
    println!("{POINTS} points, {QUERIES} queries, one thread, medians of {rounds} rounds");
    let sets: [(&str, fn(&mut isophote::samplers::UniformStream) -> Vec3); 2] = [("walls", on_walls), ("caustics", in_caustics)];
    for (name, make) in sets {
        let (points, queries) = (draw(POINTS, 0, make), draw(QUERIES, 1, make));
        for k in sizes.split_whitespace().filter_map(|k| k.parse().ok()) {
            compare(name, &points, &queries, k, rounds);
        }
    }
}
