//! What `vcm` and `bdpt` are told.

use super::super::photon_settings::{ChainSettings, CombineName, GlossyPaths, PhotonSettings, SamplerName};
use super::super::{Common, Integrator, MethodError, Settings};
use super::technique::{Technique, TechniqueName};
use super::{Engine, EngineSettings};
use crate::scene::Scene;
use crate::transport::mis::{Heuristic, MergeWeights, Techniques};
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

/// How merges are weighed against connections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MergeWeightsName {
    /// Balance heuristic
    #[default]
    Balance,
    /// Power heuristic with the exponent --beta
    Power,
    /// Merges count for less where many photons lie (Jendersie and Grosch 2018)
    VcmPlus,
    /// The same relative to the whole path's merges
    VcmStar,
}

/// So many that stratified numbers last for a while.
const MOST_CAMERA_PATHS: i64 = 4096;

/// What `vcm` and `bdpt` are told alike.
#[derive(Args, Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SharedSettings {
    /// Camera paths a pixel and iteration; default one, and with Metropolis samplers about as many camera paths as light paths
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_CAMERA_PATHS))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_paths: Option<u32>,
    /// One technique, with weight 1: for tests.
    #[arg(long, hide = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alone: Option<Technique>,
}

impl SharedSettings {
    /// What the command line refuses by itself, for studies.
    fn validate(&self) -> Result<(), String> {
        match self.camera_paths {
            Some(paths) if !(1..=MOST_CAMERA_PATHS).contains(&i64::from(paths)) => {
                Err(format!("--camera-paths is {paths}: give 1 to {MOST_CAMERA_PATHS}, or leave it out"))
            }
            _ => Ok(()),
        }
    }
}

/// Settings of `vcm`.
#[derive(Args, Clone, Debug, Serialize, Deserialize)]
#[serde(default)]
pub struct VcmSettings {
    /// Techniques that take part
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["vc", "vm", "lt"], value_name = "LIST")]
    pub techniques: Vec<TechniqueName>,
    /// How merges are weighed against connections
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    pub merge_weights: MergeWeightsName,
    /// Exponent of the heuristic; anything but 1 with balance is refused
    #[arg(long, default_value_t = 1.0, value_name = "B")]
    pub beta: f64,
    /// Options of both methods.
    #[command(flatten)]
    #[serde(flatten)]
    pub shared: SharedSettings,
    /// Photon options.
    #[command(flatten)]
    #[serde(flatten)]
    pub photons: PhotonSettings,
}

impl Default for VcmSettings {
    fn default() -> Self {
        Self {
            techniques: vec![TechniqueName::Vc, TechniqueName::Vm, TechniqueName::Lt],
            merge_weights: MergeWeightsName::Balance,
            beta: 1.0,
            shared: SharedSettings::default(),
            photons: PhotonSettings::default(),
        }
    }
}

impl VcmSettings {
    fn set(&self) -> Result<Techniques, String> {
        let count = |name| self.techniques.iter().filter(|&&t| t == name).count();
        let [vc, vm, lt] = [TechniqueName::Vc, TechniqueName::Vm, TechniqueName::Lt].map(count);
        if self.techniques.is_empty() || vc.max(vm).max(lt) > 1 {
            return Err("--techniques needs one or more of vc, vm, lt, each at most once".into());
        }
        Ok(Techniques { connections: vc > 0, merges: vm > 0, light_tracing: lt > 0 })
    }

    fn heuristic(&self) -> Result<Heuristic, String> {
        let merges = match self.merge_weights {
            MergeWeightsName::Balance => MergeWeights::Balance,
            MergeWeightsName::Power => MergeWeights::Power,
            MergeWeightsName::VcmPlus => MergeWeights::VcmPlus,
            MergeWeightsName::VcmStar => MergeWeights::VcmStar,
        };
        Heuristic::new(merges, self.beta).map_err(|e| e.to_string())
    }

    fn check(&self) -> Result<(), String> {
        self.photons.validate()?;
        self.shared.validate()?;
        whole_mixture(&self.photons)?;
        let asks_map = matches!(self.merge_weights, MergeWeightsName::VcmPlus | MergeWeightsName::VcmStar);
        if asks_map && self.photons.sampler != SamplerName::Uniform {
            return Err(
                "--merge-weights vcm-plus and vcm-star count independent photons: give --sampler uniform, or --merge-weights balance \
                        or power"
                    .into(),
            );
        }
        if self.photons.glossy_paths != GlossyPaths::Keep {
            return Err("--glossy-paths drop is for sppm: here every path is counted by some technique".into());
        }
        Ok(())
    }
}

/// Connections, and merges at later camera vertices, need light paths that no target likes: independent ones alone draw them, and weights
/// that are not the mixture's count them wrong.
fn whole_mixture(photons: &PhotonSettings) -> Result<(), String> {
    match photons.chains.combine {
        Some(CombineName::Average) => {
            Err("--combine average leaves out light paths that no target likes, which are needed here: give mis".into())
        }
        Some(CombineName::Last) => {
            Err("--combine last leaves out light paths that no target likes, which are needed here: give mis".into())
        }
        Some(CombineName::Mis) | None => Ok(()),
    }
}

impl Settings for VcmSettings {
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError> {
        let settings = |message| MethodError::Settings { method: "vcm", message };
        self.check().map_err(settings)?;
        let (techniques, heuristic) = (self.set().map_err(settings)?, self.heuristic().map_err(settings)?);
        let (photons, SharedSettings { camera_paths, alone }) = (self.photons.clone(), self.shared.clone());
        Ok(Box::new(Engine::new(scene, size, common, EngineSettings { techniques, heuristic, photons, camera_paths, alone })))
    }
}

/// Settings of `bdpt`: the engine without merges.
#[derive(Args, Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct BdptSettings {
    /// Photon sampler
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub sampler: SamplerName,
    /// Light paths per iteration; default one a pixel, at least 100,000 for Metropolis samplers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=u64::from(u32::MAX)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photons: Option<u64>,
    /// Options of both methods.
    #[command(flatten)]
    #[serde(flatten)]
    pub shared: SharedSettings,
    /// Options of Metropolis samplers.
    #[command(flatten)]
    #[serde(flatten)]
    pub chains: ChainSettings,
}

impl Settings for BdptSettings {
    fn build<'a>(&self, scene: &'a Scene, size: (usize, usize), common: &Common) -> Result<Box<dyn Integrator + 'a>, MethodError> {
        let (sampler, chains) = (self.sampler, self.chains.clone());
        let photons = PhotonSettings { sampler, photons: self.photons, chains, ..PhotonSettings::default() };
        let checked = photons.validate().and_then(|()| self.shared.validate()).and_then(|()| whole_mixture(&photons));
        checked.map_err(|message| MethodError::Settings { method: "bdpt", message })?;
        let (techniques, heuristic) = (Techniques::BDPT, Heuristic::default());
        let SharedSettings { camera_paths, alone } = self.shared.clone();
        Ok(Box::new(Engine::new(scene, size, common, EngineSettings { techniques, heuristic, photons, camera_paths, alone })))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn camera_paths_of_a_study_are_checked() {
        for (paths, fine) in [(None, true), (Some(1), true), (Some(4096), true), (Some(0), false), (Some(4097), false)] {
            let shared = SharedSettings { camera_paths: paths, alone: None };
            assert_eq!(shared.validate().is_ok(), fine, "{paths:?}");
            assert_eq!(VcmSettings { shared, ..VcmSettings::default() }.check().is_ok(), fine, "{paths:?}");
        }
    }
}
