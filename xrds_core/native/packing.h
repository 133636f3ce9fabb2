// Frames are packed: passes become one picture of half floats, and its noise is told.

INLINE int is_finite(float x) { return fabsf(x) < INFINITY; }

// The nearest half that is finite; 0 for NaN.
INLINE half finite_half(float x) {
    return to_half(x == x ? at_most(at_least(x, -LARGEST_HALF), LARGEST_HALF) : 0.0f);
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

static size_t packing_floats(const Packing *p, int rows) {
    return ((size_t)(rows + 2) * p->width + 64) * (MOST_CHANNELS + 1);
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
