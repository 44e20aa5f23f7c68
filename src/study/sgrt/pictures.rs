//! A patient under fringes, the scanned surface and its error.

use super::inputs::SIZE_PX;
use crate::clinic::{InRoom, Pods, binned};
use crate::report::overview;
use image::{GrayImage, ImageFormat};
use phasmid_core::error::{Error, Result};
use phasmid_report::lab::{Block, Context, Image, Row, Settings, Trial};
use phasmid_sgrt::Region;
use std::io::Cursor;

const FILE: &str = "sgrt-patient.png";
/// Device time of the images in nanoseconds.
const TIME_NS: u64 = 60_000_000_000;

pub(super) fn trial(settings: &Settings, patient: &'static str) -> Trial {
    Trial::new("picture", settings.seed, move |context| {
        draw(context, patient)
    })
}

fn draw(context: &Context<'_>, patient: &str) -> Result<Vec<Row>> {
    let scratch = context.folder.place("planning-picture")?;
    let room = InRoom::new(patient, &Region::chest(), &scratch)?;
    let mut pods = Pods::new(&room.scene, context.seed, &|profile| {
        binned(profile, SIZE_PX)
    })?;
    let Some(foot) = pods.all.last_mut() else {
        return Ok(Vec::new());
    };
    let scanned = foot.scan(TIME_NS, None)?;
    let decoded = foot.decode(&scanned)?;
    let truth = foot.truth(TIME_NS + foot.duration_ns() / 2);
    let first = scanned.images.first();
    let frame = first.and_then(|image| {
        let size = (image.width() as u32, image.height() as u32);
        GrayImage::from_raw(size.0, size.1, image.as_u8()?.to_vec())
    });
    let frame = frame.ok_or_else(|| Error::device("frames of more than 8 bits"))?;
    let picture = overview(&frame, &decoded, &truth, foot.rig());
    let mut png = Cursor::new(Vec::new());
    picture
        .write_to(&mut png, ImageFormat::Png)
        .map_err(|e| Error::device(format!("picture of {patient}: {e}")))?;
    context.folder.leave(FILE, &png.into_inner())?;
    Ok(vec![Row::new().text("patient", patient)])
}

pub(super) fn block() -> Block {
    Block::Image(Image {
        file: FILE.to_owned(),
        caption:
            "The pod over the foot end: a patient on the couch under fringes, the measured depth, \
                  and measured minus true depth."
                .to_owned(),
    })
}
