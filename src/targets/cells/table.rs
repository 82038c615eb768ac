//! A hash table over cells that never forgets and remembers the order of arrival, so that sums over it have one order.

use crate::math::fetch;
use glam::{IVec3, Vec3};

/// A cell of a size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Key {
    pub(super) cell: IVec3,
    pub(super) level: i32,
}

impl Key {
    /// The cell of a place.
    #[inline(always)]
    pub(super) fn of(p: Vec3, inverse_side: f32, level: i32) -> Self {
        Self { cell: (p * inverse_side).floor().as_ivec3(), level }
    }

    /// A number whose low bits depend on everything: products with odd constants, and shifts that bring high bits down.
    #[inline(always)]
    pub(super) fn hash(self) -> u32 {
        let IVec3 { x, y, z } = self.cell;
        let xy = (x as u32 as u64) << 32 | u64::from(y as u32);
        let zl = (z as u32 as u64) << 32 | u64::from(self.level as u32);
        let h = (xy.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ zl).wrapping_mul(0xd6e8_feb8_6659_fd93);
        let h = (h ^ (h >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
        (h ^ (h >> 32)) as u32
    }
}

/// Values by cell: open addressing, linear probing, at most half full.
#[derive(Clone, Debug)]
pub(super) struct Table<T> {
    /// Numbers of entries, [`VACANT`] where there is none; a power of two of them.
    slots: Vec<u32>,
    entries: Vec<(Key, T)>,
}

const VACANT: u32 = u32::MAX;

/// A look-up that has asked for its slot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probe {
    key: Key,
    hash: u32,
}

/// Tables side by side, each with the cells of a range of hashes, so that threads fill them at once.
pub(super) const SHARDS: usize = 8;

/// The table of a hash.
#[inline(always)]
pub(super) fn shard(hash: u32) -> usize {
    (hash >> (u32::BITS - SHARDS.ilog2())) as usize
}

/// Tables of all shards.
#[derive(Clone, Debug)]
pub(super) struct Sharded<T>(pub(super) Vec<Table<T>>);

impl<T> Default for Sharded<T> {
    fn default() -> Self {
        Self((0..SHARDS).map(|_| Table::default()).collect())
    }
}

impl<T> Sharded<T> {
    pub(super) fn len(&self) -> usize {
        self.0.iter().map(Table::len).sum()
    }

    /// Asks for what [`Sharded::at`] reads.
    #[inline(always)]
    pub(super) fn probe(&self, key: Key) -> Probe {
        let hash = key.hash();
        let table = &self.0[shard(hash)];
        fetch(&table.slots[hash as usize & (table.slots.len() - 1)]);
        Probe { key, hash }
    }

    /// A number of its own and the value of a cell.
    #[inline(always)]
    pub(super) fn at(&self, probe: &Probe) -> Option<(u32, &T)> {
        let shard = shard(probe.hash);
        let (number, value) = self.0[shard].at(probe)?;
        Some((number * SHARDS as u32 + shard as u32, value))
    }
}

impl<T> Default for Table<T> {
    fn default() -> Self {
        Self::with_capacity(0)
    }
}

impl<T> Table<T> {
    pub(super) fn with_capacity(cells: usize) -> Self {
        Self { slots: vec![VACANT; (2 * cells.max(4)).next_power_of_two()], entries: Vec::with_capacity(cells) }
    }

    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Cells in the order of arrival.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Key, &T)> {
        self.entries.iter().map(|(key, value)| (*key, value))
    }

    /// The cell of a number.
    pub(super) fn key(&self, number: usize) -> Key {
        self.entries[number].0
    }

    /// As [`Table::iter`], to change the values.
    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = (Key, &mut T)> {
        self.entries.iter_mut().map(|(key, value)| (*key, value))
    }

    /// The number and value of a cell, `new` if there is none yet.
    pub(super) fn entry(&mut self, key: Key, new: T) -> (u32, &mut T) {
        if 2 * (self.entries.len() + 1) > self.slots.len() {
            self.grow();
        }
        let slot = self.find(key, key.hash());
        let mut number = self.slots[slot];
        if number == VACANT {
            number = self.entries.len() as u32;
            self.slots[slot] = number;
            self.entries.push((key, new));
        }
        (number, &mut self.entries[number as usize].1)
    }

    /// Number and value of a cell.
    #[inline(always)]
    fn at(&self, probe: &Probe) -> Option<(u32, &T)> {
        let number = self.slots[self.find(probe.key, probe.hash)];
        self.entries.get(number as usize).map(|(_, value)| (number, value))
    }

    /// The slot of a cell, or the vacant one where it would be, from a hash on.
    #[inline(always)]
    fn find(&self, key: Key, hash: u32) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = hash as usize & mask;
        while let Some((other, _)) = self.entries.get(self.slots[slot] as usize) {
            if *other == key {
                break;
            }
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn grow(&mut self) {
        self.slots = vec![VACANT; 2 * self.slots.len()];
        for number in 0..self.entries.len() {
            let key = self.entries[number].0;
            let slot = self.find(key, key.hash());
            self.slots[slot] = number as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_found_again_and_no_others() {
        let mut table = Table::default();
        let probe = |key: Key| Probe { key, hash: key.hash() };
        let key = |i: i32| Key { cell: IVec3::new(i % 10 - 5, i / 10 % 10 - 5, i / 100 - 5), level: i % 3 };
        for i in 0..1000 {
            *table.entry(key(i), 0).1 += i;
            *table.entry(key(i), 7).1 += 1;
        }
        assert_eq!(table.len(), 1000);
        assert!(table.iter().enumerate().all(|(i, (k, value))| k == key(i as i32) && *value == i as i32 + 1));
        for i in 0..1000 {
            assert_eq!(table.at(&probe(key(i))), Some((i as u32, &(i + 1))));
            let other = Key { level: 3, ..key(i) };
            assert_eq!(table.at(&probe(other)), None);
        }
    }

    /// Every cell is found in its shard, and numbers are its own.
    #[test]
    fn shards_share_no_number() {
        let mut all = Sharded::default();
        let key = |i: i32| Key { cell: IVec3::new(i % 10, i / 10 % 10, i / 100), level: 0 };
        for i in 0..1000 {
            all.0[shard(key(i).hash())].entry(key(i), i);
        }
        let numbers: std::collections::HashSet<u32> =
            (0..1000).map(|i| all.at(&all.probe(key(i))).filter(|(_, v)| **v == i).unwrap().0).collect();
        assert_eq!((numbers.len(), all.len()), (1000, 1000));
        assert!(all.0.iter().all(|table| (80..180).contains(&table.len())));
    }

    /// Neighbouring cells fill the table evenly: at half load a look-up takes less than two steps.
    #[test]
    fn hashes_scatter() {
        let mut counts = vec![0u32; 4096];
        for i in 0..4096 {
            let key = Key { cell: IVec3::new(i % 16, i / 16 % 16, i / 256), level: 2 };
            counts[key.hash() as usize % 4096] += 1;
        }
        let empty = counts.iter().filter(|n| **n == 0).count() as f64 / 4096.0;
        // 1/e, with a standard error of 0.5 %.
        assert!((empty - (-1.0f64).exp()).abs() < 0.03, "{empty}");
    }
}
