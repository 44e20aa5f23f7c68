// The slides' tables as the CPU made them, all in one buffer. Twin of `Table` of `exposure.rs`.

@group(0) @binding(57) var<storage, read> slide_cells: array<vec4u>;

const TABLE_UNIFORM: u32 = 0u;
const TABLE_ALONG_X: u32 = 1u;
const TABLE_ALONG_Y: u32 = 2u;
const TABLE_PICTURE: u32 = 3u;

// A slide prepared for averaging.
struct Table {
    kind: u32,
    // Where it starts in `slide_cells`.
    first: u32,
    // Held pixels of a row; columns and rows of a picture.
    width: u32,
    height: u32,
    // Light of one unit of the levels; of the whole slide where it is uniform.
    scale: f32,
    // Whether its sums take two words.
    long: bool,
    // Where its row for kernels starts.
    held: u32,
}

// A word of the tables, counted from the start of a cell.
fn slide_word(first: u32, word: u32) -> u32 {
    return slide_cells[first + (word >> 2u)][word & 3u];
}
