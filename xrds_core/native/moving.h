// What moves by itself: where motion vectors are not explained by the camera's motion.

// The motion of a row of pixels as if only the camera moved, with its ends repeated.
INLINE void still_motion(const float *depth, const Reprojection *forth, int w, int row,
                         float *x, float *y, const int panorama) {
    In at = depth + (size_t)row * w;
    Row to_x = x + 1, to_y = y + 1;
    LANES(i, w) {
        const Point p = reproject(forth, (int32_t)i, row, at[i], panorama);
        to_x[i] = p.x - (i + 0.5f), to_y[i] = p.y - (row + 0.5f);
    }
    x[0] = x[1], x[w + 1] = x[w], y[0] = y[1], y[w + 1] = y[w];
}

// How far a motion is from the range of those of 3 x 3 pixels, from pixel `i` of each row.
INLINE float beyond(In up, In at, In down, int64_t i, float told) {
    float low = less_of(less_of(up[i], up[i + 1]), up[i + 2]);
    low = less_of(less_of(low, at[i]), less_of(at[i + 1], at[i + 2]));
    low = less_of(less_of(low, down[i]), less_of(down[i + 1], down[i + 2]));
    float high = more_of(more_of(up[i], up[i + 1]), up[i + 2]);
    high = more_of(more_of(high, at[i]), more_of(at[i + 1], at[i + 2]));
    high = more_of(more_of(high, down[i]), more_of(down[i + 1], down[i + 2]));
    return at_least(told - high, at_least(low - told, 0.0f));
}

// A vector is a mean over the pixel's samples, so it may have any value between the
// camera's motion vectors of the surrounding pixels. `steps` is how many frames later the
// other one is; marked is what is more than `least` pixels off. `scratch`: six rows with
// two pixels more.
INLINE void moving_of(const float *depth, const half *vectors, const Reprojection *forth,
                      int w, int h, int top, int bottom, float steps, float least,
                      uint8_t *out, float *scratch, const int panorama) {
    const size_t wide = (size_t)w + 18;
    const int channel = steps > 0.0f ? 2 : 0;
    for (int y = top; y < bottom; y++) {
        float *x[3], *down[3];
        EACH(k, 3) {
            x[k] = scratch + 2 * k * wide, down[k] = x[k] + wide;
            still_motion(depth, forth, w, clamped(y + k - 1, h), x[k], down[k], panorama);
        }
        In x0 = x[0], x1 = x[1], x2 = x[2], y0 = down[0], y1 = down[1], y2 = down[2];
        const half *vector = vectors + 4 * (size_t)y * w + channel;
        In near = depth + (size_t)y * w;
        uint8_t *restrict to = out + (size_t)y * w;
        LANES(i, w) {
            const float across = beyond(x0, x1, x2, i, -steps * from_half(vector[4 * i]));
            const float along = beyond(y0, y1, y2, i, steps * from_half(vector[4 * i + 1]));
            const int hit = (near[i] > 0.0f) | (near[i] < 0.0f);  // neither sky nor NaN
            to[i] = hit & ((across > least) | (along > least));
        }
    }
}
