//! What a library tells of materials that are not in it, by leaving out parts of itself.

use std::sync::Arc;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::Prior;
use super::calibration::Calibration;
use super::learn::{LearnOptions, Library, family, learn_functions};
use crate::base::error::Result;
use crate::brdf::Rgb;
use crate::brdf::angles::HalfDiff;
use crate::model::{FitOptions, IntervalOf, PriorChoice, fit};
use crate::sample::layout::hemisphere_directions;
use crate::sample::{InPlaneScan, MeanFunction, Sample, SampleSet};

/// The number of parts of a library that are left out in turn.
pub(super) const FOLDS: usize = 8;

/// The most materials that are predicted from few samples.
const MOST_MATERIALS: usize = 48;

/// The numbers of scattered samples, and the seed of their directions.
const SAMPLES: [usize; 2] = [20, 60];
const SEED: u64 = 11;

/// The number of samples in the plane of incidence.
const IN_PLANE: usize = 120;

/// The fewest materials outside a fold from which a prior for it is learned.
const FEWEST_OTHERS: usize = 8;

/// The fold of each material. All of a family have the same, and folds have about as many materials.
pub(super) fn folds(names: &[String]) -> Vec<usize> {
    let mut sizes = std::collections::BTreeMap::<&str, usize>::new();
    names.iter().for_each(|name| *sizes.entry(family(name)).or_default() += 1);
    let mut families: Vec<(&str, usize)> = sizes.into_iter().collect();
    // The largest first, each into the smallest fold.
    families.sort_by_key(|(name, size)| (std::cmp::Reverse(*size), *name));
    let mut filled = [0; FOLDS];
    let mut fold_of = std::collections::BTreeMap::new();
    for (name, size) in families {
        let smallest = (0..FOLDS).min_by_key(|&fold| filled[fold]).unwrap_or(0);
        filled[smallest] += size;
        fold_of.insert(name, smallest);
    }
    names.iter().map(|name| fold_of[family(name)]).collect()
}

/// Predicts materials of the library from few samples, in random directions and in the plane of incidence, with a prior
/// that is learned from the other folds, and compares the errors at the centres with the standard deviations that the
/// processes give. The library is too small for it where fewer than 8 materials are left to learn from: then nothing is
/// calibrated.
pub(super) fn calibration(library: &Library, options: &LearnOptions) -> Result<Calibration> {
    let folds = folds(library.names());
    let step = folds.len().div_ceil(MOST_MATERIALS).max(1);
    let errors: Vec<Result<[Errors; 2]>> = (0..FOLDS)
        .into_par_iter()
        .map(|fold| {
            let own: Vec<usize> = (0..folds.len()).step_by(step).filter(|&i| folds[i] == fold).collect();
            let others = library.without_places(|i| folds[i] == fold);
            if own.is_empty() || others.names().len() < FEWEST_OTHERS {
                return Ok(Default::default());
            }
            let prior = Arc::new(learn_functions("other folds", &others, options)?);
            let options = FitOptions { prior: PriorChoice::Learned(prior), ..FitOptions::default() };
            let mut errors: [Errors; 2] = Default::default();
            for i in own {
                let truth = library.values_at(i, library.centres());
                for count in SAMPLES {
                    let pairs = hemisphere_directions(count, SEED + i as u64)?;
                    errors[0].extend(errors_of((library, i), &truth, pairs, &options)?);
                }
                let pairs = InPlaneScan { count: IN_PLANE, ..InPlaneScan::default() }.directions()?;
                errors[1].extend(errors_of((library, i), &truth, pairs, &options)?);
            }
            Ok(errors)
        })
        .collect();
    let errors = errors.into_iter().collect::<Result<Vec<_>>>()?;
    let all = |layout: usize| errors.iter().flat_map(|own| &own[layout]).copied().collect::<Errors>();
    Ok(Calibration::measured([&all(0), &all(1)]))
}

/// Errors in standard deviations, each with its direction.
type Errors = Vec<(HalfDiff, f64)>;

/// The errors of a material's prediction from samples in these directions, at the centres, where its values are
/// `truth`, in standard deviations; none where the samples are likelier without the prior.
fn errors_of(
    (library, material): (&Library, usize),
    truth: &[Rgb],
    pairs: Vec<[Vector3<f64>; 2]>,
    options: &FitOptions,
) -> Result<Errors> {
    let angles: Vec<HalfDiff> = pairs.iter().map(|[wi, wo]| HalfDiff::from_directions(wi, wo)).collect();
    let values = library.values_at(material, &angles);
    let samples: SampleSet =
        pairs.into_iter().zip(values).map(|([wi, wo], value)| Sample { wi, wo, value }).collect();
    let model = fit(&samples, options)?.model;
    if model.mean != MeanFunction::Learned {
        // The intervals of fits without the prior are their own.
        return Ok(Errors::new());
    }
    let centres = library.centres();
    let predicted = model.predict_target(centres);
    let variances = model.predict_variance(centres, IntervalOf::Latent)?;
    let rows = centres.iter().zip(truth).zip(predicted.iter().zip(&variances));
    Ok(rows
        .flat_map(|((at, truth), (predicted, variance))| {
            (0..3).map(move |c| {
                let error = Prior::TRANSFORM.forward(truth[c]) - predicted[c];
                (*at, error / variance[c].sqrt().max(f64::MIN_POSITIVE))
            })
        })
        .filter(|(_, error)| error.is_finite())
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn families_share_a_fold_and_folds_are_about_as_large() {
        let names: Vec<String> = (0..40)
            .map(|i| format!("{}_{i}", ["felt", "metal", "m", "n", "o", "p", "q", "r"][i % 8]))
            .collect();
        let found = folds(&names);
        for (i, a) in names.iter().enumerate() {
            for (j, b) in names.iter().enumerate() {
                assert_eq!(family(a) == family(b), found[i] == found[j], "{a} {b}");
            }
        }
        for name in ["blue-metallic-paint", "blue_felt", "blue steel", "blue"] {
            assert_eq!(family(name), "blue");
        }
    }
}
