//! Draws charts of several series on two axes, with a legend.

use super::document::Figure;
use super::labels;
use crate::plot::{Anchor, Axis, Panel, ROOM, Sheet, curve, dots, spans};
use glam::DVec2;

/// Width and height of a chart's panel.
const SIZE: DVec2 = DVec2::new(560.0, 330.0);
const HEADING: f64 = 28.0;
const LEGEND: f64 = 250.0;

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesStyle {
    /// A line through the points.
    Line,
    /// A dashed line: bounds and published figures.
    Dashed,
    /// Points without a line.
    Dots,
    /// Points and a line through them.
    Both,
    /// Points as red rings: results that are left out.
    Rings,
}

/// One series.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Style in which the series is drawn.
    pub style: SeriesStyle,
    /// Values along x and y; values that are not finite are omitted.
    pub points: Vec<DVec2>,
    /// Tooltip of each point; may be shorter than `points`.
    pub tips: Vec<String>,
    /// Whether the tooltips are also written beside the points, if there is room.
    pub labelled: bool,
    /// Error bars: x, low, high.
    pub spans: Vec<[f64; 3]>,
    /// Whether the series has the colour of the previous one, as for truth and measurement of one
    /// quantity.
    pub paired: bool,
}

impl Series {
    /// Makes a series without tooltips and error bars.
    pub fn new(
        name: &str,
        style: SeriesStyle,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self {
            name: name.to_owned(),
            style,
            points: points.into_iter().map(DVec2::from).collect(),
            tips: Vec::new(),
            labelled: false,
            spans: Vec::new(),
            paired: false,
        }
    }

    /// Gives the series the colour of the previous one.
    #[must_use]
    pub fn paired(mut self) -> Self {
        self.paired = true;
        self
    }
}

/// A chart.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Heading above the chart.
    pub heading: String,
    /// Label of the horizontal axis, with the unit.
    pub x: String,
    /// Label of the vertical axis, with the unit.
    pub y: String,
    /// Whether x and y are logarithmic.
    pub log: [bool; 2],
    /// The series, in drawing order.
    pub series: Vec<Series>,
}

impl Chart {
    /// Returns the chart as a figure of a document.
    pub fn figure(&self, name: &str, caption: impl Into<String>) -> Figure {
        Figure {
            name: name.to_owned(),
            caption: caption.into(),
            sheet: self.sheet(),
        }
    }

    /// Draws the chart. Colours repeat after eight unpaired series. The legend omits series without a
    /// point in the panel.
    pub fn sheet(&self) -> Sheet {
        let rows = self.series.len() as f64;
        let height = (HEADING + SIZE.y + ROOM.y).max(HEADING + 20.0 * rows);
        let mut sheet = Sheet::new(ROOM.x + SIZE.x + LEGEND, height);
        let panel = Panel {
            corner: DVec2::new(ROOM.x, HEADING),
            size: SIZE,
            x: self.axis(&self.x, 0),
            y: self.axis(&self.y, 1),
        };
        panel.draw(&mut sheet);
        panel.head(&mut sheet, &self.heading);
        let mut named = 0.0;
        let mut colours = 0;
        for (i, series) in self.series.iter().enumerate() {
            if i > 0 && !series.paired && series.style != SeriesStyle::Rings {
                colours += 1;
            }
            if !series.points.iter().any(|p| panel.inside(*p).is_some()) {
                continue;
            }
            let colour = format!("c{}", colours % 8);
            let dash = if series.style == SeriesStyle::Dashed {
                " dash"
            } else {
                ""
            };
            let class = format!("{colour}{dash}");
            let line = !matches!(series.style, SeriesStyle::Dots | SeriesStyle::Rings);
            let dot = match series.style {
                SeriesStyle::Dots | SeriesStyle::Both => Some(format!("fill {colour}")),
                SeriesStyle::Rings => Some("ring".to_owned()),
                SeriesStyle::Line | SeriesStyle::Dashed => None,
            };
            if line {
                curve(&mut sheet, &panel, &class, &series.points);
            }
            if let Some(class) = &dot {
                dots(&mut sheet, &panel, class, 3.0, &series.points, &series.tips);
            }
            spans(&mut sheet, &panel, &colour, &series.spans);
            let at = DVec2::new(ROOM.x + SIZE.x + 14.0, HEADING + 10.0 + 20.0 * named);
            named += 1.0;
            let end = at + DVec2::new(22.0, 0.0);
            if line {
                sheet.polyline(&format!("line {class}"), &[at, end], false, None);
            }
            if let Some(class) = &dot {
                sheet.disc(class, (at + end) / 2.0, 3.0, None);
            }
            let words = end + DVec2::new(6.0, 4.0);
            sheet.text("", words, Anchor::Start, &series.name);
        }
        let named = self.series.iter().filter(|series| series.labelled);
        let named = named.flat_map(|series| {
            let tips = series.tips.iter().map(String::as_str);
            series.points.iter().copied().zip(tips)
        });
        labels::draw(&mut sheet, &panel, &named.collect::<Vec<_>>());
        sheet
    }

    fn axis(&self, label: &str, which: usize) -> Axis {
        let points = self.series.iter().flat_map(|series| &series.points);
        let values = points.map(|point| point[which]);
        let of_spans = self.series.iter().flat_map(|series| &series.spans);
        let ends = of_spans.flat_map(|&[x, low, high]| match which {
            0 => [x, x],
            _ => [low, high],
        });
        let all = values.chain(ends);
        if self.log[which] {
            Axis::logarithmic(label, all)
        } else {
            Axis::around(label, all)
        }
    }
}
