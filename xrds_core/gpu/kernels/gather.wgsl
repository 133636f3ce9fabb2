// Where every pixel of a frame was in a neighbour, and the samples it takes there.
// The same steps as in motion.py and accumulate.py, which say why.

@group(0) @binding(1) var<storage, read> here_depth: array<f32>;
@group(0) @binding(2) var<storage, read> there_depth: array<f32>;
@group(0) @binding(3) var<storage, read> picture: array<u32>;
@group(0) @binding(4) var<storage, read> noise: array<u32>;
@group(0) @binding(5) var<storage, read> counts: array<f32>;
@group(0) @binding(6) var<storage, read> extent: array<vec2f>;
@group(0) @binding(7) var<storage, read> slots: array<u32>;
@group(0) @binding(8) var<storage, read> moved: array<vec2f>;
@group(0) @binding(9) var<storage, read> masks: array<u32>;
@group(0) @binding(10) var<storage, read> image: array<f32>;
@group(0) @binding(11) var<storage, read> lattice: array<f32>;
@group(0) @binding(12) var<storage, read> coarse: array<f32>;
@group(0) @binding(13) var<storage, read> light: array<vec2f>;
@group(0) @binding(14) var<storage, read_write> sums: array<f32>;
@group(0) @binding(15) var<storage, read_write> taken: array<vec4u>;

struct Point { x: f32, y: f32, depth: f32, ahead: bool };
struct Place { pixel: u32, apart: f32, seen: bool };

const TOLERANCE = 1.0;
const AS_DISTANCE = 2.0;
const AS_DISTANCE_AT_RIMS = 0.3;
const MOST_AT_RIMS = 1.0;
const SURFACE = 0.02;
const OFF = 0.6;
const SPREAD_X = vec3u(3518319155u, 2882110345u, 2360945575u);
const SPREAD_Y = vec3u(3242174889u, 2447445414u, 2654435769u);
const TILE = 64.0;
// WGSL knows no NaN: what is unknown has this value, or less.
const UNKNOWN = -1e37;
const NO_SLOT = 0xffffffffu;

fn is_known(depth: f32) -> bool {
    return depth > UNKNOWN;
}

fn reproject(m: array<vec4f, 4>, x: f32, y: f32, depth: f32) -> Point {
    let across = m[0].x * x + m[0].y * y + m[0].w * depth + m[0].z;
    let down = m[1].x * x + m[1].y * y + m[1].w * depth + m[1].z;
    let w = m[2].x * x + m[2].y * y + m[2].w * depth + m[2].z;
    let near = m[3].x * x + m[3].y * y + m[3].w * depth + m[3].z;
    let ahead = w > 0.0 && is_known(depth);
    let divisor = select(1.0, w, ahead);
    return Point(across / divisor, down / divisor, near / divisor, ahead);
}

fn nearest(x: f32, y: f32, ahead: bool) -> Place {
    let size = vec2f(step.there_size);
    let seen = ahead && x >= 0.0 && x < size.x && y >= 0.0 && y < size.y;
    let at = select(vec2f(0.5), vec2f(x, y), seen);
    let cell = floor(at);
    let off = at - cell - 0.5;
    return Place(u32(cell.y) * step.there_size.x + u32(cell.x), dot(off, off), seen);
}

fn centre(pixel: u32, width: u32) -> vec2f {
    return vec2f(f32(pixel % width), f32(pixel / width)) + 0.5;
}

fn nearer(one: f32, other: f32) -> f32 {
    if !is_known(other) { return one; }
    if !is_known(one) { return other; }
    return select(max(one, other), min(one, other), has(ORTHOGRAPHIC));
}

fn depth_at(is_here: bool, pixel: i32) -> f32 {
    if is_here { return here_depth[pixel]; }
    return there_depth[pixel];
}

