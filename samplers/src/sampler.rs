//! What a sampler asks of a renderer, and what a renderer gets back.
