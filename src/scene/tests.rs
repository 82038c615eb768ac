//! The scene as a whole: against Mitsuba's values, against analytic answers, and against itself.

mod camera;
mod gold;
mod gold_xml;
mod hits;
mod irradiance;
mod kit;
mod parts;
mod sampling;
