// Means over squares and extremes over neighbourhoods, of planes.

static void row_sums(Row out, In x, Row wide, int w, int size) {
    const int r = size / 2;
    memset(wide, 0, r * sizeof(float));
    memcpy(wide + r, x, w * sizeof(float));
    memset(wide + r + w, 0, r * sizeof(float));
    LANES(i, w) out[i] = wide[i];
    for (int k = 1; k < size; k++) LANES(i, w) out[i] += wide[i + k];
}

// The mean over `size` x `size` pixels, as far as they are in the plane (h, w). `part` is
// another plane, `wide` a row with `size` more.
static void box(Row out, In x, Row part, Row wide, int h, int w, int size) {
    const int r = size / 2;
    EACH(y, h) row_sums(part + (size_t)y * w, x + (size_t)y * w, wide, w, size);
    EACH(y, h) {
        const int first = whole_at_least(y - r, 0), last = whole_at_most(y + r, h - 1);
        Row to = out + (size_t)y * w;
        memcpy(to, part + (size_t)first * w, w * sizeof(float));
        for (int k = first + 1; k <= last; k++) {
            In from = part + (size_t)k * w;
            LANES(i, w) to[i] += from[i];
        }
        const float share = 1.0f / (last - first + 1);
        LANES(i, w) {
            const int left = i < r ? i : r, right = w - 1 - i < r ? w - 1 - i : r;
            to[i] *= share / (left + right + 1);
        }
    }
}

// NaN is ignored.
INLINE float less_of(float a, float b) { return a < b || b != b ? a : b; }
INLINE float more_of(float a, float b) { return a > b || b != b ? a : b; }

// The smallest of a pixel's second differences, in four directions.
INLINE float least_difference(const float *up, const float *at, const float *down,
                                     int64_t left, int64_t i, int64_t right) {
    const float x = at[i];
    const float level = fabsf(x - 0.5f * at[right] - 0.5f * at[left]);
    const float upright = fabsf(x - 0.5f * down[i] - 0.5f * up[i]);
    const float falling = fabsf(x - 0.5f * down[right] - 0.5f * up[left]);
    const float rising = fabsf(x - 0.5f * down[left] - 0.5f * up[right]);
    return at_most(at_most(level, upright), at_most(falling, rising));
}

// The standard deviation of the noise in guides, of the rows `first` to `last` of planes
// (h, w): their smallest differences, added up over `count` planes.
static void noise_of_guides(Row out, float *const *guides, int count, float factor, int h,
                            int w, int first, int last) {
    const size_t n = (size_t)(last - first) * w;
    memset(out, 0, n * sizeof(float));
    EACH(c, count) for (int y = first; y < last; y++) {
        const float *at = guides[c] + (size_t)y * w;
        const float *up = y ? at - w : at, *down = y < h - 1 ? at + w : at;
        Row to = out + (size_t)(y - first) * w;
        LANES(k, w - 2) {
            const float least = least_difference(up, at, down, k, k + 1, k + 2);
            to[k + 1] += least * least;
        }
        EACH(k, w > 1 ? 2 : 1) {
            const int i = k ? w - 1 : 0;
            const float least =
                least_difference(up, at, down, clamped(i - 1, w), i, clamped(i + 1, w));
            to[i] += least * least;
        }
    }
    LANES(i, n) out[i] = sqrtf(out[i] * (2.0f / 3.0f)) * factor;
}
