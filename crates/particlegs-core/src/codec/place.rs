//! The encoder's search for places: trellis-coded on three axes of each Gaussian, the least error measured in the
//! Gaussian's own widths (docs/format.md, section 11).

use super::trellis::{NEXT, STATES, TrellisState, nearest};

/// Gaussians that are decided together; bounds the memory of the search.
const WINDOW: usize = 1 << 12;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PlacementTarget {
    /// Levels of each axis.
    pub levels: [u64; 3],
    /// Place in levels, each within 0 to the number of levels.
    pub place: [f64; 3],
    /// Width of a level in steps of the shape's axis: what an error costs is the square of it.
    pub coarse: [f64; 3],
    /// By how many levels the best place on axis 1 moves for an error of one step on axis 0, on axis 2 for one on 0 and 1.
    pub moves: [f64; 3],
}

#[derive(Clone, Copy)]
struct TrellisPath {
    cost: f64,
    /// Errors of the Gaussian's axes so far, in steps of its shape.
    error: [f64; 3],
}

/// Steps into each state: the state before, and the index.
type TrellisStep = [(u8, i64); STATES];

/// Levels, and quarter levels of the places of least total error (Viterbi).
pub(crate) fn quantise_places(count: usize, target: impl Fn(usize) -> PlacementTarget) -> Vec<[[u64; 3]; 2]> {
    let mut out = vec![[[1; 3], [2; 3]]; count];
    let mut state = TrellisState::default();
    let mut steps: Vec<TrellisStep> = Vec::with_capacity(3 * WINDOW.min(count));
    for start in (0..count).step_by(WINDOW) {
        let end = count.min(start + WINDOW);
        let mut paths = [TrellisPath { cost: f64::INFINITY, error: [0.0; 3] }; STATES];
        paths[state.number()].cost = 0.0;
        steps.clear();
        for i in start..end {
            let target = target(i);
            out[i][0] = target.levels;
            for axis in 0..3 {
                if target.levels[axis] > 1 {
                    steps.push(choose(&mut paths, &target, axis));
                } else {
                    paths.iter_mut().for_each(|path| path.add(axis, &target, 0.5));
                }
            }
        }
        let best = (0..STATES).min_by(|&a, &b| paths[a].cost.total_cmp(&paths[b].cost)).unwrap_or(0);
        state = TrellisState::from_number(best);
        let mut s = best;
        for i in (start..end).rev() {
            let levels = out[i][0];
            for axis in (0..3).rev().filter(|&axis| levels[axis] > 1) {
                let Some(step) = steps.pop() else { break };
                let (from, index) = step[s];
                s = usize::from(from);
                out[i][1][axis] = 4 * index as u64 + 1 + 2 * (s as u64 & 1);
            }
        }
    }
    out
}

/// Codes one axis: the cheapest way into each state.
fn choose(paths: &mut [TrellisPath; STATES], target: &PlacementTarget, axis: usize) -> TrellisStep {
    let mut next = [TrellisPath { cost: f64::INFINITY, error: [0.0; 3] }; STATES];
    let mut step: TrellisStep = [(0, 0); STATES];
    let range = [0, target.levels[axis] as i64 - 1];
    for s in 0..STATES {
        let path = paths[s];
        if path.cost == f64::INFINITY {
            continue;
        }
        let lattice = 0.25 + 0.5 * (s & 1) as f64;
        let wanted = path.wanted(axis, target);
        for parity in 0..2 {
            let Some(index) = nearest(wanted - lattice, parity, range) else { continue };
            let mut candidate = path;
            candidate.add(axis, target, index as f64 + lattice);
            let to = usize::from(NEXT[s][parity as usize]);
            if candidate.cost < next[to].cost {
                next[to] = candidate;
                step[to] = (s as u8, index);
            }
        }
    }
    *paths = next;
    step
}

impl TrellisPath {
    /// The place on an axis that leaves no error in the widths of the Gaussian, those of earlier axes given.
    fn wanted(&self, axis: usize, target: &PlacementTarget) -> f64 {
        let [a, b, _] = self.error;
        let shift = match axis {
            0 => 0.0,
            1 => target.moves[0] * a,
            _ => target.moves[1] * a + target.moves[2] * b,
        };
        target.place[axis] + shift
    }

    fn add(&mut self, axis: usize, target: &PlacementTarget, place: f64) {
        let error = (place - self.wanted(axis, target)) * target.coarse[axis];
        self.error[axis] = error;
        self.cost += error * error;
    }
}
