//! `report.html`: one file that shows a calibration, without scripts or anything from elsewhere than
//! its own folder, in the form that both HTML and XML parsers take.

mod coverage;
mod errors;
mod head;
mod html;
mod normal;
mod pictures;
mod residuals;
mod spots;
mod stage;
mod tables;
mod whitened;

use super::about::About;
use super::summary::Summary;
use crate::calibrate::rig::Calibration;
use crate::measure::plot::STYLE;

const PAGE_STYLE: &str = "\
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
a{color:#0060a8}\
@media(prefers-color-scheme:dark){body{background:#16181a;color:#ddd}.note{color:#aaa}\
.warning{border-color:#f0a050}a{color:#6cb8f0}}\
";

/// The whole page.
pub(super) fn page(calibration: &Calibration, about: &About, summary: &Summary) -> String {
    let camera = spots::camera(calibration);
    let projector = spots::projector(calibration);
    let solution = &calibration.solution;
    let sections = [
        ("Figures", head::head(summary)),
        ("Error of each pose", errors::errors(solution)),
        (
            "Residuals over the images",
            residuals::residuals(solution, &camera, &projector),
        ),
        (
            "Whitened residuals",
            whitened::whitened(&camera, &projector),
        ),
        ("Poses", stage::stage(calibration)),
        (
            "Coverage of the images",
            coverage::coverage(solution, &camera, &projector),
        ),
        ("Parameters", tables::parameters(solution)),
        ("Table of poses", tables::poses(solution, about)),
        ("What was found", pictures::pictures(about)),
    ];
    let title = "Calibration of a camera and a projector";
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width\"/>\n<title>{title}</title>\n\
         <style>{PAGE_STYLE}{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n"
    );
    for (name, body) in sections.iter().filter(|(_, body)| !body.is_empty()) {
        out.push_str(&format!("<section>\n<h2>{name}</h2>\n{body}</section>\n"));
    }
    out.push_str("</body>\n</html>\n");
    out
}
