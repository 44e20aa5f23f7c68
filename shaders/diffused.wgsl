// needs: image_table, skin_types
// Two-dimensional patterns on skin: each Gaussian of the subsurface spread is approximated by three
// squares on the pattern. `diffused.rs`, its twin, gives the reason.

// Average level over a footprint whose light spreads under the skin.
fn diffused_average(
    table: Table,
    at: vec2f,
    slope: vec4f,
    sigma: vec2f,
    tissue: u32,
    px_per_mm: vec2f,
) -> f32 {
    // Weight of each of the three squares, and its squared half width divided by the variance.
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
            // `image_average` takes the standard deviation of a box.
            let box = deviation * sqrt(squares[k].y / 3.0);
            sum += gaussian.x * squares[k].x * image_average(table, at, slope, box);
        }
    }
    return sum;
}
