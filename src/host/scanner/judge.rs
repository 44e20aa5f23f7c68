//! Checks that a received frame is the expected next frame of a sequence.

use phasmid_protocol::Frame;

/// Checks that `frame` is the one expected to follow `before`; the error describes the mismatch.
pub(super) fn judge(
    frame: &Frame,
    before: &[Frame],
    stale: Option<u64>,
    size: Option<(u32, u32)>,
) -> Result<(), String> {
    let id = frame.id;
    let due = before.len();
    if before.iter().any(|other| other.id == id) || stale.is_some_and(|last| id == last) {
        return Err(format!(
            "frame {id} is repeated where pattern {due} was due"
        ));
    }
    let Some(index) = frame.pattern_index else {
        return Err(format!(
            "frame {id} is foreign: it shows no pattern of the sequence where pattern {due} was due"
        ));
    };
    let (first, index) = (before.first(), index as usize);
    let due_id = match first.map(|first| first.id.checked_add(due as u64)) {
        Some(None) => {
            return Err(format!(
                "frame {id} is foreign: the frame ids overflow before it"
            ));
        }
        due_id => due_id.flatten(),
    };
    if stale.is_some_and(|last| id < last) || first.is_some_and(|first| id < first.id) {
        return Err(format!("frame {id} is foreign: it is older than this run"));
    }
    if index > due && due_id.is_none_or(|due_id| id.wrapping_sub(due_id) == (index - due) as u64) {
        return Err(format!(
            "pattern {due} is missing: frame {id} with pattern {index} came in its place"
        ));
    }
    if index != due || due_id.is_some_and(|due_id| id != due_id) {
        let wanted = due_id.map_or(String::new(), |due_id| format!("frame {due_id} with "));
        return Err(format!(
            "frame {id} with pattern {index} is foreign: {wanted}pattern {due} was due"
        ));
    }
    same_kind(frame, first, size)
}

/// Checks frames as [`judge`] does, for frames that do not identify themselves: their ids are only
/// running numbers.
pub(super) fn judge_counted(
    frame: &Frame,
    before: &[Frame],
    size: Option<(u32, u32)>,
) -> Result<(), String> {
    let due = before.len();
    if let Some(last) = before.last()
        && last.id.checked_add(1) != Some(frame.id)
    {
        let lost = frame.id.saturating_sub(last.id).saturating_sub(1);
        return Err(format!(
            "pattern {due} is missing: the driver has lost {lost} frames before it"
        ));
    }
    same_kind(frame, before.first(), size)
}

/// Rejects a frame whose size or format differs from the first frame's.
fn same_kind(frame: &Frame, first: Option<&Frame>, size: Option<(u32, u32)>) -> Result<(), String> {
    let id = frame.id;
    let got = (frame.width, frame.height);
    let same = first.is_none_or(|f| (f.width, f.height, f.format) == (got.0, got.1, frame.format));
    if !same || size.is_some_and(|size| size != got) {
        let (w, h) = size.or(first.map(|f| (f.width, f.height))).unwrap_or(got);
        return Err(format!(
            "frame {id} is foreign: {} x {} pixels of {:?}, expected {w} x {h} in one format",
            got.0, got.1, frame.format
        ));
    }
    Ok(())
}
