// needs: plan, pattern_images
// The schedule of an exposure: the pattern images that each row of the sensor sees, and for how
// long. Twin of `schedule.rs`, with the same lines and parts.

// A header of two vectors, the lines, the parts, and two vectors for each table.
@group(0) @binding(56) var<storage, read> schedule: array<vec4u>;

// A group of pixels with the same exposure.
struct Line {
    first: u32,
    parts: u32,
    // Exposure in seconds times the mean of the flicker pulse over it.
    swing: f32,
}

// One pattern image within the exposure of a line.
struct Part {
    table: u32,
    // Seconds for which it is shown, and the projector's light relative to full.
    seconds: f32,
    power: f32,
}

fn schedule_pixels() -> u32 {
    return schedule[0].x;
}

// The line of a pixel.
fn schedule_line(pixel: u32) -> Line {
    var index = 0u;
    if has_rolling_shutter {
        index = pixel / schedule[0].y;
    }
    let line = schedule[2u + index];
    return Line(line.x, line.y, bitcast<f32>(line.z));
}

fn schedule_part(index: u32) -> Part {
    let part = schedule[schedule[0].z + index];
    return Part(part.x, bitcast<f32>(part.y), bitcast<f32>(part.z));
}

fn schedule_table(index: u32) -> Table {
    let at = schedule[0].w + 2u * index;
    let size = schedule[at];
    let more = schedule[at + 1u];
    return Table(size.x, size.y, size.z, size.w, bitcast<f32>(more.x), more.y == 1u, more.z);
}

// Number of tables.
fn schedule_tables() -> u32 {
    return schedule[1].x;
}
