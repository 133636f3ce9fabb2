// A first look at a neighbour, at some pixels of the frame: see `accumulation/coarse_rejection.py`.

// Where the pixels `step` apart were, as if only the camera moved, whether they show the
// same there, and whether they are in the neighbour at all.
INLINE void find_spots_of(const Target *t, const Neighbour *o, int step, int32_t *pixel,
                          uint8_t *seen, uint8_t *in_frame, float *scratch,
                          const int panorama) {
    const int wide = o->frame.width, high = o->frame.height, left = step / 2;
    const int count = (t->frame.width - left + step - 1) / step;
    for (int y = left; y < t->frame.height; y += step) {
        const Found f = {.x = scratch, .y = scratch + count, .apart = scratch + 2 * count,
                         .at_x = scratch + 3 * count, .at_y = scratch + 4 * count,
                         .column = (int32_t *)(scratch + 5 * count),
                         .row = (int32_t *)(scratch + 6 * count), .pixel = pixel};
        places_of(t, o, left, y, count, step, &f, panorama);
        LANES(i, count) {
            const float there_x = f.at_x[i], there_y = f.at_y[i];
            in_frame[i] = (there_x >= 0.0f) & (there_x < wide) & (there_y >= 0.0f)
                          & (there_y < high);
            seen[i] = pixel[i] >= 0;
            pixel[i] = f.row[i] * wide + f.column[i];
        }
        pixel += count, seen += count, in_frame += count;
    }
}

// The square root of luminance. Between frames of different sample counts the root would
// be biased, for less noise has a larger mean root: luminance then.
static float light_of(const Frame *f, int channels, size_t pixel, int root) {
    const half *from = f->picture + pixel * channels;
    const float r = root_of_luminance(from_half(from[0]), from_half(from[1]), from_half(from[2]));
    return root ? r : r * r;
}

static int is_invalid(const Frame *f, size_t pixel) {
    return f->invalid && f->invalid[pixel];
}

// Sum over the pixels of each tile that match: how many, by how much their light differs,
// its square, and their own light. Moving and invalid pixels are left out. `counts`: of
// all pixels, then of those that show a surface, how many are compared and match; then
// how many show a surface.
static void compare_spots_of(const Target *t, const Neighbour *o, int step,
                             const int32_t *pixel, const uint8_t *seen,
                             const uint8_t *in_frame, double *sums, int64_t *counts) {
    const int w = t->frame.width, h = t->frame.height, across = (w + TILE - 1) / TILE;
    const int channels = t->channels, root = t->frame.samples == o->frame.samples;
    const size_t plane = (size_t)across * ((h + TILE - 1) / TILE);
    const Places *moved = &o->moved;
    int64_t next = 0;
    size_t k = 0;
    for (int y = step / 2; y < h; y += step) for (int x = step / 2; x < w; x += step, k++) {
        const int64_t here = (int64_t)y * w + x, there = pixel[k];
        const float depth = t->frame.depth[here];
        const int surface = (depth > 0.0f) | (depth < 0.0f);
        counts[4] += surface;
        while (next < moved->count && moved->pixels[next] < here) next++;
        if (next < moved->count && moved->pixels[next] == here) continue;
        if (o->moving && o->moving[there]) continue;
        if (is_invalid(&t->frame, here) || is_invalid(&o->frame, there)) continue;
        counts[0] += in_frame[k], counts[2] += in_frame[k] & surface;
        if (!seen[k]) continue;
        counts[1]++, counts[3] += surface;
        const float own = light_of(&t->frame, channels, here, root);
        const float differs = light_of(&o->frame, channels, there, root) - own;
        double *tile = sums + (size_t)(y / TILE) * across + x / TILE;
        tile[0] += 1.0, tile[plane] += differs;
        tile[2 * plane] += differs * differs, tile[3 * plane] += own;
    }
}
