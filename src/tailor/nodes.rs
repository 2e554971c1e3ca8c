//! Which of the candidates become nodes: from the ends of every axis on, always
//! the one that lowers the errors most for the bytes it takes; then some are moved,
//! and those that prove needless are dropped.
use rayon::prelude::*;

use super::TailorError;
use super::training::{Nodes, Score, Training};

/// A way to change nodes, and what comes of it.
struct Step {
    nodes: Nodes,
    judgement: Score,
}

/// Number of curves.
fn size(nodes: &Nodes) -> f64 {
    nodes.iter().map(|axis| axis.len() as f64).product()
}

/// The fewest nodes found whose largest error is below `bound`; `go_on` is asked
/// before every change, and the best nodes so far are given when it says no.
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
    let mut here = training.judge(&training.exact(&nodes))?;
    while here.max >= bound {
        if !go_on(&nodes, here)? {
            return Ok((nodes, here));
        }
        let steps = tried(training, inserted(training, &nodes))?;
        // what a step brings per byte, both as factors
        let worth = |step: &Step| {
            (here.typical / step.judgement.typical).ln() / (size(&step.nodes) / size(&nodes)).ln()
        };
        let best = steps
            .into_iter()
            .max_by(|a, b| worth(a).total_cmp(&worth(b)));
        // all candidates are nodes: their own curves are answered exactly
        let Some(best) = best else { break };
        (nodes, here) = (best.nodes, best.judgement);
    }
    loop {
        if !go_on(&nodes, here)? {
            return Ok((nodes, here));
        }
        let steps = tried(training, moved(training, &nodes))?;
        let best = steps
            .into_iter()
            .min_by(|a, b| a.judgement.typical.total_cmp(&b.judgement.typical));
        if let Some(best) = best
            && best.judgement.typical < 0.98 * here.typical
            && best.judgement.max < bound
        {
            (nodes, here) = (best.nodes, best.judgement);
            continue;
        }
        let steps = tried(training, dropped(&nodes))?;
        let smallest = steps
            .into_iter()
            .filter(|step| step.judgement.max < bound)
            .min_by(|a, b| size(&a.nodes).total_cmp(&size(&b.nodes)));
        let Some(smallest) = smallest else {
            return Ok((nodes, here));
        };
        (nodes, here) = (smallest.nodes, smallest.judgement);
    }
}

fn tried(training: &Training, all: Vec<Nodes>) -> Result<Vec<Step>, TailorError> {
    let step = |nodes: Nodes| {
        let judgement = training.judge(&training.exact(&nodes))?;
        Ok(Step { nodes, judgement })
    };
    all.into_par_iter().with_max_len(1).map(step).collect()
}

fn with(nodes: &Nodes, axis: usize, values: Vec<usize>) -> Nodes {
    let mut changed = nodes.clone();
    changed[axis] = values;
    changed
}

/// One more node.
fn inserted(training: &Training, nodes: &Nodes) -> Vec<Nodes> {
    let mut all = Vec::new();
    for (axis, there) in nodes.iter().enumerate() {
        for new in (0..training.axes[axis].len()).filter(|i| !there.contains(i)) {
            let mut values = [there.as_slice(), &[new]].concat();
            values.sort_unstable();
            all.push(with(nodes, axis, values));
        }
    }
    all
}

/// One node between the ends by one candidate up or down.
fn moved(training: &Training, nodes: &Nodes) -> Vec<Nodes> {
    let mut all = Vec::new();
    for (axis, there) in nodes.iter().enumerate() {
        for i in 1..there.len().max(1) - 1 {
            for to in [there[i] - 1, there[i] + 1] {
                if to < training.axes[axis].len() && !there.contains(&to) {
                    let mut values = there.clone();
                    values[i] = to;
                    all.push(with(nodes, axis, values));
                }
            }
        }
    }
    all
}

/// One node between the ends less.
fn dropped(nodes: &Nodes) -> Vec<Nodes> {
    let mut all = Vec::new();
    for (axis, there) in nodes.iter().enumerate() {
        for i in 1..there.len().max(1) - 1 {
            let mut values = there.clone();
            values.remove(i);
            all.push(with(nodes, axis, values));
        }
    }
    all
}
