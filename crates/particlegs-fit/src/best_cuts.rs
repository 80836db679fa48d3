//! The choice of cuts to keep: those whose gain for each Gaussian spent is largest.
//!
//! A cut can gain little itself and open the way to cuts that gain much. Its key is therefore the
//! largest mean gain of any part of the tree that starts with it (the convex hull of tree pruning:
//! Chou, Lookabaugh and Gray 1989). Keys never grow on the way down, so the cuts of the largest keys
//! are a tree.

/// A cut that was made in `start .. end`.
#[derive(Clone, Copy, Debug)]
pub(super) struct CutRecord {
    pub start: usize,
    pub mid: usize,
    pub end: usize,
    pub gain: f64,
}

const NONE: u32 = u32::MAX;

/// A group of cuts that are kept or dropped together, a node of a leftist heap of groups.
#[derive(Clone, Copy)]
struct CutGroup {
    gain: f64,
    cuts: u32,
    left: u32,
    right: u32,
    rank: u32,
    /// The group that this one was joined to.
    joined: u32,
}

impl CutGroup {
    fn mean(&self) -> f64 {
        self.gain / f64::from(self.cuts)
    }
}

/// The places of the `keep` best cuts, unsorted.
pub(super) fn best_cuts(mut cuts: Vec<CutRecord>, keep: usize) -> Vec<usize> {
    if cuts.len() > keep {
        // Parents before children, first halves before second ones.
        cuts.sort_unstable_by(|a, b| a.start.cmp(&b.start).then(b.end.cmp(&a.end)));
        let keys = keys(&cuts);
        let mut order: Vec<u32> = (0..cuts.len() as u32).collect();
        order.sort_unstable_by(|&a, &b| keys[b as usize].total_cmp(&keys[a as usize]).then(a.cmp(&b)));
        order.truncate(keep);
        return order.into_iter().map(|i| cuts[i as usize].mid).collect();
    }
    cuts.into_iter().map(|m| m.mid).collect()
}

/// Keys of cuts in preorder.
fn keys(cuts: &[CutRecord]) -> Vec<f64> {
    let mut groups: Vec<CutGroup> = cuts
        .iter()
        .map(|m| CutGroup { gain: m.gain, cuts: 1, left: NONE, right: NONE, rank: 1, joined: NONE })
        .collect();
    // Backwards, a cell's halves come before it: their heaps wait on a stack.
    let mut waiting: Vec<(usize, usize, u32)> = Vec::new();
    for i in (0..cuts.len()).rev() {
        let cut = &cuts[i];
        let mut heap = NONE;
        while let Some(&(start, end, root)) = waiting.last()
            && start >= cut.start
            && end <= cut.end
        {
            heap = merge(&mut groups, heap, root);
            waiting.pop();
        }
        // A group of more gain below this cut is to be had with it only: the two become one.
        while heap != NONE && groups[heap as usize].mean() > groups[i].mean() {
            let top = groups[heap as usize];
            groups[i].gain += top.gain;
            groups[i].cuts += top.cuts;
            groups[heap as usize].joined = i as u32;
            heap = merge(&mut groups, top.left, top.right);
        }
        let root = merge(&mut groups, heap, i as u32);
        waiting.push((cut.start, cut.end, root));
    }
    // Groups are joined to cuts before them, whose keys are known by then.
    let mut keys = vec![0.0; cuts.len()];
    for i in 0..cuts.len() {
        let joined = groups[i].joined;
        keys[i] = if joined == NONE { groups[i].mean() } else { keys[joined as usize] };
    }
    keys
}

/// Merges two leftist heaps, largest mean on top, along their right spines.
fn merge(groups: &mut [CutGroup], a: u32, b: u32) -> u32 {
    let (mut a, mut b) = (a, b);
    let mut spine: Vec<u32> = Vec::new();
    while a != NONE && b != NONE {
        if groups[b as usize].mean() > groups[a as usize].mean() {
            std::mem::swap(&mut a, &mut b);
        }
        spine.push(a);
        a = groups[a as usize].right;
    }
    let mut merged = if a == NONE { b } else { a };
    let rank = |groups: &[CutGroup], i: u32| if i == NONE { 0 } else { groups[i as usize].rank };
    while let Some(top) = spine.pop() {
        let (left, right) = (groups[top as usize].left, merged);
        let swap = rank(groups, left) < rank(groups, right);
        let (left, right) = if swap { (right, left) } else { (left, right) };
        let node_rank = rank(groups, right) + 1;
        let node = &mut groups[top as usize];
        (node.left, node.right, node.rank) = (left, right, node_rank);
        merged = top;
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_poor_cut_before_rich_ones_is_taken() {
        let cut = |start, mid, end, gain| CutRecord { start, mid, end, gain };
        let cuts = vec![
            cut(0, 8, 16, 10.0),
            cut(0, 4, 8, 3.0),
            cut(8, 12, 16, 1.0),
            cut(8, 10, 12, 9.0),
            cut(12, 14, 16, 8.0),
        ];
        let kept_places = |n| {
            let mut k = best_cuts(cuts.clone(), n);
            k.sort_unstable();
            k
        };
        assert_eq!(kept_places(1), [8]);
        assert_eq!(kept_places(4), [8, 10, 12, 14]);
        assert_eq!(kept_places(5), [4, 8, 10, 12, 14]);
    }

    #[test]
    fn keys_fall_on_the_way_down() {
        // A random tree over 0 .. 4096.
        fn grow(start: usize, end: usize, out: &mut Vec<CutRecord>) {
            if end - start < 2 {
                return;
            }
            let mut r = particlegs_core::math::Random::new(1, start as u32, end as u64);
            let mid = start + 1 + (r.uniform() * (end - start - 1) as f64) as usize;
            out.push(CutRecord { start, mid, end, gain: r.uniform() });
            grow(start, mid, out);
            grow(mid, end, out);
        }
        let mut cuts = Vec::new();
        grow(0, 4096, &mut cuts);
        let keys = keys(&cuts);
        for (i, a) in cuts.iter().enumerate() {
            let parent = cuts[..i].iter().rposition(|b| b.start <= a.start && a.end <= b.end);
            assert!(parent.is_none_or(|p| keys[p] >= keys[i]));
        }
    }
}
