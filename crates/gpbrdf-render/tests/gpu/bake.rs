//! Baked textures against the tables of `gpbrdf-core`, which are in f64.

use std::ops::ControlFlow;

use gpbrdf_core::model::PriorChoice;
use gpbrdf_core::sample::InputSpace;
use gpbrdf_core::{
    CompressOptions, FitOptions, InducingSize, LatticeLayout, Layout, MeanFunction, Model, Provenance, Shape,
    Solver, Source, Symmetry, Transform, bake_mean, bake_sigma, compress, fit,
};
use gpbrdf_render::{Baker, Context, Error, Precision};

crate::support::gpu_tests![
    lattice_bakes_are_the_core_s_for_every_kernel,
    the_default_lattice_bakes_in_both_precisions,
    sums_separate_channels_and_transforms_bake_too,
    inducing_lattices_bake_in_both_precisions,
    dense_bakes_are_the_core_s_for_every_kernel,
    what_has_no_shader_says_so_and_work_can_be_cancelled,
];

const SHAPES: [Shape; 5] = [
    Shape::SquaredExponential,
    Shape::RationalQuadratic { alpha: 1.3 },
    Shape::Matern12,
    Shape::Matern32,
    Shape::Matern52,
];

fn keep_going() -> impl FnMut(f64) -> ControlFlow<()> {
    |_| ControlFlow::Continue(())
}

fn lattice_model(material: &str, shape: [usize; 3], symmetry: Symmetry, options: &FitOptions) -> Model {
    let source = Source::built_in(material).unwrap();
    let layout = LatticeLayout { shape, symmetry, ..LatticeLayout::default() };
    let samples = source.measure(&Layout::Lattice(layout)).unwrap();
    fit(&samples, options).unwrap().model
}

/// The largest `|found - expected| / (expected + epsilon)` over the whole table, where `epsilon` is that of
/// the targets, and the largest `|found - expected| / (expected + 1e-4)` of sigma.
fn errors(context: &Context, model: &Model, precision: Precision) -> (f64, f64) {
    let baker = Baker::new(context).unwrap();
    let texture = baker.bake(model, precision, &mut keep_going()).unwrap();
    let found = texture.download(context).unwrap();
    let mean = bake_mean(model);
    let sigma = bake_sigma(model).unwrap();
    let mut worst = (0.0f64, 0.0f64);
    for (cell, (found, expected)) in found.iter().zip(mean.values()).enumerate() {
        for c in 0..3 {
            let gap = f64::from((found[c] - expected[c]).abs()) / (f64::from(expected[c]) + 1e-3);
            worst.0 = worst.0.max(gap);
        }
        let expected = (0..3).map(|c| sigma.value(cell, c)).fold(0.0, f32::max);
        worst.1 = worst.1.max(f64::from((found[3] - expected).abs() / (expected + 1e-4)));
    }
    worst
}

fn lattice_bakes_are_the_core_s_for_every_kernel(context: &Context) {
    for (i, shape) in SHAPES.into_iter().chain([Shape::Matern { nu: 0.9 }]).enumerate() {
        let symmetry = if i % 2 == 0 { Symmetry::Bilateral } else { Symmetry::Reciprocal };
        let options = FitOptions::default().with_kernel(&[shape]);
        let model = lattice_model("cherry-235", [16, 9, 6], symmetry, &options);
        let (mean, sigma) = errors(context, &model, Precision::Single);
        eprintln!("{shape:?} {symmetry:?}: mean {mean:e}, sigma {sigma:e}");
        assert!(mean < 1e-4 && sigma < 2e-3, "{shape:?} {symmetry:?}: mean {mean:e}, sigma {sigma:e}");
    }
}

fn the_default_lattice_bakes_in_both_precisions(context: &Context) {
    let model = lattice_model("cherry-235", [64, 32, 18], Symmetry::Bilateral, &FitOptions::default());
    for (precision, limit) in [(Precision::Single, 1e-4), (Precision::Half, 1e-3)] {
        let (mean, sigma) = errors(context, &model, precision);
        assert!(mean < limit && sigma < 2e-3, "{precision:?}: mean {mean:e}, sigma {sigma:e}");
    }
}

fn sums_separate_channels_and_transforms_bake_too(context: &Context) {
    let options = FitOptions {
        per_channel: true,
        transform: Transform::CubeRoot,
        mean: MeanFunction::Zero,
        ..FitOptions::default()
    }
    .with_kernel(&[Shape::Matern32, Shape::RationalQuadratic { alpha: 1.0 }]);
    let model = lattice_model("red-plastic", [10, 8, 6], Symmetry::Reciprocal, &options);
    let (mean, sigma) = errors(context, &model, Precision::Single);
    assert!(mean < 1e-4 && sigma < 1e-3, "mean {mean:e}, sigma {sigma:e}");
}

