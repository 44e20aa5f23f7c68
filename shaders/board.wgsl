// needs: plan, laid
//
// Twin of geometry/board/ink.rs and parallelogram.rs: the fraction of ink on a piece of a
// calibration board. Positions are relative to the piece's centre, and relative to a dot in units
// of its radius, to avoid cancellation.

// Kinds of print on an object, as values of its `lay`.
const LAY_DOTS: u32 = 5u;
const LAY_CHESS: u32 = 6u;
// Maximum number of dots or squares evaluated one by one.
const MOST_CELLS: i32 = 64;
// Pieces that reach farther than this, in millimetres, count as free of ink.
const WIDEST_PIECE: f32 = 1e7;
// Angle below which an arc's segment is computed from its series.
const SMALL_ARC: f32 = 1.0;

struct Board {
    is_dots: bool,
    // Columns and rows of dots or corners.
    grid: vec2f,
    pitch: f32,
    // Radii of a dot and of a marker.
    dot: f32,
    marker: f32,
    // Mean fraction of ink on the grid.
    mean: f32,
}

// A parallelogram with a non-zero area.
struct Piece {
    at: vec2f,
    // Relative to the centre, counter-clockwise if y points up.
    corners: array<vec2f, 4>,
    area: f32,
    // Half sides of the axis-aligned bounding rectangle.
    half: vec2f,
}

// Fraction of ink, 0 to 1, in the parallelogram centred at `at` with two sides, in millimetres of
// the board's plane.
fn board_ink(board: Board, at: vec2f, across: vec2f, down: vec2f) -> f32 {
    let half = 0.5 * (abs(across) + abs(down));
    if !(max(half.x, half.y) <= WIDEST_PIECE && max(abs(at.x), abs(at.y)) <= WIDEST_PIECE) {
        return 0.0;
    }
    let signed = perp_dot(across, down);
    if !(abs(signed) > 1e-6 * (dot(across, across) + dot(down, down))) {
        return board_point(board, at);
    }
    let b = down * sign(signed);
    let sum = 0.5 * (across + b);
    let difference = 0.5 * (across - b);
    let corners = array<vec2f, 4>(-sum, difference, sum, -difference);
    let piece = Piece(at, corners, abs(signed), half);
    let beyond = select(0.0, max(board.marker - 0.5 * board.pitch, 0.0), board.is_dots);
    let low = cells_from(board, at - half - beyond);
    let high = cells_to(board, at + half + beyond);
    if any(low > high) {
        return 0.0;
    }
    let count = high - low + 1;
    if count.x * count.y > MOST_CELLS {
        let edge = 0.5 * cell_count(board) * board.pitch;
        return board.mean * piece_in_rectangle(piece, -edge, edge);
    }
    var share = 0.0;
    for (var row = low.y; row <= high.y; row++) {
        for (var column = low.x; column <= high.x; column++) {
            share += ink_of_cell(board, vec2i(column, row), piece);
        }
    }
    return min(share, 1.0);
}

fn perp_dot(a: vec2f, b: vec2f) -> f32 {
    return a.x * b.y - a.y * b.x;
}

fn cell_count(board: Board) -> vec2f {
    return board.grid + select(1.0, 0.0, board.is_dots);
}

// Column and row of the cell that contains a position, as the start of a range of cells. It is
// clamped so that a range beyond the board is empty; `cells_to` returns the end of the range.
fn cells_from(board: Board, place: vec2f) -> vec2i {
    let cells = cell_count(board);
    return vec2i(clamp(floor(place / board.pitch + 0.5 * cells), vec2f(0.0), cells));
}

fn cells_to(board: Board, place: vec2f) -> vec2i {
    let cells = cell_count(board);
    return vec2i(clamp(floor(place / board.pitch + 0.5 * cells), vec2f(-1.0), cells - 1.0));
}

fn board_point(board: Board, at: vec2f) -> f32 {
    let reach = select(0.0, board.marker, board.is_dots);
    let low = cells_from(board, at - reach);
    let high = cells_to(board, at + reach);
    for (var row = low.y; row <= high.y; row++) {
        for (var column = low.x; column <= high.x; column++) {
            let cell = vec2i(column, row);
            var is_ink = is_dark(cell);
            if board.is_dots {
                is_ink = distance(at, dot_center(board, cell)) <= dot_radius(board, cell);
            }
            if is_ink {
                return 1.0;
            }
        }
    }
    return 0.0;
}

