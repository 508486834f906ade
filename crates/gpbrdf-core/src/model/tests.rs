//! Tests of models that are loaded from files written by hand, against the posterior written out with dense
//! matrices.
//!
//! The tests run with every set of features: with `fit`, predictions are computed by faer, without it by
//! nalgebra.

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::brdf::table::{N_CELLS, cell_center, cell_indices};
use crate::gp::{DeviceForm, InducingShape, SeparableForm, TensorWriter};
use crate::kernel::{Kernel, Kernel1d, Shape};
use crate::sample::{Symmetry, WarpedBox};

const OFFSETS: Rgb = [0.3, -0.2, 0.1];

const BOX: WarpedBox =
    WarpedBox { density: 1.3, v_density: 0.61, symmetry: Symmetry::Bilateral, tail: 1.1, phi_density: 1.5 };

/// A model file with one posterior.
fn load(solver: &str, process: &Value, tensors: &TensorWriter) -> Model {
    let header = json!({
        "version": 2,
        "written_by": "a test",
        "provenance": Provenance::default(),
        "transform": Transform::Identity,
        "mean": MeanFunction::Constant,
        "offsets": OFFSETS,
        "posteriors": [{ "solver": solver, "process": process }],
    });
    let metadata = [("gpbrdf".to_owned(), header.to_string())].into_iter().collect();
    let bytes = safetensors::serialize(tensors.views().unwrap(), Some(metadata)).unwrap();
    Model::from_bytes(&bytes, "model.safetensors").unwrap()
}

/// Directions spread over all angles, including some below the horizon.
fn directions() -> Vec<HalfDiff> {
    let spread = |i: u32, ratio: f64| (f64::from(i) * ratio).fract();
    (0..200)
        .map(|i| HalfDiff {
            theta_h: 1.55 * spread(i, 0.618_034),
            theta_d: 1.55 * spread(i, 0.754_878),
            phi_d: 3.1 * spread(i, 0.569_84),
        })
        .collect()
}

fn close(found: f64, expected: f64, tolerance: f64) {
    // Sums of terms of about 1 may cancel.
    assert!((found - expected).abs() <= tolerance * expected.abs() + 1e-15, "{found:e} {expected:e}");
}

/// Compares the predictions and the baked tables of a model with the target and the latent variance that are
/// `expected` of each channel.
fn check(model: &Model, expected: &dyn Fn(HalfDiff) -> (Rgb, Rgb)) {
    let angles = directions();
    let (means, variances) =
        (model.predict_target(&angles), model.predict_variance(&angles, IntervalOf::Latent).unwrap());
    for ((angles, mean), variance) in angles.into_iter().zip(means).zip(variances) {
        let expected = expected(angles);
        for c in 0..3 {
            close(mean[c], expected.0[c], 1e-12);
            close(variance[c], expected.1[c], 1e-8);
        }
    }
    let (mean, sigma) = (bake_mean(model), bake_sigma(model).unwrap());
    for cell in (0..N_CELLS).step_by(12_347) {
        let (h, d, p) = cell_indices(cell);
        let (target, variance) = expected(cell_center(h, d, p));
        for c in 0..3 {
            assert!(
                (f64::from(mean.values()[cell][c]) - target[c].max(0.0)).abs() < 2e-6,
                "{cell} {target:?}"
            );
            // The sigma of a dense model is interpolated between cells, so it is not compared.
            if model.solver() != "dense" {
                close(f64::from(sigma.value(cell, c)), variance[c].sqrt(), 1e-6);
            }
        }
    }
}

/// The axes and the nodes of a small lattice, and the targets of three channels at its nodes.
fn lattice() -> ([Vec<f64>; 3], Vec<[f64; 3]>, DMatrix<f64>) {
    let axes = [vec![0.05, 0.3, 0.55, 0.8, 0.97], vec![0.0, 0.35, 0.7, 0.95], vec![0.2, 0.7, 1.3]];
    let [u, v, phi] = &axes;
    let nodes: Vec<[f64; 3]> = u
        .iter()
        .flat_map(|&u| v.iter().flat_map(move |&v| phi.iter().map(move |&phi| [u, v, phi])))
        .collect();
    let targets = DMatrix::from_fn(nodes.len(), 3, |i, c| {
        let [u, v, phi] = nodes[i];
        (3.0 * u + c as f64).sin() + v * phi.cos()
    });
    (axes, nodes, targets)
}

