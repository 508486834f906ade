//! The order in which an instrument visits directions.

use super::device::Geometry;

/// What it costs to turn each axis of an instrument by one degree. All axes turn at the same time, so that a move costs
/// as much as its most expensive axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCosts {
    /// The light's angle from the normal.
    pub theta_i: f64,
    /// The light's azimuth, which stays where it is.
    pub phi_i: f64,
    /// The detector's angle from the normal.
    pub theta_o: f64,
    /// The detector's azimuth.
    pub phi_o: f64,
}

impl Default for AxisCosts {
    /// 1 per degree of each axis.
    fn default() -> Self {
        Self { theta_i: 1.0, phi_i: 1.0, theta_o: 1.0, phi_o: 1.0 }
    }
}

impl AxisCosts {
    /// The cost of a move. The detector's azimuth means nothing where it stands on the normal, but its axis turns all
    /// the same.
    #[must_use]
    pub fn of_move(&self, from: &Geometry, to: &Geometry) -> f64 {
        let turn = |cost: f64, a: f64, b: f64| cost * (a - b).abs();
        turn(self.theta_i, from.theta_i, to.theta_i)
            .max(turn(self.theta_o, from.theta_o, to.theta_o))
            .max(turn(self.phi_o, from.phi_o, to.phi_o))
    }

    /// The cost of a way through geometries in an order, from light and detector on the normal.
    #[must_use]
    pub fn of_way(&self, geometries: &[Geometry], order: &[usize]) -> f64 {
        let mut at = Geometry::default();
        let mut cost = 0.0;
        for &i in order {
            cost += self.of_move(&at, &geometries[i]);
            at = geometries[i];
        }
        cost
    }
}

/// A short order: from the normal always to the nearest geometry that was not visited, then improved by 2-opt (G. A.
/// Croes, "A Method for Solving Traveling-Salesman Problems", Operations Research 6, 1958), which turns parts of the
/// way around as long as that makes it shorter. The order that was given is improved too, and the shorter way is taken.
/// Cost: `O(n^2)` per round of improvements.
#[must_use]
pub fn tour(geometries: &[Geometry], costs: &AxisCosts) -> Vec<usize> {
    let mut ways = [(0..geometries.len()).collect(), nearest_first(geometries, costs)];
    ways.iter_mut().for_each(|way| improve(geometries, costs, way));
    let [given, nearest] = ways;
    if costs.of_way(geometries, &nearest) <= costs.of_way(geometries, &given) { nearest } else { given }
}

fn nearest_first(geometries: &[Geometry], costs: &AxisCosts) -> Vec<usize> {
    let mut open: Vec<usize> = (0..geometries.len()).collect();
    let mut at = Geometry::default();
    let mut way = Vec::with_capacity(open.len());
    while !open.is_empty() {
        let distance = |&i: &usize| costs.of_move(&at, &geometries[i]);
        let nearest = (0..open.len()).min_by(|&a, &b| distance(&open[a]).total_cmp(&distance(&open[b])));
        let next = open.remove(nearest.unwrap_or(0));
        at = geometries[next];
        way.push(next);
    }
    way
}

/// Turns parts of the way around while that makes it shorter.
fn improve(geometries: &[Geometry], costs: &AxisCosts, way: &mut [usize]) {
    let n = way.len();
    loop {
        let mut is_shorter = false;
        for first in 0..n {
            for last in first + 1..n {
                let at = |place: usize| geometries[way[place]];
                let before = if first == 0 { Geometry::default() } else { at(first - 1) };
                let mut gain = costs.of_move(&before, &at(first)) - costs.of_move(&before, &at(last));
                if last + 1 < n {
                    let after = at(last + 1);
                    gain += costs.of_move(&at(last), &after) - costs.of_move(&at(first), &after);
                }
                if gain > 1e-9 {
                    way[first..=last].reverse();
                    is_shorter = true;
                }
            }
        }
        if !is_shorter {
            return;
        }
    }
}
