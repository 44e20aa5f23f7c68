//! The sheet that plots are drawn on, and the style sheets of plots and their pages.

use super::text::{coordinate, escaped};
use glam::DVec2;
use std::fmt::Write;

/// The part of a text that lies at the given position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Start of the text.
    Start,
    /// Middle of the text.
    Middle,
    /// End of the text.
    End,
}

impl Anchor {
    fn word(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// A drawing in progress: x to the right, y down, units of about a screen pixel. Marks with a coordinate
/// that is not finite are omitted. `class` is one or more classes of the style.
#[derive(Debug, Clone)]
pub struct Sheet {
    size: DVec2,
    body: String,
}

impl Sheet {
    /// Makes an empty sheet of this size.
    pub fn new(width: f64, height: f64) -> Self {
        Self {
            size: DVec2::new(width, height),
            body: String::new(),
        }
    }

    /// Draws a line through points; `closed` joins its ends. `tip` is its tooltip.
    pub fn polyline(&mut self, class: &str, points: &[DVec2], closed: bool, tip: Option<&str>) {
        if points.is_empty() || points.iter().any(|p| !p.is_finite()) {
            return;
        }
        let name = if closed { "polygon" } else { "polyline" };
        self.write(format_args!(
            "<{name} class=\"{}\" points=\"",
            escaped(class)
        ));
        for (i, p) in points.iter().enumerate() {
            let gap = if i == 0 { "" } else { " " };
            let (x, y) = (coordinate(p.x), coordinate(p.y));
            self.write(format_args!("{gap}{x},{y}"));
        }
        self.end(name, tip);
    }

    /// Draws separate lines as one element.
    pub fn lines(&mut self, class: &str, lines: impl IntoIterator<Item = [DVec2; 2]>) {
        let mut path = String::new();
        for [from, to] in lines {
            if from.is_finite() && to.is_finite() {
                let [a, b] = [coordinate(from.x), coordinate(from.y)];
                let [c, d] = [coordinate(to.x), coordinate(to.y)];
                // Writing to a string does not fail.
                let _ = write!(path, "M{a} {b}L{c} {d}");
            }
        }
        if !path.is_empty() {
            self.write(format_args!(
                "<path class=\"{}\" d=\"{path}\"/>\n",
                escaped(class)
            ));
        }
    }

    /// Draws a rectangle, given its upper left corner and its size.
    pub fn rect(&mut self, class: &str, corner: DVec2, size: DVec2, tip: Option<&str>) {
        if corner.is_finite() && size.is_finite() {
            self.write(format_args!(
                "<rect class=\"{}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}",
                escaped(class),
                coordinate(corner.x),
                coordinate(corner.y),
                coordinate(size.x.max(0.0)),
                coordinate(size.y.max(0.0))
            ));
            self.end("rect", tip);
        }
    }

    /// Draws a disc.
    pub fn disc(&mut self, class: &str, centre: DVec2, radius: f64, tip: Option<&str>) {
        if centre.is_finite() && radius.is_finite() {
            self.write(format_args!(
                "<circle class=\"{}\" cx=\"{}\" cy=\"{}\" r=\"{}",
                escaped(class),
                coordinate(centre.x),
                coordinate(centre.y),
                coordinate(radius.max(0.0))
            ));
            self.end("circle", tip);
        }
    }

    /// Draws a line of text; `at` is on its baseline. `class` may be empty.
    pub fn text(&mut self, class: &str, at: DVec2, anchor: Anchor, words: &str) {
        self.words(class, at, anchor, words, false);
    }

    /// Draws a line of text that reads upwards.
    pub fn text_upwards(&mut self, class: &str, at: DVec2, anchor: Anchor, words: &str) {
        self.words(class, at, anchor, words, true);
    }

    fn words(&mut self, class: &str, at: DVec2, anchor: Anchor, words: &str, upwards: bool) {
        if !at.is_finite() {
            return;
        }
        let (x, y) = (coordinate(at.x), coordinate(at.y));
        let turn = if upwards {
            format!(" transform=\"rotate(-90 {x} {y})\"")
        } else {
            String::new()
        };
        self.write(format_args!(
            "<text class=\"{}\" x=\"{x}\" y=\"{y}\" text-anchor=\"{}\"{turn}>{}</text>\n",
            escaped(class),
            anchor.word(),
            escaped(words)
        ));
    }

    /// Ends an attribute and its element, with a tooltip if there is one.
    fn end(&mut self, name: &str, tip: Option<&str>) {
        match tip {
            Some(tip) => {
                let tip = escaped(tip);
                self.write(format_args!("\"><title>{tip}</title></{name}>\n"));
            }
            None => self.write(format_args!("\"/>\n")),
        }
    }

    fn write(&mut self, what: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = self.body.write_fmt(what);
    }

    /// Returns the drawing as an element for a page that contains [`STYLE`]; `label` is the description
    /// for screen readers.
    pub fn into_element(self, label: &str) -> String {
        self.element(label, "", "")
    }

    /// Returns the drawing as the contents of a file.
    pub fn into_file(self, label: &str) -> String {
        let style = format!("<style>{STYLE}</style>\n");
        self.element(label, " xmlns=\"http://www.w3.org/2000/svg\"", &style)
    }

    fn element(self, label: &str, space: &str, style: &str) -> String {
        let (width, height) = (coordinate(self.size.x), coordinate(self.size.y));
        format!(
            "<svg{space} class=\"plot\" role=\"img\" aria-label=\"{}\" width=\"{width}\" \
             height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n{style}{}</svg>\n",
            escaped(label),
            self.body
        )
    }
}

/// Style of every plot, for light and dark backgrounds. The colours of `c0` (blue) and `c1` (orange) are
/// distinguishable with any colour vision.
pub const STYLE: &str = "\
.plot{font:12px system-ui,sans-serif;max-width:100%;height:auto}\
.plot text{fill:#333}\
.plot .name{font-weight:600}\
.plot .frame{fill:none;stroke:#999}\
.plot .grid{stroke:#888;stroke-opacity:.22}\
.plot .line{fill:none;stroke-width:1.5}\
.plot .thin{fill:none;stroke-width:.8;stroke-opacity:.75}\
.plot .faint{fill:none;stroke:#777;stroke-width:.8}\
.plot .ring{fill:none;stroke:#c00000;stroke-width:1.5}\
.plot .fill{fill-opacity:.85}\
.plot .area{fill-opacity:.12;stroke-width:1}\
.plot .veil{fill-opacity:.04;stroke-width:.8;stroke-opacity:.7}\
.plot .c0{stroke:#0060a8}.plot .fill.c0{stroke:none}.plot .c0.fill,.plot .c0.area,.plot .c0.veil{fill:#0060a8}\
.plot .c1{stroke:#c24a00}.plot .fill.c1{stroke:none}.plot .c1.fill,.plot .c1.area,.plot .c1.veil{fill:#c24a00}\
.plot .c2{stroke:#555}.plot .fill.c2{stroke:none}.plot .c2.fill,.plot .c2.area,.plot .c2.veil{fill:#555}\
.plot .c3{stroke:#007a55}.plot .fill.c3{stroke:none}.plot .c3.fill,.plot .c3.area,.plot .c3.veil{fill:#007a55}\
.plot .c4{stroke:#8a3fa0}.plot .fill.c4{stroke:none}.plot .c4.fill,.plot .c4.area,.plot .c4.veil{fill:#8a3fa0}\
.plot .c5{stroke:#8a6d00}.plot .fill.c5{stroke:none}.plot .c5.fill,.plot .c5.area,.plot .c5.veil{fill:#8a6d00}\
.plot .c6{stroke:#b0205a}.plot .fill.c6{stroke:none}.plot .c6.fill,.plot .c6.area,.plot .c6.veil{fill:#b0205a}\
.plot .c7{stroke:#006f80}.plot .fill.c7{stroke:none}.plot .c7.fill,.plot .c7.area,.plot .c7.veil{fill:#006f80}\
.plot .dash{stroke-dasharray:5 4}\
@media(prefers-color-scheme:dark){\
.plot text{fill:#ddd}\
.plot .frame{stroke:#888}\
.plot .faint{stroke:#aaa}\
.plot .c0{stroke:#6cb8f0}.plot .c0.fill,.plot .c0.area,.plot .c0.veil{fill:#6cb8f0}\
.plot .c1{stroke:#f0a050}.plot .c1.fill,.plot .c1.area,.plot .c1.veil{fill:#f0a050}\
.plot .c3{stroke:#4cc79a}.plot .c3.fill,.plot .c3.area,.plot .c3.veil{fill:#4cc79a}\
.plot .c4{stroke:#c890dc}.plot .c4.fill,.plot .c4.area,.plot .c4.veil{fill:#c890dc}\
.plot .c5{stroke:#d4b840}.plot .c5.fill,.plot .c5.area,.plot .c5.veil{fill:#d4b840}\
.plot .c6{stroke:#f080a8}.plot .c6.fill,.plot .c6.area,.plot .c6.veil{fill:#f080a8}\
.plot .c7{stroke:#58c4d4}.plot .c7.fill,.plot .c7.area,.plot .c7.veil{fill:#58c4d4}\
.plot .c2{stroke:#bbb}.plot .c2.fill,.plot .c2.area,.plot .c2.veil{fill:#bbb}}\
";

/// Style of pages with plots, such as reports.
pub const PAGE_STYLE: &str = "\
:root{color-scheme:light dark}\
body{font:15px/1.45 system-ui,sans-serif;max-width:1000px;margin:1.5em auto;padding:0 1em;\
background:#fff;color:#222}\
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums;margin:.6em 0}\
th,td{padding:.15em .7em;text-align:right;border-bottom:1px solid #8884}\
th:first-child,td:first-child{text-align:left}\
td.words{text-align:left}\
.wide{overflow-x:auto}\
.note{color:#666;max-width:46em}\
.warning{border-left:4px solid #c24a00;padding-left:.8em}\
figure{display:inline-block;margin:.4em}figure img{max-width:300px;height:auto}\
figure.large img{max-width:100%}\
a{color:#0060a8}\
@media(prefers-color-scheme:dark){body{background:#16181a;color:#ddd}.note{color:#aaa}\
.warning{border-color:#f0a050}a{color:#6cb8f0}}\
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_at_invalid_positions_are_left_out() {
        let mut sheet = Sheet::new(10.0, 10.0);
        let nan = DVec2::new(f64::NAN, 1.0);
        sheet.polyline("line", &[nan, DVec2::ONE], false, None);
        sheet.lines("line", [[nan, DVec2::ONE]]);
        sheet.rect("fill", nan, DVec2::ONE, None);
        sheet.disc("fill", DVec2::ONE, f64::INFINITY, None);
        sheet.text("", nan, Anchor::Start, "x");
        let element = sheet.into_element("nothing");
        assert!(!element.contains("NaN") && !element.contains("inf"));
        assert_eq!(element.lines().count(), 2, "{element}");
    }

    #[test]
    fn words_from_elsewhere_are_escaped() {
        let mut sheet = Sheet::new(10.0, 10.0);
        let bad = "</svg><script>\"'";
        sheet.text(bad, DVec2::ONE, Anchor::End, bad);
        sheet.rect(bad, DVec2::ZERO, DVec2::ONE, Some(bad));
        let file = sheet.into_file(bad);
        assert_eq!(file.matches("</svg>").count(), 1);
        assert!(!file.contains("<script>"));
        assert!(file.contains("xmlns"));
    }
}
