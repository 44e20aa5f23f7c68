//! Links pairs of corners that are mutual nearest neighbours along an edge. The edge must have the
//! same dark side over its whole length.

use super::grey::Grey;
use super::saddles::Saddle;
use glam::DVec2;
use rayon::prelude::*;

/// AHEAD: minimum cosine between an edge and the direction to the neighbour. ALIKE: minimum cosine
/// between the neighbour's edge and the direction back.
const AHEAD: f64 = 0.965;
const ALIKE: f64 = 0.9;
/// Maximum number of neighbours that are tried along an edge.
const TRIED: usize = 6;

/// For each corner and each of its edges: the neighbour, and the neighbour's edge that leads back.
pub(super) type Links = Vec<[Option<(usize, usize)>; 4]>;

/// Returns the links for which each of the two corners finds the other.
pub(super) fn links(grey: &Grey, saddles: &[Saddle]) -> Links {
    let one_way: Links = saddles
        .par_iter()
        .map(|from| std::array::from_fn(|edge| next(grey, saddles, from, edge)))
        .collect();
    let mutual = |i: usize, edge: usize| {
        one_way[i][edge].filter(|&(other, back)| one_way[other][back] == Some((i, edge)))
    };
    (0..saddles.len())
        .map(|i| std::array::from_fn(|edge| mutual(i, edge)))
        .collect()
}

/// Finds the nearest saddle along an edge, and its edge that leads back.
fn next(grey: &Grey, saddles: &[Saddle], from: &Saddle, edge: usize) -> Option<(usize, usize)> {
    let direction = from.edges[edge];
    let mut ahead: Vec<(f64, usize)> = saddles
        .iter()
        .enumerate()
        .filter_map(|(i, to)| {
            let step = to.px - from.px;
            let length = step.length();
            (length > 2.0 && step.dot(direction) > AHEAD * length).then_some((length, i))
        })
        .collect();
    if ahead.len() > TRIED {
        ahead.select_nth_unstable_by(TRIED, |a, b| a.0.total_cmp(&b.0));
        ahead.truncate(TRIED);
    }
    ahead.sort_by(|a, b| a.0.total_cmp(&b.0));
    ahead.into_iter().find_map(|(length, i)| {
        let to = &saddles[i];
        let back = (from.px - to.px) / length;
        // The sector after an even-numbered edge is dark, the sector after an odd-numbered edge is
        // light. Seen from the neighbour, the dark side is on the opposite hand. So the neighbour's
        // edge that leads back has odd parity if `edge` is even, and vice versa.
        let returning = [0, 1, 2, 3]
            .into_iter()
            .find(|&k| to.edges[k].dot(back) > ALIKE)?;
        let same = (returning + edge) % 2 == 1 && is_edge(grey, from, to, edge.is_multiple_of(2));
        same.then_some((i, returning))
    })
}

/// Whether the line between two corners is an edge whose dark side is the clockwise side (if
/// `dark_clockwise` is set) or the counter-clockwise side (if not).
fn is_edge(grey: &Grey, from: &Saddle, to: &Saddle, dark_clockwise: bool) -> bool {
    let step = to.px - from.px;
    let length = step.length();
    let aside = step.perp() / length * (0.2 * length).clamp(1.5, 4.0);
    let aside = if dark_clockwise { aside } else { -aside };
    let least = 0.3 * from.contrast.min(to.contrast);
    [0.3, 0.5, 0.7].into_iter().all(|t| {
        let at: DVec2 = from.px + step * t;
        let sides = grey.between(at - aside).zip(grey.between(at + aside));
        sides.is_some_and(|(light, dark)| light - dark > least)
    })
}
