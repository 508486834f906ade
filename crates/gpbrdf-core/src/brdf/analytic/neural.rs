//! The Neural BRDF: a small network in place of a formula.

use nalgebra::Vector3;

use crate::base::error::{Error, Result};
use crate::brdf::angles::HalfDiff;
use crate::brdf::{Brdf, Rgb};

/// Number of inputs of the network: the components of the half vector and of the difference vector.
const INPUTS: usize = 6;
/// Width of both hidden layers.
const HIDDEN: usize = 21;

/// Number of weights of a [`NeuralBrdf`].
pub const NEURAL_FLOATS: usize = INPUTS * HIDDEN + HIDDEN + HIDDEN * HIDDEN + HIDDEN + HIDDEN * 3 + 3;

/// A network with two hidden layers of 21 units whose inputs are the half vector `h` and the difference
/// vector `d` with `phi_h = 0`: `a1 = relu(x W1 + b1)`, `a2 = relu(a1 W2 + b2)`,
/// `f = max(exp(a2 W3 + b3) - 1, 0)` in sr^-1.
///
/// Source: A. Sztrajman et al., "Neural BRDF Representation and Importance Sampling" (2021). Not reciprocal
/// by itself.
#[derive(Clone, Debug, PartialEq)]
pub struct NeuralBrdf {
    /// `W1`, `b1`, `W2`, `b2`, `W3`, `b3` in this order. Matrices are stored by rows, with one row per input.
    weights: Vec<f64>,
}

impl NeuralBrdf {
    /// A network with these [`NEURAL_FLOATS`] weights: `W1[6][21]`, `b1[21]`, `W2[21][21]`, `b2[21]`,
    /// `W3[21][3]`, `b3[3]`.
    ///
    /// # Errors
    /// Another number of weights, or one that is not finite.
    pub fn new(weights: Vec<f64>) -> Result<Self> {
        if weights.len() != NEURAL_FLOATS {
            return Err(Error::argument("weights", NEURAL_FLOATS.to_string(), weights.len()));
        }
        match weights.iter().find(|weight| !weight.is_finite()) {
            None => Ok(Self { weights }),
            Some(weight) => Err(Error::argument("weights", "finite numbers", weight)),
        }
    }
}

/// `x W + b` of the layer whose matrix and offsets are at the start of `weights`, and the weights that follow
/// them.
fn layer<'a, const IN: usize, const OUT: usize>(
    x: &[f64; IN],
    weights: &'a [f64],
) -> ([f64; OUT], &'a [f64]) {
    let (matrix, rest) = weights.split_at(IN * OUT);
    let (offsets, rest) = rest.split_at(OUT);
    let mut y: [f64; OUT] = std::array::from_fn(|j| offsets[j]);
    for (x, row) in x.iter().zip(matrix.chunks(OUT)) {
        y.iter_mut().zip(row).for_each(|(y, w)| *y += x * w);
    }
    (y, rest)
}

impl Brdf for NeuralBrdf {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        if !(wi.z > 0.0 && wo.z > 0.0) {
            return [0.0; 3];
        }
        self.eval_half_diff(HalfDiff::from_directions(wi, wo))
    }

    fn eval_half_diff(&self, angles: HalfDiff) -> Rgb {
        let (sin_h, cos_h) = angles.theta_h.sin_cos();
        let (sin_d, cos_d) = angles.theta_d.sin_cos();
        let (sin_p, cos_p) = angles.phi_d.sin_cos();
        let x = [sin_h, 0.0, cos_h, sin_d * cos_p, sin_d * sin_p, cos_d];
        let (a, rest) = layer::<INPUTS, HIDDEN>(&x, &self.weights);
        let (b, rest) = layer::<HIDDEN, HIDDEN>(&a.map(|a| a.max(0.0)), rest);
        let (y, _) = layer::<HIDDEN, 3>(&b.map(|b| b.max(0.0)), rest);
        y.map(|y| (y.exp() - 1.0).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_of_few_weights_is_its_formula() {
        assert_eq!(NEURAL_FLOATS, 675);
        let mut weights = vec![0.0; NEURAL_FLOATS];
        // cos(theta_d) goes through one unit per layer to the green channel.
        weights[5 * HIDDEN + 4] = 2.0;
        weights[INPUTS * HIDDEN + 4] = -0.5;
        let second = INPUTS * HIDDEN + HIDDEN;
        weights[second + 4 * HIDDEN + 7] = 0.5;
        let third = second + HIDDEN * HIDDEN + HIDDEN;
        weights[third + 7 * 3 + 1] = 3.0;
        weights[third + HIDDEN * 3 + 2] = -1.0;
        let brdf = NeuralBrdf::new(weights.clone()).unwrap();
        let angles = HalfDiff { theta_h: 0.3, theta_d: 0.4, phi_d: 1.0 };
        let expected = (3.0 * 0.5 * (2.0 * 0.4f64.cos() - 0.5)).exp() - 1.0;
        let found = brdf.eval_half_diff(angles);
        assert!((found[1] - expected).abs() < 1e-12, "{found:?}");
        assert_eq!((found[0], found[2]), (0.0, 0.0));
        let (wi, wo) = angles.to_directions();
        assert!((brdf.eval(&wi, &wo)[1] - expected).abs() < 1e-9);
        assert_eq!(brdf.eval(&-wi, &wo), [0.0; 3]);
        assert!(NeuralBrdf::new(weights[1..].to_vec()).is_err());
        weights[0] = f64::NAN;
        assert!(NeuralBrdf::new(weights).is_err());
    }
}
