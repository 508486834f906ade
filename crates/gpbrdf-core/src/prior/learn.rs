//! Learning a prior from a library of materials.

use rayon::prelude::*;

use super::calibration::Calibration;
use super::colour::{Colour, from_opponent, to_opponent};
use super::cross_validation::{FOLDS, calibration, folds};
use super::span::{SPACE, Span};
use super::{Functions, Prior};
use crate::base::error::{Error, Result};
use crate::base::linalg::{factorize, product, solve, symmetric_eigen, view_slice};
use crate::base::simd::{add_scaled, dot};
use crate::brdf::angles::HalfDiff;
use crate::brdf::{Brdf, Rgb};
use crate::gp::{Outliers, Solver};
use crate::model::{FitOptions, PriorChoice, fit};
use crate::sample::{Layout, SampleSet};

/// The largest value that is taken from a material, sr^-1.
const BRIGHTEST: f64 = 1e5;

/// Half the number of measurements of a material of a library, and the seed of their directions.
const MEASUREMENTS: usize = 400;
const SEED: u64 = 7;

/// The variance of what the functions of a span leave of a material, relative to that of their kernel.
const NOISE: f64 = 2e-4;

/// Size of a prior.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LearnOptions {
    /// The largest number of achromatic and of chromatic functions. There are never more of them than materials.
    pub functions: [usize; 2],
}

impl Default for LearnOptions {
    fn default() -> Self {
        Self { functions: [60, 30] }
    }
}

/// Materials, each as three colours of `ln(f + 1e-3)` that are functions of a span.
#[derive(Clone, Debug)]
pub struct Library {
    span: Span,
    /// Cholesky factor of the covariance at the centres.
    factor: Vec<f64>,
    pub(super) names: Vec<String>,
    colours: Vec<[Member; 3]>,
}

/// A colour of a material: its values at the centres, its constant, and the coefficients of the centres.
#[derive(Clone, Debug)]
struct Member {
    values: Vec<f64>,
    constant: f64,
    coefficients: Vec<f64>,
}

impl Library {
    /// The usual number of centres.
    pub const CENTRES: usize = 1000;

    /// An empty library, of materials that are known at this number of directions.
    ///
    /// # Errors
    /// Fewer than 10 directions, or more than 20,000.
    pub fn new(centres: usize) -> Result<Self> {
        let span = Span::new(centres)?;
        let n = span.len();
        let x: Vec<[f64; 3]> = span.centres().iter().map(|&at| SPACE.coordinates(at)).collect();
        let mut factor = vec![0.0; n * n];
        factor.par_chunks_mut(n).enumerate().for_each(|(j, column)| {
            for (i, value) in column.iter_mut().enumerate().skip(j) {
                *value = span.kernel().value(&x[i], &x[j]);
            }
            column[j] += NOISE;
        });
        if !factorize(&mut factor, n) {
            return Err(Error::NotPositiveDefinite { size: n, largest_jitter: NOISE });
        }
        Ok(Self { span, factor, names: Vec::new(), colours: Vec::new() })
    }

    /// Adds a material, as a Gaussian process without a learned prior describes it after 800 measurements, which half
    /// are spread over all pairs of directions and half over the warped box, closer to the mirror direction: published
    /// fits have kinks that reflectances do not have. One of the same name is replaced. Takes some seconds.
    ///
    /// # Errors
    /// Those of the fit, where the material is not finite.
    pub fn add(&mut self, name: &str, brdf: &dyn Brdf) -> Result<()> {
        let mut samples = SampleSet::measure(brdf, &Layout::Hemisphere { count: MEASUREMENTS, seed: SEED })?;
        let near = SampleSet::measure(brdf, &Layout::Random { count: MEASUREMENTS, seed: SEED })?;
        samples.angles.extend(near.angles);
        samples.values.extend(near.values);
        samples.directions.clear();
        samples.values.iter_mut().flatten().for_each(|f| *f = f.clamp(0.0, BRIGHTEST));
        let options = FitOptions {
            solver: Solver::Scattered,
            prior: PriorChoice::None,
            outliers: Outliers::Keep,
            ..FitOptions::default()
        };
        let model = fit(&samples, &options)?.model;
        self.add_values(name, &model.predict_mean(self.centres()))
    }

    /// The directions at which materials are known.
    #[must_use]
    pub fn centres(&self) -> &[HalfDiff] {
        self.span.centres()
    }

