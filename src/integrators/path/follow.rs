//! What a path remembers of its class, and which paths count: all of them, or those of `--paths`.

use crate::samplers::Stream;
use crate::scene::bsdf::Lobes;
use crate::transport::class::PathClass;
use crate::transport::shading::SurfacePoint;
use regex::Regex;

/// Watches one path from the eye on.
pub(super) trait Follow: Clone + Sync {
    /// Every path counts, through whatever lobes it goes.
    const EVERY: bool;
    /// Chooses the lobes to go on through at a vertex; the factor on the throughput that makes up for the choice.
    fn choose_lobes<S: Stream>(&mut self, point: &SurfacePoint<'_>, stream: &mut S) -> f32;
    /// The lobes chosen last.
    fn lobes(&self) -> Lobes;
    /// Does emission met at the end of the path so far count?
    fn emission_counts(&self) -> bool;
    /// Does light count that reaches the path through the lobes chosen?
    fn light_counts(&mut self) -> bool;
    /// Goes on through the lobes chosen; `delta` where the one sampled is one.
    fn scatter(&mut self, delta: bool);
}

/// Every path counts, whatever its class.
#[derive(Clone, Copy)]
pub(super) struct AnyClass;

impl Follow for AnyClass {
    const EVERY: bool = true;

    #[inline(always)]
    fn choose_lobes<S: Stream>(&mut self, _point: &SurfacePoint<'_>, _stream: &mut S) -> f32 {
        1.0
    }

    #[inline(always)]
    fn lobes(&self) -> Lobes {
        Lobes::All
    }

    #[inline(always)]
    fn emission_counts(&self) -> bool {
        true
    }

    #[inline(always)]
    fn light_counts(&mut self) -> bool {
        true
    }

    #[inline(always)]
    fn scatter(&mut self, _delta: bool) {}
}

/// Paths count whose class matches. One set of lobes is followed a vertex, so that every path has a class.
#[derive(Clone)]
pub(super) struct Matching<'a> {
    class: PathClass,
    lobes: Lobes,
    pattern: &'a Regex,
}

impl<'a> Matching<'a> {
    /// At the eye.
    pub(super) fn new(pattern: &'a Regex) -> Self {
        Self { class: PathClass::default(), lobes: Lobes::All, pattern }
    }
}

/// The set of lobes that makes an event diffuse; the other one holds the rest.
const DIFFUSE: Lobes = Lobes::Rough(1.0);
/// What [`DIFFUSE`] leaves.
const REST: Lobes = Lobes::Smooth(1.0);

/// Letter of an event that is no delta.
fn letter(lobes: Lobes) -> u8 {
    if lobes == DIFFUSE { b'D' } else { b'G' }
}

impl Follow for Matching<'_> {
    const EVERY: bool = false;

    fn choose_lobes<S: Stream>(&mut self, point: &SurfacePoint<'_>, stream: &mut S) -> f32 {
        let diffuse = point.bsdf.albedo(point.uv, point.given_local, DIFFUSE);
        let rest = point.bsdf.albedo(point.uv, point.given_local, REST);
        let probability = diffuse / (diffuse + rest);
        let choose_diffuse = stream.next_1d() < probability;
        self.lobes = if choose_diffuse { DIFFUSE } else { REST };
        1.0 / if choose_diffuse { probability } else { 1.0 - probability }
    }

    fn lobes(&self) -> Lobes {
        self.lobes
    }

    fn emission_counts(&self) -> bool {
        self.class.matches(self.pattern)
    }

    fn light_counts(&mut self) -> bool {
        self.class.push(letter(self.lobes));
        let counts = self.class.matches(self.pattern);
        self.class.pop();
        counts
    }

    fn scatter(&mut self, delta: bool) {
        self.class.push(if delta { b'S' } else { letter(self.lobes) });
    }
}
