//! Lit spheres and objects.

pub(crate) mod object;
pub(crate) mod sphere;