/// The product kernel `k_u k_v k_phi` of the warped box; its last axis is a mirrored circle.
fn product_kernel(kernels: &[Kernel1d; 3], x: [f64; 3], y: [f64; 3]) -> f64 {
    let circle = |y: f64| kernels[2].value((x[2] - y).sin().abs());
    kernels[0].value((x[0] - y[0]).abs())
        * kernels[1].value((x[1] - y[1]).abs())
        * (circle(y[2]) + circle(-y[2]))
}

/// The posterior mean of each column of `alpha = A^-1 y`, and the posterior variance `k(x, x) - k^T A^-1 k`.
fn posterior(prior: f64, k: &DVector<f64>, alpha: &DMatrix<f64>, inverse: &DMatrix<f64>) -> (Vec<f64>, f64) {
    (alpha.tr_mul(k).iter().copied().collect(), prior - k.dot(&(inverse * k)))
}

#[test]
fn a_loaded_lattice_model_is_the_posterior_written_out() {
    let (axes, nodes, y) = lattice();
    let (n, signal, noise) = (nodes.len(), 1.7, 0.01);
    let kernels = [(Shape::Matern52, 0.4), (Shape::Matern32, 0.5), (Shape::SquaredExponential, 0.7)]
        .map(|(shape, length)| Kernel1d::new(shape, length));
    let kernel = |x, y| signal * product_kernel(&kernels, x, y);
    let nugget = |i, j| if i == j { noise } else { 0.0 };
    let inverse =
        DMatrix::from_fn(n, n, |i, j| kernel(nodes[i], nodes[j]) + nugget(i, j)).try_inverse().unwrap();
    let alpha = &inverse * &y;

    let mut tensors = TensorWriter::default();
    for (name, x) in ["u", "v", "phi"].into_iter().zip(&axes) {
        tensors.add(name, &[x.len()], x);
    }
    tensors.add("targets", &[3, 5, 4, 3], y.as_slice());
    tensors.add("weights", &[3, 5, 4, 3], (&alpha * signal).as_slice());
    let hyper = json!({ "signal_variance": signal, "noise_variance": noise, "kernels": kernels });
    let model = load("lattice", &json!({ "space": BOX, "hyper": hyper }), &tensors);
    let expected = |angles| {
        let x = BOX.coordinates(angles);
        let k = DVector::from_fn(n, |i, _| kernel(x, nodes[i]));
        let (mean, variance) = posterior(kernel(x, x), &k, &alpha, &inverse);
        (std::array::from_fn(|c| OFFSETS[c] + mean[c]), [variance; 3])
    };
    check(&model, &expected);

    let (_, process) = model.posteriors().next().unwrap();
    let DeviceForm::Separable(parts) = process.device_form() else { panic!("{model:?}") };
    let form = SeparableForm::new(parts[0].gp).unwrap();
    for angles in directions() {
        let x = BOX.coordinates(angles);
        let [a, b, c] = std::array::from_fn(|k| DVector::from_vec(form.basis(k, &[x[k]]).values));
        let products = a.kronecker(&b).kronecker(&c);
        for (channel, coefficients) in form.coefficients().chunks(n).enumerate() {
            let mean = products.dot(&DVector::from_column_slice(coefficients)) + OFFSETS[channel];
            assert!((mean - expected(angles).0[channel]).abs() < 1e-11, "{angles:?}");
        }
    }
}

