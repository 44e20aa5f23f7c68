// needs: sensor_parameters, elementary
// Nonlinear response of the sensor, twin of sensor/response.rs: full (linear / full)^exponent.

fn bend(linear_dn: f32) -> f32 {
    // Relative signals up to this count as zero.
    const LEAST: f32 = 1e-9;
    let share = linear_dn / sensor_parameters.full_scale_dn;
    if sensor_parameters.exponent == 1.0 {
        return linear_dn;
    }
    if share <= LEAST {
        return 0.0;
    }
    return sensor_parameters.full_scale_dn * exp_negative(-ln(share) * sensor_parameters.exponent);
}
