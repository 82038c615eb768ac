//! Which techniques take part, and how many samples a merge counts for: every heuristic is here and nowhere else.

/// The techniques of one engine. Every path of length 1, a light seen directly, is left to the emitter hit in every set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Techniques {
    /// Emitter hits, next event and connections between interior vertices. Without them an emitter hit still counts where nothing else
    /// can make the path: no splat of the set, and no vertex that may merge, whether or not the set has merges.
    pub connections: bool,
    /// Light tracing: connections of a light vertex to the camera.
    pub light_tracing: bool,
    /// Merges.
    pub merges: bool,
}

impl Techniques {
    /// Every technique: vertex connection and merging.
    pub const VCM: Self = Self { connections: true, light_tracing: true, merges: true };
    /// Bidirectional path tracing.
    pub const BDPT: Self = Self { merges: false, ..Self::VCM };
    /// Bidirectional photon mapping: merges at every vertex.
    pub const BPM: Self = Self { connections: false, light_tracing: false, merges: true };
    /// Light tracing alone.
    pub const LIGHT_TRACING: Self = Self { connections: false, light_tracing: true, merges: false };
}

/// What a merge's density is multiplied by before it competes: the number of samples it is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MergeWeights {
    /// The number of light paths, exponent 1: the balance heuristic ([VEACH (9.8)], \[VCM-TR\]).
    #[default]
    Balance,
    /// The number of light paths, any exponent: the power heuristic ([VEACH 9.2], [THESIS (2.11)]).
    Power,
    /// The number of light paths over the number of photons found ([VCM* (6)]).
    VcmPlus,
    /// As [`MergeWeights::VcmPlus`], over its mean along the path, so that connections keep their standing against merges ([VCM* (7)]).
    VcmStar,
}

/// A heuristic that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HeuristicError {
    /// The exponent makes no weights.
    #[error("the exponent (beta) of merge weights is {0}: it must be finite and positive")]
    Exponent(f64),
    /// The balance heuristic is the one with exponent 1.
    #[error("the balance heuristic has the exponent (beta) 1, not {0}: leave the exponent out, or ask for the power heuristic")]
    Balance(f64),
}

/// Merge weights and the exponent that every technique's term is raised to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heuristic {
    merges: MergeWeights,
    beta: f64,
}

impl Default for Heuristic {
    fn default() -> Self {
        Self { merges: MergeWeights::Balance, beta: 1.0 }
    }
}

impl Heuristic {
    /// Refuses an exponent that is not finite and positive, and any but 1 with [`MergeWeights::Balance`].
    pub fn new(merges: MergeWeights, beta: f64) -> Result<Self, HeuristicError> {
        if !(beta.is_finite() && beta > 0.0) {
            return Err(HeuristicError::Exponent(beta));
        }
        if merges == MergeWeights::Balance && beta != 1.0 {
            return Err(HeuristicError::Balance(beta));
        }
        Ok(Self { merges, beta })
    }

    /// The same where every vertex says for how many samples its merges count: balance and power relative to the number of light paths.
    pub fn by_photons(self) -> Self {
        match self.merges {
            MergeWeights::Balance | MergeWeights::Power => Self { merges: MergeWeights::VcmPlus, ..self },
            MergeWeights::VcmPlus | MergeWeights::VcmStar => self,
        }
    }

    /// What merges count for.
    pub fn merges(&self) -> MergeWeights {
        self.merges
    }

    /// The exponent.
    pub fn beta(&self) -> f64 {
        self.beta
    }

    /// Must a vertex know how many photons a merge there finds?
    pub fn asks_density(&self) -> bool {
        matches!(self.merges, MergeWeights::VcmPlus | MergeWeights::VcmStar)
    }

    /// Samples that each merge of a path is worth: the factors `c` of [VCM* (6), (7)] as they stand. `photons` is the expected number of
    /// photons found at each vertex of the path that may merge, positive; `light_paths` is their number in the iteration.
    ///
    /// The mean in (7) runs over the vertices that may merge: where the paper divides by all interior vertices, it means "all possible
    /// merges along the path".
    pub fn samples(&self, light_paths: f64, photons: &[f64]) -> Vec<f64> {
        let mean_inverse = photons.iter().map(|k| 1.0 / k).sum::<f64>() / photons.len() as f64;
        photons
            .iter()
            .map(|k| match self.merges {
                MergeWeights::Balance | MergeWeights::Power => light_paths,
                MergeWeights::VcmPlus => light_paths / k,
                MergeWeights::VcmStar => light_paths / k / mean_inverse,
            })
            .collect()
    }
}

/// One iteration, as far as weights ask.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    /// Techniques that are evaluated.
    pub techniques: Techniques,
    /// How they are weighed.
    pub heuristic: Heuristic,
    /// Light subpaths in the iteration, at least 1: each camera subpath connects to one of them, merges with all, and all of them splat.
    pub light_paths: f64,
    /// Camera subpaths of a pixel in the iteration, at least 1.
    pub camera_paths: f64,
    /// Radius of a merge, world units, positive.
    pub radius: f64,
}

impl Sampling {
    /// Area over which a merge finds photons, world units squared.
    pub fn merge_area(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_checked() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(Heuristic::new(MergeWeights::Power, wrong), Err(HeuristicError::Exponent(_))));
        }
        assert_eq!(Heuristic::new(MergeWeights::Balance, 2.0), Err(HeuristicError::Balance(2.0)));
        assert_eq!(Heuristic::new(MergeWeights::Power, 2.0).unwrap().beta(), 2.0);
        assert_eq!(Heuristic::new(MergeWeights::Balance, 1.0).unwrap(), Heuristic::default());
        assert!(!Heuristic::default().asks_density());
    }

    /// By hand: k = 2 and 8, so the mean of 1/k is 5/16.
    #[test]
    fn samples_follow_the_equations() {
        let samples = |merges| Heuristic::new(merges, 1.0).unwrap().samples(100.0, &[2.0, 8.0]);
        assert_eq!(samples(MergeWeights::Balance), [100.0, 100.0]);
        assert_eq!(samples(MergeWeights::Power), [100.0, 100.0]);
        assert_eq!(samples(MergeWeights::VcmPlus), [50.0, 12.5]);
        assert_eq!(samples(MergeWeights::VcmStar), [160.0, 40.0]);
    }
}
