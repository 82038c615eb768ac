//! Many methods, many scenes, many seeds: what is compared, what came of it, and one page that shows it.

pub mod error;
pub mod hash;
pub mod machine;
pub mod plan;
pub mod records;
pub mod references;
pub mod report;
pub mod run;
pub mod viewer;
