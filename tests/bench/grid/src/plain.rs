//! The hash grid as one would first write it: cells as wide as the radius, 27 of them a query, positions beside their numbers.

use glam::{IVec3, Vec3};

/// Positions by hashed cell.
#[derive(Debug)]
pub struct Plain {
    entries: Vec<(Vec3, u32)>,
    starts: Vec<u32>,
    inverse_cell: f32,
}

impl Plain {
    /// By counting sort, on one thread.
    pub fn build(points: &[Vec3], radius: f32) -> Self {
        let inverse_cell = 1.0 / radius;
        let buckets = points.len().next_power_of_two();
        let mut starts = vec![0u32; buckets + 1];
        let key = |p: Vec3| bucket((p * inverse_cell).floor().as_ivec3(), buckets);
        points.iter().for_each(|p| starts[key(*p) + 1] += 1);
        for b in 0..buckets {
            starts[b + 1] += starts[b];
        }
        let mut next = starts.clone();
        let mut entries = vec![(Vec3::ZERO, 0); points.len()];
        for (i, &p) in points.iter().enumerate() {
            let place = &mut next[key(p)];
            entries[*place as usize] = (p, i as u32);
            *place += 1;
        }
        Self { entries, starts, inverse_cell }
    }

    /// Calls `visit` for every position closer than `radius`; one that shares a bucket with another cell of the query is passed by there.
    pub fn query(&self, p: Vec3, radius: f32, mut visit: impl FnMut(u32, f32)) {
        let middle = (p * self.inverse_cell).floor().as_ivec3();
        for i in 0..27 {
            let cell = middle + IVec3::new(i % 3, i / 3 % 3, i / 9) - 1;
            let bucket = bucket(cell, self.starts.len() - 1);
            for &(q, number) in &self.entries[self.starts[bucket] as usize..self.starts[bucket + 1] as usize] {
                let distance2 = q.distance_squared(p);
                if distance2 < radius * radius && (q * self.inverse_cell).floor().as_ivec3() == cell {
                    visit(number, distance2);
                }
            }
        }
    }
}

/// Teschner et al.
fn bucket(cell: IVec3, buckets: usize) -> usize {
    let [x, y, z] = [(cell.x, 73_856_093u32), (cell.y, 19_349_663), (cell.z, 83_492_791)].map(|(c, prime)| (c as u32).wrapping_mul(prime));
    (x ^ y ^ z) as usize & (buckets - 1)
}
