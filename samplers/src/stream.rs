//! Random numbers are coordinates with an address.

use rand::Rng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Coordinates of primary sample space, drawn in order. The only source of randomness an integrator sees.
pub trait Stream {
    /// The next coordinate, in [0, 1).
    fn next_1d(&mut self) -> f32;
    /// The next two coordinates, each in [0, 1).
    #[inline(always)]
    fn next_2d(&mut self) -> [f32; 2] {
        let a = self.next_1d();
        [a, self.next_1d()]
    }
}

impl<S: Stream + ?Sized> Stream for &mut S {
    #[inline(always)]
    fn next_1d(&mut self) -> f32 {
        (**self).next_1d()
    }
}

/// What a stream is for. Streams of different purposes are independent even when all else is equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u32)]
pub enum Purpose {
    /// A camera subpath; the index is the pixel.
    Camera = 1,
    /// A light subpath; the index is its number within the iteration.
    Light = 2,
    /// Choices that join subpaths; the index is the pixel.
    Connect = 3,
    /// A Markov chain's mutations; the index is the chain.
    Mutate = 4,
    /// Start-up of a chain or a pilot; the index is free.
    Pilot = 5,
    /// Tests and diagnostics.
    Test = 6,
    /// Which subpaths are joined with which, for all pixels of an iteration together; the index is 0.
    Pair = 7,
    /// A camera subpath that finds where light is wanted and adds nothing to the image; the index is the pixel.
    Look = 8,
}

impl Purpose {
    /// Every purpose, with the name the command line uses for it.
    pub const ALL: [(Purpose, &'static str); 8] = [
        (Purpose::Camera, "camera"),
        (Purpose::Light, "light"),
        (Purpose::Connect, "connect"),
        (Purpose::Mutate, "mutate"),
        (Purpose::Pilot, "pilot"),
        (Purpose::Test, "test"),
        (Purpose::Pair, "pair"),
        (Purpose::Look, "look"),
    ];
}

/// The address of a stream. Equal keys give equal streams, on every machine and at any thread count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Key {
    /// The run's seed.
    pub seed: u64,
    /// The iteration's absolute index.
    pub iteration: u64,
    /// Pixel, light path or chain, as the purpose says.
    pub index: u64,
    /// What the numbers are for.
    pub purpose: Purpose,
}

impl Key {
    /// The stream of independent uniform numbers at this address.
    #[inline]
    pub fn stream(self) -> UniformStream {
        // Two rounds of a full-avalanche mixer (Stafford's variant 13 of the 64-bit finaliser) for each half of the generator's
        // state: neighbouring keys must give unrelated streams, and Pcg's own seeding does not promise that.
        let a = mix(self.seed ^ mix(self.iteration.wrapping_add(0x9e37_79b9_7f4a_7c15)));
        let b = mix(a ^ mix(self.index ^ ((self.purpose as u64) << 56)));
        let c = mix(b.wrapping_add(0x9e37_79b9_7f4a_7c15));
        UniformStream { rng: Pcg64Mcg::new((u128::from(b) << 64) | u128::from(c)), spare: None }
    }
}

#[inline(always)]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The upper 24 bits as a number in [0, 1); never 1.
#[inline(always)]
pub(crate) fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Independent uniform numbers. Made by [`Key::stream`].
#[derive(Clone, Debug)]
pub struct UniformStream {
    rng: Pcg64Mcg,
    /// The second half of the generator's last output.
    spare: Option<u32>,
}

impl UniformStream {
    /// 32 random bits: what [`Stream::next_1d`] makes a coordinate of.
    #[inline(always)]
    pub(crate) fn bits(&mut self) -> u32 {
        if let Some(bits) = self.spare.take() {
            return bits;
        }
        let bits = self.rng.next_u64();
        self.spare = Some(bits as u32);
        (bits >> 32) as u32
    }

    /// A number in [0, 1) with 53 bits: for acceptances, whose ratios of targets can be far below a coordinate's resolution.
    #[inline(always)]
    pub(crate) fn chance(&mut self) -> f64 {
        (self.rng.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A whole number below `count`, which is positive; uniform to a 2^-32nd.
    #[inline(always)]
    pub fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.bits()) * count as u64) >> 32) as usize
    }
}

