//! Draws bar charts.

use super::{Anchor, Panel, Sheet, figures};
use glam::DVec2;

/// Draws vertical bars over the whole width of a panel, with their names below. The names are horizontal
/// if there is room, else rotated to read upwards; only every n-th name is drawn if rotated names would
/// overlap. A value that is not finite leaves a gap. The panel's x axis is ignored.
pub fn bars(sheet: &mut Sheet, panel: &Panel, class: &str, bars: &[(&str, f64)], unit: &str) {
    panel.draw_rows(sheet);
    let pitch = panel.size.x / bars.len().max(1) as f64;
    let width = (0.74 * pitch).min(40.0);
    let foot = panel.corner.y + panel.size.y;
    let middle = |i: usize| panel.corner.x + (i as f64 + 0.5) * pitch;
    for (i, (name, value)) in bars.iter().enumerate() {
        let Some(t) = panel.y.at(*value) else {
            continue;
        };
        let height = t.clamp(0.0, 1.0) * panel.size.y;
        sheet.rect(
            &format!("fill {class}"),
            DVec2::new(middle(i) - 0.5 * width, foot - height),
            DVec2::new(width, height),
            Some(&format!("{name}: {} {unit}", figures(*value, 4))),
        );
    }
    let names = bars.iter().map(|(name, _)| *name);
    let upright = longest(names) as f64 * LETTER < pitch;
    let every = if upright {
        1
    } else {
        (13.0 / pitch).ceil() as usize
    };
    for (i, (name, _)) in bars.iter().enumerate().step_by(every.max(1)) {
        let name = short(name);
        if upright {
            sheet.text(
                "",
                DVec2::new(middle(i), foot + 16.0),
                Anchor::Middle,
                &name,
            );
        } else {
            let at = DVec2::new(middle(i) + 4.0, foot + 8.0);
            sheet.text_upwards("", at, Anchor::End, &name);
        }
    }
}

/// Maximum number of letters of a name below a bar; the tooltip has the whole name.
const LETTERS: usize = 14;
/// Approximate width of a letter on the sheet; a line is 13 high.
const LETTER: f64 = 7.0;

/// Returns the maximum room that the names of bars need below a panel.
pub fn room_for_names<'a>(names: impl IntoIterator<Item = &'a str>) -> f64 {
    longest(names.into_iter()) as f64 * LETTER + 16.0
}

fn longest<'a>(names: impl Iterator<Item = &'a str>) -> usize {
    let letters = names.map(|name| name.chars().count());
    letters.max().unwrap_or(0).min(LETTERS)
}

fn short(name: &str) -> String {
    if name.chars().count() <= LETTERS {
        return name.to_owned();
    }
    let end: Vec<char> = name.chars().rev().take(LETTERS - 1).collect();
    std::iter::once('…').chain(end.into_iter().rev()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Axis;

    #[test]
    fn bar_heights_are_proportional_to_values() {
        let values = [0.25, f64::NAN, 1.0];
        let panel = Panel {
            corner: DVec2::new(60.0, 20.0),
            size: DVec2::new(300.0, 200.0),
            x: Axis::between("", 0.0, 1.0),
            y: Axis::from_zero("px", values),
        };
        let mut sheet = Sheet::new(400.0, 300.0);
        let named: Vec<(&str, f64)> = ["a", "b", "<c>"].into_iter().zip(values).collect();
        bars(&mut sheet, &panel, "c0", &named, "px");
        let text = sheet.into_element("bars");
        let heights: Vec<f64> = text
            .lines()
            .filter(|line| line.contains("fill c0"))
            .map(|line| {
                let height = line.split("height=\"").nth(1).unwrap();
                height.split('"').next().unwrap().parse::<f64>().unwrap()
            })
            .collect();
        let (_, high) = panel.y.range();
        assert_eq!(heights.len(), 2);
        for (height, value) in heights.iter().zip([0.25, 1.0]) {
            assert!((height / 200.0 * high - value).abs() < 1e-4, "{height}");
        }
        assert!(text.contains("&lt;c&gt;: 1.000 px"));
    }

    #[test]
    fn draws_any_number_of_bars_with_few_labels() {
        for count in [0, 1, 20, 5000] {
            let names: Vec<String> = (0..count).map(|i| format!("a long name ä {i}")).collect();
            let named: Vec<(&str, f64)> = names.iter().map(|n| (n.as_str(), 1.0)).collect();
            let panel = Panel {
                corner: DVec2::ZERO,
                size: DVec2::new(300.0, 100.0),
                x: Axis::between("", 0.0, 1.0),
                y: Axis::from_zero("", [1.0]),
            };
            let mut sheet = Sheet::new(300.0, 100.0);
            bars(&mut sheet, &panel, "c0", &named, "");
            let text = sheet.into_element("");
            assert_eq!(text.matches("<rect class=\"fill").count(), count);
            assert!(text.matches("rotate").count() <= 26);
        }
    }
}
