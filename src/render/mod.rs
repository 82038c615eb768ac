//! The progressive loop: which iterations run, when they stop, what is written on the way. The only room with a clock.

pub mod budget;
pub mod clock;
pub mod diagnose;
pub mod metadata;
pub mod progress;
pub mod run;
pub mod settings;
pub mod snapshots;

pub use budget::{Budget, IterationRange};
pub use clock::{Interrupt, RenderClock};
pub use diagnose::{Diagnosis, diagnose};
pub use metadata::{ErrorRecord, Metadata, Run, SceneRecord};
pub use progress::{Bar, Lines, Progress, Silent, Step};
pub use run::{Layers, Outcome, Output, Plan, Reference, RenderError, render};
pub use settings::{Changes, Crop, Resolution};
pub use snapshots::{Snapshot, Snapshots};
