#[cfg(feature = "fit")]
use std::f64::consts::PI;

use super::*;
#[cfg(feature = "fit")]
use crate::brdf::{Brdf, materials};

#[cfg(feature = "fit")]
fn library() -> Library {
    let mut library = Library::new(300).unwrap();
    for material in materials() {
        let values: Vec<_> = library.centres().iter().map(|&at| material.brdf.eval_half_diff(at)).collect();
        library.add_values(material.name, &values).unwrap();
    }
    library
}

#[cfg(feature = "fit")]
fn small() -> LearnOptions {
    LearnOptions { functions: [6, 4] }
}

#[cfg(feature = "fit")]
#[test]
fn functions_do_not_depend_on_phi_d_where_it_has_no_meaning() {
    let prior = learn("test", &library(), &small()).unwrap();
    for (theta_h, theta_d) in [(0.0, 0.7), (0.4, 0.0), (0.0, 0.0)] {
        let at = |phi_d: f64| HalfDiff { theta_h, theta_d, phi_d };
        for colour in Colour::ALL {
            let rows = prior.features(colour, &[at(0.0), at(0.4), at(2.0), at(PI)]);
            let first = &rows[..prior.n_functions(colour)];
            for row in rows.chunks(first.len()) {
                assert!(row.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-9), "{row:?} {first:?}");
            }
        }
    }
    let turned = [0.3, PI - 0.3, PI + 0.3].map(|phi_d| HalfDiff { theta_h: 0.5, theta_d: 0.6, phi_d });
    let means = prior.mean(Colour::Achromatic, &turned);
    assert!(means.iter().all(|m| (m - means[0]).abs() < 1e-9), "{means:?}");
}

/// The materials of the library are described by its functions; one that is not among them is described less well.
#[cfg(feature = "fit")]
#[test]
fn functions_explain_the_library() {
    let all = library();
    let options = LearnOptions { functions: [100, 100] };
    let prior = learn("test", &all, &options).unwrap();
    assert_eq!(prior.n_functions(Colour::Achromatic), all.names().len() - 1);
    let few = learn("test", &all, &small()).unwrap();
    assert!(few.left(Colour::Achromatic) >= prior.left(Colour::Achromatic));
    // Projections of a material of the library on all functions leave rounding only.
    let centres = all.centres();
    let count = prior.n_functions(Colour::Achromatic);
    let features = prior.features(Colour::Achromatic, centres);
    let mean = prior.mean(Colour::Achromatic, centres);
    let bright = all.brightness_of("red-plastic");
    let mut left: Vec<f64> = bright.iter().zip(&mean).map(|(a, b)| a - b).collect();
    for k in 0..count {
        let function: Vec<f64> = features.iter().skip(k).step_by(count).copied().collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let share = dot(&function, &left) / dot(&function, &function);
        left.iter_mut().zip(&function).for_each(|(l, f)| *l -= share * f);
    }
    let worst = left.iter().fold(0.0f64, |worst, l| worst.max(l.abs()));
    assert!(worst < 0.02, "{worst}");
}

#[cfg(feature = "fit")]
#[test]
fn files_are_read_as_they_were_written_and_damaged_ones_are_refused() {
    let prior = learn("test", &library(), &small()).unwrap();
    let bytes = prior.to_bytes().unwrap();
    assert_eq!(Prior::from_bytes(&bytes, "p").unwrap(), prior);
    assert!(Prior::from_bytes(&bytes[..bytes.len() - 7], "p").is_err());
    assert!(Prior::from_bytes(b"", "p").is_err());
    let one = library().without(|name| name != "red-plastic");
    assert!(one.names().len() == 1 && learn("test", &one, &small()).is_err());
}

#[test]
fn the_built_in_prior_is_small_and_whole() {
    let prior = Prior::built_in();
    assert!(
        prior.n_functions(Colour::Achromatic) >= 20 && prior.materials.len() > 100,
        "{}",
        prior.materials.len()
    );
    assert!(prior.left(Colour::Achromatic) < 1.0 && prior.left(Colour::Chromatic) < 1.0);
    assert!(file::BUILT_IN.len() <= 1 << 20, "{}", file::BUILT_IN.len());
    #[cfg(feature = "formats")]
    assert_eq!(crate::formats::sha256_hex(file::BUILT_IN), Prior::BUILT_IN_SHA256);
}

/// Weights on one half of the library: the prior moves towards it, and equal weights leave its mean where it is.
#[cfg(feature = "fit")]
#[test]
fn adapted_priors_resemble_the_materials_with_large_weights() {
    let all = library();
    let prior = learn("test", &all, &LearnOptions { functions: [100, 100] }).unwrap();
    let count = prior.materials.len();
    let equal = prior.adapted(&vec![0.2; count]).unwrap();
    let place = prior.materials.iter().position(|name| name == "red-plastic").unwrap();
    let mut weights = vec![1e-3; count];
    weights[place] = 1.0;
    let near = prior.adapted(&weights).unwrap();
    let truth = all.brightness_of("red-plastic");
    let error = |prior: &Prior| {
        let mean = prior.mean(Colour::Achromatic, all.centres());
        mean.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    assert!((error(&equal) / error(&prior) - 1.0).abs() < 1e-3, "{} {}", error(&equal), error(&prior));
    assert!(error(&near) < 0.2 * error(&prior), "{} {}", error(&near), error(&prior));
    for bad in [vec![1.0; count - 1], vec![0.0; count], vec![-1.0; count]] {
        assert!(prior.adapted(&bad).is_err());
    }
}
