//! Bakes Gaussian-process BRDFs into a texture on the GPU, and shades with it.
