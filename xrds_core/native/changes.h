// Light that changes from frame to frame. The noise of one frame hides that a shadow has
// moved. All its neighbours together have many times its samples. Where they vary by more
// than their noise, the frame itself is as far from their mean. Light is compared by tiles
// of 2 x 2 pixels, over areas of 1, 2, 4 and 8 of them.

// Weight of noise against the variance beyond it. The variance of nine frames is off by
// a third, which must not cost the samples they add; real changes are many times the
// noise of an area.
static const float CHANCE = 10.0f;

// Sums over tiles `step` apart, beginning `before`; in place of size, twice the size.
static void pool(float *x, Row part, const Block *b, int before, int step) {
    const int across = b->tiles_across + 2 * PAD, down = b->tiles_down + 2 * PAD;
    const int after = step - before;
    EACH(y, down) {
        Row to = part + (size_t)y * across;
        const float *from = x + (size_t)y * across;
        memset(to, 0, across * sizeof(float));
        LANES(i, across - step) to[before + i] = from[i] + from[i + step];
    }
    EACH(y, down) {
        Row to = x + (size_t)y * across;
        if (y < before || y >= down - after) { memset(to, 0, across * sizeof(float)); continue; }
        In one = part + (size_t)(y - before) * across, two = part + (size_t)(y + after) * across;
        LANES(i, across) to[i] = one[i] + two[i];
    }
}

// Add a neighbour's tiles to the sums of each area.
static void add_tiles(Block *b, float *tiles) {
    const size_t n = b->plane;
    static const int before[] = {0, 1, 2}, step[] = {1, 2, 4};
    EACH(l, LEVELS) {
        if (l) EACH(k, 3) pool(tiles + k * n, b->pooled[0], b, before[l - 1], step[l - 1]);
        In weight = tiles, light = tiles + n, chance = tiles + 2 * n;
        float **s = b->level[l];
        Row w = s[0], w2 = s[1], l1 = s[2], l2 = s[3], c1 = s[4], c2 = s[5];
        LANES(i, n) {
            const float share = 1.0f / at_least(weight[i], TINY);
            w[i] += weight[i], w2[i] += weight[i] * weight[i];
            l1[i] += light[i], l2[i] += light[i] * light[i] * share;
            c1[i] += chance[i], c2[i] += chance[i] * share;
        }
    }
}

// The variance between neighbours beyond that of their noise, the noise, and the weight
// it is free of, of one area: into the pooled planes.
static void variances(Block *b, int level) {
    const int stride = b->tiles_across + 2 * PAD;
    float **s = b->level[level];
    EACH(y, b->tiles_down) {
        const size_t row = (size_t)(y + PAD) * stride + PAD;
        In w = s[0] + row, w2 = s[1] + row, l1 = s[2] + row, l2 = s[3] + row;
        In c1 = s[4] + row, c2 = s[5] + row;
        Row varies = b->pooled[0] + row, chances = b->pooled[1] + row, free = b->pooled[2] + row;
        LANES(i, b->tiles_across) {
            const float share = 1.0f / at_least(w[i], TINY);
            const float chance = c2[i] - c1[i] * share;
            varies[i] = l2[i] - l1[i] * l1[i] * share - chance;
            chances[i] = chance;
            free[i] = w[i] - w2[i] * share;
        }
    }
}

// The squared error due to changes, summed over areas of all sizes, of each pixel.
static void changes(Block *b) {
    const int stride = b->tiles_across + 2 * PAD, w = b->width;
    float *error = b->tiles;
    memset(error, 0, b->plane * sizeof(float));
    EACH(i, 3) memset(b->pooled[i], 0, b->plane * sizeof(float));
    EACH(l, LEVELS) {
        variances(b, l);
        EACH(y, b->tiles_down) {
            const size_t row = (size_t)(y + PAD) * stride + PAD;
            Row to = error + row;
            LANES(x, b->tiles_across) {
                float sum[3];
                EACH(k, 3) {
                    const float *p = b->pooled[k] + row + x;
                    const float *up = p - stride, *down = p + stride;
                    sum[k] = (up[-1] + up[0] + up[1]) + (p[-1] + p[0] + p[1])
                             + (down[-1] + down[0] + down[1]);
                }
                const float free = at_least(sum[2], TINY);
                const float variance = at_least(sum[0] / free, 0.0f);
                const float chance = at_least(sum[1] / free, 0.0f) * CHANCE;
                to[x] += variance * variance / (variance + chance + TINY);
            }
        }
    }
    EACH(y, b->rows) {
        In from = error + (size_t)(y / 2 + PAD) * stride + PAD;
        Row to = b->changed + (size_t)y * w;
        LANES(i, w) to[i] = from[i / 2];
    }
}