// The nearest surface in the 3 x 3 pixels around one, here or in the neighbour.
fn nearest_around(is_here: bool, pixel: u32) -> f32 {
    let size = vec2i(select(step.there_size, step.size, is_here));
    let x = i32(pixel) % size.x;
    let y = i32(pixel) / size.x;
    var found = UNKNOWN;
    for (var i = -1; i <= 1; i++) {
        let row = clamp(y + i, 0, size.y - 1) * size.x;
        for (var j = -1; j <= 1; j++) {
            let column = clamp(x + j, 0, size.x - 1);
            found = nearer(found, depth_at(is_here, row + column));
        }
    }
    return found;
}

// Pixels next to a nearer surface, some of whose light they contain.
fn is_rim(depth: f32, nearest: f32) -> bool {
    return is_known(depth) && abs(nearest - depth) > SURFACE * abs(depth);
}

// The squared parallax of a pixel to the nearest surface around it; -1 behind a camera.
fn parallax(m: array<vec4f, 4>, at: vec2f, depth: f32, nearest: f32) -> f32 {
    let own = reproject(m, at.x, at.y, depth);
    let near = reproject(m, at.x, at.y, nearest);
    if !own.ahead || !near.ahead { return -1.0; }
    let apart = vec2f(near.x - own.x, near.y - own.y);
    return dot(apart, apart);
}

fn rim_distance(here: u32, there: u32) -> f32 {
    var apart = 0.0;
    let own = here_depth[here];
    let own_nearest = nearest_around(true, here);
    if is_rim(own, own_nearest) {
        apart = parallax(step.forth, centre(here, step.size.x), own, own_nearest);
    }
    let other = there_depth[there];
    let other_nearest = nearest_around(false, there);
    if is_rim(other, other_nearest) {
        let at = centre(there, step.there_size.x);
        apart = max(apart, parallax(step.back, at, other, other_nearest));
    }
    return select(min(apart, MOST_AT_RIMS), MOST_AT_RIMS, apart < 0.0);
}

// As if only the camera moved.
fn still_place(pixel: u32) -> Place {
    let own = centre(pixel, step.size.x);
    let forth = reproject(step.forth, own.x, own.y, here_depth[pixel]);
    var found = nearest(forth.x, forth.y, forth.ahead);
    if has(JITTER) && found.seen && found.apart < step.whole {
        let place = vec3u(pixel % step.size.x, pixel / step.size.x, step.number);
        let mixed = vec2u(dot(SPREAD_X, place), dot(SPREAD_Y, place)) >> vec2u(8u);
        let off = 2.0 * OFF * (vec2f(mixed) / 16777216.0 - 0.5);
        let other = nearest(forth.x + off.x, forth.y + off.y, true);
        if other.seen { found.pixel = other.pixel; }
    }
    let there = centre(found.pixel, step.there_size.x);
    let back = reproject(step.back, there.x, there.y, there_depth[found.pixel]);
    let left = vec2f(
        back.x + (forth.x - own.x - there.x), back.y + (forth.y - own.y - there.y)
    );
    let square = dot(left, left);
    let range = extent[pixel];
    let seen = found.seen && back.ahead && square < TOLERANCE * TOLERANCE
        && is_known(range.x) && back.depth >= range.x && back.depth <= range.y;
    if seen { found.apart += AS_DISTANCE * square; }
    found.seen = seen;
    if seen { found.apart += AS_DISTANCE_AT_RIMS * rim_distance(pixel, found.pixel); }
    return found;
}

fn is_marked(pixel: u32, from_word: u32) -> bool {
    return (masks[from_word + (pixel >> 5u)] & (1u << (pixel & 31u))) != 0u;
}

fn words_there() -> u32 {
    return (step.there_size.x * step.there_size.y + 31u) >> 5u;
}

// The place of what moves by itself.
fn with_object_motion(still: Place, pixel: u32) -> Place {
    let slot = slots[pixel];
    if slot != NO_SLOT {
        let position = moved[slot];
        return nearest(position.x, position.y, is_known(position.x));
    }
    var found = still;
    if is_marked(found.pixel, 0u) { found.seen = false; }
    if has(BESIDE) && is_marked(pixel, words_there()) { found.seen = false; }
    return found;
}

// Inverse depth between the surface (0) and the end of the path (1).
fn depth_of_image(near: f32, far: f32, share: f32) -> f32 {
    if has(ORTHOGRAPHIC) { return near + share * (far - near); }
    return near * (far / (far + share * (near - far)));
}

