//! The definition of the weights of vertex connection and merging: every technique's density of a full path, multiplied out, and the
//! weights that a heuristic makes of them. Slow and plain: [`mis`](super::mis) is the fast form and is held against this one.
//!
//! A path with `k` edges has vertices `x_0` on the light to `x_k`, the camera. The connection `s` makes `x_0..x_{s-1}` from the light
//! and `x_s..x_k` from the camera: 0 hits an emitter, 1 is next event estimation, `k` is light tracing. The merge `i` makes `x_i` from
//! both sides: the density of connection `i`, times the light side's density of `x_i`, times the merge's area ([THESIS (2.44), (2.60)]).
//!
//! **Densities** are per area, those of the light's end in the light's own measure:
//!
//! | light | density of `x_0` | density of `x_1` from `x_0` |
//! |---|---|---|
//! | surface | per area | per area |
//! | position without area (point, spot) | 1 | per area |
//! | single direction from infinity | 1 | per area: that on the disk of emission times the cosine at `x_1` |
//! | all around | per steradian | per area: the same |
//!
//! each with the probability of choosing the emitter, and each with the survival in Russian roulette that the walk had. Deltas of a
//! position or direction are left out: every technique but the emitter hit, which then has density 0, has the same.
//!
//! **Smooth scattering** at `x_i` puts the same delta into every technique that can make the path; it is left out as well. What is left
//! has to be in one measure from both sides: per steradian on the side of `x_{i-1}`. So the density of `x_{i-1}` from `x_i` is the
//! event's probability times the geometry, and that of `x_{i+1}` is divided by `d omega_{i+1} / d omega_{i-1}`, which is
//! 1 in reflection ([`Scatter::refraction`](super::mis::Scatter::refraction) says more).

pub mod scene;

use super::mis::Sampling;

/// What is known of one vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathVertex {
    /// Density with which the light side makes it from its predecessor; at the camera, which no walk finds, never asked for.
    pub from_light: f64,
    /// Density with which the camera side makes it from its successor: for the last vertex before the camera that of one pixel, at the
    /// camera 1, and 0 on a light that no walk finds.
    pub from_camera: f64,
    /// The event here is a delta: no connection ends here. False at both ends of the path.
    pub delta: bool,
    /// A merge is evaluated here. False where `delta` is true, and at both ends.
    pub merges: bool,
    /// Expected number of photons that a merge here finds in an iteration, positive. Asked for where `merges` is true, by heuristics that
    /// ask ([`Heuristic::asks_density`](super::mis::Heuristic::asks_density)).
    pub photons: f64,
}

/// A full path, from the light to the camera, at least one edge.
#[derive(Clone, Debug, PartialEq)]
pub struct FullPath {
    vertices: Vec<PathVertex>,
    direct: f64,
}

/// Numbers that describe no path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PathError {
    /// Too short.
    #[error("a path needs a light and a camera; this one has {0} vertices")]
    Short(usize),
    /// A vertex cannot be what it is said to be.
    #[error("vertex {0} of the path is an end or a delta and yet merges, or is an end and a delta: set these to false")]
    Event(usize),
    /// A density is impossible.
    #[error("{what} of vertex {vertex} is {value}: densities and photon numbers must be finite and not negative, photon numbers positive")]
    Number {
        /// Vertex, counted from the light.
        vertex: usize,
        /// What the number is.
        what: &'static str,
        /// The number.
        value: f64,
    },
}

/// The weight of every technique.
#[derive(Clone, Debug, PartialEq)]
pub struct PathWeights {
    /// By connection, 0 to `k`.
    pub connections: Vec<f64>,
    /// By merging vertex, 0 to `k`; 0 at both ends.
    pub merges: Vec<f64>,
}

impl PathWeights {
    /// The sum of all: 1 where any technique can make the path, else 0.
    pub fn total(&self) -> f64 {
        self.connections.iter().chain(&self.merges).sum()
    }
}

