//! The tabular BSDF format of Zemax and of Radiant's Imaging Sphere.
//!
//! A text with four lists of angles in degrees: rotations of the sample, angles of incidence, and for each of
//! them azimuthal and radial angles about the specular direction. The values follow, one line for each azimuth,
//! after a line with the total integrated scatter. Radial 0 is the specular direction; azimuth 0 points from it
//! towards the normal, and azimuths increase counter-clockwise. Values are the BRDF in sr^-1, for one colour or
//! for each of CIE X, Y and Z; 0 stands for directions that were not measured. Source: Zemax, "Tabular BSDF data
//! file format".

mod frame;
mod read;
mod write;

pub(crate) use read::FORMAT;
pub use write::{SpecularGrid, SpecularTable, write_zemax, write_zemax_to};
