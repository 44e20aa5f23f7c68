// Tables of the slides, computed on the CPU, all in one buffer. Twin of `Table` of `exposure.rs`.

@group(0) @binding(57) var<storage, read> slide_cells: array<vec4u>;

const TABLE_UNIFORM: u32 = 0u;
const TABLE_ALONG_X: u32 = 1u;
const TABLE_ALONG_Y: u32 = 2u;
const TABLE_PICTURE: u32 = 3u;

// A slide prepared for averaging.
struct Table {
    kind: u32,
    // Its start in `slide_cells`.
    first: u32,
    // Held pixels of a one-dimensional slide; columns and rows of a two-dimensional one.
    width: u32,
    height: u32,
    // Light per unit of the levels; for a uniform slide, the light of the whole slide.
    scale: f32,
    // Whether its sums occupy two words.
    long: bool,
    // Start of its row of levels for kernels.
    held: u32,
}

// A word of the tables, counted from the start of a cell.
fn slide_word(first: u32, word: u32) -> u32 {
    return slide_cells[first + (word >> 2u)][word & 3u];
}
