//! Settings that photon methods share.

use crate::samplers::{Allocation, Combine, LadderSettings, Normaliser};
use crate::targets::aim::Rung;
use crate::targets::regions::Refinement;
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

/// Who draws the light paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SamplerName {
    /// Independent light paths
    #[default]
    Uniform,
    /// Markov chains over paths that reach a measurement point (Hachisuka and Jensen 2011)
    Visibility,
    /// Replica exchange up to visibility over kernel size
    Kernel,
    /// Replica exchange up to equal relative error, densities kept over the image
    Image,
    /// Replica exchange up to equal relative error, densities kept over space (Gruson et al. 2016)
    Spatial,
}

/// Over what regions of a target are built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegionKind {
    /// The target needs none.
    None,
    /// Boxes in space.
    Space,
    /// Rectangles of the image.
    Image,
}

/// How rungs are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CombineName {
    /// Balance heuristic over rungs
    Mis,
    /// Average by the rungs' steps
    Average,
    /// The last rung alone
    Last,
}

/// Where the rungs' normalisations come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NormaliserName {
    /// Each iteration by itself
    Pass,
    /// All iterations since the targets last changed
    Pooled,
}

/// How steps are shared between rungs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StepsName {
    /// By measured usefulness, from earlier iterations
    Measured,
    /// Fixed shares: 2/6, 1/6, 1/6, 2/6 of four rungs
    Fixed,
}

/// What becomes of chains in scenes that do not need them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RestName {
    /// Iterations are left to independent light paths where chains are not expected to be worth their cost; needs --steps measured
    Easy,
    /// Chains draw in every iteration
    Never,
}

/// Where a target reads photon densities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DensitiesName {
    /// Every leaf of the tree, leaning on its parents where few paths came
    Blend,
    /// A cut through the tree, refined by path count and error
    Cut,
}

/// Paths that meet smooth lobes that are no deltas, and never a rough one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GlossyPaths {
    /// Path traced
    #[default]
    Keep,
    /// Left out and reported
    Drop,
}

/// Options of every method that merges photons.
#[derive(Args, Clone, Debug, Serialize, Deserialize)]
#[serde(default)]
pub struct PhotonSettings {
    /// Photon sampler
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub sampler: SamplerName,
    /// Light paths per iteration; default one a pixel, at least 100,000 for Metropolis samplers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=u64::from(u32::MAX)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photons: Option<u64>,
    /// Merge radius in world units, instead of pixel footprints
    #[arg(long, value_name = "R", conflicts_with = "radius_pixels")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Merge radius in pixel footprints; default 1
    #[arg(long, value_name = "P")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_pixels: Option<f64>,
    /// Radius schedule r (i+1)^((alpha-1)/2), in (0, 1]; 1 keeps it constant
    #[arg(long, default_value_t = 0.75, value_name = "A")]
    pub alpha: f64,
    /// Lobes at least this rough are merged at; default 0.05 for sppm and gpm, 0 (anything not a delta) for the rest
    #[arg(long, value_name = "RHO")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness_threshold: Option<f32>,
    /// Paths seen through smooth lobes that are no deltas alone
    #[arg(long, value_enum, default_value_t, value_name = "WHAT")]
    pub glossy_paths: GlossyPaths,
    /// Options of Metropolis samplers.
    #[command(flatten)]
    #[serde(flatten)]
    pub chains: ChainSettings,
}

/// Options of Metropolis samplers; none may be given with the uniform one.
#[derive(Args, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ChainSettings {
    /// Ladder of target functions, uniform first; needs --sampler kernel, image or spatial, whose target it uses
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rungs: Option<Vec<Rung>>,
    /// How rungs are joined; default mis
    #[arg(long, value_enum, value_name = "HOW")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub combine: Option<CombineName>,
    /// Proposals a chain thrown away where its targets are new: before iterations 0, 1, 2, 4, 8, ...; default 250 before 0, 64 later
    #[arg(long, value_name = "B")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub burn_in: Option<u64>,
    /// Independent ensembles of chains; default 16
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..=4096))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ensembles: Option<u64>,
    /// Acceptance that the chains' small steps are adapted to, in (0, 1); default 0.4
    #[arg(long, value_name = "A")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceptance: Option<f64>,
    /// Share of a chain's steps that redraw a path from a random vertex on, in [0, 1); default 0.15, 0 for small steps alone
    #[arg(long, value_name = "P")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub redraw: Option<f64>,
    /// Where the rungs' normalisations come from; default pooled
    #[arg(long, value_enum, value_name = "FROM")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normaliser: Option<NormaliserName>,
    /// How steps are shared between rungs; default measured
    #[arg(long, value_enum, value_name = "HOW")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<StepsName>,
    /// When chains rest; default easy with --steps measured, else never
    #[arg(long, value_enum, value_name = "WHEN")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rest: Option<RestName>,
    /// Where an image or spatial target reads densities; default blend
    #[arg(long, value_enum, value_name = "HOW")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub densities: Option<DensitiesName>,
    /// Light paths that a region needs before --densities cut refines it; default 10000
    #[arg(long, value_name = "N")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refine_paths: Option<f64>,
    /// Largest error of a region that --densities cut refines; default 0.05
    #[arg(long, value_name = "E")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refine_error: Option<f64>,
    /// Weight of a region's parent under --densities blend, in light paths; default 64
    #[arg(long, value_name = "N")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blend_paths: Option<f64>,
}

