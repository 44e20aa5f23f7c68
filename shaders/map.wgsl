// needs: materials, there, texture, laid, board
//
// Twin of `Material::factor` in transport/reflect.rs, of material/map.rs and
// material/spot.rs: the factor that vertex colours, a texture or a board's ink apply to an object's
// albedo.
//
// The CPU transforms a point first to the surface's rest pose in the rig's frame, then into the
// object's own frame; here both steps are combined into one, from the frame in which the surface is
// stored.

// Albedo factor at a hit at a point in the rig's frame, averaged over the parallelogram spanned by
// two sides on the tangent plane.
fn material_factor(hit: Hit, there: There, point: vec3f, across: vec3f, down: vec3f) -> f32 {
    let about = materials[object_of(hit.surface)];
    let is_corners = hit.triangle != NO_SURFACE;
    let local = Own(
        there_point(there, point),
        there_direction(there, hit.normal),
        there_direction(there, across),
        there_direction(there, down),
    );
    var corners = mat3x3f();
    var weights = vec3f(0.0);
    if is_corners {
        corners = there_corners(hit);
        weights = barycentric(corners, local.point);
    }
    let index = hit.surface - about.first_triangle;
    var factor = 1.0;
    if about.colours != NOTHING && is_corners {
        factor = dot(weights, material_value3(about.colours + 3u * index));
    }
    if about.lay == LAY_DOTS || about.lay == LAY_CHESS {
        return printed_factor(about, local);
    }
    if about.lay == LAY_NONE || (about.lay == LAY_CORNERS && !is_corners) {
        return factor;
    }
    var steps = mat2x3f();
    if is_corners && (about.lay == LAY_CORNERS || about.rest != NOTHING) {
        steps = mat2x3f(shares(corners, local.across), shares(corners, local.down));
    }
    var laid: Laid;
    if about.lay == LAY_CORNERS {
        laid = laid_by_corners(about.coordinates + 6u * index, weights, steps);
    } else {
        if about.rest != NOTHING {
            laid = laid_over(about.lay, own_at_rest(about.rest + 9u * index, weights, steps, local.normal));
        } else {
            laid = laid_over(about.lay, own_of(about.own_from_there, local));
        }
        laid.at = laid.at / about.size_mm + 0.5;
        laid.across /= about.size_mm;
        laid.down /= about.size_mm;
    }
    let image = Picture(about.sums, about.width, about.height, about.mean);
    return factor * texture_average(image, laid.at, laid.across, laid.down);
}

// A board is stored in its own frame and printed on the side towards -z.
fn printed_factor(about: Material, own: Own) -> f32 {
    if !(own.normal.z < 0.0) {
        return 1.0;
    }
    let grid = vec2f(f32(about.width), f32(about.height));
    let sizes = about.board;
    let board = Board(about.lay == LAY_DOTS, grid, sizes.x, sizes.y, sizes.z, about.mean);
    let ink = board_ink(board, own.point.xy, own.across.xy, own.down.xy);
    return 1.0 - (1.0 - sizes.w) * ink;
}

// Whether a footprint with this mean factor crosses the outline of a board's ink.
fn material_is_edge(object: u32, mean: f32) -> bool {
    let about = materials[object];
    let ink = (1.0 - mean) / (1.0 - about.board.w);
    return (about.lay == LAY_DOTS || about.lay == LAY_CHESS) && ink > 1e-4 && ink < 1.0 - 1e-4;
}

fn own_of(pose: mat3x4f, local: Own) -> Own {
    return Own(
        vec4f(local.point, 1.0) * pose,
        vec4f(local.normal, 0.0) * pose,
        vec4f(local.across, 0.0) * pose,
        vec4f(local.down, 0.0) * pose,
    );
}

// The surface point in the rest pose of its triangle.
fn own_at_rest(at: u32, weights: vec3f, steps: mat2x3f, facet: vec3f) -> Own {
    let corners = mat3x3f(material_value3(at), material_value3(at + 3u), material_value3(at + 6u));
    let normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
    let length2 = dot(normal, normal);
    return Own(
        corners * weights,
        select(facet, normal * inverseSqrt(max(length2, 1e-36)), length2 > 1e-36),
        corners * steps[0],
        corners * steps[1],
    );
}

// Position on the texture by the coordinates at the triangle's corners; v points down.
fn laid_by_corners(at: u32, weights: vec3f, steps: mat2x3f) -> Laid {
    let a = vec2f(material_values[at], material_values[at + 1u]);
    let b = vec2f(material_values[at + 2u], material_values[at + 3u]);
    let c = vec2f(material_values[at + 4u], material_values[at + 5u]);
    let coordinates = mat3x2f(a, b, c);
    return Laid(coordinates * weights, coordinates * steps[0], coordinates * steps[1]);
}