impl FullPath {
    /// Checks the vertices, light first. `direct` is the density with which next event estimation at `x_1` chooses `x_0`, in the light's own
    /// measure; it may differ from that of emission.
    pub fn new(vertices: Vec<PathVertex>, direct: f64) -> Result<Self, PathError> {
        let last = vertices.len().saturating_sub(1);
        if last == 0 {
            return Err(PathError::Short(vertices.len()));
        }
        let valid = |x: f64| x.is_finite() && x >= 0.0;
        let number = |vertex, what, value| Err(PathError::Number { vertex, what, value });
        for (i, v) in vertices.iter().enumerate() {
            let end = i == 0 || i == last;
            if v.merges && (end || v.delta) || v.delta && end {
                return Err(PathError::Event(i));
            }
            if !valid(v.from_light) {
                return number(i, "the light side's density", v.from_light);
            }
            if !valid(v.from_camera) {
                return number(i, "the camera side's density", v.from_camera);
            }
            if v.merges && !(valid(v.photons) && v.photons > 0.0) {
                return number(i, "the photon number", v.photons);
            }
        }
        if !valid(direct) {
            return number(0, "the density of direct sampling", direct);
        }
        Ok(Self { vertices, direct })
    }

    /// Edges, `k`.
    pub fn edges(&self) -> usize {
        self.vertices.len() - 1
    }

    /// The vertices, light first.
    pub fn vertices(&self) -> &[PathVertex] {
        &self.vertices
    }

    /// Product of the densities of `x_0..x_{s-1}` from the light and `x_s..x_k` from the camera, [THESIS (2.44)].
    fn split(&self, s: usize) -> f64 {
        let (light, camera) = self.vertices.split_at(s);
        light.iter().map(|v| v.from_light).product::<f64>() * camera.iter().map(|v| v.from_camera).product::<f64>()
    }

    /// Can two subpaths be joined between `x_{s-1}` and `x_s`? Not at a delta, and not from light to camera: light seen directly is left
    /// to the emitter hit.
    fn joins(&self, s: usize) -> bool {
        s >= 1 && self.edges() > 1 && self.vertices.get(s).is_some_and(|v| !v.delta) && !self.vertices[s - 1].delta
    }

    /// The density of connection `s`, of one sample of it; 0 where it cannot make the path, and for `s > k`.
    pub fn connection(&self, s: usize) -> f64 {
        match s {
            0 => self.split(0),
            1 if self.joins(1) => self.direct * self.vertices[1..].iter().map(|v| v.from_camera).product::<f64>(),
            _ if self.joins(s) => self.split(s),
            _ => 0.0,
        }
    }

    /// The density of a merge at `x_i` per area of the merge, of one light path; 0 where no merge is evaluated.
    pub fn merge(&self, i: usize) -> f64 {
        match self.vertices.get(i) {
            Some(v) if v.merges => self.split(i) * v.from_light,
            _ => 0.0,
        }
    }

    /// Is an emitter hit among the techniques of the set?
    fn hit_counts(&self, sampling: &Sampling) -> bool {
        let splat = sampling.techniques.light_tracing && self.connection(self.edges()) > 0.0;
        sampling.techniques.connections || !splat && self.vertices.iter().all(|v| !v.merges)
    }

