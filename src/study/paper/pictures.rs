//! The trapezoid and the torso under fringes, their depth and its error.

use super::bench::{View, around_torso, around_trapezoid, bench, torso, trapezoid};
use super::scan::Scan;
use crate::report::overview;
use image::{GrayImage, ImageFormat};
use phasmid_core::error::{Error, Result};
use phasmid_profile::Scene;
use phasmid_report::lab::{Block, Context, Image, Row, Section, Settings, Trial};
use std::io::Cursor;

const NAMES: [&str; 2] = ["trapezoid", "torso"];

/// A trial for each picture.
pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let one = |name| {
        Trial::new(format!("picture/{name}"), settings.seed, move |context| {
            draw(context, name)
        })
    };
    NAMES.map(one).into()
}

fn draw(context: &Context<'_>, name: &'static str) -> Result<Vec<Row>> {
    let quick = context.settings.quick;
    let (scene, cut): (Scene, _) = match name {
        "trapezoid" => (trapezoid(1000.0)?, around_trapezoid(quick)),
        _ => (torso(View::Left)?, around_torso(quick)),
    };
    let scan = Scan::new(&bench(1.0, cut)?, &scene, context.seed)?;
    let (width, height) = scan.size();
    let frame = GrayImage::from_raw(width as u32, height as u32, scan.frame(0)?.to_vec())
        .ok_or_else(|| Error::device("the frame has a wrong size"))?;
    let picture = overview(&frame, &scan.decoded, &scan.truth, scan.rig());
    let mut png = Cursor::new(Vec::new());
    picture
        .write_to(&mut png, ImageFormat::Png)
        .map_err(|e| Error::device(format!("picture of {name}: {e}")))?;
    context.folder.leave(&file(name), &png.into_inner())?;
    Ok(vec![Row::new().text("case", name)])
}

fn file(name: &str) -> String {
    format!("paper-{name}.png")
}

/// The pictures.
pub(super) fn section() -> Section {
    let captions = [
        "The trapezoid at 1000 mm: a frame with fringes, the depth measured by triangulation, and \
         measured minus true depth.",
        "The torso from its left at 45 degrees, head to the right: fringes, depth and error as \
         above.",
    ];
    let pictures = NAMES.into_iter().zip(captions).map(|(name, caption)| {
        Block::Image(Image {
            file: file(name),
            caption: caption.to_owned(),
        })
    });
    Section {
        title: "Examples".to_owned(),
        blocks: pictures.collect(),
    }
}
