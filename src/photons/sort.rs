//! A stable counting sort in parallel.

use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

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

/// Sorts the items 0, 1, ... `count` (at most 2^32 - 1) by their keys, all below `keys`, a power of two of at most 2^31.
///
/// Items are dealt to parts of 2^12 keys first, slice by slice of the input; then each part is sorted on its own. How many slices there are
/// depends on the number of threads, and the outcome does not: a part takes its items from the slices in their order.
pub(super) fn sort(count: usize, keys: usize, key: impl Fn(usize) -> u32 + Sync) -> Sorted {
    let width = keys.min(1 << PART);
    let (items, sizes) = deal(count, keys / width, width.trailing_zeros(), key);
    let mut order = vec![0u32; count];
    let mut starts = vec![0u32; keys + 1];
    starts[keys] = count as u32;
    let mut parts = Vec::with_capacity(keys / width);
    let (mut items, mut places) = (items.as_slice(), order.as_mut_slice());
    let mut first = 0;
    for (counts, size) in starts[..keys].chunks_exact_mut(width).zip(sizes) {
        let (own, places_of_part);
        (own, items) = items.split_at(size);
        (places_of_part, places) = places.split_at_mut(size);
        parts.push((own, places_of_part, counts, first));
        first += size as u32;
    }
    parts.into_par_iter().for_each(|(items, places, counts, first)| place(items, places, counts, first));
    Sorted { order, starts }
}

/// Items by part, as key and number in one, and how many each part has.
fn deal(count: usize, parts: usize, shift: u32, key: impl Fn(usize) -> u32 + Sync) -> (Vec<AtomicU64>, Vec<usize>) {
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

    // Every slice gets its own room in every part: counts become places.
    let mut sizes = Vec::with_capacity(parts);
    let mut next = 0;
    for part in 0..parts {
        let first = next;
        for counts in &mut counts {
            let room = next;
            next += counts[part];
            counts[part] = room;
        }
        sizes.push((next - first) as usize);
    }

    // No two threads write to one place; atomics say so to the compiler and cost nothing.
    let items: Vec<AtomicU64> = std::iter::repeat_with(AtomicU64::default).take(count).collect();
    keyed.par_chunks(slice).zip(counts).enumerate().for_each(|(s, (keyed, mut next))| {
        for (i, &key) in keyed.iter().enumerate() {
            let place = &mut next[(key >> shift) as usize];
            items[*place as usize].store(u64::from(key) << 32 | (s * slice + i) as u64, Ordering::Relaxed);
            *place += 1;
        }
    });
    (items, sizes)
}

/// Sorts a part; `counts` are zero on entry, and where each key starts on return.
fn place(items: &[AtomicU64], places: &mut [u32], counts: &mut [u32], first: u32) {
    let mask = counts.len() - 1;
    let key = |item: u64| (item >> 32) as usize & mask;
    for item in items {
        counts[key(item.load(Ordering::Relaxed))] += 1;
    }
    let mut end = 0;
    for count in counts.iter_mut() {
        end += *count;
        *count = end;
    }
    // From the last item to the first, so that ends become starts and equal keys keep their order.
    for item in items.iter().rev() {
        let item = item.load(Ordering::Relaxed);
        let start = &mut counts[key(item)];
        *start -= 1;
        places[*start as usize] = item as u32;
    }
    counts.iter_mut().for_each(|start| *start += first);
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