impl ChainSettings {
    fn measured(&self) -> bool {
        self.steps != Some(StepsName::Fixed)
    }
}

impl Default for PhotonSettings {
    fn default() -> Self {
        Self {
            sampler: SamplerName::Uniform,
            photons: None,
            radius: None,
            radius_pixels: None,
            alpha: 0.75,
            roughness_threshold: None,
            glossy_paths: GlossyPaths::Keep,
            chains: ChainSettings::default(),
        }
    }
}

/// Acceptance of small steps unless told. \[HACHISUKA11\] steers to 0.234, best for a target that is smooth over a step in many dimensions; what
/// counts here is how soon a chain leaves a pixel's kernel, and 0.4 was measured better (docs/methods/samplers.md).
const ACCEPTANCE: f64 = 0.4;

/// Fewest light paths an iteration of a Metropolis sampler has unless told.
const CHAIN_PHOTONS: u64 = 100_000;

/// A sampler's ladder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LadderPlan {
    /// Its targets, uniform first.
    pub rungs: Vec<Rung>,
    /// Over what its full target keeps densities.
    pub regions: RegionKind,
    /// Leaves easy scenes to independent paths.
    pub rest: bool,
}

impl LadderPlan {
    /// What the sampler is told.
    pub fn settings(&self, photons: &PhotonSettings, seed: u64) -> LadderSettings {
        let chains = &photons.chains;
        let defaults = LadderSettings::default();
        LadderSettings {
            seed,
            rungs: self.rungs.len(),
            ensembles: chains.ensembles.map_or(defaults.ensembles, |n| n as usize),
            first_burn_in: chains.burn_in.unwrap_or(defaults.first_burn_in),
            later_burn_in: chains.burn_in.unwrap_or(defaults.later_burn_in),
            acceptance: chains.acceptance.unwrap_or(ACCEPTANCE),
            redraw: chains.redraw.unwrap_or(defaults.redraw),
            combine: match chains.combine.unwrap_or(CombineName::Mis) {
                CombineName::Mis => Combine::Mis,
                CombineName::Average => Combine::Average,
                CombineName::Last => Combine::Last,
            },
            allocation: if chains.measured() { Allocation::Measured } else { Allocation::Fixed },
            normaliser: match chains.normaliser.unwrap_or(NormaliserName::Pooled) {
                NormaliserName::Pass => Normaliser::Pass,
                NormaliserName::Pooled => Normaliser::Pooled,
            },
            ..defaults
        }
    }
}

impl PhotonSettings {
    /// The sampler's ladder; `None` for the uniform one.
    pub fn ladder(&self) -> Option<LadderPlan> {
        use Rung::{Kernel, Target, Uniform, Visibility};
        let (rungs, regions) = match self.sampler {
            SamplerName::Uniform => return None,
            SamplerName::Visibility => (vec![Uniform, Visibility], RegionKind::None),
            SamplerName::Kernel => (vec![Uniform, Visibility, Kernel], RegionKind::None),
            SamplerName::Image => (vec![Uniform, Visibility, Kernel, Target], RegionKind::Image),
            SamplerName::Spatial => (vec![Uniform, Visibility, Kernel, Target], RegionKind::Space),
        };
        let rest = self.chains.measured() && self.chains.rest != Some(RestName::Never);
        Some(LadderPlan { rungs: self.chains.rungs.clone().unwrap_or(rungs), regions, rest })
    }

