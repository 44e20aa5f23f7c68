//! Places names beside the points of a chart, if there is room.

use crate::plot::{Anchor, Panel, Sheet};
use glam::DVec2;

/// Approximate width of a letter and height of a line.
const LETTER: DVec2 = DVec2::new(6.6, 13.0);
/// Distance from a point to its name.
const GAP: f64 = 6.0;

/// A rectangle on a sheet: upper left and lower right corner.
type Area = [DVec2; 2];

fn overlap(a: &Area, b: &Area) -> bool {
    a[0].cmplt(b[1]).all() && b[0].cmplt(a[1]).all()
}

/// Returns the places of names on a panel, without overlap between names and points. Tries the four
/// sides of each point in turn; a name that does not fit on any of them has no place.
pub(super) fn places(panel: &Panel, points: &[(DVec2, &str)]) -> Vec<Option<(DVec2, Anchor)>> {
    let at: Vec<Option<DVec2>> = points.iter().map(|(p, _)| panel.inside(*p)).collect();
    let dots = at.iter().flatten().map(|at| [*at - 4.0, *at + 4.0]);
    let mut taken: Vec<Area> = dots.collect();
    let whole = [panel.corner, panel.corner + panel.size];
    let mut place = |(at, name): (&Option<DVec2>, &str)| {
        let at = (*at)?;
        let width = LETTER.x * name.chars().count() as f64;
        let half = 0.5 * LETTER.y;
        // Sides of the point (right, left, above, below), each with the text's offset, its anchor, and
        // the distance to the area's left edge.
        let sides = [
            (DVec2::new(GAP, 4.0), Anchor::Start, 0.0),
            (DVec2::new(-GAP, 4.0), Anchor::End, width),
            (DVec2::new(0.0, -GAP), Anchor::Middle, 0.5 * width),
            (
                DVec2::new(0.0, GAP + LETTER.y - 3.0),
                Anchor::Middle,
                0.5 * width,
            ),
        ];
        let found = sides.into_iter().find_map(|(by, anchor, left)| {
            let base = at + by;
            let corner = base - DVec2::new(left, half + 4.0);
            let area = [corner, corner + DVec2::new(width, LETTER.y)];
            let inside = area[0].cmpge(whole[0]).all() && area[1].cmple(whole[1]).all();
            let free = inside && !taken.iter().any(|other| overlap(other, &area));
            free.then_some((base, anchor, area))
        });
        let (base, anchor, area) = found?;
        taken.push(area);
        Some((base, anchor))
    };
    let names = points.iter().map(|(_, name)| *name);
    at.iter().zip(names).map(&mut place).collect()
}

/// Writes the names that have a place.
pub(super) fn draw(sheet: &mut Sheet, panel: &Panel, points: &[(DVec2, &str)]) {
    for (place, (_, name)) in places(panel, points).into_iter().zip(points) {
        if let Some((at, anchor)) = place {
            sheet.text("", at, anchor, name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Axis;

    #[test]
    fn labels_do_not_overlap_and_stay_inside() {
        let panel = Panel {
            corner: DVec2::new(60.0, 20.0),
            size: DVec2::new(300.0, 200.0),
            x: Axis::between("", 0.0, 1.0),
            y: Axis::between("", 0.0, 1.0),
        };
        let point = |x: f64, y: f64, name| (DVec2::new(x, y), name);
        let alone = places(
            &panel,
            &[point(0.5, 0.5, "middle"), point(0.99, 0.5, "right")],
        );
        assert_eq!(alone[0], Some((DVec2::new(216.0, 124.0), Anchor::Start)));
        assert_eq!(alone[1].unwrap().1, Anchor::End, "no room to the right");
        // Crowded points: names that do not fit are left out, and the placed names do not touch.
        let crowd: Vec<_> = (0..20).map(|_| point(0.5, 0.5, "crowded")).collect();
        let placed = places(&panel, &crowd).into_iter().flatten().count();
        assert!((1..=4).contains(&placed), "{placed}");
        let outside = [point(2.0, 0.5, "away"), point(f64::NAN, 0.5, "nowhere")];
        assert_eq!(places(&panel, &outside), [None, None]);
    }
}
