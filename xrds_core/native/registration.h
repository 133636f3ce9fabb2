// The offset of the nearest pixel, taken out by the frame itself.
//
// A neighbour's sample is taken from the nearest pixel, whose centre lies up to half a
// pixel (d) beside the true place x. It counts as N + G(x) - G(x + d), where N is the
// sample and G the guess: the frame with the samples of the frames just before and after
// it. Nothing noisy of a neighbour is interpolated, so noise stays uncorrelated from pixel
// to pixel, as denoisers need it; and texture that G knows is not blurred.
//
// Near a pixel's centre G is a polynomial of second degree in d. So a weighted sum over
// neighbours needs only the weighted sums of the powers of d, the moments, and G is looked
// at once for all of them.

enum { REACH = 2 };  // pixels on each side of one that its polynomial needs
// Central differences of fourth order. Those of second order left 0.4 dB of fine checks
// at 64 samples; a cubic spline's cost as much at 16, for they raise noise.
static const float SLOPE[2] = {8.0f / 12, -1.0f / 12};
static const float BEND[3] = {-30.0f / 24, 16.0f / 24, -1.0f / 24};

#define SLOPE_OF(x, i, step) \
    (SLOPE[0] * (x[(i) + (step)] - x[(i) - (step)]) \
     + SLOPE[1] * (x[(i) + 2 * (step)] - x[(i) - 2 * (step)]))
#define BEND_OF(x, i, step) \
    (BEND[0] * x[i] + BEND[1] * (x[(i) + (step)] + x[(i) - (step)]) \
     + BEND[2] * (x[(i) + 2 * (step)] + x[(i) - 2 * (step)]))

static size_t registration_floats(const Block *b) {
    const size_t wide = (size_t)b->width + 2 * REACH, high = (size_t)b->rows + 2 * REACH;
    return 2 * wide * high + 64;
}

// The guess around a block, of one plane; its edges are repeated beyond the picture.
static void read_guess(const Block *b, const half *plane, Row out) {
    const int w = b->target->frame.width, h = b->target->frame.height;
    const int wide = b->width + 2 * REACH;
    EACH(y, b->rows + 2 * REACH) {
        const half *from = plane + (size_t)clamped(b->top + y - REACH, h) * w;
        Row to = out + (size_t)y * wide;
        LANES(i, b->width) to[REACH + i] = from_half(from[b->left + i]);
        EACH(k, REACH) {
            to[k] = from_half(from[clamped(b->left + k - REACH, w)]);
            to[REACH + b->width + k] = from_half(from[clamped(b->left + b->width + k, w)]);
        }
    }
}

// Add to each group's sums of a plane what its neighbours' offsets take away.
static void register_plane(const Block *b, const half *plane, float *sums[GROUPS],
                           float *scratch) {
    const int w = b->width, wide = w + 2 * REACH, high = b->rows + 2 * REACH;
    float *guess = scratch, *slopes = scratch + (size_t)wide * high;
    read_guess(b, plane, guess);
    EACH(y, high) {
        In at = guess + (size_t)y * wide + REACH;
        Row to = slopes + (size_t)y * wide;
        LANES(i, w) to[i] = SLOPE_OF(at, i, 1);
    }
    EACH(y, b->rows) {
        In at = guess + (size_t)(y + REACH) * wide + REACH;
        In slope = slopes + (size_t)(y + REACH) * wide;
        const size_t row = (size_t)y * w;
        Row one = sums[0] + row, two = sums[1] + row;
        float *const *m = b->sums[0].moments, *const *n = b->sums[1].moments;
        LANES(i, w) {
            const float power[MOMENTS] = {slope[i], SLOPE_OF(at, i, wide), BEND_OF(at, i, 1),
                                          SLOPE_OF(slope, i, wide), BEND_OF(at, i, wide)};
            float of_one = 0.0f, of_two = 0.0f;
            EACH(k, MOMENTS) {
                of_one += m[k][row + i] * power[k];
                of_two += n[k][row + i] * power[k];
            }
            // not finite beside pixels without samples
            one[i] -= fabsf(of_one) < INFINITY ? of_one : 0.0f;
            two[i] -= fabsf(of_two) < INFINITY ? of_two : 0.0f;
        }
    }
}

static void take_out_offsets(Block *b, float *scratch) {
    const Target *t = b->target;
    const size_t plane = (size_t)t->frame.width * t->frame.height;
    const half *guess = t->guess;
    Sums *s = b->sums;
    EACH(c, t->channels) {
        register_plane(b, guess, (float *[]){s[0].values[c], s[1].values[c]}, scratch);
        guess += plane;
    }
    EACH(c, 3 * t->parts) {
        register_plane(b, guess, (float *[]){part_plane(b, s, c), part_plane(b, s + 1, c)}, scratch);
        guess += plane;
    }
    if (has_light(t))
        register_plane(b, guess, (float *[]){s[0].brightness, s[1].brightness}, scratch);
}
