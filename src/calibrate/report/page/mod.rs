//! `report.html`: a single page that shows a calibration. It contains no scripts, refers only to
//! files in its own folder, and is valid for both HTML and XML parsers.
//!
//! | File | Section |
//! | --- | --- |
//! | `head` | key figures |
//! | `residuals`, `whitened` | error of each pose and residual vectors, whitened residuals |
//! | `stage` | drawing of rig and boards |
//! | `coverage` | coverage of the images |
//! | `tables` | parameters and poses |
//! | `spots`, `html` | points of all poses, HTML elements |

mod coverage;
mod head;
mod html;
mod residuals;
mod spots;
mod stage;
mod tables;
mod whitened;

use super::about::About;
use super::summary::Summary;
use crate::rig::Calibration;
use html::address;
use phasmid_report::plot::{PAGE_STYLE, STYLE, escaped};

/// The whole page.
pub(super) fn page(calibration: &Calibration, about: &About, summary: &Summary) -> String {
    let camera = spots::camera(calibration);
    let projector = spots::projector(calibration);
    let solution = &calibration.solution;
    let sections = [
        ("Figures", head::head(summary)),
        ("Error of each pose", residuals::errors(solution)),
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
        ("What was found", images(about)),
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

/// Images of the detected boards, stored beside the page.
fn images(about: &About) -> String {
    about
        .images
        .iter()
        .map(|(pose, file)| {
            let (pose, file) = (escaped(pose), address(file));
            format!(
                "<figure><a href=\"{file}\"><img src=\"{file}\" alt=\"{pose}\" loading=\"lazy\"/>\
                 </a><figcaption>{pose}</figcaption></figure>\n"
            )
        })
        .collect()
}
