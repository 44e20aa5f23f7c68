// needs: plan, maps_in, skin_in, footprint, flicker
// The exposure pass: the light of the pattern images at each pixel, averaged over its footprint,
// plus ambient light. Twin of `exposure/pass.rs` and `schedule.rs`. One thread per pixel.

// Mean electrons of each pixel.
@group(0) @binding(55) var<storage, read_write> electrons: array<f32>;

// Whether to add the light to that of other instants already in the buffer.
override adds: bool = false;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= schedule_pixels() {
        return;
    }
    // Mixed pixels get their light from `mixed_exposure.wgsl`, which overwrites the value written
    // here unless it adds to the light of other instants.
    if adds && (marks[i] & CREASE) != 0u {
        return;
    }
    let line = schedule_line(i);
    let steady = light[i];
    var sum = 0.0;
    for (var k = 0u; k < line.parts; k += 1u) {
        let part = schedule_part(line.first + k);
        var level = 0.0;
        if steady.x > 0.0 && part.power > 0.0 {
            level = footprint_level(schedule_table(part.table), footprint_of(i));
        }
        sum += part.seconds * (steady.y + part.power * steady.x * level);
    }
    if has_flicker {
        sum = flicker_both(sum, line.swing, flickering[i]);
    }
    if adds {
        sum += electrons[i];
    }
    electrons[i] = sum;
}

fn footprint_of(i: u32) -> Footprint {
    var footprint: Footprint;
    footprint.tissue = NO_TISSUE;
    if along_rows || in_images {
        footprint.at = place[i];
        footprint.slopes = slopes[i];
        if has_subsurface {
            let skin = under_skin[i];
            footprint.at = skin.origin;
            footprint.px_per_mm = skin.px_per_mm;
            footprint.tissue = skin.tissue;
        }
        if has_projector_defocus {
            footprint.sigma = blur[i];
        }
    }
    return footprint;
}
