// Mains flicker. Twin of `flicker.rs`.

// Electrons with those that flicker; `seconds` is the exposure times the pulse's mean over it.
// Rounding must not leave less than no light.
fn flicker_both(steady: f32, seconds: f32, swinging: f32) -> f32 {
    return max(steady + seconds * swinging, 0.0);
}