fn ink_of_cell(board: Board, cell: vec2i, piece: Piece) -> f32 {
    if board.is_dots {
        return piece_in_disc(piece, dot_center(board, cell), dot_radius(board, cell));
    }
    if !is_dark(cell) {
        return 0.0;
    }
    let low = (vec2f(cell) - 0.5 * cell_count(board)) * board.pitch;
    return piece_in_rectangle(piece, low, low + board.pitch);
}

fn is_dark(cell: vec2i) -> bool {
    return ((cell.x + cell.y) & 1) == 0;
}

fn dot_center(board: Board, cell: vec2i) -> vec2f {
    return (vec2f(cell) - 0.5 * (board.grid - 1.0)) * board.pitch;
}

// Radius of a dot. The positions of the markers must match geometry/board/kind.rs.
fn dot_radius(board: Board, cell: vec2i) -> f32 {
    let place = cell - vec2i(board.grid) / 2;
    let is_marker = all(place == vec2i(0, 0)) || all(place == vec2i(2, 0))
        || all(place == vec2i(-2, 1)) || all(place == vec2i(0, -2)) || all(place == vec2i(1, 2));
    return select(board.dot, board.marker, is_marker);
}

// Outline of the intersection of a piece with the unit circle, built side by side.
struct Outline {
    // Twice the area of the polygon.
    polygon: f32,
    // Area of the circle segments.
    segments: f32,
    // Angle covered since the outline last left the circle, or since the start.
    angle: f32,
    // The angle covered before the outline first entered the circle, and the point of entry.
    before: f32,
    first: vec2f,
    // Point at which the outline last left the circle.
    left: vec2f,
    has_first: bool,
    has_left: bool,
}

fn piece_in_disc(piece: Piece, center: vec2f, radius: f32) -> f32 {
    let middle = (piece.at - center) / radius;
    let near = max(abs(middle) - piece.half / radius, vec2f(0.0));
    if dot(near, near) >= 1.0 {
        return 0.0;
    }
    var corners = piece.corners;
    var is_inside: array<bool, 4>;
    for (var i = 0u; i < 4u; i++) {
        corners[i] /= radius;
        let corner = middle + corners[i];
        is_inside[i] = dot(corner, corner) <= 1.0;
    }
    if is_inside[0] && is_inside[1] && is_inside[2] && is_inside[3] {
        return 1.0;
    }
    var outline = Outline();
    for (var i = 0u; i < 4u; i++) {
        let next = (i + 1u) % 4u;
        outline_side(&outline, middle, corners[i], corners[next], is_inside[i], is_inside[next]);
    }
    return clamp(outline_area(&outline, middle) / (piece.area / (radius * radius)), 0.0, 1.0);
}

// Processes the side from p to q, relative to `middle`; the flags tell whether its ends are inside
// the circle.
fn outline_side(
    outline: ptr<function, Outline>,
    middle: vec2f,
    p: vec2f,
    q: vec2f,
    starts_in: bool,
    ends_in: bool,
) {
    if starts_in && ends_in {
        (*outline).polygon += perp_dot(p, q);
        return;
    }
    // Measured from the point of the line closest to the circle's centre, in both directions.
    let step = q - p;
    let length2 = dot(step, step);
    let start = middle + p;
    let nearest = -dot(start, step) / length2;
    let closest = start + step * nearest;
    let half2 = (1.0 - dot(closest, closest)) / length2;
    if !starts_in && !ends_in && !(half2 > 0.0 && nearest > 0.0 && nearest < 1.0) {
        (*outline).angle += arc_between(start, middle + q);
        return;
    }
    let half = sqrt(max(half2, 0.0));
    let enter = select(p + step * clamp(nearest - half, 0.0, 1.0), p, starts_in);
    let leave = select(p + step * clamp(nearest + half, 0.0, 1.0), q, ends_in);
    if !starts_in {
        (*outline).angle += arc_between(start, middle + enter);
        if (*outline).has_left {
            outline_close(outline, middle, enter, (*outline).angle);
        } else {
            (*outline).before = (*outline).angle;
            (*outline).first = enter;
            (*outline).has_first = true;
        }
        (*outline).angle = 0.0;
    }
    (*outline).polygon += perp_dot(enter, leave);
    if !ends_in {
        (*outline).left = leave;
        (*outline).has_left = true;
        (*outline).angle = arc_between(middle + leave, middle + q);
    }
}

