//! A stable counting sort in parallel.

use rayon::prelude::*;

/// Items ordered by key, items of one key in the order in which they came.
#[derive(Debug)]
pub(super) struct Sorted {
    /// Numbers of items in their new order.
    pub(super) order: Vec<u32>,
    /// Key `k` is that of `order[starts[k]..starts[k + 1]]`.
    pub(super) starts: Vec<u32>,
}

/// Keys of a part, as a power of two: their counts fit the first level of cache.
const PART: u32 = 12;

/// An item on its way to its place.
#[derive(Clone, Copy, Debug, Default)]
struct Item {
    key: u32,
    number: u32,
}

/// Sorts the items 0, 1, ... `count` (at most 2^32 - 1) by their keys, all below `keys`, a power of two of at most 2^31.
///
/// Items are dealt to parts of 2^12 keys first, slice by slice of the input; then each part is sorted on its own. How many slices there are
/// depends on the number of threads, and the outcome does not: a part takes its items from the slices in their order.
pub(super) fn sort(count: usize, keys: usize, key: impl Fn(usize) -> u32 + Sync) -> Sorted {
    let width = keys.min(1 << PART);
    let dealt = deal(count, keys / width, width.trailing_zeros(), key);
    let mut order = vec![0u32; count];
    let mut starts = vec![0u32; keys + 1];
    starts[keys] = count as u32;
    let mut parts = Vec::with_capacity(keys / width);
    let (mut items, mut places) = (dealt.items.as_slice(), order.as_mut_slice());
    let mut first = 0;
    for (counts, size) in starts[..keys].chunks_exact_mut(width).zip(dealt.sizes) {
        let (own, places_of_part);
        (own, items) = items.split_at(size);
        (places_of_part, places) = places.split_at_mut(size);
        parts.push((own, places_of_part, counts, first));
        first += size as u32;
    }
    parts.into_par_iter().for_each(|(items, places, counts, first)| place(items, places, counts, first));
    Sorted { order, starts }
}

struct Dealt {
    items: Vec<Item>,
    /// Items of each part.
    sizes: Vec<usize>,
}

/// Items by part.
fn deal(count: usize, parts: usize, shift: u32, key: impl Fn(usize) -> u32 + Sync) -> Dealt {
    let slice = count.div_ceil(rayon::current_num_threads()).max(1 << 14);
    let mut keyed = vec![0u32; count];
    let mut counts: Vec<Vec<u32>> = keyed
        .par_chunks_mut(slice)
        .enumerate()
        .map(|(s, keyed)| {
            let mut counts = vec![0u32; parts];
            for (i, kept) in keyed.iter_mut().enumerate() {
                *kept = key(s * slice + i);
                counts[(*kept >> shift) as usize] += 1;
            }
            counts
        })
        .collect();
    let sizes: Vec<usize> = (0..parts).map(|part| counts.iter().map(|c| c[part] as usize).sum()).collect();

    // Every slice gets its own room in every part.
    let mut items = vec![Item::default(); count];
    let mut rooms: Vec<Vec<&mut [Item]>> = counts.iter().map(|_| Vec::with_capacity(parts)).collect();
    let mut rest = items.as_mut_slice();
    for part in 0..parts {
        for (rooms, counts) in rooms.iter_mut().zip(&counts) {
            let room;
            (room, rest) = rest.split_at_mut(counts[part] as usize);
            rooms.push(room);
        }
    }
    keyed.par_chunks(slice).zip(rooms).zip(&mut counts).enumerate().for_each(|(s, ((keyed, mut rooms), next))| {
        next.fill(0);
        for (i, &key) in keyed.iter().enumerate() {
            let part = (key >> shift) as usize;
            rooms[part][next[part] as usize] = Item { key, number: (s * slice + i) as u32 };
            next[part] += 1;
        }
    });
    Dealt { items, sizes }
}

/// Sorts a part; `counts` are zero on entry, and where each key starts on return.
fn place(items: &[Item], places: &mut [u32], counts: &mut [u32], first: u32) {
    let mask = counts.len() - 1;
    for item in items {
        counts[item.key as usize & mask] += 1;
    }
    let mut end = first;
    for count in counts.iter_mut() {
        end += *count;
        *count = end;
    }
    // From the last item to the first, so that ends become starts and equal keys keep their order.
    for item in items.iter().rev() {
        let start = &mut counts[item.key as usize & mask];
        *start -= 1;
        places[(*start - first) as usize] = item.number;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::ThreadPoolBuilder;

    fn by_library(keys: &[u32]) -> Vec<u32> {
        let mut order: Vec<u32> = (0..keys.len() as u32).collect();
        order.sort_by_key(|i| keys[*i as usize]);
        order
    }

    #[test]
    fn the_library_sorts_the_same_way() {
        for (count, range) in [(0, 512u32), (1, 1), (1000, 512), (100_000, 4096), (100_000, 1 << 17), (200_001, 1 << 20)] {
            let keys: Vec<u32> = (0..count as u32).map(|i| (i.wrapping_mul(2_654_435_769) >> 7) % range / 3 * 3 % range).collect();
            for threads in [1, 2, 5] {
                let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let sorted = pool.install(|| sort(count, range as usize, |i| keys[i]));
                assert_eq!(sorted.order, by_library(&keys), "{count} items, {range} keys, {threads} threads");
                for k in 0..range as usize {
                    let run = &sorted.order[sorted.starts[k] as usize..sorted.starts[k + 1] as usize];
                    assert!(run.iter().all(|i| keys[*i as usize] as usize == k));
                }
            }
        }
    }
}
