//! What an EXR file says about how it was made.

use crate::image::metrics::{METRICS, Measured, Pairs};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Version of the metadata's layout.
pub const SCHEMA: u32 = 1;

/// Key of the pixels left out, in [`ErrorRecord::values`].
pub const MASKED: &str = "masked";

/// Which scene.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneRecord {
    /// Path as given.
    pub path: String,
    /// Hash over the XML and every file it names.
    pub hash: String,
}

/// What one seed contributed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// The seed.
    pub seed: u64,
    /// Half-open ranges of iterations, ascending.
    pub ranges: Vec<[u64; 2]>,
}

/// How far the image was from the reference on the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorRecord {
    /// Iterations in the film.
    pub iteration: u64,
    /// Render time until then.
    pub seconds: f64,
    /// Value by metric; `null` where none could be computed. `masked`: pixels that are not finite, where there are some.
    #[serde(flatten)]
    pub values: Map<String, Value>,
}

impl ErrorRecord {
    /// Measures with every metric.
    pub fn measure(iteration: u64, seconds: f64, pairs: &Pairs, epsilon: f64) -> Self {
        let mut values = Map::new();
        for metric in METRICS {
            let Measured { value, .. } = metric.measure(pairs, epsilon);
            values.insert(metric.name.to_string(), value.into());
        }
        if pairs.masked() > 0 {
            values.insert(MASKED.to_string(), pairs.masked().into());
        }
        Self { iteration, seconds, values }
    }
}

/// The header attribute `isophote`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// The scene.
    pub scene: SceneRecord,
    /// The method's name.
    pub method: String,
    /// All settings that decide the image but the seed and the iterations; keys are the long option names with underscores.
    pub settings: Value,
    /// Merge radius of the first iteration in world units, where there is one for all vertices.
    pub radius: Option<f64>,
    /// Seeds and their iterations.
    pub runs: Vec<Run>,
    /// Render time: wall seconds of preparing and iterating.
    pub seconds: f64,
    /// Processor seconds over the same spans, all threads.
    pub cpu_seconds: f64,
    /// Threads used.
    pub threads: usize,
    /// Light subpaths, burn-in and start-up counted.
    pub light_paths: u64,
    /// Camera subpaths.
    pub camera_paths: u64,
    /// Rays traced.
    pub rays: u64,
    /// Samples that gave no usable number, by cause.
    pub rejected: BTreeMap<String, u64>,
    /// Error against the reference on the way.
    pub errors: Vec<ErrorRecord>,
    /// What the method tells of itself, by its own keys; `null` if it has nothing to tell.
    #[serde(default)]
    pub diagnostics: Option<Value>,
}

impl Metadata {
    /// Before anything is rendered.
    pub fn new(scene: SceneRecord, method: &str, settings: Value) -> Self {
        Self {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION").to_string(),
            scene,
            method: method.to_string(),
            settings,
            radius: None,
            runs: Vec::new(),
            seconds: 0.0,
            cpu_seconds: 0.0,
            threads: 1,
            light_paths: 0,
            camera_paths: 0,
            rays: 0,
            rejected: BTreeMap::new(),
            errors: Vec::new(),
            diagnostics: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::picture::Picture;
    use crate::math::Rgb;

    #[test]
    fn the_keys_are_those_of_the_interface_and_come_back() {
        let mut metadata = Metadata::new(SceneRecord::default(), "path", serde_json::json!({"alpha": 0.75}));
        let picture = Picture::new(1, 1, vec![Rgb::WHITE]);
        let pairs = Pairs::new(&picture, &picture).expect("one size");
        metadata.errors.push(ErrorRecord::measure(4, 0.1, &pairs, 0.01));
        metadata.radius = Some(0.1 + 0.2);
        let value = serde_json::to_value(&metadata).expect("JSON");
        let keys: Vec<&str> = value.as_object().expect("an object").keys().map(String::as_str).collect();
        let expected = "schema version scene method settings radius runs seconds cpu_seconds threads light_paths camera_paths rays rejected \
                        errors diagnostics";
        assert_eq!(keys.join(" "), expected);
        assert!(value["errors"][0]["relmse_trimmed"].is_number() && value["errors"][0].get("masked").is_none());
        let back: Metadata = serde_json::from_str(&value.to_string()).expect("metadata");
        assert_eq!(back, metadata);
    }
}