#[test]
fn a_loaded_dense_model_is_the_posterior_written_out() {
    let (_, nodes, y) = lattice();
    let (n, noise) = (nodes.len(), 0.01);
    let kernel = Kernel::ard(1.7, Shape::Matern52, &[0.4, 0.5, 0.7]);
    let nugget = |i, j| if i == j { noise } else { 0.0 };
    let covariance = DMatrix::from_fn(n, n, |i, j| kernel.value(&nodes[i], &nodes[j]) + nugget(i, j));
    let inverse = covariance.try_inverse().unwrap();
    let alpha = &inverse * &y;

    let mut tensors = TensorWriter::default();
    tensors.add("x", &[n, 3], nodes.as_flattened());
    tensors.add("targets", &[n, 3], y.transpose().as_slice());
    tensors.add("weights", &[n, 3], alpha.transpose().as_slice());
    let space = InputSpace::from(BOX);
    let process =
        json!({ "space": space, "kernel": kernel, "noise_variance": noise, "jitter": 0.0, "channels": 3 });
    let model = load("dense", &process, &tensors);
    check(&model, &|angles| {
        let x = BOX.coordinates(angles);
        let k = DVector::from_fn(n, |i, _| kernel.value(&x, &nodes[i]));
        let (mean, variance) = posterior(kernel.value(&x, &x), &k, &alpha, &inverse);
        (std::array::from_fn(|c| OFFSETS[c] + mean[c]), [variance; 3])
    });
}

#[test]
fn a_loaded_compressed_table_is_the_posterior_written_out() {
    let shape = [4, 3, 2];
    let (c, s) = (0.8, 0.6);
    let mix = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
    let components: Vec<_> = [0.9, 1.1, 1.3]
        .map(|scale| InducingShape {
            shape,
            space: WarpedBox { density: 0.9 * scale, ..BOX },
            kernels: [0.2, 0.3, 0.4].map(|length| Kernel1d::new(Shape::Matern32, length * scale)),
            signal_variance: 1.5 * scale,
            noise_variance: 0.01,
        })
        .into();
    let mut tensors = TensorWriter::default();
    // For each component: its nodes, the inverse covariance of its values, and its weights, which are
    // computed with a jitter along each axis.
    let mut parts = Vec::new();
    for (k, lattice) in components.iter().enumerate() {
        let [u, v, phi] = lattice.nodes();
        let nodes: Vec<[f64; 3]> = u
            .iter()
            .flat_map(|&u| {
                v.iter().flat_map(|&v| phi.iter().map(move |&phi| [u, v, phi])).collect::<Vec<_>>()
            })
            .collect();
        // Half precision represents every value exactly.
        let values: Vec<f64> = (0..24).map(|i| ((i * 7 + k) % 13) as f64 / 8.0 - 0.75).collect();
        tensors.add_half(&format!("{k}.values"), &shape, &values);
        let n = nodes.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| product_kernel(&lattice.kernels, nodes[i], nodes[j]));
        let inverse = (covariance + DMatrix::identity(n, n) * 1e-9).try_inverse().unwrap();
        let axis = |k: usize, x: &[f64]| {
            let at = |x: f64| std::array::from_fn(|axis| if axis == k { x } else { 0.0 });
            // At 0 the mirrored circle contributes a factor of 2, every other axis a factor of 1.
            let others = if k == 2 { 1.0 } else { 2.0 };
            let gram = DMatrix::from_fn(x.len(), x.len(), |i, j| {
                product_kernel(&lattice.kernels, at(x[i]), at(x[j])) / others
            });
            let jitter = 1e-9 * gram.diagonal().mean();
            gram + DMatrix::identity(x.len(), x.len()) * jitter
        };
        let whole = axis(0, &u).kronecker(&axis(1, &v)).kronecker(&axis(2, &phi));
        let weights = whole.lu().solve(&DMatrix::from_column_slice(n, 1, &values)).unwrap();
        parts.push((nodes, inverse, weights));
    }
    let process = json!({ "mix": mix, "cells": 1000, "components": components });
    let model = load("inducing", &process, &tensors);
    check(&model, &|angles| {
        let (mut mean, mut variance) = (OFFSETS, [0.0; 3]);
        for (k, (lattice, (nodes, inverse, weights))) in components.iter().zip(&parts).enumerate() {
            let x = lattice.space.coordinates(angles);
            let cross = DVector::from_fn(nodes.len(), |i, _| product_kernel(&lattice.kernels, x, nodes[i]));
            let prior = product_kernel(&lattice.kernels, x, x);
            let (part, unknown) = posterior(prior, &cross, weights, inverse);
            for channel in 0..3 {
                mean[channel] += mix[channel][k] * part[0];
                variance[channel] += mix[channel][k] * mix[channel][k] * lattice.signal_variance * unknown;
            }
        }
        (mean, variance)
    });
}