    /// Adds a material by its values at [`Library::centres`], sr^-1, as they are. One of the same name is replaced.
    ///
    /// # Errors
    /// A number of values that is not that of the centres, or values that are not finite.
    pub fn add_values(&mut self, name: &str, values: &[Rgb]) -> Result<()> {
        let n = self.span.len();
        if values.len() != n || values.as_flattened().iter().any(|f| !f.is_finite()) {
            let expected = format!("{n} finite ones for {name}");
            return Err(Error::argument("values of a material", expected, values.len()));
        }
        let target = |f: f64| Prior::TRANSFORM.forward(f.clamp(0.0, BRIGHTEST));
        let values: Vec<[f64; 3]> = values.iter().map(|&rgb| to_opponent(rgb.map(target))).collect();
        let columns: [Vec<f64>; 3] = std::array::from_fn(|c| values.iter().map(|v| v[c]).collect());
        let colours = columns.map(|mut column| {
            let constant = column.iter().sum::<f64>() / n as f64;
            column.iter_mut().for_each(|y| *y -= constant);
            let mut coefficients = column.clone();
            solve(&self.factor, n, &mut coefficients);
            // What the noise does not take.
            add_scaled(-NOISE, &coefficients, &mut column);
            column.iter_mut().for_each(|y| *y += constant);
            Member { values: column, constant, coefficients }
        });
        match self.names.iter().position(|known| known == name) {
            Some(place) => self.colours[place] = colours,
            None => {
                self.names.push(name.to_owned());
                self.colours.push(colours);
            }
        }
        Ok(())
    }

    /// The values of material `i` at any directions, sr^-1.
    pub(super) fn values_at(&self, i: usize, angles: &[HalfDiff]) -> Vec<Rgb> {
        let coefficients: Vec<f64> =
            self.colours[i].iter().flat_map(|member| &member.coefficients).copied().collect();
        let constants = self.colours[i].each_ref().map(|member| member.constant);
        let values = self.span.values(&coefficients, angles);
        let rgb = |row: &[f64]| {
            from_opponent(std::array::from_fn(|c| constants[c] + row[c])).map(|y| Prior::TRANSFORM.inverse(y))
        };
        values.chunks(3).map(rgb).collect()
    }

    /// The names of the materials.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The library without the materials whose names `leave` picks.
    #[must_use]
    pub fn without(&self, leave: impl Fn(&str) -> bool) -> Self {
        self.without_places(|i| leave(&self.names[i]))
    }

    /// The library without the materials at the places that `leave` picks.
    pub(super) fn without_places(&self, leave: impl Fn(usize) -> bool) -> Self {
        let kept = || (0..self.names.len()).filter(|i| !leave(*i));
        Self {
            names: kept().map(|i| self.names[i].clone()).collect(),
            colours: kept().map(|i| self.colours[i].clone()).collect(),
            span: self.span.clone(),
            factor: self.factor.clone(),
        }
    }
}

/// Learns a prior: the mean of the achromatic colour over the library, and the principal functions of its deviations;
/// the principal functions of both chromatic colours together, without a mean. All orders of the three channels are
/// equally likely in advance; since they rotate the chromatic colours into each other, this changes no function.
///
/// What the functions leave of unknown materials is measured on the library itself, of which one eighth at a time is
/// left out, and so is how much wider intervals must be than the process says; materials whose names begin with the
/// same word ([`family`]) are left out together. Cost: `O(m^2 n)` for `m` materials known at `n` directions, and three
/// fits of few samples for each of at most 48 materials. Numbers are rounded to single precision, as in files.
///
/// # Errors
/// Fewer than two materials.
pub fn learn(name: &str, library: &Library, options: &LearnOptions) -> Result<Prior> {
    let prior = learn_functions(name, library, options)?;
    Ok(Prior { calibration: calibration(library, options)?, ..prior })
}

/// The first word of the name of a material, up to the first `_`, `-` or blank: materials of which it is the same are
/// taken as of one family.
#[must_use]
pub fn family(name: &str) -> &str {
    name.split(['_', '-', ' ']).next().unwrap_or(name)
}

