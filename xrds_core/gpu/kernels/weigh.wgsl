// The similarity weights of a group of neighbours, as in similarity.py, and its sums
// weighted by them.

@group(0) @binding(2) var<storage, read> counts: array<f32>;
@group(0) @binding(3) var<storage, read> noise_of_guides: array<f32>;
@group(0) @binding(4) var<storage, read> plain: array<vec4f>;
@group(0) @binding(5) var<storage, read> bounds: array<vec4f>;
@group(0) @binding(6) var<storage, read> changes: array<f32>;
@group(0) @binding(7) var<storage, read_write> sums: array<f32>;
@group(0) @binding(8) var<storage, read_write> apart: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> likeness: array<f32>;
@group(0) @binding(10) var<storage, read_write> result: array<f32>;
@group(0) @binding(11) var<storage, read_write> factors: array<f32>;

const BRIGHTEST = 4.0;
const NORMAL_SHARE = 0.31622776;  // square root of 0.1
const UNSURE = 6.0 / 9.0;
const LIGHT = 4.0;
const LIGHT_AREA = 2;  // pixels to each side

fn is_valid(pixel: u32) -> bool {
    return !has(HERE_COUNTS) || counts[pixel] >= 0.0;
}

fn guide(value: f32, number: u32) -> f32 {
    let scale = select(1.0, NORMAL_SHARE, number >= 3u && number < 6u);
    return clamp(value * scale, -BRIGHTEST, BRIGHTEST);
}

fn sum_at(at: u32) -> u32 {
    return step.offset + at * (step.channels + 3u);
}

// Squared differences of guides and differences of light, by pixel.
@compute @workgroup_size(8, 8)
fn compare(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let at = id.y * step.size.x + id.x;
    let pixel = step.band.x * step.size.x + at;
    let sum = sum_at(at);
    if !(sums[sum] > 0.0 && is_valid(pixel)) {
        apart[at] = vec4f(0.0);
        return;
    }
    let weights = max(sums[sum], TINY);
    var square = 0.0;
    for (var i = 3u; i < step.channels; i++) {
        let mean = guide(sums[sum + 3u + i] / weights, i - 3u);
        let difference = mean - guide(channel(pixel * step.channels + i), i - 3u);
        square += difference * difference;
    }
    let noise = noise_of_guides[pixel];
    let light = plain[at].z - sums[sum + 2u] / weights;
    apart[at] = vec4f(square - noise * noise, 1.0, light, 0.0);
}

// The squared mean difference of light, without what chance makes of it.
@compute @workgroup_size(8, 8)
fn compare_light(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let at = id.y * step.size.x + id.x;
    var light = 0.0;
    var count = 0.0;
    for (var i = -1; i <= 1; i++) {
        for (var j = -1; j <= 1; j++) {
            let x = i32(id.x) + j;
            let y = i32(id.y) + i;
            if !in_band(x, y) { continue; }
            light += apart[y * i32(step.size.x) + x].z;
            count += 1.0;
        }
    }
    light /= count;
    apart[at].w = light * light - bounds[at].z;
}

// V / (V + E) of each pixel.
@compute @workgroup_size(8, 8)
fn liken(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let at = id.y * step.size.x + id.x;
    var guides = 0.0;
    var valid = 0.0;
    var light = 0.0;
    var light_count = 0.0;
    for (var i = -step.area; i <= step.area; i++) {
        for (var j = -step.area; j <= step.area; j++) {
            let x = i32(id.x) + j;
            let y = i32(id.y) + i;
            if !in_band(x, y) { continue; }
            let beside = apart[y * i32(step.size.x) + x];
            guides += beside.x;
            valid += beside.y;
            if max(abs(i), abs(j)) > LIGHT_AREA { continue; }
            light += beside.w;
            light_count += 1.0;
        }
    }
    let bound = bounds[at];
    let row = (step.size.x + 1u) / 2u;
    let changed = changes[id.y / 2u * row + id.x / 2u];
    let error = step.guides * bound.w * discounted(guides / max(valid, TINY), bound.x)
        + LIGHT * discounted(light / light_count, UNSURE * bound.y)
        + step.changes * changed;
    likeness[at] = bound.y / (bound.y + error);
}

// Transparent in a pixel or next to it: there is no noise, and outlines must not widen.
fn is_void(id: vec3u) -> bool {
    if step.channels < 10u { return false; }
    for (var i = -1; i <= 1; i++) {
        for (var j = -1; j <= 1; j++) {
            let x = i32(id.x) + j;
            let y = i32(id.y) + i;
            if !in_band(x, y) { continue; }
            let pixel = (step.band.x + u32(y)) * step.size.x + u32(x);
            if channel(pixel * step.channels + 9u) == 0.0 { return true; }
        }
    }
    return false;
}

// Weights, samples and picture of the group, added to those of the other one.
@compute @workgroup_size(8, 8)
fn weigh(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let at = id.y * step.size.x + id.x;
    let pixel = step.band.x * step.size.x + at;
    let sum = sum_at(at);
    var total = 0.0;
    var valid = 0.0;
    for (var i = -1; i <= 1; i++) {
        for (var j = -1; j <= 1; j++) {
            let x = i32(id.x) + j;
            let y = i32(id.y) + i;
            if !in_band(x, y) { continue; }
            let beside = y * i32(step.size.x) + x;
            total += likeness[beside] * apart[beside].y;
            valid += apart[beside].y;
        }
    }
    var weight = select(1.0, total / max(valid, TINY), is_valid(pixel));
    if !(sums[sum] > 0.0) || is_void(id) { weight = 0.0; }
    factors[step.offset / (step.channels + 3u) + at] = weight;
    let to = at * (step.channels + 3u);
    for (var i = 0u; i < step.channels + 3u; i++) {
        let value = weight * sums[sum + i];
        if has(FIRST_GROUP) { result[to + i] = value; } else { result[to + i] += value; }
    }
}
