// Some rows and columns of a frame, with the margin that judging needs, as planes of
// floats: one loop for each step. Sums over two groups of neighbours.

enum {
    MARGIN = 12,        // pixels on each side of one that influence its weight
    MOST_CHANNELS = 10,
    MOMENTS = 5,        // of offsets: x, y, x x, x y, y y
    GROUPS = 2,
    LEVELS = 4,         // areas over which light is compared
    PAD = 4,            // tiles of 2 x 2 pixels around those of a block
    LEVEL_SUMS = 6
};
typedef struct {
    float *values[MOST_CHANNELS], *weights, *reused, *brightness, *moments[MOMENTS];
    float *parts;                                 // planes, `stride` apart
} Sums;

typedef struct {
    const Target *target;
    int left, top, width, rows;                   // with the margin
    int inner_left, inner_top, inner_width, inner_rows;
    size_t count, stride;                         // pixels, with the margin; of a plane
    float *own[MOST_CHANNELS], *brightness, *texture, *variance, *chance, *unsure;
    float *light_for_albedo, *light, *untextured, *known, *clear, *noise, *changed;
    Sums sums[GROUPS];
    int tiles_across, tiles_down;
    size_t plane;                                 // of tiles
    float *tiles, *pooled[3], *level[LEVELS][LEVEL_SUMS];
    float *wide, *a, *b, *c, *d;                  // for what is computed on the way
    Found found;
} Block;

static int has_light(const Target *t) { return t->channels >= 9; }
static int first_guide(const Target *t) { return has_light(t) ? 3 : 0; }
static int has_alpha(const Target *t) { return t->channels % 3 == 1; }

// The largest block.
static Block largest_block(const Target *t, Area area) {
    Block b = {.target = t};
    b.rows = area.bottom - area.top + 2 * MARGIN;
    b.width = area.right - area.left + 2 * MARGIN;
    return b;
}

static Block block_of(const Target *t, Area area) {
    Block b = {.target = t, .inner_left = area.left, .inner_top = area.top,
               .inner_width = area.right - area.left, .inner_rows = area.bottom - area.top};
    b.left = whole_at_least(area.left - MARGIN, 0);
    b.top = whole_at_least(area.top - MARGIN, 0);
    b.width = whole_at_most(area.right + MARGIN, t->frame.width) - b.left;
    b.rows = whole_at_most(area.bottom + MARGIN, t->frame.height) - b.top;
    return b;
}

// Tests make what lies between two planes forbidden.
#ifndef BOUND
#define BOUND(from, to, end)
#endif

static void *take(char **next, size_t count, size_t size) {
    char *found = *next;
    *next += (count * size + 127) / 64 * 64;  // a vector more, for loads beyond the end
    BOUND(found, found + count * size, *next);
    return found;
}

static float *take_floats(char **next, size_t count) {
    return take(next, count, sizeof(float));
}

static void lay_out_sums(Block *b, Sums *s, char **next) {
    EACH(c, b->target->channels) s->values[c] = take_floats(next, b->count);
    s->parts = take_floats(next, 3 * b->target->parts * b->stride);
    EACH(m, b->target->guess ? MOMENTS : 0) s->moments[m] = take_floats(next, b->count);
    float **planes[] = {&s->weights, &s->reused, &s->brightness};
    EACH(i, 3) *planes[i] = take_floats(next, b->count);
}

// Give a block its planes, from `next` on; returns where they end.
static char *lay_out(Block *b, char *next) {
    const int channels = b->target->channels;
    b->count = (size_t)b->rows * b->width, b->stride = (b->count + 31) / 16 * 16;
    b->tiles_across = (b->width + 1) / 2, b->tiles_down = (b->rows + 1) / 2;
    b->plane = (size_t)(b->tiles_across + 2 * PAD) * (b->tiles_down + 2 * PAD);
    float **planes[] = {&b->brightness, &b->texture, &b->variance, &b->chance, &b->unsure,
                        &b->light_for_albedo, &b->light, &b->untextured, &b->known,
                        &b->clear, &b->noise, &b->changed, &b->a, &b->b, &b->c, &b->d};
    EACH(i, (int)(sizeof planes / sizeof *planes)) *planes[i] = take_floats(&next, b->count);
    EACH(c, channels) b->own[c] = take_floats(&next, b->count);
    // the sums of all neighbours begin here
    EACH(g, GROUPS) lay_out_sums(b, b->sums + g, &next);
    const int neighbours = whole_at_least(b->target->neighbours, 1);
    b->tiles = take_floats(&next, 3 * b->plane * neighbours);
    EACH(i, 3) b->pooled[i] = take_floats(&next, b->plane);
    EACH(l, LEVELS) EACH(i, LEVEL_SUMS) b->level[l][i] = take_floats(&next, b->plane);
    b->wide = take_floats(&next, 4 * ((size_t)b->width + 64));
    Found *f = &b->found;
    float **rows[] = {&f->x, &f->y, &f->apart, &f->weight, &f->share, &f->light, &f->chance,
                      &f->at_x, &f->at_y};
    EACH(k, (int)(sizeof rows / sizeof *rows)) *rows[k] = take_floats(&next, b->width);
    int32_t **columns[] = {&f->pixel, &f->column, &f->row};
    EACH(k, 3) *columns[k] = take(&next, b->width, sizeof(int32_t));
    return next;
}

static float *part_plane(const Block *b, const Sums *s, int c) {
    return s->parts + c * b->stride;
}

static void clear(Block *b) {
    const size_t plane = b->count * sizeof(float);
    EACH(g, GROUPS) {
        Sums *s = b->sums + g;
        EACH(c, b->target->channels) memset(s->values[c], 0, plane);
        memset(s->parts, 0, 3 * b->target->parts * b->stride * sizeof(float));
        EACH(m, b->target->guess ? MOMENTS : 0) memset(s->moments[m], 0, plane);
        memset(s->weights, 0, plane);
        memset(s->reused, 0, plane);
        memset(s->brightness, 0, plane);
    }
    memset(b->tiles, 0, 3 * b->plane * b->target->neighbours * sizeof(float));
    EACH(i, 3) memset(b->pooled[i], 0, b->plane * sizeof(float));
    EACH(l, LEVELS) EACH(i, LEVEL_SUMS) memset(b->level[l][i], 0, b->plane * sizeof(float));
}
