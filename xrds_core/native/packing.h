// Frames are packed: passes become one picture of half floats, and its noise is told.

INLINE int is_finite(float x) { return fabsf(x) < INFINITY; }

// The nearest half that is finite; 0 for NaN.
INLINE half finite_half(float x) {
    return to_half(x == x ? limited_half(x) : 0.0f);
}

INLINE const float *channel_of(const Pass *p, int y, int c) {
    return p->first + y * p->row + c * p->channel;
}

static void mark_invalid(const Packing *p, int y, uint8_t *restrict invalid) {
    memset(invalid, 0, p->width);
    EACH(k, p->count) EACH(c, p->passes[k].channels) {
        const float *from = channel_of(p->passes + k, y, c);
        const int64_t step = p->passes[k].column;
        LANES(i, p->width) invalid[i] |= !is_finite(from[i * step]);
    }
}

static void pack_row(const Packing *p, int y, const uint8_t *invalid) {
    int channels = 0, first = 0;
    EACH(k, p->count) channels += p->passes[k].channels;
    half *restrict to = p->picture + (size_t)y * p->width * channels;
    EACH(k, p->count) EACH(c, p->passes[k].channels) {
        const float *from = channel_of(p->passes + k, y, c);
        const int64_t step = p->passes[k].column;
        LANES(i, p->width)
            to[i * channels + first] = finite_half(invalid[i] ? 0.0f : from[i * step]);
        first++;
    }
}

// Brightness and the halves' difference: half of it for equal halves, the standard
// deviation of their mean.
static void pack_noise(const Packing *p, int y, const uint8_t *invalid) {
    const Pass *one = p->halves, *two = p->halves + 1;
    const float *a = channel_of(one, y, 0), *b = channel_of(two, y, 0);
    const int64_t ac = one->channel, bc = two->channel, as = one->column, bs = two->column;
    const float *shares = p->shares ? p->shares + (size_t)y * p->width : NULL;
    half *restrict to = p->noise + 2 * (size_t)y * p->width;
    LANES(i, p->width) {
        const float share = shares ? shares[i] : p->share;
        const float *s = a + i * as, *t = b + i * bs;
        const float r = root_of_luminance(s[0], s[ac], s[2 * ac]);
        const float q = root_of_luminance(t[0], t[bc], t[2 * bc]);
        const float spread = sqrtf(share * (1.0f - share));
        to[2 * i] = finite_half(invalid[i] ? 0.0f : (r + q) / 2);
        to[2 * i + 1] = finite_half(invalid[i] ? 0.0f : (r - q) * spread);
    }
}

// Without halves noise is how far a pixel is from those around it, with albedo's texture
// divided out where that leaves less: light divided by albedo is smooth in most places.
enum { LIT = 5, AROUND_NOISE = 5 };  // pixels across; pixels on each side that count

static void pack_noise_around(const Packing *p, int top, int bottom, float *scratch) {
    const int w = p->width, first = whole_at_least(top - AROUND_NOISE, 0);
    const int rows = whole_at_most(bottom + AROUND_NOISE, p->height) - first;
    const size_t n = (size_t)rows * w;
    float *planes[6];
    EACH(k, 6) planes[k] = scratch + k * (n + 16);
    Row root = planes[0], texture = planes[1], even = planes[2], plain = planes[3];
    float *part = planes[4], *other = planes[5], *wide = scratch + 6 * (n + 16);
    EACH(y, rows) {
        const float *light[3], *albedo[3];
        EACH(c, 3) light[c] = channel_of(p->passes, first + y, c);
        EACH(c, 3) albedo[c] = channel_of(p->passes + 1, first + y, c);
        const int64_t s = p->passes[0].column, t = p->passes[1].column;
        Row to = root + (size_t)y * w, of = texture + (size_t)y * w;
        LANES(i, w) {
            const float one = root_of_luminance(light[0][i * s], light[1][i * s], light[2][i * s]);
            const float two =
                root_of_luminance(albedo[0][i * t], albedo[1][i * t], albedo[2][i * t]);
            const int known = is_finite(one) & is_finite(two);  // means would spread the rest
            to[i] = known ? one : 0.0f, of[i] = known ? two : 0.0f;
        }
    }
    box(even, root, part, wide, rows, w, LIT);
    box(plain, texture, part, wide, rows, w, LIT);
    LANES(i, n) other[i] = root[i] - even[i] / (plain[i] + DARKEST_ROOT) * texture[i];
    box(even, other, part, wide, rows, w, 3);
    LANES(i, n) even[i] = other[i] - even[i];
    box(plain, root, part, wide, rows, w, 3);
    LANES(i, n) plain[i] = root[i] - plain[i];
    LANES(i, n) other[i] = plain[i] * plain[i];
    box(texture, other, part, wide, rows, w, LIT);
    LANES(i, n) other[i] = even[i] * even[i];
    float *squares = scratch + 6 * (n + 16) + w + 64;
    box(squares, other, part, wide, rows, w, LIT);
    const size_t start = (size_t)top * w, off = (size_t)(top - first) * w;
    half *restrict to = p->noise + 2 * start;
    const uint8_t *invalid = p->invalid + start, *signs = p->signs + start;
    LANES(i, (size_t)(bottom - top) * w) {
        const float apart = (texture[off + i] < squares[off + i] ? plain[off + i] : even[off + i])
                            * p->light_factor;
        to[2 * i] = finite_half(invalid[i] ? 0.0f : root[off + i]);
        to[2 * i + 1] = finite_half(invalid[i] ? 0.0f : signs[i] ? apart : -apart);
    }
}

static size_t packing_floats(const Packing *p, int rows) {
    const size_t planes = MOST_CHANNELS + 1;
    return ((size_t)(rows + 2 * AROUND_NOISE) * p->width + 64) * planes + p->width + 128;
}

// The noise of guides of some rows; `scratch` holds `packing_floats`.
static void pack_guide_noise(const Packing *p, int top, int bottom, float *scratch) {
    const int w = p->width, first = whole_at_least(top - 1, 0);
    const int rows = whole_at_most(bottom + 1, p->height) - first;
    float *planes[MOST_CHANNELS];
    int count = 0;
    for (int k = p->has_light; k < p->count; k++) EACH(c, p->passes[k].channels) {
        const float scale = k == p->has_light + 1 ? NORMAL_SHARE : 1.0f;
        float *plane = planes[count++] = scratch;
        EACH(y, rows) {
            const float *from = channel_of(p->passes + k, first + y, c);
            const int64_t step = p->passes[k].column;
            Row to = plane + (size_t)y * w;
            LANES(i, w) to[i] = limited(from[i * step] * scale);
        }
        scratch += (size_t)rows * w + 16;
    }
    noise_of_guides(scratch, planes, count, p->guide_factor, rows, w, top - first,
                    bottom - first);
    half *restrict to = p->guide_noise + (size_t)top * w;
    const uint8_t *invalid = p->invalid + (size_t)top * w;
    LANES(i, (size_t)(bottom - top) * w) to[i] = finite_half(invalid[i] ? 0.0f : scratch[i]);
}