fn coarse_weight(column: u32, row: u32) -> f32 {
    let last = vec2f(step.coarse) - 1.0;
    let place = clamp((vec2f(f32(column), f32(row)) + 0.5) / TILE - 0.5, vec2f(0.0), last);
    let one = vec2u(floor(place));
    let two = min(one + 1u, step.coarse - 1u);
    let share = fract(place);
    let above = mix(coarse[one.y * step.coarse.x + one.x],
                    coarse[one.y * step.coarse.x + two.x], share.x);
    let below = mix(coarse[two.y * step.coarse.x + one.x],
                    coarse[two.y * step.coarse.x + two.x], share.x);
    return mix(above, below, share.y);
}

fn channel(at: u32) -> f32 {
    if !has(THERE_HALF) { return bitcast<f32>(picture[at]); }
    return unpack2x16float(picture[at >> 1u])[at & 1u];
}

fn noise_at(pixel: u32) -> vec2f {
    if has(THERE_HALF) { return unpack2x16float(noise[pixel]); }
    return vec2f(bitcast<f32>(noise[2u * pixel]), bitcast<f32>(noise[2u * pixel + 1u]));
}

@compute @workgroup_size(8, 8)
fn gather(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let at = id.y * step.size.x + id.x;
    let row = step.band.x + id.y;
    let pixel = row * step.size.x + id.x;
    var found = Place(pixel, 0.0, true);
    var share = 1.0;
    if !has(ALIGNED) {
        found = still_place(pixel);
        if has(MOVING) { found = with_object_motion(found, pixel); }
        share = coarse_weight(id.x, row);
        if has(IMAGES) && is_known(image[pixel]) {
            let spot = 3u * (row / step.stride * step.spots + id.x / step.stride);
            if is_known(lattice[spot]) {
                let depth = depth_of_image(here_depth[pixel], image[pixel], lattice[spot]);
                let own = centre(pixel, step.size.x);
                let there = reproject(step.forth, own.x, own.y, depth);
                found = nearest(
                    there.x + lattice[spot + 1u] * step.apart,
                    there.y + lattice[spot + 2u] * step.apart,
                    there.ahead && is_known(here_depth[pixel])
                );
                // tiles compare surfaces; light that changes everywhere leaves none
                share = step.coarse_most;
            }
        }
    }
    var count = step.there_samples;
    if has(THERE_COUNTS) { count = max(counts[found.pixel], 0.0); }
    let reused = select(0.0, share * count, found.seen);
    let weight = reused * exp(found.apart * step.fall);
    if weight == 0.0 {
        taken[at] = vec4u(0u);
        return;
    }
    add(at, found.pixel, weight, reused);
}

fn add(at: u32, pixel: u32, weight: f32, reused: f32) {
    let start = pixel * step.channels;
    let other = noise_at(pixel);
    let sum = step.offset + at * (step.channels + 3u);
    sums[sum] += weight;
    sums[sum + 1u] += reused;
    sums[sum + 2u] += other.x * weight;
    for (var i = 0u; i < 6u; i++) { sums[sum + 3u + i] += channel(start + i) * weight; }
    var normal = vec3f(channel(start + 6u), channel(start + 7u), channel(start + 8u));
    if has(TURNED) {
        normal = vec3f(
            dot(step.turn[0].xyz, normal),
            dot(step.turn[1].xyz, normal),
            dot(step.turn[2].xyz, normal)
        );
    }
    for (var i = 0u; i < 3u; i++) { sums[sum + 9u + i] += normal[i] * weight; }
    if step.channels > 9u { sums[sum + 12u] += channel(start + 9u) * weight; }
    let albedo = vec3f(channel(start + 3u), channel(start + 4u), channel(start + 5u));
    // the nearest pixel differs in texture from this one, but not in light
    let difference = other.x - light[at].x * root_of_luminance(albedo) - light[at].y;
    taken[at] = vec4u(
        bitcast<u32>(weight), bitcast<u32>(difference), bitcast<u32>(other.y), pixel
    );
}
