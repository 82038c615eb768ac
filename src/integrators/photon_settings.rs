//! Settings that photon methods share.

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

/// Who draws the light paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SamplerName {
    /// Independent light paths.
    #[default]
    Uniform,
}

/// Options of every method that merges photons.
#[derive(Args, Clone, Debug, Serialize, Deserialize)]
#[serde(default)]
pub struct PhotonSettings {
    /// Photon sampler
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub sampler: SamplerName,
    /// Light paths per iteration; default one a pixel
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
}

impl Default for PhotonSettings {
    fn default() -> Self {
        Self { sampler: SamplerName::Uniform, photons: None, radius: None, radius_pixels: None, alpha: 0.75, roughness_threshold: None }
    }
}

impl PhotonSettings {
    /// What is wrong with the numbers, if anything.
    pub fn validate(&self) -> Result<(), String> {
        let positive = |name: &str, value: Option<f64>| match value {
            Some(v) if !(v.is_finite() && v > 0.0) => Err(format!("--{name} must be a positive number, not {v}")),
            _ => Ok(()),
        };
        positive("radius", self.radius)?;
        positive("radius-pixels", self.radius_pixels)?;
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
            Some(rho) if !(0.0..=1.0).contains(&rho) => Err(format!("--roughness-threshold must lie in [0, 1], not {rho}")),
            _ => Ok(()),
        }
    }
}
