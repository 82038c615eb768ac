//! Fresnel terms.