fn inducing_lattices_bake_in_both_precisions(context: &Context) {
    let table = Source::built_in("red-plastic").unwrap().table().unwrap().into_owned();
    let cases = [
        (Symmetry::Bilateral, Shape::Matern52, InducingSize::Floats(675)),
        (Symmetry::Reciprocal, Shape::Matern32, InducingSize::Shape([7, 4, 3])),
    ];
    for (symmetry, kernel, size) in cases {
        let options = CompressOptions { size, symmetry, kernel, ..CompressOptions::default() };
        let model = compress(&table, &options, Provenance::default()).unwrap().model;
        for (precision, limit) in [(Precision::Single, 1e-4), (Precision::Half, 1e-3)] {
            let (mean, sigma) = errors(context, &model, precision);
            eprintln!("inducing {symmetry:?} {precision:?}: mean {mean:e}, sigma {sigma:e}");
            assert!(
                mean < limit && sigma < 2e-3,
                "{symmetry:?} {precision:?}: mean {mean:e}, sigma {sigma:e}"
            );
        }
    }
}

fn dense_model(n: usize, symmetry: Symmetry, options: FitOptions) -> Model {
    let source = Source::built_in("cherry-235").unwrap();
    let samples = source.measure(&Layout::Random { count: n, seed: 7 }).unwrap();
    let space = LatticeLayout { symmetry, ..LatticeLayout::default() }.space();
    let options = FitOptions { solver: Solver::Dense, space: Some(space.into()), ..options };
    fit(&samples, &options).unwrap().model
}

/// The largest error of the mean, as in [`errors`].
fn dense_error(context: &Context, model: &Model) -> f64 {
    let baker = Baker::new(context).unwrap();
    let texture = baker.bake(model, Precision::Single, &mut keep_going()).unwrap();
    let mean = bake_mean(model);
    let pairs = texture.download(context).unwrap();
    let gap = |found: f32, expected: f32| f64::from((found - expected).abs()) / (f64::from(expected) + 1e-3);
    pairs
        .iter()
        .zip(mean.values())
        .flat_map(|(found, expected)| (0..3).map(|c| gap(found[c], expected[c])))
        .fold(0.0, f64::max)
}

fn dense_bakes_are_the_core_s_for_every_kernel(context: &Context) {
    if !context.f64_arithmetic() {
        eprintln!("skipped: no f64 on {}", context.describe());
        return;
    }
    for (i, shape) in SHAPES.into_iter().enumerate() {
        let symmetry = if i % 2 == 0 { Symmetry::Bilateral } else { Symmetry::Reciprocal };
        let model = dense_model(40, symmetry, FitOptions::default().with_kernel(&[shape]));
        let error = dense_error(context, &model);
        assert!(error < 1e-4, "{shape:?} {symmetry:?}: {error:e}");
    }
    let sum = vec![Shape::Matern32, Shape::SquaredExponential];
    let options = FitOptions { per_channel: true, ..FitOptions::default() }.with_kernel(&sum);
    let error = dense_error(context, &dense_model(30, Symmetry::Bilateral, options));
    assert!(error < 1e-4, "sum of kernels: {error:e}");
    // The scattered solver, in both of its spaces, without and with a learned prior.
    for space in InputSpace::ISOTROPIC {
        for (prior, solver) in [(PriorChoice::None, "scattered"), (PriorChoice::BuiltIn, "learned")] {
            let source = Source::built_in("cherry-235").unwrap();
            let samples = source.measure(&Layout::Random { count: 60, seed: 2 }).unwrap();
            let options = FitOptions { space: Some(space), prior, ..FitOptions::default() };
            let model = fit(&samples, &options).unwrap().model;
            assert_eq!((model.solver(), model.space()), (solver, space));
            let error = dense_error(context, &model);
            assert!(error < 1e-4, "{solver} {space:?}: {error:e}");
        }
    }
}

fn what_has_no_shader_says_so_and_work_can_be_cancelled(context: &Context) {
    let baker = Baker::new(context).unwrap();
    let options = FitOptions::default().with_kernel(&[Shape::Matern { nu: 0.8 }]);
    let model = dense_model(12, Symmetry::Bilateral, options);
    let error = baker.bake(&model, Precision::Half, &mut keep_going()).unwrap_err();
    assert!(matches!(error, Error::NoShader { .. }), "{error}");
    let model = dense_model(30, Symmetry::Bilateral, FitOptions::default());
    let mut asked = 0;
    let mut twice = |done: f64| {
        assert!((0.0..=1.0).contains(&done));
        asked += 1;
        if asked == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let error = baker.bake(&model, Precision::Half, &mut twice).unwrap_err();
    assert!(error.is_cancelled(), "{error}");
    assert_eq!(asked, 2);
}
