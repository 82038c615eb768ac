//! What light meets: shapes, the ray accelerator, materials, emitters, the camera, and the files they come from.

pub mod accel;
pub mod ray;
