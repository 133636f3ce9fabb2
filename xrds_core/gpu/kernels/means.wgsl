// The mean of a frame's own and the reused samples: passes, one after another, then the
// number of samples and how many of them are reused.

@group(0) @binding(2) var<storage, read> counts: array<f32>;
@group(0) @binding(3) var<storage, read> sums: array<f32>;
@group(0) @binding(4) var<storage, read_write> means: array<f32>;

@compute @workgroup_size(8, 8)
fn mean(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let at = id.y * step.size.x + id.x;
    let count = step.size.x * step.band.y;
    let pixel = step.band.x * step.size.x + at;
    let sum = at * (step.channels + 3u);
    var samples = step.samples;
    if has(HERE_COUNTS) { samples = max(counts[pixel], 0.0); }
    let total = samples + sums[sum];
    for (var i = 0u; i < step.channels; i++) {
        let own = channel(pixel * step.channels + i);
        // in this form nothing is rounded where nothing is reused
        let change = (sums[sum + 3u + i] - own * sums[sum]) / max(total, TINY);
        let pass_ = i / 3u;
        let width = min(step.channels - 3u * pass_, 3u);
        means[3u * pass_ * count + at * width + i % 3u] = own + change;
    }
    means[step.channels * count + at] = total;
    means[(step.channels + 1u) * count + at] = sums[sum + 1u];
}
