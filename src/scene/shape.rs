//! Shapes: triangle meshes and analytic quadrics; surface at a hit, area, sampling by area.
