// Mains flicker. Twin of `flicker.rs`.

// Electrons including flicker; `seconds` is the exposure times the mean of the flicker pulse over
// it. Rounding must not make the light negative.
fn flicker_both(steady: f32, seconds: f32, swinging: f32) -> f32 {
    return max(steady + seconds * swinging, 0.0);
}
