//! Many methods, many scenes, many seeds: what is compared, what came of it, and one page that shows it.

pub mod records;
pub mod report;