// The sine is computed from the two points on the circle: the built-in function may be far less
// accurate.
fn outline_close(outline: ptr<function, Outline>, middle: vec2f, at: vec2f, angle: f32) {
    let left = (*outline).left;
    (*outline).polygon += perp_dot(left, at);
    (*outline).segments += arc_segment(angle, perp_dot(middle + left, middle + at));
}

// Area in units of the squared radius.
fn outline_area(outline: ptr<function, Outline>, middle: vec2f) -> f32 {
    if !(*outline).has_left {
        // No side meets the circle: it lies entirely inside or entirely outside the piece.
        return select(0.0, 3.14159265, (*outline).angle > 3.14159265);
    }
    if (*outline).has_first {
        outline_close(outline, middle, (*outline).first, (*outline).angle + (*outline).before);
    }
    return 0.5 * (*outline).polygon + (*outline).segments;
}

fn arc_between(a: vec2f, b: vec2f) -> f32 {
    return arc_tangent(perp_dot(a, b), dot(a, b));
}

// Area between an arc of the unit circle and its chord, (x - sin x) / 2.
fn arc_segment(x: f32, sine: f32) -> f32 {
    if abs(x) < SMALL_ARC {
        let z = x * x;
        let tail = 1.0 - z / 42.0 * (1.0 - z / 72.0 * (1.0 - z / 110.0));
        return x * z / 12.0 * (1.0 - z / 20.0 * tail);
    }
    return 0.5 * (x - sine);
}

fn piece_in_rectangle(piece: Piece, low: vec2f, high: vec2f) -> f32 {
    let from_low = low - piece.at;
    let from_high = high - piece.at;
    if all(from_low <= -piece.half) && all(from_high >= piece.half) {
        return 1.0;
    }
    if any(from_low >= piece.half) || any(from_high <= -piece.half) {
        return 0.0;
    }
    var polygon = Polygon();
    polygon.count = 4u;
    for (var i = 0u; i < 4u; i++) {
        polygon.corners[i] = piece.corners[i];
    }
    polygon_cut(&polygon, vec2f(1.0, 0.0), from_high.x);
    polygon_cut(&polygon, vec2f(-1.0, 0.0), -from_low.x);
    polygon_cut(&polygon, vec2f(0.0, 1.0), from_high.y);
    polygon_cut(&polygon, vec2f(0.0, -1.0), -from_low.y);
    return clamp(polygon_area(&polygon) / piece.area, 0.0, 1.0);
}

// A convex polygon that is clipped.
struct Polygon {
    corners: array<vec2f, 8>,
    count: u32,
}

// Keeps the part that lies no farther than `offset` along a direction.
fn polygon_cut(polygon: ptr<function, Polygon>, along: vec2f, offset: f32) {
    var kept: array<vec2f, 8>;
    var count = 0u;
    for (var i = 0u; i < (*polygon).count; i++) {
        let p = (*polygon).corners[i];
        let q = (*polygon).corners[(i + 1u) % (*polygon).count];
        let over_p = dot(p, along) - offset;
        let over_q = dot(q, along) - offset;
        if over_p <= 0.0 && count < 8u {
            kept[count] = p;
            count++;
        }
        if (over_p <= 0.0) != (over_q <= 0.0) && count < 8u {
            kept[count] = p + (q - p) * (over_p / (over_p - over_q));
            count++;
        }
    }
    (*polygon).corners = kept;
    (*polygon).count = count;
}

fn polygon_area(polygon: ptr<function, Polygon>) -> f32 {
    let start = (*polygon).corners[0];
    var twice = 0.0;
    for (var i = 2u; i < (*polygon).count; i++) {
        twice += perp_dot((*polygon).corners[i - 1u] - start, (*polygon).corners[i] - start);
    }
    return 0.5 * twice;
}
