// What Python hands over; the same fields, in the same order, in structures.py. Pictures
// are flat, H W pixels row by row, row 0 on top, as `Stored` has them.
#include <stdint.h>

typedef uint16_t half;  // the bits of a half float

typedef struct {
    const half *picture;         // (H W, channels): radiance (if any), albedo, normal, alpha (if any)
    const half *noise;           // (H W, 2): brightness and difference, or NULL without radiance
    const float *depth;          // (H W): inverse depth, NaN where unknown
    const uint8_t *rims;         // (H W): as `find_rims` writes them, or NULL where nothing moves
    const half *counts;          // (H W): samples of each pixel, or NULL
    const uint8_t *invalid;      // (H W), or NULL
    const half *const *parts;    // each (H W, 3), or NULL where it is dark
    int32_t width, height, number;
    float samples;
} Frame;

// From the pixels of one frame to those of another: (x, y, 1, inverse depth) times a
// matrix, or, of a panorama, directions times a transform.
typedef struct {
    float matrix[16];
    // Of panoramas, else NULL: sine and cosine of the longitude of each column and of the
    // latitude of each row, here; then longitude and latitude of pixel (0, 0) of the
    // whole frame there, pixels per radian, and the window's first pixel.
    const float *columns, *rows;
    float left, top, across, down, window_x, window_y;
} Reprojection;

// Places of some pixels, ascending, that replace those of the surface.
typedef struct {
    const int64_t *pixels;
    const float *x, *y;          // in the neighbour
    int64_t count;
} Places;

typedef struct {
    Frame frame;
    Reprojection forth, back;
    float turn[9];               // its normals in the axes of the target
    int32_t aligned, jitters, group, tile_rows, tile_columns;
    float whole;                 // squared distance to a centre that counts as whole motion
    float fall;                  // times a squared distance: the logarithm of a weight
    float most;                  // the largest weight of its tiles
    const float *tiles;          // weights by coarse rejection, or NULL where all are 1
    const uint8_t *moving;       // (H W) of the neighbour, or NULL
    const uint8_t *beside;       // (H W) of the target, or NULL
    Places moved, images;
} Neighbour;

typedef struct {
    Frame frame;
    const half *guide_noise;     // (H W): standard deviation, or NULL without radiance
    const float *least, *most;   // (H W): range of inverse depth around, as `find_ranges`
    int32_t channels, parts, neighbours, guide_area;
    float usual, guide_penalty, change_penalty;
    const Neighbour *all;
    const half *guess;           // planes as `guess_out`, or NULL: offsets stay
    half *guess_out;             // (channels + 3 parts + 1, H, W), in place of the means
    float *means;                // planes: (H W, 3) each, the last of an alpha (H W)
    float *part_means;           // planes (H W, 3)
    float *samples;              // (H W)
} Target;

// A pass as a renderer or a file has it: floats, so many of them from row to row, from
// pixel to pixel and from channel to channel.
typedef struct {
    const float *first;
    int64_t row, column, channel;
    int32_t channels;
} Pass;

// A frame to pack: `passes` are radiance (if any), albedo, normal and alpha (if any).
typedef struct {
    Pass passes[4];
    Pass halves[2];              // radiance of both half buffers; first is NULL without any
    const float *shares;         // (H W): of the first half's samples, or NULL
    const uint8_t *signs;        // (H W): of noise, 0 or 1; or NULL: noise is of halves
    float share;                 // where there are no `shares`
    float light_factor;          // of the noise of light, without halves
    float guide_factor;          // of the noise of guides, for the number of samples
    int32_t count, width, height, has_light;
    half *picture;               // (H W, channels)
    uint8_t *invalid;            // (H W)
    half *noise, *guide_noise;   // as in a Frame, or NULL
} Packing;

// Rows and columns of a picture, the last ones excluded. The first ones are even.
typedef struct { int32_t top, bottom, left, right; } Area;
