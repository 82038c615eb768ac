//! What a render changes of a scene's own wishes, and all settings together as the metadata has them. One form for commands and studies.

use crate::integrators::{BoxedSettings, Common};
use crate::scene::mitsuba::{FilmSize, LoadOptions, RenderDefaults};
use crate::transport::class::typed;
use serde_json::{Map, Value, json};
use std::str::FromStr;

/// `WxH`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Pixels across, positive.
    pub width: u32,
    /// Pixels down, positive.
    pub height: u32,
}

impl FromStr for Resolution {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let size = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
        match size {
            Some((width, height)) if width > 0 && height > 0 => Ok(Self { width, height }),
            _ => Err("expected WIDTHxHEIGHT in pixels, as in 640x480".to_string()),
        }
    }
}

/// `X,Y,W,H`: left, top, width, height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop(pub [u32; 4]);

impl FromStr for Crop {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Self([x, y, width, height])),
            _ => Err("expected LEFT,TOP,WIDTH,HEIGHT in pixels, as in 100,50,64,64".to_string()),
        }
    }
}

/// Everything common to all methods that a command or a study may change of a scene.
#[derive(Clone, Debug)]
pub struct Changes {
    /// Size of the film.
    pub resolution: Option<Resolution>,
    /// Window of the film.
    pub crop: Option<Crop>,
    /// `(name, value)` fills `$name`.
    pub define: Vec<(String, String)>,
    /// Most path edges, -1 without limit; `None` is the scene's.
    pub max_depth: Option<i64>,
    /// Fewest path edges that count.
    pub min_depth: u32,
    /// Emitters do not show, whatever the scene says.
    pub hide_emitters: bool,
    /// Only paths of this class.
    pub paths: Option<regex::Regex>,
}

impl Default for Changes {
    fn default() -> Self {
        Self { resolution: None, crop: None, define: Vec::new(), max_depth: None, min_depth: 1, hide_emitters: false, paths: None }
    }
}

impl Changes {
    /// What of it the loader needs.
    pub fn load_options(&self) -> LoadOptions {
        LoadOptions { defines: self.define.clone(), resolution: self.resolution.map(|r| (r.width, r.height)), crop: self.crop.map(|c| c.0) }
    }

    /// What a method is told, for a scene with these defaults.
    pub fn common(&self, seed: u64, defaults: &RenderDefaults) -> Common {
        Common {
            seed,
            max_depth: self.max_depth.map_or(defaults.max_depth, |depth| u32::try_from(depth).ok()),
            min_depth: self.min_depth,
            rr_depth: defaults.rr_depth,
            hide_emitters: self.hide_emitters || defaults.hide_emitters,
            paths: self.paths.clone(),
        }
    }

    /// The method's settings and all others that decide the image but the seed, for the metadata.
    pub fn settings_json(&self, settings: &dyn BoxedSettings, common: &Common, film: &FilmSize) -> Value {
        let mut all = match settings.to_json() {
            Value::Object(map) => map,
            _ => Map::new(),
        };
        all.extend(self.shared_json(common, film));
        Value::Object(all)
    }

    /// Those settings that are not the method's own.
    pub fn shared_json(&self, common: &Common, film: &FilmSize) -> Map<String, Value> {
        let define: Map<String, Value> = self.define.iter().map(|(name, value)| (name.clone(), value.clone().into())).collect();
        let shared = json!({
            "resolution": [film.width, film.height],
            "crop": film.crop,
            "max_depth": common.max_depth.map_or(-1, i64::from),
            "min_depth": common.min_depth,
            "rr_depth": common.rr_depth,
            "hide_emitters": common.hide_emitters,
            "paths": common.paths.as_ref().map(typed),
            "define": define,
        });
        match shared {
            Value::Object(shared) => shared,
            _ => Map::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_windows_are_read_and_mistakes_refused() {
        assert_eq!("640x480".parse(), Ok(Resolution { width: 640, height: 480 }));
        assert_eq!("1,2,3,4".parse(), Ok(Crop([1, 2, 3, 4])));
        for text in ["640", "0x1", "x", "-1x2", "64x64x64"] {
            assert!(text.parse::<Resolution>().is_err(), "{text}");
        }
        for text in ["1,2,3", "1,2,0,4", "a,b,c,d"] {
            assert!(text.parse::<Crop>().is_err(), "{text}");
        }
    }
}
