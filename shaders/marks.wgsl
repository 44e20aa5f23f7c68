// Flags of pixels, and the number that stands for no surface. Twin of the constants of `truth.rs`
// and of `Surface::NONE` in `scene/hits.rs`.

const SEEN: u32 = 1u;
const LIT: u32 = 2u;
const SQUARE: u32 = 4u;
const CREASE: u32 = 8u;
const NO_SURFACE: u32 = 0xffffffffu;
