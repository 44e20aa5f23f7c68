// Positions of samples within a pixel. Twin of `sampled::offset`.

// Position, relative to the pixel's centre, of the kth of side x side samples: one per cell of the
// grid, sheared so that all differ in column and in row (Chiu, Shirley, Wang: "Multi-Jittered
// Sampling", Graphics Gems IV, 1994).
fn sheared(k: u32, side: u32) -> vec2f {
    let n = f32(side);
    let i = f32(k % side);
    let j = f32(k / side);
    return (vec2f(i, j) + (vec2f(j, n - 1.0 - i) + 0.5) / n) / n - 0.5;
}
