//! A chain's state: while it runs, and between draws.

use crate::adapt::StepSize;
use crate::mutation::Coordinates;
use crate::sampler::LightPathSpace;
use crate::stream::UniformStream;
use serde::{Deserialize, Serialize};

/// What a chain stands on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Life {
    /// Nothing has ever been found.
    #[default]
    Empty,
    /// A state whose target became 0 when the targets changed: a start for mutations, counted nowhere.
    Dead,
    /// A state with a positive target.
    Alive,
}

/// A chain between draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Chain {
    pub(crate) coordinates: Vec<u32>,
    pub(crate) life: Life,
    /// The state has been on the last rung since it came from rung 0.
    pub(crate) climbed: bool,
    pub(crate) step: StepSize,
    /// Own steps so far: whose turn it is to exchange.
    pub(crate) turn: u64,
}

/// A state with its path and its targets' values. Exchanged between chains as a whole.
pub(crate) struct State<T> {
    pub(crate) coordinates: Vec<u32>,
    pub(crate) path: T,
    /// All rungs' targets.
    pub(crate) values: Vec<f64>,
    pub(crate) life: Life,
    pub(crate) climbed: bool,
    /// Counted steps at each rung since the draw began.
    pub(crate) counts: Vec<u32>,
    /// Number of the first of them within the iteration; none before one is counted.
    pub(crate) index: Option<u64>,
    /// Target of the next rung over that of the chain's own.
    pub(crate) ratio: f64,
    /// [`State::log`], once asked for.
    log: Option<f64>,
}

/// Room for coordinates from the start: more than most paths use.
const COORDINATES: usize = 128;

impl<T: Default> State<T> {
    pub(crate) fn new(rungs: usize) -> Self {
        Self {
            coordinates: Vec::with_capacity(COORDINATES),
            path: T::default(),
            values: vec![0.0; rungs],
            life: Life::Empty,
            climbed: false,
            counts: vec![0; rungs],
            index: None,
            ratio: 0.0,
            log: None,
        }
    }

    /// Traces what the coordinates describe and keeps the used ones; evaluates all targets.
    #[inline(always)]
    pub(crate) fn trace<P: LightPathSpace<Path = T>>(&mut self, space: &P, random: &mut UniformStream) {
        let mut stream = Coordinates::after(random, &mut self.coordinates);
        space.trace(&mut stream, &mut self.path);
        stream.finish();
        space.targets(&self.path, &mut self.values);
        self.log = None;
    }

    /// Logarithm of the last rung's target; that of the smallest normal number for 0.
    #[inline]
    pub(crate) fn log(&mut self) -> f64 {
        let value = self.values[self.values.len() - 1];
        *self.log.get_or_insert_with(|| value.max(f64::MIN_POSITIVE).ln())
    }

    /// The stored state under the present targets.
    pub(crate) fn replay<P: LightPathSpace<Path = T>>(&mut self, space: &P, rung: usize, base: &[u32], random: &mut UniformStream) {
        self.coordinates.clear();
        self.coordinates.extend_from_slice(base);
        self.trace(space, random);
        self.life = if self.values[rung] > 0.0 { Life::Alive } else { Life::Dead };
    }

    /// Counts a step at this rung; `index` is its number.
    #[inline(always)]
    pub(crate) fn count(&mut self, rung: usize, index: u64) {
        self.index.get_or_insert(index);
        self.counts[rung] += 1;
    }

    /// Brings the numbers up to date that belong to the state *at this rung*.
    #[inline]
    pub(crate) fn settle(&mut self, rung: usize) {
        let last = self.values.len() - 1;
        self.ratio = if rung < last && self.values[rung] > 0.0 { self.values[rung + 1] / self.values[rung] } else { 0.0 };
        self.climbed |= rung == last;
    }
}
