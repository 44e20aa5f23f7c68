// needs: plan, gathered, noise, response
// The sensor pass: mean electrons to digital numbers, twin of sensor/mod.rs.
//
// A workgroup handles 256 pixels: each thread draws the four random words of one counter, which
// belong to four different pixels, processes four pixels a row of the workgroup apart, and finally
// packs four neighbouring pixels.

@group(0) @binding(55) var<storage, read> electrons: array<f32>;
// Bytes of the frame, four per word, little endian.
@group(0) @binding(75) var<storage, read_write> frame: array<u32>;
// Digital numbers before rounding.
@group(0) @binding(79) var<storage, read_write> expected_dn: array<f32>;

// Pixels have two bytes.
override wide: bool = false;

// Pixels per workgroup.
const GROUP_PIXELS: u32 = 4u * GROUP;

// Random words of the group's pixels, then their digital numbers.
var<workgroup> words: array<u32, GROUP_PIXELS>;

// Gain, black level and the converter's range.
fn linear_dn(electrons: f32) -> f32 {
    return clamp(electrons * sensor_parameters.gain_dn_per_e + sensor_parameters.black_dn, 0.0, sensor_parameters.full_scale_dn);
}

// Converts electrons, clipped at the full well, to digital numbers before rounding.
fn converted(electrons: f32, pixel: u32) -> f32 {
    var e = electrons;
    if has_fixed_pattern {
        e += fixed_pattern[pixel].y;
    }
    if has_camera_response {
        return bend(linear_dn(e));
    }
    return linear_dn(e);
}

// Mean charge of a pixel before it is read, in electrons; with blooming, an earlier pass has
// already computed it.
fn mean_of(pixel: u32) -> f32 {
    if has_blooming {
        return electrons[pixel];
    }
    return gathered(electrons[pixel], pixel);
}

fn number_of(pixel: u32, word: u32) -> u32 {
    let mean = mean_of(pixel);
    if has_noise {
        return u32(round(converted(noisy(mean, word, pixel), pixel)));
    }
    return u32(round(converted(min(mean, sensor_parameters.full_well_e), pixel)));
}

@compute @workgroup_size(GROUP)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let counter = linear(id, groups);
    let first = (counter - lane) * 4u;
    if has_noise {
        let drawn = philox(vec4u(counter, DRAW_SHOT, sensor_parameters.key.zw), sensor_parameters.key.xy);
        let at = philox_first_pixel(lane);
        words[at] = drawn.x;
        words[at + PHILOX_WIDTH] = drawn.y;
        words[at + 2u * PHILOX_WIDTH] = drawn.z;
        words[at + 3u * PHILOX_WIDTH] = drawn.w;
        workgroupBarrier();
    }
    for (var i = lane; i < GROUP_PIXELS; i += GROUP) {
        if first + i < sensor_parameters.pixels {
            words[i] = number_of(first + i, words[i]);
        } else {
            words[i] = 0u;
        }
    }
    workgroupBarrier();
    if first + 4u * lane >= sensor_parameters.pixels {
        return;
    }
    let n = vec4u(words[4u * lane], words[4u * lane + 1u], words[4u * lane + 2u], words[4u * lane + 3u]);
    if wide {
        frame[counter * 2u] = n.x | n.y << 16u;
        if first + 4u * lane + 2u < sensor_parameters.pixels {
            frame[counter * 2u + 1u] = n.z | n.w << 16u;
        }
    } else {
        frame[counter] = n.x | n.y << 8u | n.z << 16u | n.w << 24u;
    }
}

@compute @workgroup_size(GROUP)
fn expected(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = linear(id, groups);
    if pixel < sensor_parameters.pixels {
        expected_dn[pixel] = converted(min(mean_of(pixel), sensor_parameters.full_well_e), pixel);
    }
}
