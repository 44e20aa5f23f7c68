// needs: plan, schedule, footprint, interreflection_in
// The exposure pass of interreflected light. Twin of `indirect.rs`.

@group(0) @binding(55) var<storage, read_write> electrons: array<f32>;
// Irradiance in W/m^2 at each point for each table shown at full brightness; table by table.
@group(0) @binding(61) var<storage, read_write> interreflection_light: array<f32>;

var<workgroup> sums: array<f32, 64>;

// Averages each table over the hits of each point's rays: one workgroup per point and table; each
// thread takes every 64th ray.
@compute @workgroup_size(64)
fn average(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let number = group.y * groups.x + group.x;
    let points = interreflection_params.points;
    if number >= points * schedule_tables() {
        return;
    }
    let point = interreflection_points[number % points];
    let table = schedule_table(number / points);
    if table.kind == TABLE_UNIFORM {
        if lane == 0u {
            interreflection_light[number] = table.scale * point.white;
        }
        return;
    }
    var sum = 0.0;
    for (var ray = lane; ray < point.kept; ray += GROUP) {
        sum += bounced(table, point.first + ray);
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        interreflection_light[number] = sums[0];
    }
}

// Contribution of one ray for a table.
fn bounced(table: Table, ray: u32) -> f32 {
    if along_rows && table.kind == TABLE_ALONG_X {
        let x = interreflection_x[ray];
        return x.w * row_average(table, x.x, x.yz);
    }
    if along_rows && table.kind == TABLE_ALONG_Y {
        let y = interreflection_y[ray];
        return y.w * row_average(table, y.x, y.yz);
    }
    if in_images && table.kind == TABLE_IMAGE {
        let x = interreflection_x[ray];
        let y = interreflection_y[ray];
        let slope = vec4f(x.yz, y.yz);
        return x.w * image_average(table, vec2f(x.x, y.x), slope, vec2f(0.0));
    }
    return 0.0;
}

// Adds the interreflected light to the electrons of the pixels.
@compute @workgroup_size(64)
fn spread(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= schedule_pixels() {
        return;
    }
    let corners = interreflection_corners(i);
    let shares = interreflection_shares[i];
    let line = schedule_line(i);
    var sum = 0.0;
    for (var k = 0u; k < line.parts; k += 1u) {
        let part = schedule_part(line.first + k);
        if part.power > 0.0 {
            let first = part.table * interreflection_params.points;
            sum += part.seconds * part.power * interreflection_at(first, corners, shares);
        }
    }
    electrons[i] += sum;
}

// Interpolates between points; a point with zero weight may not exist.
fn interreflection_at(first: u32, corners: vec4u, shares: vec4f) -> f32 {
    var sum = vec4f(0.0);
    for (var k = 0u; k < 4u; k += 1u) {
        if shares[k] > 0.0 {
            sum[k] = shares[k] * interreflection_light[first + corners[k]];
        }
    }
    return (sum.x + sum.y) + (sum.z + sum.w);
}