impl Stream for UniformStream {
    #[inline(always)]
    fn next_1d(&mut self) -> f32 {
        unit(self.bits())
    }
    #[inline(always)]
    fn next_2d(&mut self) -> [f32; 2] {
        let bits = self.rng.next_u64();
        [unit((bits >> 32) as u32), unit(bits as u32)]
    }
}

/// A recorded list of coordinates played again; what follows its end is drawn from `rest`.
#[derive(Clone, Debug)]
pub struct Replay<'a> {
    recorded: &'a [f32],
    next: usize,
    rest: UniformStream,
}

impl<'a> Replay<'a> {
    /// Plays `recorded`, then goes on with the stream of `rest`.
    pub fn new(recorded: &'a [f32], rest: Key) -> Self {
        Self { recorded, next: 0, rest: rest.stream() }
    }
    /// How many of the recorded coordinates have been used.
    pub fn used(&self) -> usize {
        self.next
    }
}

impl Stream for Replay<'_> {
    #[inline]
    fn next_1d(&mut self) -> f32 {
        match self.recorded.get(self.next) {
            Some(&u) => {
                self.next += 1;
                u
            }
            None => self.rest.next_1d(),
        }
    }
}

/// Passes a stream through and keeps what it gave, for a later [`Replay`].
#[derive(Debug)]
pub struct Recorder<'a, S> {
    inner: S,
    log: &'a mut Vec<f32>,
}

impl<'a, S: Stream> Recorder<'a, S> {
    /// Appends every coordinate of `inner` to `log`.
    pub fn new(inner: S, log: &'a mut Vec<f32>) -> Self {
        Self { inner, log }
    }
}

impl<S: Stream> Stream for Recorder<'_, S> {
    fn next_1d(&mut self) -> f32 {
        let u = self.inner.next_1d();
        self.log.push(u);
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(index: u64) -> Key {
        Key { seed: 1, iteration: 2, index, purpose: Purpose::Test }
    }

    #[test]
    fn equal_keys_give_equal_streams_and_neighbours_do_not() {
        let draw = |k: Key| -> Vec<f32> {
            let mut s = k.stream();
            (0..16).map(|_| s.next_1d()).collect()
        };
        assert_eq!(draw(key(5)), draw(key(5)));
        assert_ne!(draw(key(5)), draw(key(6)));
        assert_ne!(draw(key(5)), draw(Key { purpose: Purpose::Light, ..key(5) }));
        assert_ne!(draw(key(5)), draw(Key { iteration: 3, ..key(5) }));
    }

    /// The first coordinates of consecutive keys must fill the square: a pixel's n-th sample is such a coordinate.
    #[test]
    fn first_coordinates_of_consecutive_keys_are_uniform() {
        const CELLS: usize = 16;
        const N: usize = 1 << 18;
        for dimension in 0..4 {
            let mut count = [0u32; CELLS * CELLS];
            for i in 0..N {
                let (mut a, mut b) = (key(i as u64).stream(), key(i as u64 + 1).stream());
                for _ in 0..dimension {
                    a.next_1d();
                    b.next_1d();
                }
                let (x, y) = (a.next_1d(), b.next_1d());
                assert!((0.0..1.0).contains(&x));
                count[(x * CELLS as f32) as usize * CELLS + (y * CELLS as f32) as usize] += 1;
            }
            let expected = N as f64 / (CELLS * CELLS) as f64;
            let chi2: f64 = count.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            // 255 degrees of freedom: mean 255, standard deviation 22.6; 370 is beyond five of them.
            assert!(chi2 < 370.0, "dimension {dimension}: chi2 {chi2}");
        }
    }

    #[test]
    fn replay_plays_what_was_recorded_then_goes_on() {
        let mut log = Vec::new();
        let mut recorder = Recorder::new(key(1).stream(), &mut log);
        let first: Vec<f32> = (0..5).map(|_| recorder.next_1d()).collect();
        let mut replay = Replay::new(&log, key(2));
        let again: Vec<f32> = (0..5).map(|_| replay.next_1d()).collect();
        assert_eq!(first, again);
        assert_eq!(replay.used(), 5);
        assert_eq!(replay.next_1d(), key(2).stream().next_1d());
    }
}