/// [`learn`] without a calibration of intervals.
pub(super) fn learn_functions(name: &str, library: &Library, options: &LearnOptions) -> Result<Prior> {
    let count = library.names.len();
    if count < 2 {
        return Err(Error::argument("materials of a library", "at least 2", count));
    }
    let n = library.span.len();
    let mut mean = Member { values: vec![0.0; n], constant: 0.0, coefficients: vec![0.0; n] };
    library.colours.iter().for_each(|[bright, ..]| mean.add(1.0 / count as f64, bright));
    let folds = folds(&library.names);
    let (mut left, mut scores) = ([0.0; 2], Vec::new());
    let functions = Colour::ALL.map(|colour| {
        let wanted = options.functions[colour as usize];
        // A group of one or two functions for each material.
        let groups: Vec<Vec<Member>> = library
            .colours
            .iter()
            .map(|colours| {
                let mut own = colours[colour.rows()].to_vec();
                if colour == Colour::Achromatic {
                    own.iter_mut().for_each(|member| member.add(-1.0, &mean));
                }
                own
            })
            .collect();
        // What functions of other materials leave of a material is part of what is expected of an unknown one.
        let (rests, rest) = what_is_left(&groups, &folds, wanted);
        left[colour as usize] = rest;
        let members: Vec<&Member> = groups.iter().flatten().collect();
        let deviations = members.len() as f64;
        let all: Vec<&Member> = members.into_iter().chain(&rests).collect();
        let principal = principal_functions(&all, deviations, wanted.min(count - 1));
        if colour == Colour::Achromatic {
            let score =
                |member: &Member, f: &Member| dot(&member.values, &f.values) / dot(&f.values, &f.values);
            let rows = groups.iter().flatten();
            scores = rows.flat_map(|member| principal.iter().map(|f| rounded(score(member, f)))).collect();
        }
        Functions {
            constants: principal.iter().map(|f| rounded(f.constant)).collect(),
            coefficients: principal.iter().flat_map(|f| &f.coefficients).copied().map(rounded).collect(),
        }
    });
    let mean = Functions {
        constants: vec![rounded(mean.constant)],
        coefficients: mean.coefficients.into_iter().map(rounded).collect(),
    };
    let names = (name.to_owned(), library.names.clone());
    Prior::new(names, library.span.clone(), mean, functions, left, scores, Calibration::NONE)
}

/// The nearest number in single precision.
fn rounded(x: f64) -> f64 {
    f64::from(crate::gp::table::to_f32(x))
}

impl Member {
    /// Adds a multiple of another function.
    fn add(&mut self, factor: f64, other: &Self) {
        self.constant += factor * other.constant;
        add_scaled(factor, &other.values, &mut self.values);
        add_scaled(factor, &other.coefficients, &mut self.coefficients);
    }
}

/// The first principal functions of members about zero, each times its standard deviation, whose square is the sum of
/// squares over all members divided by `divisor`; fewer where the members do not span as many.
fn principal_functions(members: &[&Member], divisor: f64, count: usize) -> Vec<Member> {
    let (n, length) = (members.len(), members.first().map_or(0, |member| member.values.len()));
    let all: Vec<f64> = members.iter().flat_map(|member| &member.values).copied().collect();
    let columns = view_slice(&all, length, n);
    let gram = product(columns.transpose(), columns);
    let Some((values, vectors)) = symmetric_eigen(&gram) else { return Vec::new() };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    let largest = values[order[0]].max(f64::MIN_POSITIVE);
    let kept = order.into_iter().take(count).filter(|&k| values[k] > 1e-9 * largest);
    // The combination with eigenvector v has the length sqrt(value).
    kept.map(|k| {
        let mut function =
            Member { values: vec![0.0; length], constant: 0.0, coefficients: vec![0.0; length] };
        for (i, member) in members.iter().enumerate() {
            function.add(vectors[(i, k)] / divisor.sqrt(), member);
        }
        function
    })
    .collect()
}

/// What the functions of the other groups leave of each member, one fold of the groups at a time, and its root mean
/// square over the centres. `folds` has the fold of each group.
fn what_is_left(groups: &[Vec<Member>], folds: &[usize], count: usize) -> (Vec<Member>, f64) {
    let rests: Vec<Member> = (0..FOLDS)
        .into_par_iter()
        .flat_map_iter(|fold| {
            let group = |inside: bool| {
                let groups = groups.iter().zip(folds).filter(move |(_, own)| (**own == fold) == inside);
                groups.flat_map(|(group, _)| group)
            };
            let others: Vec<&Member> = group(false).collect();
            let divisor = others.len() as f64;
            let functions = principal_functions(&others, divisor, count.min(others.len().saturating_sub(1)));
            let rest = |member: &Member| {
                let mut left = member.clone();
                // The functions are orthogonal.
                for function in &functions {
                    let square = dot(&function.values, &function.values);
                    left.add(-dot(&function.values, &left.values) / square, function);
                }
                left
            };
            group(true).map(rest).collect::<Vec<_>>()
        })
        .collect();
    let squares: f64 = rests.iter().map(|rest| dot(&rest.values, &rest.values)).sum();
    let terms: usize = rests.iter().map(|rest| rest.values.len()).sum();
    (rests, (squares / terms.max(1) as f64).sqrt().max(1e-3))
}

#[cfg(test)]
impl Library {
    /// The achromatic colour of a material at the centres.
    pub(super) fn brightness_of(&self, name: &str) -> Vec<f64> {
        let place = self.names.iter().position(|known| known == name);
        place.map_or_else(Vec::new, |place| self.colours[place][0].values.clone())
    }
}
