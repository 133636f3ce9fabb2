// Light that changes from frame to frame, as in changes.py, by tiles of 2 x 2 pixels.

@group(0) @binding(1) var<storage, read> taken: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> tiles: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> one: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> two: array<vec2f>;
@group(0) @binding(5) var<storage, read_write> error: array<f32>;

const CHANCE = 10.0;

fn tile_count() -> vec2u {
    return vec2u((step.size.x + 1u) / 2u, (step.band.y + 1u) / 2u);
}

@compute @workgroup_size(8, 8)
fn tile(@builtin(global_invocation_id) id: vec3u) {
    let count = tile_count();
    if id.x >= count.x || id.y >= count.y { return; }
    var sum = vec4f(0.0);
    for (var i = 0u; i < 2u; i++) {
        for (var j = 0u; j < 2u; j++) {
            let at = vec2u(2u * id.x + j, 2u * id.y + i);
            if at.x >= step.size.x || at.y >= step.band.y { continue; }
            let found = bitcast<vec4f>(taken[at.y * step.size.x + at.x]);
            let noise = found.x * found.z;
            sum += vec4f(found.x, found.x * found.y, noise * noise, 0.0);
        }
    }
    tiles[id.y * count.x + id.x] = sum;
}

// Add a neighbour's tiles, averaged over areas of 1, 2, 4 and 8.
@compute @workgroup_size(8, 8)
fn add(@builtin(global_invocation_id) id: vec3u) {
    let count = tile_count();
    if id.x >= count.x || id.y >= count.y { return; }
    for (var level = 0u; level < 4u; level++) {
        let size = 1i << level;
        let before = (size - 1) / 2;
        var sum = vec4f(0.0);
        for (var i = 0; i < size; i++) {
            let y = i32(id.y) - before + i;
            if y < 0 || y >= i32(count.y) { continue; }
            for (var j = 0; j < size; j++) {
                let x = i32(id.x) - before + j;
                if x < 0 || x >= i32(count.x) { continue; }
                sum += tiles[y * i32(count.x) + x];
            }
        }
        let share = 1.0 / max(sum.x, TINY);
        let at = (level * count.y + id.y) * count.x + id.x;
        one[at] += vec4f(sum.x, sum.x * sum.x, sum.y, sum.y * sum.y * share);
        two[at] += vec2f(sum.z, sum.z * share);
    }
}

// The squared error due to changes, summed over areas of all sizes.
@compute @workgroup_size(8, 8)
fn find(@builtin(global_invocation_id) id: vec3u) {
    let count = tile_count();
    if id.x >= count.x || id.y >= count.y { return; }
    var total = 0.0;
    for (var level = 0u; level < 4u; level++) {
        var beyond = 0.0;
        var chance = 0.0;
        var free = 0.0;
        for (var i = -1; i <= 1; i++) {
            let y = i32(id.y) + i;
            if y < 0 || y >= i32(count.y) { continue; }
            for (var j = -1; j <= 1; j++) {
                let x = i32(id.x) + j;
                if x < 0 || x >= i32(count.x) { continue; }
                let at = (level * count.y + u32(y)) * count.x + u32(x);
                let share = 1.0 / max(one[at].x, TINY);
                let by_chance = two[at].y - two[at].x * share;
                beyond += one[at].w - one[at].z * one[at].z * share - by_chance;
                chance += by_chance;
                free += one[at].x - one[at].y * share;
            }
        }
        free = max(free, TINY);
        let variance = max(beyond / free, 0.0);
        let noise = max(chance / free, 0.0) * CHANCE;
        total += variance * variance / (variance + noise + TINY);
    }
    error[id.y * count.x + id.x] = total;
}
