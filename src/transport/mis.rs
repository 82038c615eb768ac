//! Weights of vertex connection and merging without the full path at hand: what a subpath carries from vertex to vertex, and the weight
//! of every technique from what two ends carry. [`densities`](super::densities) defines what comes out; the two are held together by test.
//!
//! A walk keeps one [`Carried`] a vertex: [`Weights::from_light`] or [`Weights::from_camera`] makes that of the first vertex met,
//! [`Weights::extend`] every next one. [`LightEnd`] asks the scene for the light's numbers. Where two subpaths meet, [`Weights::connection`], [`Weights::next_event`],
//! [`Weights::emitter_hit`], [`Weights::splat`] and [`Weights::merge`] say what the technique at hand weighs against all others.
//!
//! The recursion is that of \[VCM-TR\] and [THESIS (2.50), (2.51)], with connections and merges carried apart. So every vertex may have its
//! own factor on merges ([VCM* (6)]), and a factor that only the full path knows ([VCM* (7)]) is multiplied on at the join:
//!
//! ```text
//! last_i        = n_i / p(x_i)
//! connections_i = (back / (fwd ahead)) [last_{i-1}    + rev connections_{i-1}]
//! merges_i      = (back / (fwd ahead)) [share_{i-1}   + rev merges_{i-1}]
//! at the join:    found [last_i + rev connections_i + g (share_i + rev merges_i)],     g = pi r^2 N m / S
//! ```
//!
//! `n_i` is the number of samples of the connection across the edge that led to `x_i`; `fwd` and `rev` are densities per steradian at
//! `x_{i-1}` of going on and of going back; `ahead` and `back` the edge's factors from steradians to area at its two ends; `share` is 1,
//! or one over the photons a merge finds; `m / S` is one over the mean share of the path where the heuristic asks for it, else 1. With an
//! exponent, every factor and every term is raised to it, but `S` and `m` are sums of plain shares.
//!
//! **Range.** Ratios of densities are carried, raised to the exponent; they grow with the world's unit squared. In f32 and with exponent 2,
//! paths of ten edges, of edges up to 3,000 units long, lose weights below 1e-20 and no others: an overflow on one side makes a weight 0.
//! A direction of a density below 1e-15 per steradian, in a lobe's far tail, may make one that is not a number; walks count these as
//! rejected. Longer units or larger exponents ask for f64.

mod carried;
mod heuristic;
mod light_end;
mod weights;

pub use carried::{Carried, Edge, Emission, Scatter};
pub use heuristic::{Heuristic, HeuristicError, MergeWeights, Sampling, Techniques};
pub use light_end::LightEnd;
pub use weights::{Connector, Weights};

#[cfg(test)]
mod tests;