    /// The sampler's ladder where one world radius serves all points: kernels are of one size, and a rung that evens them out is left out
    /// unless asked for.
    pub fn ladder_of_one_radius(&self) -> Option<LadderPlan> {
        let mut plan = self.ladder()?;
        if self.chains.rungs.is_none() && plan.regions != RegionKind::None {
            plan.rungs.retain(|rung| *rung != Rung::Kernel);
        }
        Some(plan)
    }

    /// Light paths an iteration over a film of this size.
    pub fn photon_count(&self, size: (usize, usize)) -> u64 {
        let pixels = (size.0 * size.1) as u64;
        let least = if self.sampler == SamplerName::Uniform { 1 } else { CHAIN_PHOTONS };
        self.photons.unwrap_or(pixels.max(least))
    }

    /// Camera subpaths a pixel that bidirectional methods trace in an iteration unless told otherwise: one, and with chains, where
    /// light paths outnumber pixels, as many as make both sides about equally many.
    pub fn balanced_camera_paths(&self, size: (usize, usize)) -> usize {
        let pixels = (size.0 * size.1).max(1) as f64;
        match self.sampler {
            SamplerName::Uniform => 1,
            _ => (self.photon_count(size) as f64 / pixels).round().max(1.0) as usize,
        }
    }

    /// Where densities are read.
    pub fn refinement(&self) -> Refinement {
        let chains = &self.chains;
        match chains.densities.unwrap_or(DensitiesName::Blend) {
            DensitiesName::Blend => Refinement::Blend { strength: chains.blend_paths.unwrap_or(64.0) },
            DensitiesName::Cut => {
                Refinement::Cut { paths: chains.refine_paths.unwrap_or(10_000.0), error: chains.refine_error.unwrap_or(0.05) }
            }
        }
    }

    /// What is wrong with the settings, if anything.
    pub fn validate(&self) -> Result<(), String> {
        let positive = |name: &str, value: Option<f64>| match value {
            Some(v) if !(v.is_finite() && v > 0.0) => Err(format!("--{name} must be a positive number, not {v}")),
            _ => Ok(()),
        };
        positive("radius", self.radius)?;
        positive("radius-pixels", self.radius_pixels)?;
        positive("refine-paths", self.chains.refine_paths)?;
        positive("refine-error", self.chains.refine_error)?;
        positive("blend-paths", self.chains.blend_paths)?;
        if self.radius.is_some() && self.radius_pixels.is_some() {
            return Err("give radius or radius-pixels, not both".into());
        }
        if !(self.alpha > 0.0 && self.alpha <= 1.0) {
            return Err(format!("--alpha must lie in (0, 1], not {}", self.alpha));
        }
        if self.photons == Some(0) {
            return Err("--photons must be at least 1".into());
        }
        match self.roughness_threshold {
            Some(rho) if !(0.0..=1.0).contains(&rho) => return Err(format!("--roughness-threshold must lie in [0, 1], not {rho}")),
            _ => {}
        }
        self.validate_chains()
    }

    fn validate_chains(&self) -> Result<(), String> {
        let chains = &self.chains;
        if self.sampler == SamplerName::Uniform && *chains != ChainSettings::default() {
            return Err(
                "rungs, combine, burn-in, ensembles, acceptance, redraw, normaliser, steps, rest and the options of densities belong to Metropolis \
                        samplers: give --sampler visibility, kernel, image or spatial"
                    .into(),
            );
        }
        if let Some(rungs) = &chains.rungs {
            if self.sampler == SamplerName::Visibility {
                return Err("--rungs needs --sampler kernel, image or spatial, whose target it uses".into());
            }
            if rungs.first() != Some(&Rung::Uniform) || !rungs.is_sorted_by(|a, b| a < b) {
                return Err("--rungs must begin with uniform and go on in the order visibility, kernel, target, each at most once".into());
            }
        }
        if let Some(a) = chains.acceptance
            && !(a > 0.0 && a < 1.0)
        {
            return Err(format!("--acceptance must lie in (0, 1), not {a}"));
        }
        if let Some(p) = chains.redraw
            && !(0.0..1.0).contains(&p)
        {
            return Err(format!("--redraw must lie in [0, 1), not {p}"));
        }
        if chains.ensembles.is_some_and(|n| !(2..=4096).contains(&n)) {
            return Err("--ensembles must lie in 2..4096".into());
        }
        if chains.rest == Some(RestName::Easy) && !chains.measured() {
            return Err("--rest easy needs --steps measured, which tells what chains are worth".into());
        }
        Ok(())
    }
}
