// The samples of neighbours, added up.

// Two halves of the pixels taken, beginning with channel `c`; the last ones of a pixel
// with an odd number of channels are the second of a pair.
INLINE uint32_t channels_at(const half *from, int64_t pixel, int c, int channels) {
    return pair_at(from + pixel * channels + c);
}

INLINE void add_picture(const Neighbour *o, const Sums *s, size_t row, int w,
                               const Found *f, const int channels) {
    const half *picture = o->frame.picture;
    const int32_t *pixel = f->pixel;
    In weight = f->weight, m = o->turn;
    Row texture = f->at_x;
    const int guide = channels >= 9 ? 3 : 0;
    float *to[MOST_CHANNELS];
    EACH(c, channels) to[c] = s->values[c] + row;
    if (guide) LANES(i, w) {
        const uint32_t p = channels_at(picture, pixel[i], 0, channels);
        const uint32_t q = channels_at(picture, pixel[i], 1, channels);
        to[0][i] += from_half(p & 0xffff) * weight[i];
        to[1][i] += from_half(p >> 16) * weight[i];
        to[2][i] += from_half(q >> 16) * weight[i];
    }
    LANES(i, w) {
        const uint32_t p = channels_at(picture, pixel[i], guide, channels);
        const uint32_t q = channels_at(picture, pixel[i], guide + 1, channels);
        const float v[3] = {from_half(p & 0xffff), from_half(p >> 16), from_half(q >> 16)};
        EACH(k, 3) to[guide + k][i] += v[k] * weight[i];
        texture[i] = root_of_luminance(v[0], v[1], v[2]);
    }
    LANES(i, w) {
        const uint32_t p = channels_at(picture, pixel[i], guide + 3, channels);
        const uint32_t q = channels_at(picture, pixel[i], channels - 2, channels);
        const float v[3] = {from_half(p & 0xffff), from_half(p >> 16),
                            from_half(channels % 3 ? q & 0xffff : q >> 16)};
        EACH(k, 3) to[guide + 3 + k][i] +=
            (m[3 * k] * v[0] + m[3 * k + 1] * v[1] + m[3 * k + 2] * v[2]) * weight[i];
        if (channels % 3) to[channels - 1][i] += from_half(q >> 16) * weight[i];
    }
}

static void add_parts(const Block *b, const Neighbour *o, const Sums *s, size_t row) {
    const Target *t = b->target;
    const Found *f = &b->found;
    const int w = b->width;
    const int32_t *pixel = f->pixel;
    In weight = f->weight;
    EACH(p, t->parts) {
        const half *part = o->frame.parts[p];
        if (!part) continue;
        Row red = part_plane(b, s, 3 * p) + row, green = red + b->stride;
        Row blue = green + b->stride;
        LANES(i, w) {
            const uint32_t one = channels_at(part, pixel[i], 0, 3);
            const uint32_t two = channels_at(part, pixel[i], 1, 3);
            red[i] += from_half(one & 0xffff) * weight[i];
            green[i] += from_half(one >> 16) * weight[i];
            blue[i] += from_half(two >> 16) * weight[i];
        }
    }
}

static void add_moments(const Sums *s, size_t row, int w, const Found *f) {
    In x = f->x, y = f->y, weight = f->weight;
    float *const *m = s->moments;
    LANES(i, w) {
        const float across = x[i] * weight[i], down = y[i] * weight[i];
        m[0][row + i] += across, m[1][row + i] += down;
        m[2][row + i] += x[i] * across, m[3][row + i] += x[i] * down;
        m[4][row + i] += y[i] * down;
    }
}

// Add a neighbour's light of a row to its tiles of 2 x 2 pixels, for what changes.
static void add_light(const Block *b, const Neighbour *o, const Sums *s, int y, float *tiles) {
    const Found *f = &b->found;
    const int w = b->width;
    const size_t row = (size_t)y * w;
    const half *noise = o->frame.noise;
    const int32_t *pixel = f->pixel;
    Row light = f->light, chance = f->chance, bright = s->brightness + row;
    In weight = f->weight, texture = f->at_x;
    In own_light = b->light + row, untextured = b->untextured + row;
    LANES(i, w) {
        const uint32_t both = channels_at(noise, pixel[i], 0, 2);
        const float brightness = from_half(both & 0xffff);
        const float spread = weight[i] * from_half(both >> 16);
        bright[i] += brightness * weight[i];
        // the nearest pixel differs in texture from this one, but not in light
        light[i] = weight[i] * (brightness - own_light[i] * texture[i] - untextured[i]);
        chance[i] = spread * spread;
    }
    const size_t tile = (size_t)(y / 2 + PAD) * (b->tiles_across + 2 * PAD) + PAD;
    const float *summed[3] = {weight, light, chance};
    EACH(k, 3) {
        float *sum = tiles + k * b->plane + tile;
        const float *from = summed[k];
        LANES(i, w / 2) sum[i] += from[2 * i] + from[2 * i + 1];
        if (w % 2) sum[w / 2] += from[w - 1];
    }
}

// Add what row `y` of a block takes of neighbour `k`.
static void add_row(Block *b, int k, int y) {
    const Target *t = b->target;
    const Neighbour *o = t->all + k;
    const Sums *s = b->sums + o->group;
    const Found *f = &b->found;
    const int w = b->width;
    const size_t row = (size_t)y * w;
    find(t, o, b->top + y, b->left, w, f);
    In weight = f->weight, share = f->share;
    Row weights = s->weights + row, reused = s->reused + row;
    LANES(i, w) { weights[i] += weight[i]; reused[i] += share[i]; }
    switch (t->channels) {
        case 6: add_picture(o, s, row, w, f, 6); break;
        case 7: add_picture(o, s, row, w, f, 7); break;
        case 9: add_picture(o, s, row, w, f, 9); break;
        default: add_picture(o, s, row, w, f, 10);
    }
    add_parts(b, o, s, row);
    if (t->guess) add_moments(s, row, w, f);
    if (has_light(t)) add_light(b, o, s, y, b->tiles + 3 * b->plane * k);
}
