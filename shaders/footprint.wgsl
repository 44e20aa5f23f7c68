// needs: plan, schedule, row_table, image_table, kernel, diffused
// The average level of any pattern image under a footprint. Twin of `average` in
// `exposure/pass.rs`, which chooses between the tables.

// Kinds of tables that a frame uses besides uniform ones.
override along_rows: bool = false;
override in_images: bool = false;
// The projector's blur along y over that along x.
override blur_aspect: f32 = 1.0;

// The area that a pixel, or one of its samples, covers on the pattern image.
struct Footprint {
    at: vec2f,
    // Derivatives of x, then of y, by the camera's column and row.
    slopes: vec4f,
    // Standard deviation of the projector's blur along x.
    sigma: f32,
    // Tissue that spreads light under the skin; `NO_TISSUE` if there is none.
    tissue: u32,
    px_per_mm: vec2f,
}

// Average level, relative to full white.
fn footprint_level(table: Table, footprint: Footprint) -> f32 {
    let sigma = footprint.sigma * vec2f(1.0, blur_aspect);
    if along_rows && (table.kind == TABLE_ALONG_X || table.kind == TABLE_ALONG_Y) {
        let along_x = table.kind == TABLE_ALONG_X;
        let x = select(footprint.at.y, footprint.at.x, along_x);
        let slope = select(footprint.slopes.zw, footprint.slopes.xy, along_x);
        if has_projector_defocus || has_subsurface {
            let px_per_mm = select(footprint.px_per_mm.y, footprint.px_per_mm.x, along_x);
            let blur = select(sigma.y, sigma.x, along_x);
            let kernel = kernel_average(table, x, slope, blur, footprint.tissue, px_per_mm);
            if kernel.blurred {
                return kernel.level;
            }
        }
        return row_average(table, x, slope);
    }
    if in_images && table.kind == TABLE_IMAGE {
        if has_subsurface && footprint.tissue != NO_TISSUE {
            return diffused_average(
                table,
                footprint.at,
                footprint.slopes,
                sigma,
                footprint.tissue,
                footprint.px_per_mm,
            );
        }
        return image_average(table, footprint.at, footprint.slopes, sigma);
    }
    return table.scale;
}
