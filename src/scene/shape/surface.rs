//! What a ray meets.
