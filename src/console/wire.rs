//! Messages between the page and the console.
//!
//! Messages to the page are binary: the length of a JSON object in 32 bits, little-endian; the object,
//! padded with spaces to a multiple of four bytes; then a payload. Messages from the page are JSON objects
//! as text.

use crate::hub::{Shown, View};
use crate::measurement::About;
use crate::operator::Request;
use crate::room::{KnownRow, Room, RoomScan, Surface};
use crate::traffic::Entry;
use phasmid_pattern::{Axis, Manifest, Pattern};
use phasmid_protocol::PixelFormat;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::sync::Arc;

/// Header of a message to the page.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(crate) enum Told<'a> {
    /// The sources and who has control.
    State(&'a View),
    /// A frame; the payload has its pixels row by row, in 8 or 16 bits, little-endian.
    Frame {
        source: usize,
        /// Running number of the frame at the source. The page returns it in [`Asked::Drawn`].
        number: u64,
        id: u64,
        pattern: Option<u32>,
        /// Whether id, pattern and times come from the device.
        identified: bool,
        width: u32,
        height: u32,
        format: &'static str,
        /// Bits per pixel in the payload.
        bits: u32,
        /// Largest pixel value of the camera's format.
        white: u16,
        exposure_ms: Option<f64>,
        /// Device time at the start of the exposure.
        time_s: Option<f64>,
        /// Median time from the arrival of recent frames to when they were drawn.
        delay_ms: Option<f64>,
    },
    /// A frame that cannot be shown.
    Damaged {
        source: usize,
        number: u64,
        id: u64,
        why: String,
    },
    /// The projected patterns. For each pattern with an axis, the payload has one 8-bit level per
    /// projector pixel along that axis.
    Sequence {
        source: usize,
        width: u32,
        height: u32,
        patterns: Vec<PatternAbout>,
    },
    /// A scan. Messages with the requested layers and the cloud follow.
    Measurement {
        source: usize,
        number: u64,
        #[serde(flatten)]
        about: About,
    },
    /// A scan without a result, or without a view that was asked for.
    Unmeasured {
        source: usize,
        number: u64,
        why: String,
    },
    /// A layer of the last measurement; the payload has a 32-bit float for each pixel.
    Layer {
        source: usize,
        number: u64,
        name: &'a str,
    },
    /// The points of the last measurement; the payload has four 32-bit floats for each point: its
    /// position in the rig's frame in millimetres, then its value of this layer.
    Cloud {
        source: usize,
        number: u64,
        name: &'a str,
        every: usize,
    },
    /// A treatment room. The payload has the planned skin, then the tumour's contour: the positions of the
    /// vertices in 32-bit floats, then the indices of the triangles' corners in 32 bits.
    Room {
        source: usize,
        #[serde(flatten)]
        room: &'a Room,
        /// Numbers of vertices and of triangles of both surfaces.
        sizes: [[usize; 2]; 2],
    },
    /// Results that are new since the last message of this kind, or to which the truth has been
    /// added since then. The payload has 32-bit floats of the last scan: four for each point, then
    /// the vertices of the tracked skin and tumour.
    Tracked {
        source: usize,
        /// Number that the page returns in [`Asked::Seen`].
        number: u64,
        rows: Vec<&'a KnownRow>,
        /// Numbers of points, of skin vertices and of tumour vertices.
        sizes: [usize; 3],
    },
    /// Events of the source since the last message of this kind.
    Traffic { source: usize, events: Vec<Entry> },
    /// The answer to [`Asked::Ask`] with this number, or the reason why it was refused.
    Answer {
        number: u64,
        answer: Option<Value>,
        error: Option<String>,
    },
    /// The measurement with this number has been sent completely. The page returns the number in
    /// [`Asked::Seen`].
    Complete { source: usize, number: u64 },
}

/// A projected pattern.
#[derive(Debug, Serialize)]
pub(crate) struct PatternAbout {
    /// Description for viewers.
    name: String,
    /// Projector axis along which the levels vary; `None` if the levels do not vary or are unknown.
    axis: Option<Axis>,
    /// The level of a uniform pattern.
    level: Option<u8>,
}

