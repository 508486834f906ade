//! Utilities without a subject of their own: errors, files written whole, grids of pixels, random numbers,
//! a test of counts, vector instructions, fast arctangents, half precision, linear algebra, numbers for people,
//! observers of long work.

pub(crate) mod atomic_file;
pub(crate) mod chi_square;
pub(crate) mod error;
pub(crate) mod f16;
pub(crate) mod linalg;
pub mod number;
pub(crate) mod random;
pub(crate) mod raster;
pub(crate) mod simd;
pub(crate) mod tensor_file;
pub(crate) mod trigonometry;
pub(crate) mod watch;

pub use atomic_file::{AtomicFile, PendingRemoved, remove_pending};
pub use chi_square::{ChiSquare, chi_square};
pub use error::{Error, Result};
pub use f16::{to_half, to_halves};
pub use random::{SplitMix64, golden_ratio_subset, quasi_random, quasi_random_pair};
pub use raster::Raster;
pub use watch::{Observer, Progress, Steps, Watch};
