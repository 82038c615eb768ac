//! Numbers that know nothing of light: frames, colours, warps beside their densities, distributions, statistics.
