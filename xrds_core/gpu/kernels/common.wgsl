// What all kernels share. Planes of a band hold its rows only, those of a frame all.

struct Step {
    size: vec2u,        // width and height of the frame
    band: vec2u,        // its first row, and how many it has
    there_size: vec2u,  // of the neighbour
    coarse: vec2u,      // columns and rows of the tiles of coarse rejection
    flags: u32,
    channels: u32,      // of the picture: 9, or 10 with alpha
    stride: u32,        // pixels between the spots of the lattice of images
    spots: u32,         // of the lattice, in a row
    forth: array<vec4f, 4>,
    back: array<vec4f, 4>,
    turn: array<vec4f, 3>,
    samples: f32,       // of the frame, per pixel
    there_samples: f32,
    fall: f32,          // of the weight, with squared distance
    whole: f32,         // squared distance below which a motion is one of whole pixels
    apart: f32,         // the neighbour's number minus the frame's
    number: u32,        // the neighbour's
    coarse_most: f32,   // largest weight of a tile of coarse rejection
    usual: f32,         // light for albedo, of the whole frame
    guides: f32,        // penalties
    changes: f32,
    area: i32,          // pixels around one over which errors of guides are averaged
    offset: u32,        // of this group in the sums, or in the factors
};

@group(0) @binding(0) var<uniform> step: Step;

const ALIGNED = 1u;
const HERE_HALF = 2u;
const THERE_HALF = 4u;
const HERE_COUNTS = 8u;
const THERE_COUNTS = 16u;
const JITTER = 32u;
const MOVING = 64u;
const BESIDE = 128u;
const IMAGES = 256u;
const TURNED = 512u;
const ORTHOGRAPHIC = 1024u;
const FIRST_GROUP = 2048u;
const DARK = 4096u;

const TINY = 1e-9;
const LUMINANCE = vec3f(0.2126, 0.7152, 0.0722);  // Rec.709

fn has(flag: u32) -> bool {
    return (step.flags & flag) != 0u;
}

// Kernels run for every pixel of a band, in groups of 8 x 8.
fn is_inside(at: vec3u) -> bool {
    return at.x < step.size.x && at.y < step.band.y;
}

fn in_band(x: i32, y: i32) -> bool {
    return x >= 0 && y >= 0 && x < i32(step.size.x) && y < i32(step.band.y);
}

fn root_of_luminance(light: vec3f) -> f32 {
    return sqrt(max(dot(light, LUMINANCE), 0.0));
}

// An error, reduced where it could be noise.
fn discounted(error: f32, unsure: f32) -> f32 {
    let positive = max(error, 0.0);
    return positive * positive / (positive + unsure + TINY);
}
