//! Controls of a node, as they are.
//!
//! Asked for here and not through the `v4l` crate, which panics on a type that it does not know and
//! on a menu without steps.

use super::call::ioctl;
use super::node::text;
use v4l::Device;
use v4l::v4l_sys::{
    V4L2_CTRL_FLAG_DISABLED, V4L2_CTRL_FLAG_INACTIVE, V4L2_CTRL_FLAG_NEXT_COMPOUND,
    V4L2_CTRL_FLAG_NEXT_CTRL, V4L2_CTRL_FLAG_READ_ONLY, V4L2_CTRL_FLAG_WRITE_ONLY, v4l2_control,
    v4l2_query_ext_ctrl, v4l2_querymenu,
};
use v4l::v4l2::vidioc;

/// Most controls that are listed, and most entries of a menu.
const MAX_CONTROLS: usize = 512;
const MAX_ENTRIES: i64 = 64;

/// One control.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Control {
    /// Its number.
    pub id: u32,
    /// Its name.
    pub name: String,
    /// What its value is.
    pub kind: &'static str,
    /// Least value, greatest value, step and default; `None` where there is no range.
    pub range: Option<(i64, i64, u64, i64)>,
    /// The value, where it is one number of 32 bits that can be read.
    pub value: Option<i32>,
    /// Entries of a menu by their value.
    pub menu: Vec<(i64, String)>,
    /// It cannot be set, or not now.
    pub read_only: bool,
}

/// The controls of a device, without headings and disabled ones; empty where there are none.
pub fn controls(device: &Device) -> Vec<Control> {
    let mut found = Vec::new();
    let mut id = 0;
    while found.len() < MAX_CONTROLS {
        // SAFETY: a `v4l2_query_ext_ctrl` is plain numbers, and zero is a value of each.
        #[allow(unsafe_code)]
        let zero: v4l2_query_ext_ctrl = unsafe { std::mem::zeroed() };
        let mut query = v4l2_query_ext_ctrl {
            id: id | V4L2_CTRL_FLAG_NEXT_CTRL | V4L2_CTRL_FLAG_NEXT_COMPOUND,
            ..zero
        };
        // SAFETY: VIDIOC_QUERY_EXT_CTRL takes a `v4l2_query_ext_ctrl`.
        #[allow(unsafe_code)]
        let done = unsafe { ioctl(&device.handle(), vidioc::VIDIOC_QUERY_EXT_CTRL, &mut query) };
        // A driver that does not go on would be asked for ever.
        if done.is_err() || query.id <= id {
            break;
        }
        id = query.id;
        found.extend(describe(device, &query));
    }
    found
}

fn describe(device: &Device, query: &v4l2_query_ext_ctrl) -> Option<Control> {
    const HEADING: u32 = 6;
    if query.type_ == HEADING || query.flags & V4L2_CTRL_FLAG_DISABLED != 0 {
        return None;
    }
    let (kind, ranged, valued) = match query.type_ {
        1 => ("integer", true, true),
        2 => ("boolean", true, true),
        3 => ("menu", true, true),
        4 => ("button", false, false),
        5 => ("64-bit integer", true, false),
        7 => ("string", false, false),
        8 => ("bit mask", true, true),
        9 => ("menu of integers", true, true),
        _ => ("compound", false, false),
    };
    let array = query.nr_of_dims > 0;
    let readable = valued && !array && query.flags & V4L2_CTRL_FLAG_WRITE_ONLY == 0;
    Some(Control {
        id: query.id,
        name: text(&query.name.map(|c| c as u8)),
        kind,
        range: ranged.then_some((
            query.minimum,
            query.maximum,
            query.step,
            query.default_value,
        )),
        value: readable.then(|| value(device, query.id)).flatten(),
        menu: match query.type_ {
            3 | 9 => menu(device, query),
            _ => Vec::new(),
        },
        read_only: query.flags & (V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_INACTIVE) != 0,
    })
}

fn value(device: &Device, id: u32) -> Option<i32> {
    let mut control = v4l2_control { id, value: 0 };
    // SAFETY: VIDIOC_G_CTRL takes a `v4l2_control`.
    #[allow(unsafe_code)]
    let done = unsafe { ioctl(&device.handle(), vidioc::VIDIOC_G_CTRL, &mut control) };
    done.is_ok().then_some(control.value)
}

fn menu(device: &Device, query: &v4l2_query_ext_ctrl) -> Vec<(i64, String)> {
    let last = query.maximum.min(query.minimum.saturating_add(MAX_ENTRIES));
    let entry = |index: i64| {
        // SAFETY: a `v4l2_querymenu` is plain numbers, and zero is a value of each.
        #[allow(unsafe_code)]
        let zero: v4l2_querymenu = unsafe { std::mem::zeroed() };
        let mut item = v4l2_querymenu {
            id: query.id,
            index: u32::try_from(index).ok()?,
            ..zero
        };
        // SAFETY: VIDIOC_QUERYMENU takes a `v4l2_querymenu`.
        #[allow(unsafe_code)]
        unsafe { ioctl(&device.handle(), vidioc::VIDIOC_QUERYMENU, &mut item) }.ok()?;
        // SAFETY: both members are plain numbers, and the struct was zeroed before.
        #[allow(unsafe_code)]
        let (name, number) = unsafe { (item.__bindgen_anon_1.name, item.__bindgen_anon_1.value) };
        let words = if query.type_ == 3 {
            text(&name)
        } else {
            number.to_string()
        };
        Some((index, words))
    };
    // Drivers may leave entries out.
    (query.minimum..=last).filter_map(entry).collect()
}