    /// Every technique's share of the path: the terms `(samples * density)^beta` over their sum ([VEACH 9.2], [THESIS (2.11)]).
    ///
    /// All terms are multiplied out in f64, so a path whose densities multiply to more than 1e300 or less than 1e-300 is out of reach.
    pub fn weights(&self, sampling: &Sampling) -> PathWeights {
        let Sampling { techniques, heuristic, light_paths, camera_paths, .. } = *sampling;
        let edges = self.edges();
        let samples = |s: usize| match s {
            0 => f64::from(self.hit_counts(sampling)),
            _ if s == edges => light_paths / camera_paths * f64::from(techniques.light_tracing),
            _ => f64::from(techniques.connections),
        };
        let mut connections: Vec<f64> = (0..=edges).map(|s| samples(s) * self.connection(s)).collect();
        let mut merges = vec![0.0; edges + 1];
        if techniques.merges {
            let places: Vec<usize> = (0..=edges).filter(|&i| self.vertices[i].merges).collect();
            let photons: Vec<f64> = places.iter().map(|&i| self.vertices[i].photons).collect();
            for (&i, samples) in places.iter().zip(heuristic.samples(light_paths, &photons)) {
                merges[i] = samples * sampling.merge_area() * self.merge(i);
            }
        }
        let mut terms: Vec<&mut f64> = connections.iter_mut().chain(&mut merges).collect();
        // The largest term is taken out first, so that no power leaves the range.
        let largest = terms.iter().fold(0.0, |m: f64, t| m.max(**t));
        if largest > 0.0 {
            terms.iter_mut().for_each(|t| **t = (**t / largest).powf(heuristic.beta()));
            let sum: f64 = terms.iter().map(|t| **t).sum();
            terms.iter_mut().for_each(|t| **t /= sum);
        }
        PathWeights { connections, merges }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::mis::{Heuristic, MergeWeights, Techniques};

    /// Densities that are easy to follow: `2, 3, 5, ..` from the light, `7, 11, ..` from the camera.
    fn path(events: &str, direct: f64) -> FullPath {
        let from_light = [2.0, 3.0, 5.0, 13.0];
        let from_camera = [7.0, 11.0, 17.0, 1.0];
        let edges = events.len() + 1;
        let mut vertices: Vec<PathVertex> = std::iter::once('L')
            .chain(events.chars())
            .chain(std::iter::once('E'))
            .enumerate()
            .map(|(i, event)| PathVertex {
                from_light: from_light[i],
                from_camera: if i == edges { 1.0 } else { from_camera[i] },
                delta: event == 'S',
                merges: event == 'D',
                photons: (i + 1) as f64,
            })
            .collect();
        vertices[edges].from_light = 0.0;
        FullPath::new(vertices, direct).unwrap()
    }

    fn sampling(techniques: Techniques, merges: MergeWeights, beta: f64) -> Sampling {
        // An area of 0.01, 100 light paths.
        let radius = (0.01 / std::f64::consts::PI).sqrt();
        Sampling { techniques, heuristic: Heuristic::new(merges, beta).unwrap(), light_paths: 100.0, camera_paths: 1.0, radius }
    }

    fn close(a: &[f64], b: &[f64]) {
        assert_eq!(a.len(), b.len());
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * b.abs()), "{a:?} is not {b:?}");
    }

    #[test]
    fn densities_are_products() {
        let p = path("DD", 23.0);
        close(
            &[p.connection(0), p.connection(1), p.connection(2), p.connection(3)],
            &[7.0 * 11.0 * 17.0, 23.0 * 11.0 * 17.0, 2.0 * 3.0 * 17.0, 2.0 * 3.0 * 5.0],
        );
        close(&[p.merge(0), p.merge(1), p.merge(2), p.merge(3)], &[0.0, 2.0 * 11.0 * 17.0 * 3.0, 2.0 * 3.0 * 17.0 * 5.0, 0.0]);
        assert_eq!((p.connection(4), p.merge(4)), (0.0, 0.0));
    }

    #[test]
    fn deltas_are_not_connected() {
        let p = path("SD", 23.0);
        close(&[p.connection(0), p.connection(1), p.connection(2), p.connection(3)], &[7.0 * 11.0 * 17.0, 0.0, 0.0, 30.0]);
        close(&[p.merge(1), p.merge(2)], &[0.0, 2.0 * 3.0 * 17.0 * 5.0]);
        let p = path("DS", 23.0);
        close(&[p.connection(1), p.connection(2), p.connection(3)], &[23.0 * 11.0 * 17.0, 0.0, 0.0]);
    }

    /// `L D E` by hand: hit 77, next event 23 * 11, splat 100 * 2 * 3, merge 100 * 0.01 * 2 * 3 * 11.
    #[test]
    fn weights_are_shares_of_powers() {
        let p = path("D", 23.0);
        for beta in [1.0, 2.0] {
            let merges = if beta == 1.0 { MergeWeights::Balance } else { MergeWeights::Power };
            let w = p.weights(&sampling(Techniques::VCM, merges, beta));
            let terms = [77.0, 253.0, 600.0, 66.0].map(|x: f64| x.powf(beta));
            let sum: f64 = terms.iter().sum();
            close(&w.connections, &[terms[0] / sum, terms[1] / sum, terms[2] / sum]);
            close(&w.merges, &[0.0, terms[3] / sum, 0.0]);
            close(&[w.total()], &[1.0]);
        }
        // Two photons found at the vertex: half as many samples; and all of them where the mean along the path is taken out.
        let terms = [77.0, 253.0, 600.0, 33.0];
        let plus = p.weights(&sampling(Techniques::VCM, MergeWeights::VcmPlus, 1.0));
        close(&[plus.merges[1]], &[33.0 / terms.iter().sum::<f64>()]);
        let star = p.weights(&sampling(Techniques::VCM, MergeWeights::VcmStar, 1.0));
        close(&[star.merges[1]], &[66.0 / 996.0]);
    }

    /// `L D E` as above with four camera paths a pixel: a splat is worth a quarter of what it was beside one sample of anything else.
    #[test]
    fn splats_are_shared_by_a_pixels_camera_paths() {
        let sampling = Sampling { camera_paths: 4.0, ..sampling(Techniques::VCM, MergeWeights::Balance, 1.0) };
        let w = path("D", 23.0).weights(&sampling);
        let sum = 77.0 + 253.0 + 150.0 + 66.0;
        close(&w.connections, &[77.0 / sum, 253.0 / sum, 150.0 / sum]);
        close(&w.merges, &[0.0, 66.0 / sum, 0.0]);
    }

    #[test]
    fn sets_leave_techniques_out() {
        let weights = |events: &str, set| path(events, 23.0).weights(&sampling(set, MergeWeights::Balance, 1.0));
        let only = |w: PathWeights| (w.connections, w.merges);
        // Light seen directly.
        for set in [Techniques::VCM, Techniques::BDPT, Techniques::BPM, Techniques::LIGHT_TRACING] {
            assert_eq!(only(weights("", set)), (vec![1.0, 0.0], vec![0.0, 0.0]));
        }
        assert_eq!(only(weights("D", Techniques::BPM)), (vec![0.0, 0.0, 0.0], vec![0.0, 1.0, 0.0]));
        assert_eq!(only(weights("D", Techniques::LIGHT_TRACING)), (vec![0.0, 0.0, 1.0], vec![0.0; 3]));
        // A lamp in a mirror is what hits are left for; a caustic in a mirror is not for light tracing.
        assert_eq!(only(weights("S", Techniques::BPM)), (vec![1.0, 0.0, 0.0], vec![0.0; 3]));
        assert_eq!(only(weights("S", Techniques::LIGHT_TRACING)), (vec![1.0, 0.0, 0.0], vec![0.0; 3]));
        assert_eq!(weights("DS", Techniques::LIGHT_TRACING).total(), 0.0);
        let bdpt = weights("D", Techniques::BDPT);
        close(&bdpt.connections, &[77.0 / 930.0, 253.0 / 930.0, 600.0 / 930.0]);
        assert_eq!(bdpt.merges, [0.0; 3]);
    }

    #[test]
    fn impossible_numbers_are_refused() {
        let good = path("D", 1.0);
        let changed = |change: &dyn Fn(&mut Vec<PathVertex>)| {
            let mut vertices = good.vertices().to_vec();
            change(&mut vertices);
            FullPath::new(vertices, 1.0)
        };
        assert!(changed(&|_| ()).is_ok());
        assert_eq!(changed(&|v| v.truncate(1)), Err(PathError::Short(1)));
        assert_eq!(changed(&|v| v.clear()), Err(PathError::Short(0)));
        assert_eq!(changed(&|v| v[1].delta = true), Err(PathError::Event(1)));
        assert_eq!(changed(&|v| v[0].delta = true), Err(PathError::Event(0)));
        assert_eq!(changed(&|v| v[2].merges = true), Err(PathError::Event(2)));
        assert!(matches!(changed(&|v| v[1].from_light = -1.0), Err(PathError::Number { vertex: 1, .. })));
        assert!(matches!(changed(&|v| v[0].from_camera = f64::NAN), Err(PathError::Number { vertex: 0, .. })));
        assert!(matches!(changed(&|v| v[1].photons = 0.0), Err(PathError::Number { vertex: 1, .. })));
        assert!(FullPath::new(good.vertices().to_vec(), f64::INFINITY).is_err());
    }
}
