// Where pixels of one frame were in another one, as if only the camera moved.
//
// A position is valid if it survives the way back: what the other frame shows there must
// come from this pixel, to within a pixel of motion, and be as near as something in the
// 9 x 9 pixels around it. This rejects occlusions and disocclusions, and leaves edges their
// mixed samples. Selecting samples by what is at the pixel's own centre would select by
// content: edges would lose their antialiasing.
//
// A pixel beside a nearer surface shows some of it. The edge moves with that surface, so
// these pixels do as well, as temporal antialiasing has them do (Yang et al., 2020, see
// docs/method.md), unless samples are so few that what lies behind counts more: it moves
// otherwise.

// Pixels by which forward and backward motion may differ, squared; their difference
// counts as this much distance, squared.
static const float TOLERANCE = 1.0f, AS_DISTANCE = 2.0f;
// Relative difference in inverse depth between adjacent pixels of one surface.
static const float SURFACE = 0.02f;
// Relative excess of inverse depth over the range around a pixel that is allowed.
static const float SLACK = 0.02f;
// The squared parallax between both sides of an edge counts up to this much.
static const float MOST_AT_RIMS = 1.0f;
// Pixels by which the pixel taken is jittered where places lie at pixel centres.
static const float OFF = 0.6f;
// Multiples of these spread evenly over a unit square (M. Roberts, R3 and R2 sequences);
// as fractions of 2^32, so that no rounding depends on the processor.
static const uint32_t SPREAD[2][3] = {{3518319155u, 2882110345u, 2360945575u},
                                      {3242174889u, 2447445414u, 2654435769u}};

typedef struct { float x, y, depth; } Point;

// Behind the camera it is NaN.
INLINE Point by_matrix(const float *m, int32_t column, int32_t row, float depth) {
    const float x = column + 0.5f, y = row + 0.5f;
    const float w = m[8] * x + m[9] * y + m[11] * depth + m[10];
    const float over = w > 0.0f ? w : NAN;
    return (Point){(m[0] * x + m[1] * y + m[3] * depth + m[2]) / over,
                   (m[4] * x + m[5] * y + m[7] * depth + m[6]) / over,
                   (m[12] * x + m[13] * y + m[15] * depth + m[14]) / over};
}

INLINE Point by_directions(const Reprojection *r, int32_t column, int32_t row,
                                  float depth) {
    const float *longitude = r->columns + 2 * column, *latitude = r->rows + 2 * row;
    const float *m = r->matrix, level = latitude[1];
    const float x = level * longitude[0], y = latitude[0], z = -level * longitude[1];
    const float sx = m[0] * x + m[1] * y + m[2] * z + m[3] * depth;
    const float sy = m[4] * x + m[5] * y + m[6] * z + m[7] * depth;
    const float sz = m[8] * x + m[9] * y + m[10] * z + m[11] * depth;
    const float flat = sx * sx + sz * sz, length = sqrtf(flat + sy * sy);
    float turned = arc_tangent(sx, -sz) - r->left;
    turned = turned < 0.0f ? turned + 2 * PI : turned;
    turned = turned >= 2 * PI ? turned - 2 * PI : turned;
    return (Point){turned * r->across - r->window_x,
                   (r->top - arc_tangent(sy, sqrtf(flat))) * r->down - r->window_y,
                   depth / length};
}

INLINE Point reproject(const Reprojection *r, int32_t column, int32_t row,
                              float depth, const int panorama) {
    return panorama ? by_directions(r, column, row, depth)
                    : by_matrix(r->matrix, column, row, depth);
}

// The nearest pixel, -1 outside of the frame; from the position to its centre.
typedef struct { int32_t pixel, column, row; float x, y, apart; } Place;

INLINE Place nearest(float x, float y, int width, int height) {
    const int seen = (x >= 0.0f) & (x < width) & (y >= 0.0f) & (y < height);
    const float sx = seen ? x : 0.5f, sy = seen ? y : 0.5f;
    const int32_t column = (int32_t)sx, row = (int32_t)sy;
    const float off_x = column + 0.5f - sx, off_y = row + 0.5f - sy;
    return (Place){seen ? row * width + column : -1, column, row, off_x, off_y,
                   off_x * off_x + off_y * off_y};
}

