// The samples of a neighbour that the pixels of a row take, and their weights.

enum { TILE = 64 };  // pixels across, of coarse rejection
// What remains of an offset's square as distance once it is taken out: what the guess
// does not know of texture.
static const float AS_DISTANCE_REGISTERED = 0.25f;
// Samples of a frame with which half of an offset is taken out beside nearer surfaces.
static const float TRUSTED_AT_RIMS = 8.0f;

static int64_t first_of(const Places *p, int64_t pixel) {
    int64_t low = 0, high = p->count;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (p->pixels[middle] < pixel) low = middle + 1; else high = middle;
    }
    return low;
}

// Put places of their own in a row's; their tiles have the weight `share`, if it is any.
static void put(const Places *p, const Frame *there, int64_t start, int w, const Found *f,
                float share) {
    for (int64_t k = first_of(p, start); k < p->count && p->pixels[k] < start + w; k++) {
        const int i = (int)(p->pixels[k] - start);
        const Place n = nearest(p->x[k], p->y[k], there->width, there->height);
        f->pixel[i] = n.pixel, f->apart[i] = n.apart, f->x[i] = n.x, f->y[i] = n.y;
        if (share >= 0.0f) f->share[i] = share;
    }
}

// The weights of tiles, linear between their centres.
static void tile_shares(const Neighbour *o, int y, int left, int w, float *share) {
    if (!o->tiles) { LANES(i, w) share[i] = 1.0f; return; }
    const int rows = o->tile_rows, columns = o->tile_columns;
    const float down = at_most(at_least((y + 0.5f) / TILE - 0.5f, 0.0f), rows - 1);
    const int one = (int)down, two = one + 1 < rows ? one + 1 : one;
    const float low = down - one;
    const float *up = o->tiles + one * columns, *under = o->tiles + two * columns;
    for (int k = -1; k < columns; k++) {  // between the centres of tiles k and k + 1
        const int before = whole_at_least(k, 0), after = whole_at_most(k + 1, columns - 1);
        const float a = up[before] * (1 - low) + under[before] * low;
        const float c = up[after] * (1 - low) + under[after] * low;
        const int start = k * TILE + TILE / 2 - left;
        const int first = whole_at_least(start, 0), last = whole_at_most(start + TILE, w);
        for (int i = first; i < last; i++) {
            const float far = (left + i + 0.5f) / TILE - 0.5f - k;
            share[i] = a * (1 - far) + c * far;
        }
    }
}

// Offsets that are taken out: less of them beside a nearer surface, where the guess has
// more noise than slope if samples are few; none where a pixel takes nothing.
static void choose_offsets(const Target *t, const Neighbour *o, int64_t start, int w,
                           const Found *f) {
    if (o->aligned) { LANES(i, w) f->x[i] = f->y[i] = 0.0f; return; }
    const float at_rims = t->frame.samples / (t->frame.samples + TRUSTED_AT_RIMS);
    const uint8_t *here = t->frame.rims + start, *there = o->frame.rims;
    LANES(i, w) {
        const int32_t at = f->pixel[i] < 0 ? 0 : f->pixel[i];
        const float share = f->pixel[i] < 0 ? 0.0f : here[i] | there[at] ? at_rims : 1.0f;
        f->x[i] = share > 0.0f ? f->x[i] * share : 0.0f;
        f->y[i] = share > 0.0f ? f->y[i] * share : 0.0f;
    }
}

// Find the pixels that a row takes, `share` samples of each with a `weight`; -1 becomes 0.
static void find(const Target *t, const Neighbour *o, int y, int left, int w, const Found *f) {
    const int64_t start = (int64_t)y * t->frame.width + left;
    int32_t *restrict pixel = f->pixel;
    Row share = f->share, weight = f->weight, apart = f->apart;
    if (o->aligned) {
        LANES(i, w) { pixel[i] = (int32_t)(start + i); apart[i] = 0.0f; share[i] = 1.0f; }
    } else {
        if (o->forth.columns) places_of(t, o, left, y, w, 1, f, 1);
        else places_of(t, o, left, y, w, 1, f, 0);
        tile_shares(o, y, left, w, share);
        if (o->moving) LANES(i, w)
            pixel[i] = pixel[i] >= 0 && o->moving[pixel[i]] ? -1 : pixel[i];
        put(&o->moved, &o->frame, start, w, f, -1.0f);
        put(&o->images, &o->frame, start, w, f, o->most);
    }
    if (o->frame.invalid) LANES(i, w)
        pixel[i] = pixel[i] >= 0 && o->frame.invalid[pixel[i]] ? -1 : pixel[i];
    const float samples = o->frame.samples, fall = o->fall;
    if (o->frame.counts) LANES(i, w)
        share[i] *= pixel[i] >= 0 ? from_half(o->frame.counts[pixel[i]]) : 0.0f;
    else LANES(i, w) share[i] *= pixel[i] >= 0 ? samples : 0.0f;
    if (t->guess) {
        choose_offsets(t, o, start, w, f);
        const float less = 1.0f - AS_DISTANCE_REGISTERED;
        In x = f->x, dy = f->y;
        LANES(i, w) apart[i] -= less * (x[i] * x[i] + dy[i] * dy[i]);
    }
    LANES(i, w) {
        weight[i] = share[i] * exponential(apart[i] * fall);
        pixel[i] = pixel[i] < 0 ? 0 : pixel[i];
    }
}
