// The frame's own picture, for kernels that read no other one.

@group(0) @binding(1) var<storage, read> picture: array<u32>;

fn channel(at: u32) -> f32 {
    if !has(HERE_HALF) { return bitcast<f32>(picture[at]); }
    return unpack2x16float(picture[at >> 1u])[at & 1u];
}