// ---- rims: pixels next to a nearer surface, some of whose light they contain ----

// 0, or 1 + which of the 3 x 3 pixels around has the nearest surface; of the rows `top`
// to `bottom` of (h, w).
static void rims_of(const float *depth, uint8_t *out, int w, int h, int top, int bottom,
                    int nearer_is_less) {
    const float sign = nearer_is_less ? -1.0f : 1.0f;
    for (int y = top; y < bottom; y++) {
        const float *at = depth + (size_t)y * w;
        const float *rows[3] = {y ? at - w : at, at, y < h - 1 ? at + w : at};
        uint8_t *restrict to = out + (size_t)y * w;
        LANES(i, w) {
            const int64_t columns[3] = {i ? i - 1 : 0, i, i < w - 1 ? i + 1 : i};
            float found = NAN;
            int which = 0;
            EACH(k, 9) {
                const float x = sign * rows[k / 3][columns[k % 3]];
                const int better = (x > found) | ((found != found) & (x == x));
                found = better ? x : found, which = better ? k + 1 : which;
            }
            to[i] = fabsf(sign * found - at[i]) > SURFACE * fabsf(at[i]) ? which : 0;
        }
    }
}

// The range of depth (inverse, but for orthographic cameras) in the 9 x 9 pixels around,
// with some slack, of the rows `top` to `bottom`. Less than 9 x 9 cost 1.4 dB on a house
// with fine rails: for objects thinner than a pixel, hits and misses must not decide which
// samples are reused. `scratch`: two rows with 8 pixels more.
static void ranges_of(const float *depth, float *least, float *most, int w, int h, int top,
                      int bottom, float *scratch) {
    enum { AROUND = 4 };
    float *low = scratch, *high = scratch + w + 2 * AROUND;
    for (int y = top; y < bottom; y++) {
        Row to_low = low + AROUND, to_high = high + AROUND;
        memcpy(to_low, depth + (size_t)y * w, w * sizeof(float));
        memcpy(to_high, to_low, w * sizeof(float));
        for (int k = whole_at_least(y - AROUND, 0); k <= whole_at_most(y + AROUND, h - 1); k++) {
            In from = depth + (size_t)k * w;
            LANES(i, w) {
                to_low[i] = less_of(to_low[i], from[i]);
                to_high[i] = more_of(to_high[i], from[i]);
            }
        }
        EACH(k, AROUND) {
            low[k] = to_low[0], high[k] = to_high[0];
            to_low[w + k] = to_low[w - 1], to_high[w + k] = to_high[w - 1];
        }
        Row out_low = least + (size_t)y * w, out_high = most + (size_t)y * w;
        LANES(i, w) {
            float a = low[i], b = high[i];
            for (int k = 1; k <= 2 * AROUND; k++) {
                a = less_of(a, low[i + k]);
                b = more_of(b, high[i + k]);
            }
            out_low[i] = a * (1.0f - SLACK), out_high[i] = b * (1.0f + SLACK);
        }
    }
}

// The depth of the nearest surface around a pixel, if that is nearer than its own.
INLINE float nearer_depth(const Frame *f, int32_t column, int32_t row) {
    const int32_t rim = f->rims[row * f->width + column], k = rim ? rim - 1 : 4;
    const int32_t beside = clamped(row + k / 3 - 1, f->height) * f->width
                           + clamped(column + k % 3 - 1, f->width);
    return f->depth[beside];
}

// The depth that a pixel moves by, or that of its edge's other side.
INLINE float side_depth(const Frame *f, int32_t column, int32_t row, int nearer) {
    return nearer ? nearer_depth(f, column, row) : f->depth[row * f->width + column];
}

// The squared parallax between a pixel's place and that of its edge's other side.
INLINE float parallax(const Reprojection *r, const Frame *f, int32_t column, int32_t row,
                      float at_x, float at_y, int leads, const int panorama) {
    const float depth = side_depth(f, column, row, !leads);
    const Point p = reproject(r, column, row, depth, panorama);
    const float dx = p.x - at_x, dy = p.y - at_y, square = dx * dx + dy * dy;
    const float most = square < MOST_AT_RIMS ? square : MOST_AT_RIMS;  // NaN: behind
    return most * (f->rims[row * f->width + column] != 0);
}

