//! Every material against its own definition and against Mitsuba's values.

mod distribution;
mod identities;
mod oracle;
mod support;
