//! What was found in each pose, as pictures beside the page.

use super::html::address;
use crate::calibrate::report::about::About;
use crate::measure::plot::escaped;

pub(super) fn pictures(about: &About) -> String {
    about
        .pictures
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