// ---- places of a row of pixels, `step` apart ----

// `pixel` is that of the neighbour, or -1; `x` and `y` lead from the position to its
// centre; `apart` is the square of that distance and of what else is unsure.
typedef struct {
    float *x, *y, *apart, *weight, *share, *light, *chance, *at_x, *at_y;
    int32_t *pixel, *column, *row;
} Found;

INLINE void jitter(const Neighbour *o, int left, int row, int count, int step,
                          const Found *f) {
    const uint32_t number = o->frame.number;
    const uint32_t down = row * SPREAD[0][1] + number * SPREAD[0][2];
    const uint32_t down_y = row * SPREAD[1][1] + number * SPREAD[1][2];
    const int wide = o->frame.width, high = o->frame.height;
    const float whole = o->whole;
    LANES(i, count) {
        const uint32_t column = (uint32_t)(left + i * step);
        const uint32_t x = column * SPREAD[0][0] + down, y = column * SPREAD[1][0] + down_y;
        const float ox = 2 * OFF * ((int32_t)(x >> 8) * 0x1p-24f - 0.5f);
        const float oy = 2 * OFF * ((int32_t)(y >> 8) * 0x1p-24f - 0.5f);
        const Place n = nearest(f->at_x[i] + ox, f->at_y[i] + oy, wide, high);
        const int jitters = (f->pixel[i] >= 0) & (f->apart[i] < whole) & (n.pixel >= 0);
        f->pixel[i] = jitters ? n.pixel : f->pixel[i];
        f->column[i] = jitters ? n.column : f->column[i];
        f->row[i] = jitters ? n.row : f->row[i];
        f->x[i] = jitters ? n.x + ox : f->x[i];
        f->y[i] = jitters ? n.y + oy : f->y[i];
    }
}

INLINE void places_of(const Target *t, const Neighbour *o, int left, int row,
                             int count, const int step, const Found *f,
                             const int panorama) {
    const int wide = o->frame.width, high = o->frame.height;
    const size_t start = (size_t)row * t->frame.width + left;
    In least = t->least + start, most = t->most + start;
    const int leads = t->leads;
    Row x = f->x, y = f->y, apart = f->apart, at_x = f->at_x, at_y = f->at_y;
    int32_t *restrict pixel = f->pixel, *restrict columns = f->column, *restrict rows = f->row;
    LANES(i, count) {
        const int32_t column = left + (int32_t)i * step;
        const float depth = side_depth(&t->frame, column, row, leads);
        const Point p = reproject(&o->forth, column, row, depth, panorama);
        const Place n = nearest(p.x, p.y, wide, high);
        at_x[i] = p.x, at_y[i] = p.y, x[i] = n.x, y[i] = n.y;
        pixel[i] = n.pixel, apart[i] = n.apart;
        columns[i] = n.column, rows[i] = n.row;
    }
    if (o->jitters) jitter(o, left, row, count, step, f);
    LANES(i, count) {
        const int32_t column = left + (int32_t)i * step, at = pixel[i] < 0 ? 0 : pixel[i];
        const int32_t across = columns[i], down = rows[i];
        const float depth = side_depth(&o->frame, across, down, leads);
        const Point p = reproject(&o->back, across, down, depth, panorama);
        const float dx = p.x + (at_x[i] - (column + 0.5f) - (across + 0.5f));
        const float dy = p.y + (at_y[i] - (row + 0.5f) - (down + 0.5f));
        const float differs = dx * dx + dy * dy;
        const int seen = (pixel[i] >= 0) & (differs < TOLERANCE)
                         & (p.depth >= least[i * step]) & (p.depth <= most[i * step]);
        const float one = parallax(&o->forth, &t->frame, column, row, at_x[i], at_y[i], leads,
                                   panorama);
        const float two = parallax(&o->back, &o->frame, across, down, p.x, p.y, leads, panorama);
        pixel[i] = seen ? at : -1;
        apart[i] = seen ? apart[i] + AS_DISTANCE * differs
                              + o->at_rims * at_least(one, two)
                        : 0.0f;
    }
}
