//! Files of planned directions.

use gpbrdf_core::base::number::significant;
use gpbrdf_core::plan::{Geometry, Plan};

/// A CSV file: comments, the header of a samples file, and one row per direction in degrees, to which measured values
/// are added.
pub(crate) fn plan_csv<'a>(comments: &[String], rows: impl IntoIterator<Item = &'a Geometry>) -> String {
    let mut text = String::new();
    for line in comments {
        text.push_str(&format!("# {line}\n"));
    }
    text.push_str("# add a column value, or r, g and b, with f in 1/sr for each row\n");
    text.push_str("theta_i,phi_i,theta_o,phi_o\n");
    for Geometry { theta_i, theta_o, phi_o } in rows {
        let [theta_i, theta_o, phi_o] = [theta_i, theta_o, phi_o].map(rounded);
        text.push_str(&format!("{theta_i},0,{theta_o},{phi_o}\n"));
    }
    text
}

/// The expected error before and after some of the directions, for a comment.
pub(crate) fn expected_errors(plan: &Plan) -> String {
    let count = plan.geometries.len();
    let mut marks: Vec<usize> = [5, 10, 20, 50, 100, 200, 500].into_iter().filter(|&m| m < count).collect();
    marks.push(count);
    let after: Vec<String> =
        marks.iter().map(|&m| format!("{} after {m}", significant(plan.errors[m], 3))).collect();
    format!("expected error of ln f by rank: {} now, {}", significant(plan.errors[0], 3), after.join(", "))
}

/// A multiple of a step without what rounding has added.
fn rounded(degrees: &f64) -> f64 {
    (degrees * 1e9).round() / 1e9
}
