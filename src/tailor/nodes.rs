//! The choice of nodes among the candidates. It starts with the ends of every axis and inserts,
//! again and again, the node that lowers the errors most for the bytes it takes. Then it moves
//! some nodes and drops those that are not needed.
use rayon::prelude::*;

use super::TailorError;
use super::training::{Nodes, Score, Training};

/// A changed set of nodes and its score.
struct Step {
    nodes: Nodes,
    score: Score,
}

/// The number of curves at `nodes`.
fn size(nodes: &Nodes) -> f64 {
    nodes.iter().map(|axis| axis.len() as f64).product()
}

/// The fewest nodes found whose largest error is below `bound`. `go_on` is called before
/// every change; if it returns false, the best nodes so far are returned.
///
/// # Errors
/// Those of `go_on` and of look-ups.
pub(super) fn choose(
    training: &Training,
    bound: f64,
    go_on: &dyn Fn(&Nodes, Score) -> Result<bool, TailorError>,
) -> Result<(Nodes, Score), TailorError> {
    let ends = |axis: &Vec<f64>| match axis.len() {
        1 => vec![0],
        n => vec![0, n - 1],
    };
    let mut nodes: Nodes = training.axes.iter().map(ends).collect();
    let mut score = training.score(&training.exact(&nodes))?;
    while score.max >= bound {
        if !go_on(&nodes, score)? {
            return Ok((nodes, score));
        }
        let steps = scored(training, inserted(training, &nodes))?;
        // The improvement of the error per increase in size, both as logarithms of factors.
        let worth = |step: &Step| {
            (score.typical / step.score.typical).ln() / (size(&step.nodes) / size(&nodes)).ln()
        };
        let best = steps
            .into_iter()
            .max_by(|a, b| worth(a).total_cmp(&worth(b)));
        // Without a step left, all candidates are nodes, and look-ups at them are exact.
        let Some(best) = best else { break };
        (nodes, score) = (best.nodes, best.score);
    }
    loop {
        if !go_on(&nodes, score)? {
            return Ok((nodes, score));
        }
        let steps = scored(training, moved(training, &nodes))?;
        let best = steps
            .into_iter()
            .min_by(|a, b| a.score.typical.total_cmp(&b.score.typical));
        if let Some(best) = best
            && best.score.typical < 0.98 * score.typical
            && best.score.max < bound
        {
            (nodes, score) = (best.nodes, best.score);
            continue;
        }
        let steps = scored(training, dropped(&nodes))?;
        let smallest = steps
            .into_iter()
            .filter(|step| step.score.max < bound)
            .min_by(|a, b| size(&a.nodes).total_cmp(&size(&b.nodes)));
        let Some(smallest) = smallest else {
            return Ok((nodes, score));
        };
        (nodes, score) = (smallest.nodes, smallest.score);
    }
}

/// The candidates for the next step with their scores.
fn scored(training: &Training, candidates: Vec<Nodes>) -> Result<Vec<Step>, TailorError> {
    let step = |nodes: Nodes| {
        let score = training.score(&training.exact(&nodes))?;
        Ok(Step { nodes, score })
    };
    candidates
        .into_par_iter()
        .with_max_len(1)
        .map(step)
        .collect()
}

/// `nodes` with the nodes of one axis replaced by `values`.
fn with(nodes: &Nodes, axis: usize, values: Vec<usize>) -> Nodes {
    let mut changed = nodes.clone();
    changed[axis] = values;
    changed
}

/// All sets with one more node.
fn inserted(training: &Training, nodes: &Nodes) -> Vec<Nodes> {
    let mut candidates = Vec::new();
    for (axis, present) in nodes.iter().enumerate() {
        for new in (0..training.axes[axis].len()).filter(|i| !present.contains(i)) {
            let mut values = [present.as_slice(), &[new]].concat();
            values.sort_unstable();
            candidates.push(with(nodes, axis, values));
        }
    }
    candidates
}

/// All sets with one inner node moved by one candidate up or down.
fn moved(training: &Training, nodes: &Nodes) -> Vec<Nodes> {
    let mut candidates = Vec::new();
    for (axis, present) in nodes.iter().enumerate() {
        for i in 1..present.len().max(1) - 1 {
            for to in [present[i] - 1, present[i] + 1] {
                if to < training.axes[axis].len() && !present.contains(&to) {
                    let mut values = present.clone();
                    values[i] = to;
                    candidates.push(with(nodes, axis, values));
                }
            }
        }
    }
    candidates
}

/// All sets without one of the inner nodes.
fn dropped(nodes: &Nodes) -> Vec<Nodes> {
    let mut candidates = Vec::new();
    for (axis, present) in nodes.iter().enumerate() {
        for i in 1..present.len().max(1) - 1 {
            let mut values = present.clone();
            values.remove(i);
            candidates.push(with(nodes, axis, values));
        }
    }
    candidates
}
