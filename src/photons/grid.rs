//! A hash grid over photons, built by counting sort; the photons themselves lie in cell order.

use crate::math::Rgb;
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// A photon: flux that arrived at a surface point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Position, world units.
    pub p: Vec3,
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

/// Photons in cell order, with where each cell's run starts.
///
/// Cells with equal (y, z) and neighbouring x lie in neighbouring buckets, so a query reads one contiguous run a row of cells.
/// Different rows may share buckets; a photon counts only for the row it lies in, so none counts twice.
#[derive(Debug)]
pub struct PhotonGrid {
    photons: Vec<Photon>,
    /// Bucket `b` holds `photons[starts[b]..starts[b + 1]]`.
    starts: Vec<u32>,
    mask: u32,
    inverse_cell: f32,
}

impl PhotonGrid {
    /// Sorts the photons into cells of side `cell` (world units, positive). At most 2^32 - 1 photons.
    pub fn build(photons: Vec<Photon>, cell: f32) -> Self {
        let inverse_cell = 1.0 / cell;
        let buckets = (photons.len().max(1) * 2).next_power_of_two().min(1 << 31);
        let mask = (buckets - 1) as u32;
        let keys: Vec<u32> = photons.par_iter().map(|photon| bucket(cell_of(photon.p, inverse_cell), mask)).collect();

        // Counting sort: stable, so the order within a bucket is the order of emission.
        let mut starts = vec![0u32; buckets + 1];
        for &key in &keys {
            starts[key as usize + 1] += 1;
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        let mut next = starts.clone();
        let mut order = vec![0u32; photons.len()];
        for (i, &key) in keys.iter().enumerate() {
            let place = &mut next[key as usize];
            order[*place as usize] = i as u32;
            *place += 1;
        }
        let sorted = order.par_iter().map(|&i| photons[i as usize]).collect();
        Self { photons: sorted, starts, mask, inverse_cell }
    }

    /// Photons kept.
    pub fn len(&self) -> usize {
        self.photons.len()
    }

    /// No photon at all.
    pub fn is_empty(&self) -> bool {
        self.photons.is_empty()
    }

    /// Calls `visit` with every photon closer than `radius` to `p` and its squared distance, each exactly once, in an order that depends
    /// on the photons alone.
    #[inline]
    pub fn query(&self, p: Vec3, radius: f32, mut visit: impl FnMut(&Photon, f32)) {
        let low = cell_of(p - Vec3::splat(radius), self.inverse_cell);
        let high = cell_of(p + Vec3::splat(radius), self.inverse_cell);
        let radius2 = radius * radius;
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let first = bucket(IVec3::new(low.x, y, z), self.mask);
                let count = ((high.x - low.x) as u32).min(self.mask);
                let last = first.wrapping_add(count) & self.mask;
                let mut run = |from: u32, to: u32| {
                    let photons = &self.photons[self.starts[from as usize] as usize..self.starts[to as usize + 1] as usize];
                    for photon in photons {
                        let distance2 = photon.p.distance_squared(p);
                        if distance2 < radius2 {
                            let cell = cell_of(photon.p, self.inverse_cell);
                            if cell.y == y && cell.z == z && cell.x >= low.x && cell.x <= high.x {
                                visit(photon, distance2);
                            }
                        }
                    }
                };
                if first <= last {
                    run(first, last);
                } else {
                    run(first, self.mask);
                    run(0, last);
                }
            }
        }
    }
}

#[inline(always)]
fn cell_of(p: Vec3, inverse_cell: f32) -> IVec3 {
    (p * inverse_cell).floor().as_ivec3()
}

/// Teschner et al.'s primes for the row; x runs on within it.
#[inline(always)]
fn bucket(cell: IVec3, mask: u32) -> u32 {
    let row = (cell.y as u32).wrapping_mul(19_349_663) ^ (cell.z as u32).wrapping_mul(83_492_791);
    row.wrapping_mul(0x9e37_79b9).rotate_left(15).wrapping_add(cell.x as u32) & mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use isophote_samplers::{Key, Purpose, Stream};

    #[test]
    fn queries_find_exactly_what_brute_force_finds() {
        let mut s = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
        let mut point = |scale: f32| Vec3::new(s.next_1d() - 0.5, s.next_1d() - 0.5, 0.1 * s.next_1d()) * scale;
        for (scale, cell) in [(1.0, 0.02), (1.0, 0.3), (1000.0, 5.0), (1e-3, 1e-4)] {
            let photons: Vec<Photon> = (0..5000)
                .map(|i| Photon { p: point(scale), n_g: Vec3::Z, wi: Vec3::Z, flux: Rgb::splat(i as f32), depth: 1, stratum: 0 })
                .collect();
            let grid = PhotonGrid::build(photons.clone(), cell);
            assert_eq!(grid.len(), photons.len());
            for _ in 0..200 {
                let p = point(scale);
                for radius in [0.3 * cell, cell, 4.1 * cell] {
                    let mut found: Vec<u32> = Vec::new();
                    grid.query(p, radius, |photon, _| found.push(photon.flux.r() as u32));
                    found.sort_unstable();
                    let inside = |q: &Photon| q.p.distance_squared(p) < radius * radius;
                    let expected: Vec<u32> = photons.iter().filter(|q| inside(q)).map(|q| q.flux.r() as u32).collect();
                    assert_eq!(found, expected, "scale {scale}, cell {cell}, radius {radius}");
                }
            }
        }
    }

    #[test]
    fn an_empty_grid_answers_nothing() {
        PhotonGrid::build(Vec::new(), 1.0).query(Vec3::ZERO, 10.0, |_, _| panic!("found something"));
    }
}
