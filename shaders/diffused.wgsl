// needs: picture_table, skin_types
// Pictures on skin: each Gaussian of the spread is three squares on the picture. Twin of
// `diffused.rs`, which says why.

// Average level over a footprint whose light spreads under skin.
fn diffused_average(
    table: Table,
    at: vec2f,
    slope: vec4f,
    sigma: f32,
    tissue: u32,
    px_per_mm: vec2f,
) -> f32 {
    // Weights of the three squares, and their squared half widths over the variance.
    var squares = array<vec2f, 3>(
        vec2f(0.6400012, 1.3326518),
        vec2f(0.34457514, 5.60155),
        vec2f(0.015423678, 14.065798),
    );
    var sum = 0.0;
    for (var i = 0u; i < MOST_GAUSSIANS; i += 1u) {
        let gaussian = mixtures[tissue * MOST_GAUSSIANS + i];
        if gaussian.x == 0.0 {
            break;
        }
        let spread = gaussian.y * px_per_mm;
        let deviation = sqrt(spread * spread + sigma * sigma);
        for (var k = 0u; k < 3u; k += 1u) {
            // The table takes the standard deviation of a box.
            let box = deviation * sqrt(squares[k].y / 3.0);
            sum += gaussian.x * squares[k].x * picture_average(table, at, slope, box);
        }
    }
    return sum;
}
