// Logarithm and exponential, twin of sensor/elementary.rs: WGSL's own are inexact on some drivers.

// Natural logarithm of a positive normal number, to 3e-7 relative or absolute: exponent plus a
// polynomial in s = (m - 1)/(m + 1), ln m = 2 (s + s^3/3 + s^5/5 + ...), m in [1/sqrt 2, sqrt 2).
fn ln(x: f32) -> f32 {
    // Shifts the lower end of the mantissa's range to 1/sqrt(2).
    let bits = bitcast<u32>(x) - 0x3f3504f3u;
    let exponent = bitcast<i32>(bits) >> 23u;
    let m = bitcast<f32>((bits & 0x007fffffu) + 0x3f3504f3u);
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = 1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * (1.0 / 9.0)));
    return f32(exponent) * 0.6931471805599453 + 2.0 * (s + s * z * series);
}

// exp(-x) for x from 0 to 80, to 5e-7 relative: 2^k times the series of the remainder, which is
// within half an octave.
fn exp_negative(x: f32) -> f32 {
    let whole = round(x * -1.4426950408889634);
    // ln 2 in two parts; the first ends in zero bits, so that its product is exact (Cody and Waite
    // 1980).
    let rest = (-x - whole * 0.6933594) + whole * 2.1219444e-4;
    var series = 1.0 + rest * (1.0 / 7.0);
    series = 1.0 + series * rest * (1.0 / 6.0);
    series = 1.0 + series * rest * (1.0 / 5.0);
    series = 1.0 + series * rest * (1.0 / 4.0);
    series = 1.0 + series * rest * (1.0 / 3.0);
    series = 1.0 + series * rest * (1.0 / 2.0);
    series = 1.0 + series * rest;
    return series * bitcast<f32>(bitcast<u32>(i32(whole) + 127) << 23u);
}