/// A message from the page.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Asked {
    /// The frame with this number has been drawn, or reported as damaged.
    Drawn { source: usize, number: u64 },
    /// Show, from now on, this source instead of the previous one.
    Watch { source: usize },
    /// Show, from now on, these layers of each measurement, and its cloud coloured by the layer
    /// `cloud`.
    Show {
        layers: Vec<String>,
        cloud: Option<String>,
    },
    /// Start or stop to show the source's traffic.
    Traffic { show: bool },
    /// A request for the source's operator; the answer has the same number.
    Ask { number: u64, request: Request },
    /// The measurement or the results with this number have been drawn.
    Seen { source: usize, number: u64 },
    /// Take control, or give it back. With `if_free`, take control only if no viewer has it.
    Control { take: bool, if_free: bool },
}

/// Returns the bytes of 32-bit floats, little-endian.
pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

/// Returns the bytes of a message.
pub(crate) fn message(told: &Told<'_>, payload: &[u8]) -> Vec<u8> {
    let mut json = serde_json::to_vec(told).expect("numbers and strings");
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = Vec::with_capacity(4 + json.len() + payload.len());
    bytes.extend_from_slice(&(json.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&json);
    bytes.extend_from_slice(payload);
    bytes
}

/// Returns the message that carries a frame.
pub(crate) fn frame_message(source: usize, shown: &Shown, delay_ms: Option<f64>) -> Vec<u8> {
    let frame = &*shown.frame;
    let (found, expected) = (
        frame.data.len(),
        frame.format.frame_bytes(frame.width, frame.height),
    );
    if found != expected {
        let why = format!("{found} bytes, expected {expected}");
        let damaged = Told::Damaged {
            source,
            number: shown.number,
            id: frame.id,
            why,
        };
        return message(&damaged, &[]);
    }
    let luma = match frame.format {
        PixelFormat::Grey | PixelFormat::Y16 => None,
        _ => Some(frame.clone().into_luma()),
    };
    let luma = luma.as_ref().unwrap_or(frame);
    let length_ns = frame
        .exposure_end_ns
        .saturating_sub(frame.exposure_start_ns);
    let told = Told::Frame {
        source,
        number: shown.number,
        id: frame.id,
        pattern: frame.pattern_index,
        identified: shown.identified,
        width: frame.width,
        height: frame.height,
        format: frame.format.name(),
        bits: luma.format.bits_per_pixel() as u32,
        white: frame.format.max_value(),
        exposure_ms: { shown.identified }.then_some(length_ns as f64 * 1e-6),
        time_s: { shown.identified }.then_some(frame.exposure_start_ns as f64 * 1e-9),
        delay_ms,
    };
    message(&told, &luma.data)
}

/// Returns the message that carries the patterns of a sequence.
pub(crate) fn sequence_message(source: usize, sequence: &Manifest) -> Vec<u8> {
    let size = &sequence.projector;
    let mut payload = Vec::new();
    let patterns = sequence.frame.iter().map(|frame| {
        let pattern = &frame.pattern;
        let axis = pattern.axis();
        if let Some(axis) = axis {
            let len = match axis {
                Axis::X => size.width_px,
                Axis::Y => size.height_px,
            };
            let levels = pattern.quantised_row(len, 8).unwrap_or_default();
            payload.extend(levels.into_iter().map(|level| level as u8));
        }
        let level = pattern.level(0).filter(|_| axis.is_none());
        PatternAbout {
            name: in_words(pattern),
            axis,
            level: level.map(|level| (255.0 * level) as u8),
        }
    });
    let told = Told::Sequence {
        source,
        width: size.width_px,
        height: size.height_px,
        patterns: patterns.collect(),
    };
    message(&told, &payload)
}

fn in_words(pattern: &Pattern) -> String {
    match pattern {
        Pattern::Fringe {
            axis,
            period_px,
            phase_rad,
        } => format!(
            "fringes along {axis}, period {period_px:.4} px, phase {:.1} degrees",
            phase_rad.to_degrees()
        ),
        Pattern::Gray {
            axis,
            cell_px,
            bit,
            inverted,
            ..
        } => format!(
            "Gray code along {axis}, bit {bit} of cells of {cell_px} px{}",
            if *inverted { ", inverted" } else { "" }
        ),
        Pattern::White {} => "white".into(),
        Pattern::Black {} => "black".into(),
        Pattern::Image { file } => format!("image {}", file.display()),
    }
}

/// Returns the message that carries a treatment room.
pub(crate) fn room_message(source: usize, room: &Room) -> Vec<u8> {
    let surfaces = [&room.skin, &room.tumour];
    let sizes = surfaces.map(|surface| [surface.vertices.len(), surface.triangles.len()]);
    let mut payload = Vec::new();
    for Surface {
        vertices,
        triangles,
    } in surfaces
    {
        payload.extend(floats(vertices.as_flattened()));
        payload.extend(
            triangles
                .as_flattened()
                .iter()
                .flat_map(|index| index.to_le_bytes()),
        );
    }
    message(
        &Told::Room {
            source,
            room,
            sizes,
        },
        &payload,
    )
}

/// Returns the message that carries tracking results and the patient in the last scan.
pub(crate) fn tracked_message(
    source: usize,
    number: u64,
    rows: &[Arc<KnownRow>],
    scan: &RoomScan,
) -> Vec<u8> {
    let RoomScan {
        points,
        skin,
        tumour,
    } = scan;
    let mut payload = floats(points.as_flattened());
    payload.extend(floats(skin.as_flattened()));
    payload.extend(floats(tumour.as_flattened()));
    let told = Told::Tracked {
        source,
        number,
        rows: rows.iter().map(|row| &**row).collect(),
        sizes: [points.len(), skin.len(), tumour.len()],
    };
    message(&told, &payload)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::Frame;
    use serde_json::{Value, json};
    use std::time::Instant;

    fn parts(format: PixelFormat, data: Vec<u8>) -> (Value, Vec<u8>) {
        let frame = Frame {
            id: 7,
            pattern_index: Some(3),
            width: 4,
            height: 1,
            format,
            exposure_start_ns: 1_500_000_000,
            exposure_end_ns: 1_502_000_000,
            data,
        };
        let shown = Shown {
            number: 5,
            frame: Arc::new(frame),
            identified: true,
            arrived: Instant::now(),
        };
        let bytes = frame_message(1, &shown, Some(2.5));
        let (len, rest) = bytes.split_first_chunk().unwrap();
        let (json, payload) = rest.split_at(u32::from_le_bytes(*len) as usize);
        assert_eq!(json.len() % 4, 0);
        (serde_json::from_slice(json).unwrap(), payload.to_vec())
    }

    #[test]
    fn frame_of_each_layout_comes_as_8_or_16_bits() {
        let (json, payload) = parts(PixelFormat::Grey, vec![1, 2, 3, 255]);
        let want = json!({ "kind": "frame", "source": 1, "number": 5, "id": 7, "pattern": 3, "identified": true,
            "width": 4, "height": 1, "format": "GREY", "bits": 8, "white": 255, "exposure_ms": 2.0, "time_s": 1.5,
            "delay_ms": 2.5 });
        assert_eq!((json, payload), (want, vec![1, 2, 3, 255]));
        let (json, payload) = parts(PixelFormat::Yuyv, vec![1, 128, 2, 128, 3, 128, 4, 128]);
        assert_eq!((&json["bits"], payload), (&json!(8), vec![1, 2, 3, 4]));
        let mut packed = Vec::new();
        PixelFormat::Y10P.pack_row(&[1, 2, 3, 1023], &mut packed);
        let (json, payload) = parts(PixelFormat::Y10P, packed);
        assert_eq!((&json["bits"], &json["white"]), (&json!(16), &json!(1023)));
        assert_eq!(payload, [1, 0, 2, 0, 3, 0, 255, 3]);
    }

    #[test]
    fn damaged_frame_is_named() {
        let (json, payload) = parts(PixelFormat::Grey, vec![1, 2, 3]);
        let want = json!({ "kind": "damaged", "source": 1, "number": 5, "id": 7, "why": "3 bytes, expected 4" });
        assert_eq!((json, payload), (want, Vec::new()));
    }
}
