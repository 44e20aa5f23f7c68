// needs: plan, sensor_parameters
// Blooming, twin of sensor/bloom.rs: charge beyond the full well spills half upwards and half
// downwards along the column and fills each pixel up. One thread per column, first down, then up:
// each step depends on the one before it, and neighbouring threads read neighbouring words.

@group(0) @binding(55) var<storage, read_write> electrons: array<f32>;
// Charge that each pixel spills in each direction. It is stored because the downward pass clips the
// pixel before the upward pass needs it.
@group(0) @binding(78) var<storage, read_write> bloom_excess: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let column = linear(id, groups);
    let width = sensor_parameters.width;
    if column >= width {
        return;
    }
    // Columns without excess charge, the usual case, are skipped.
    var most = 0.0;
    for (var i = column; i < sensor_parameters.pixels; i += width) {
        most = max(most, electrons[i]);
    }
    if most <= sensor_parameters.full_well_e {
        return;
    }
    var carried = 0.0;
    for (var i = column; i < sensor_parameters.pixels; i += width) {
        let e = electrons[i];
        let excess = max(e - sensor_parameters.full_well_e, 0.0) * sensor_parameters.bloom_share;
        bloom_excess[i] = excess;
        carried = fill(i, e, excess, carried);
    }
    carried = 0.0;
    for (var i = column + (sensor_parameters.pixels / width - 1u) * width; ; i -= width) {
        carried = fill(i, electrons[i], bloom_excess[i], carried);
        if i < width {
            break;
        }
    }
}

// A pixel takes as much of the charge carried over from its neighbour as fits; returns the rest
// plus its own excess.
fn fill(pixel: u32, electrons_here: f32, excess: f32, carried: f32) -> f32 {
    let held = min(electrons_here, sensor_parameters.full_well_e);
    let taken = min(carried, sensor_parameters.full_well_e - held);
    electrons[pixel] = held + taken;
    return carried - taken + excess;
}
