//! Which symmetry a BRDF has.

use crate::brdf::Brdf;
use crate::brdf::angles::BoxPoint;
use crate::sample::lattice::LatticeLayout;
use crate::sample::symmetry::Symmetry;
use crate::sample::target::log_value;

/// A BRDF is taken for bilateral if the root mean square difference in `ln(f + 1e-3)` between `phi_d` and
/// `pi - phi_d`, over all probes, is below this.
const BILATERAL_TOLERANCE: f64 = 0.03;

/// Finds out on which symmetry samples of `brdf` can rely. It is evaluated at 64 pairs `phi_d`, `pi - phi_d`,
/// and taken for bilateral if the root mean square difference in `ln(f + 1e-3)` is below 3 %.
#[must_use]
pub fn detect_symmetry(brdf: &dyn Brdf) -> Symmetry {
    let lattice = LatticeLayout { shape: [4, 4, 4], v_max: 0.9, ..LatticeLayout::default() };
    let [u, v, phi] = lattice.nodes();
    // The ends of phi are avoided, since both sides are the same direction there.
    let phi = phi.iter().map(|p| 0.1 + 0.8 * p);
    let mut sum = 0.0;
    for phi in phi {
        for (&u, &v) in u.iter().flat_map(|u| v.iter().map(move |v| (u, v))) {
            let side = |phi| brdf.eval_half_diff(BoxPoint { u, v, phi }.to_half_diff());
            let (a, b) = (side(phi), side(std::f64::consts::PI - phi));
            sum += a.iter().zip(b).map(|(&a, b)| (log_value(a) - log_value(b)).powi(2)).sum::<f64>();
        }
    }
    let count = 3 * lattice.len();
    if (sum / count as f64).sqrt() < BILATERAL_TOLERANCE { Symmetry::Bilateral } else { Symmetry::Reciprocal }
}
