// What the similarity weights need to know of the frame itself, as in similarity.py.

@group(0) @binding(2) var<storage, read> noise: array<u32>;
@group(0) @binding(3) var<storage, read> noise_of_guides: array<f32>;
@group(0) @binding(4) var<storage, read_write> plain: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> bounds: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> light: array<vec2f>;

const BRIGHTEST = 4.0;
const UNSURE = 6.0;
const EVEN_NOISE = 0.1;
const DARKEST_ALBEDO = 0.02;
const DARKEST_ROOT = 0.1;
const NOISE_AREA = 3;  // pixels to each side

fn noise_at(pixel: u32) -> vec2f {
    if has(HERE_HALF) { return unpack2x16float(noise[pixel]); }
    return vec2f(bitcast<f32>(noise[2u * pixel]), bitcast<f32>(noise[2u * pixel + 1u]));
}

// Root of albedo's luminance, albedo's square, brightness and its noise, by pixel.
@compute @workgroup_size(8, 8)
fn unpack(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let pixel = (step.band.x + id.y) * step.size.x + id.x;
    let start = pixel * step.channels;
    let albedo = vec3f(channel(start + 3u), channel(start + 4u), channel(start + 5u));
    let guide = clamp(albedo, vec3f(-BRIGHTEST), vec3f(BRIGHTEST));
    plain[id.y * step.size.x + id.x] =
        vec4f(root_of_luminance(albedo), dot(guide, guide), noise_at(pixel));
}

// How much error is harmless, the variance of light, what chance makes of it, and the
// light for albedo; light and what of it is no texture.
@compute @workgroup_size(8, 8)
fn prepare(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) { return; }
    let wide = max(step.area, NOISE_AREA);
    var unsure = 0.0;
    var unsure_count = 0.0;
    var difference = 0.0;
    var even = 0.0;
    var near = vec4f(0.0);
    var near_count = 0.0;
    for (var i = -wide; i <= wide; i++) {
        for (var j = -wide; j <= wide; j++) {
            let x = i32(id.x) + j;
            let y = i32(id.y) + i;
            if !in_band(x, y) { continue; }
            let at = y * i32(step.size.x) + x;
            let guides = noise_of_guides[at + i32(step.band.x * step.size.x)];
            unsure += guides * guides;
            unsure_count += 1.0;
            if max(abs(i), abs(j)) > NOISE_AREA { continue; }
            difference += plain[at].w * plain[at].w;
            even += plain[at].x * plain[at].x + EVEN_NOISE;
            if max(abs(i), abs(j)) > 1 { continue; }
            near += plain[at];
            near_count += 1.0;
        }
    }
    let at = id.y * step.size.x + id.x;
    let texture = plain[at].x;
    let mean = near / near_count;
    let variance = difference / even * (texture * texture + EVEN_NOISE) + TINY;
    let bright = mean.z * mean.z / 4.0;
    let for_albedo = (bright + DARKEST_ALBEDO * step.usual) / (mean.y + DARKEST_ALBEDO);
    bounds[at] = vec4f(UNSURE * unsure / unsure_count, variance, mean.w * mean.w, for_albedo);
    let lit = mean.z / (mean.x + DARKEST_ROOT);
    light[at] = vec2f(lit, plain[at].z - lit * texture);
}
