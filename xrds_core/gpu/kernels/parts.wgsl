// One part of the light, with the weights that the picture's samples have.

@group(0) @binding(1) var<storage, read> part: array<u32>;
@group(0) @binding(2) var<storage, read> taken: array<vec4u>;
@group(0) @binding(3) var<storage, read> factors: array<f32>;
@group(0) @binding(4) var<storage, read_write> sums: array<f32>;
@group(0) @binding(5) var<storage, read> counts: array<f32>;
@group(0) @binding(6) var<storage, read> weights: array<f32>;
@group(0) @binding(7) var<storage, read_write> means: array<f32>;

fn light(at: u32, is_half: bool) -> f32 {
    if !is_half { return bitcast<f32>(part[at]); }
    return unpack2x16float(part[at >> 1u])[at & 1u];
}

// Add what a neighbour lends.
@compute @workgroup_size(8, 8)
fn add(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let at = id.y * step.size.x + id.x;
    let weight = bitcast<f32>(taken[at].x) * factors[step.offset + at];
    if weight == 0.0 { return; }
    let start = 3u * taken[at].w;
    for (var i = 0u; i < 3u; i++) {
        sums[3u * at + i] += weight * light(start + i, has(THERE_HALF));
    }
}

// The mean with the frame's own.
@compute @workgroup_size(8, 8)
fn mean(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let at = id.y * step.size.x + id.x;
    let pixel = step.band.x * step.size.x + at;
    let reused = weights[at * (step.channels + 3u)];
    var samples = step.samples;
    if has(HERE_COUNTS) { samples = max(counts[pixel], 0.0); }
    for (var i = 0u; i < 3u; i++) {
        var own = 0.0;
        if !has(DARK) { own = light(3u * pixel + i, has(HERE_HALF)); }
        let change = (sums[3u * at + i] - own * reused) / max(samples + reused, TINY);
        means[3u * at + i] = own + change;
    }
}
