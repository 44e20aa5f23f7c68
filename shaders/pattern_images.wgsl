// Tables of the pattern images, computed on the CPU, all in one buffer. Twin of `Table` in
// `exposure/pass.rs`.

@group(0) @binding(57) var<storage, read> pattern_image_cells: array<vec4u>;

const TABLE_UNIFORM: u32 = 0u;
const TABLE_ALONG_X: u32 = 1u;
const TABLE_ALONG_Y: u32 = 2u;
const TABLE_IMAGE: u32 = 3u;

// A pattern image prepared for averaging.
struct Table {
    kind: u32,
    // Its start in `pattern_image_cells`.
    first: u32,
    // Number of pixels of a pattern image that varies along one axis; columns and rows of a
    // two-dimensional one.
    width: u32,
    height: u32,
    // Light per unit of the levels; for a uniform pattern image, the light of the whole pattern
    // image.
    scale: f32,
    // Whether its sums occupy two words.
    long: bool,
    // Start of its row of levels for kernels.
    held: u32,
}

// A word of the tables, counted from the start of a cell.
fn pattern_image_word(first: u32, word: u32) -> u32 {
    return pattern_image_cells[first + (word >> 2u)][word & 3u];
}
