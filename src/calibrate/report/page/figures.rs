//! Images of the detected boards, stored beside the page.

use super::html::address;
use crate::report::about::About;
use phasmid_report::plot::escaped;

pub(super) fn images(about: &About) -> String {
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
