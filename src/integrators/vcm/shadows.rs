//! Edges that join two subpaths, and whether anything is on them: asked for many at once, which costs less than one by one
//! (`docs/rays.md`).

use crate::scene::Scene;
use crate::scene::ray::Ray;

/// Edges asked about at once.
const TOGETHER: usize = 256;

/// Values that count if their edge is free, in the order in which they came. Keeps its memory.
#[derive(Debug)]
pub(super) struct Shadows<T> {
    rays: Vec<Ray>,
    values: Vec<T>,
    blocked: Vec<bool>,
}

impl<T> Default for Shadows<T> {
    fn default() -> Self {
        Self { rays: Vec::new(), values: Vec::new(), blocked: Vec::new() }
    }
}

impl<T> Shadows<T> {
    /// Keeps `value` until it is known whether anything is on `ray`.
    #[inline(always)]
    pub(super) fn push(&mut self, ray: Ray, value: T) {
        self.rays.push(ray);
        self.values.push(value);
    }

    /// As many as are asked about at once: time to.
    #[inline(always)]
    pub(super) fn is_full(&self) -> bool {
        self.rays.len() >= TOGETHER
    }

    /// Gives `free` every value whose edge is, and forgets all.
    pub(super) fn trace(&mut self, scene: &Scene, mut free: impl FnMut(T)) {
        let Self { rays, values, blocked } = self;
        blocked.resize(rays.len(), false);
        scene.occluded_each(rays, blocked);
        for (value, blocked) in values.drain(..).zip(blocked) {
            if !*blocked {
                free(value);
            }
        }
        rays.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::{Key, Purpose, Stream};
    use crate::scene::hit::Endpoint;
    use crate::scene::mitsuba::{LoadOptions, load};
    use glam::Vec3;
    use std::path::Path;

    /// Of random segments of a room those are free that one by one meet nothing, in their order; of what was asked before nothing is left.
    #[test]
    fn what_is_free_is_what_meets_nothing() {
        let scene = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/box/scene.xml"), &LoadOptions::default()).unwrap().scene;
        let bounds = scene.bounds().unwrap();
        let mut s = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
        let mut point = || Endpoint::free(bounds.min + (bounds.max - bounds.min) * Vec3::from_array(std::array::from_fn(|_| s.next_1d())));
        let mut shadows = Shadows::default();
        for count in [TOGETHER + 100, 3, 0, 40] {
            let ends: Vec<_> = (0..count).map(|_| (point(), point())).collect();
            for (i, (a, b)) in ends.iter().enumerate() {
                assert_eq!(shadows.is_full(), i >= TOGETHER);
                shadows.push(a.segment(b), i);
            }
            let mut free = Vec::new();
            shadows.trace(&scene, |i| free.push(i));
            let expected: Vec<usize> = (0..count).filter(|&i| !scene.occluded(&ends[i].0, &ends[i].1)).collect();
            assert_eq!(free, expected);
            assert!(count < TOGETHER || (20..count - 20).contains(&free.len()), "{} of {count} are free", free.len());
        }
    }
}
