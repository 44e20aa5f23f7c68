//! Reads the controls of a node.
//!
//! Implemented without the `v4l` crate, which panics on unknown control types and on menus without
//! a step.

use super::call::ioctl;
use super::node::text;
use v4l::Device;
use v4l::v4l_sys::{
    V4L2_CTRL_FLAG_DISABLED, V4L2_CTRL_FLAG_INACTIVE, V4L2_CTRL_FLAG_NEXT_COMPOUND,
    V4L2_CTRL_FLAG_NEXT_CTRL, V4L2_CTRL_FLAG_READ_ONLY, V4L2_CTRL_FLAG_WRITE_ONLY, v4l2_control,
    v4l2_ext_control, v4l2_ext_controls, v4l2_query_ext_ctrl, v4l2_querymenu,
};
use v4l::v4l2::vidioc;

/// Maximum number of controls listed.
const MAX_CONTROLS: usize = 512;
/// Maximum number of entries of a menu.
const MAX_ENTRIES: i64 = 64;
/// Maximum length of a text value in bytes.
const MAX_TEXT: u32 = 64 << 10;

/// One control.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Control {
    /// Control id.
    pub id: u32,
    /// Control name.
    pub name: String,
    /// Type of the value.
    pub kind: &'static str,
    /// Minimum, maximum, step and default; `None` if the control has none.
    pub range: Option<(i64, i64, u64, i64)>,
    /// Present value, if it is a single number or a text and could be read.
    pub value: Option<Value>,
    /// Entries of the menu, each with its value.
    pub menu: Vec<(i64, String)>,
    /// Whether the control cannot be set at all or at present.
    pub read_only: bool,
}

/// A control's value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Value {
    /// A number, including the index of a menu entry.
    Number(i64),
    /// An unsigned bit mask.
    Mask(u32),
    /// Text.
    Text(String),
}

/// Returns the controls of a device, without headings and disabled controls; empty if the device has
/// no controls.
pub fn controls(device: &Device) -> Vec<Control> {
    let mut found = Vec::new();
    let mut id = 0;
    while found.len() < MAX_CONTROLS {
        // SAFETY: a `v4l2_query_ext_ctrl` consists of plain numbers, for which zero is valid.
        #[allow(unsafe_code)]
        let zero: v4l2_query_ext_ctrl = unsafe { std::mem::zeroed() };
        let mut query = v4l2_query_ext_ctrl {
            id: id | V4L2_CTRL_FLAG_NEXT_CTRL | V4L2_CTRL_FLAG_NEXT_COMPOUND,
            ..zero
        };
        // SAFETY: VIDIOC_QUERY_EXT_CTRL takes a `v4l2_query_ext_ctrl`.
        #[allow(unsafe_code)]
        let done = unsafe { ioctl(&device.handle(), vidioc::VIDIOC_QUERY_EXT_CTRL, &mut query) };
        // Stop if the driver returns no further control, since the loop would never end.
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
    const MASK: u32 = 8;
    if query.type_ == HEADING || query.flags & V4L2_CTRL_FLAG_DISABLED != 0 {
        return None;
    }
    let (kind, ranged) = match query.type_ {
        1 => ("integer", true),
        2 => ("boolean", true),
        3 => ("menu", true),
        4 => ("button", false),
        5 => ("64-bit integer", true),
        7 => ("string", false),
        MASK => ("bit mask", true),
        9 => ("menu of integers", true),
        _ => ("compound", false),
    };
    let array = query.nr_of_dims > 0;
    let readable = !array && query.flags & V4L2_CTRL_FLAG_WRITE_ONLY == 0;
    // Masks are unsigned 32-bit values, which drivers may have sign-extended to 64 bits.
    let limit = |value: i64| match query.type_ {
        MASK => i64::from(value as u32),
        _ => value,
    };
    Some(Control {
        id: query.id,
        name: text(&query.name.map(|c| c as u8)),
        kind,
        range: ranged.then_some((
            limit(query.minimum),
            limit(query.maximum),
            query.step,
            limit(query.default_value),
        )),
        value: readable.then(|| value(device, query)).flatten(),
        menu: match query.type_ {
            3 | 9 => menu(device, query),
            _ => Vec::new(),
        },
        read_only: query.flags & (V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_INACTIVE) != 0,
    })
}

fn value(device: &Device, query: &v4l2_query_ext_ctrl) -> Option<Value> {
    match query.type_ {
        1..=3 | 9 => plain(device, query.id).map(|value| Value::Number(value.into())),
        5 => {
            let (control, _) = extended(device, query.id, 0)?;
            // SAFETY: every member of the union is plain bits, and all bits have been initialised.
            #[allow(unsafe_code)]
            let value = unsafe { control.__bindgen_anon_1.value64 };
            Some(Value::Number(value))
        }
        7 => {
            let size = query.elem_size.min(MAX_TEXT);
            extended(device, query.id, size).map(|(_, bytes)| Value::Text(text(&bytes)))
        }
        8 => plain(device, query.id).map(|value| Value::Mask(value.cast_unsigned())),
        _ => None,
    }
}

/// Reads a value that does not fit 32 bits; `size` is the length in bytes of a text, or 0 for a
/// number.
fn extended(device: &Device, id: u32, size: u32) -> Option<(v4l2_ext_control, Vec<u8>)> {
    let mut bytes = vec![0; size as usize];
    // SAFETY: both structs consist of plain numbers and pointers, for which zero is valid.
    #[allow(unsafe_code)]
    let (mut control, mut request): (v4l2_ext_control, v4l2_ext_controls) =
        unsafe { (std::mem::zeroed(), std::mem::zeroed()) };
    control.id = id;
    control.size = size;
    if size > 0 {
        control.__bindgen_anon_1.ptr = bytes.as_mut_ptr().cast();
    }
    request.count = 1;
    request.controls = &raw mut control;
    // SAFETY: VIDIOC_G_EXT_CTRLS takes a `v4l2_ext_controls`; it points to one valid control and to
    // a buffer of the size that the control states.
    #[allow(unsafe_code)]
    unsafe { ioctl(&device.handle(), vidioc::VIDIOC_G_EXT_CTRLS, &mut request) }.ok()?;
    Some((control, bytes))
}

fn plain(device: &Device, id: u32) -> Option<i32> {
    let mut control = v4l2_control { id, value: 0 };
    // SAFETY: VIDIOC_G_CTRL takes a `v4l2_control`.
    #[allow(unsafe_code)]
    let done = unsafe { ioctl(&device.handle(), vidioc::VIDIOC_G_CTRL, &mut control) };
    done.is_ok().then_some(control.value)
}

fn menu(device: &Device, query: &v4l2_query_ext_ctrl) -> Vec<(i64, String)> {
    let last = query.maximum.min(query.minimum.saturating_add(MAX_ENTRIES));
    let entry = |index: i64| {
        // SAFETY: a `v4l2_querymenu` consists of plain numbers, for which zero is valid.
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
        // SAFETY: both members of the union are plain numbers, and the struct was zeroed before the
        // call.
        #[allow(unsafe_code)]
        let (name, number) = unsafe { (item.__bindgen_anon_1.name, item.__bindgen_anon_1.value) };
        let words = if query.type_ == 3 {
            text(&name)
        } else {
            number.to_string()
        };
        Some((index, words))
    };
    // Drivers may leave out entries of a menu.
    (query.minimum..=last).filter_map(entry).collect()
}
