// needs: sensor_parameters, normal, philox, poisson
// Shot and read noise, twin of sensor/noise.rs.

const DRAW_SHOT: u32 = 0u;
const DRAW_READ: u32 = 1u;

// Sum of shot noise and read noise of this variance from one normal number (Cornish and Fisher
// 1938).
fn many(mean: f32, read_variance: f32, z: f32) -> f32 {
    let variance = mean + read_variance;
    let inverse = 1.0 / sqrt(variance);
    // g1 = share * inverse and g2 = share * inverse^2.
    let share = mean * (inverse * inverse);
    let square = z * z;
    let excess = (square - 3.0) * (1.0 / 24.0) - (2.0 * square - 5.0) * (share * (1.0 / 36.0));
    return mean + z * (variance * inverse)
        + share * ((square - 1.0) * (1.0 / 6.0) + z * excess * inverse);
}

// Electrons of a pixel with this mean; `word` is its random word of the shot-noise draw.
fn noisy(mean: f32, word: u32, pixel: u32) -> f32 {
    let read_noise = sensor_parameters.read_noise_e;
    if mean < POISSON_BELOW {
        let shot = poisson(mean, word);
        return shot.number + read_noise * quantile(shot.rest);
    }
    let z = quantile(tail_of_word(word));
    if mean < sensor_parameters.apart_from_e {
        return many(mean, read_noise * read_noise, z);
    }
    // Near or above the full well: shot noise, clipping at the full well, then read noise.
    let shot = many(mean, 0.0, z);
    let read = quantile(tail_of_word(philox_of_pixel(pixel, DRAW_READ, sensor_parameters.key)));
    return min(shot, sensor_parameters.full_well_e) + read_noise * read;
}
