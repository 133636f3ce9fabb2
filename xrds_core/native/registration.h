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
//
// Beside a lamp a thousand times as bright as the sky no polynomial fits: it left dark rims.
// So a maximum principle holds, as for limiters of transport: neither the guess at the
// pixels taken nor what becomes of their samples leaves the range of the guess in 3 x 3
// pixels. What was outside before may stay there.

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

typedef struct {
    float *guess, *slopes;     // of the block and REACH more on each side
    float *change[GROUPS], *least, *most, *low, *high;  // of a row
    float *shares[3][GROUPS];  // of a change of radiance that counts
} Offsets;

static Offsets lay_out_offsets(const Block *b, char **next) {
    const size_t wide = (size_t)b->width + 2 * REACH, high = (size_t)b->rows + 2 * REACH;
    Offsets o = {.guess = take_floats(next, wide * high),
                 .slopes = take_floats(next, wide * high)};
    float **rows[] = {&o.change[0], &o.change[1], &o.least, &o.most, &o.low, &o.high};
    EACH(k, 6) *rows[k] = take_floats(next, wide);
    if (b->target->parts)
        EACH(c, 3) EACH(g, GROUPS) o.shares[c][g] = take_floats(next, b->count);
    return o;
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

INLINE float within(float x, float least, float most) {
    return at_most(at_least(x, least), most);
}

// The least and the largest of 3 x 3 pixels around each of a row.
static void range_of(In at, const Offsets *o, int w, int wide) {
    Row least = o->least, most = o->most, low = o->low, high = o->high;
    LANES(i, w + 2) {
        const float up = at[i - 1 - wide], here = at[i - 1], down = at[i - 1 + wide];
        low[i] = at_most(at_most(up, down), here);
        high[i] = at_least(at_least(up, down), here);
    }
    LANES(i, w) {
        least[i] = at_most(at_most(low[i], low[i + 2]), low[i + 1]);
        most[i] = at_least(at_least(high[i], high[i + 2]), high[i + 1]);
    }
}

// What offsets put into the sums of a row, by group; `at` and `slope` are of the guess.
static void changes_of(const Block *b, float *const change[GROUPS], In at, In slope,
                       size_t row, int wide) {
    Row one = change[0], two = change[1];
    float *const *m = b->sums[0].moments, *const *n = b->sums[1].moments;
    LANES(i, b->width) {
        const float power[MOMENTS] = {slope[i], SLOPE_OF(at, i, wide), BEND_OF(at, i, 1),
                                      SLOPE_OF(slope, i, wide), BEND_OF(at, i, wide)};
        float of_one = 0.0f, of_two = 0.0f;
        EACH(k, MOMENTS) {
            of_one += m[k][row + i] * power[k];
            of_two += n[k][row + i] * power[k];
        }
        one[i] = of_one, two[i] = of_two;
    }
}

// Take a row's changes out of its sums of samples with `weight`, as far as the range allows;
// `shares`, if any, become what counted of them.
static void take_within_range(Row sums, In change, In weight, In here, const Offsets *o,
                              float *shares, int w) {
    In least = o->least, most = o->most;
    LANES(i, w) {
        const float low = least[i] * weight[i], high = most[i] * weight[i];
        const float own = here[i] * weight[i], sum = sums[i];
        const float found = sum - within(change[i], low - own, high - own);
        const float kept = within(found, at_most(sum, low), at_least(sum, high));
        // not finite beside pixels without samples
        sums[i] = fabsf(change[i]) < INFINITY ? kept : sum;
        if (shares) {
            const float share = within((sum - kept) / change[i], 0.0f, 1.0f);
            shares[i] = kept == sum - change[i] ? 1.0f : share;
        }
    }
}

static void take_shares(Row sums, In change, In shares, int w) {
    LANES(i, w) {
        const float x = shares[i] * change[i];
        sums[i] -= fabsf(x) < INFINITY ? x : 0.0f;
    }
}

// Take out of each group's sums of a plane what its neighbours' offsets put in. Parts of
// the light take out the `shares` that counted of the whole, so that they still add up.
static void register_plane(const Block *b, const half *plane, float *const sums[GROUPS],
                           float *const *shares, int is_part, const Offsets *o) {
    const int w = b->width, wide = w + 2 * REACH, high = b->rows + 2 * REACH;
    read_guess(b, plane, o->guess);
    EACH(y, high) {
        In at = o->guess + (size_t)y * wide + REACH;
        Row to = o->slopes + (size_t)y * wide;
        LANES(i, w) to[i] = SLOPE_OF(at, i, 1);
    }
    EACH(y, b->rows) {
        In at = o->guess + (size_t)(y + REACH) * wide + REACH;
        In slope = o->slopes + (size_t)(y + REACH) * wide;
        const size_t row = (size_t)y * w;
        if (!is_part) range_of(at, o, w, wide);
        changes_of(b, o->change, at, slope, row, wide);
        EACH(g, GROUPS) {
            Row change = o->change[g], sum = sums[g] + row;
            float *share = shares && shares[g] ? shares[g] + row : NULL;
            if (is_part) take_shares(sum, change, share, w);
            else take_within_range(sum, change, b->sums[g].weights + row, at, o, share, w);
        }
    }
}

static void take_out_offsets(Block *b, char **next) {
    const Target *t = b->target;
    const Offsets o = lay_out_offsets(b, next);
    const size_t plane = (size_t)t->frame.width * t->frame.height;
    const half *guess = t->guess;
    Sums *s = b->sums;
    EACH(c, t->channels) {
        float *const *shares = c < first_guide(t) ? o.shares[c] : NULL;
        register_plane(b, guess, (float *[]){s[0].values[c], s[1].values[c]}, shares, 0, &o);
        guess += plane;
    }
    EACH(c, 3 * t->parts) {
        float *const sums[] = {part_plane(b, s, c), part_plane(b, s + 1, c)};
        register_plane(b, guess, sums, has_light(t) ? o.shares[c % 3] : NULL, has_light(t), &o);
        guess += plane;
    }
    if (has_light(t))
        register_plane(b, guess, (float *[]){s[0].brightness, s[1].brightness}, NULL, 0, &o);
}
