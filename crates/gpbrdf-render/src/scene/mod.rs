//! From an object, a light and materials to a picture.

pub(crate) mod camera;
pub(crate) mod colour;
pub(crate) mod display;
pub(crate) mod gbuffer;
pub(crate) mod ground;
pub(crate) mod light;
pub(crate) mod mesh;
pub(crate) mod mesh_file;
pub(crate) mod renderer;
pub(crate) mod shade;
pub(crate) mod twin;
