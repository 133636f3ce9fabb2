// Accumulation of a part of a frame, as `xrds_core/temporal` tells it: gather the samples
// of all neighbours, judge them, and write the means. Compiled once for each level of
// processors, see dispatch.c.
#include "accumulate.h"
#include "vectors.h"
#include "filters.h"
#include "reprojection.h"
#include "gathering.h"
#include "moving.h"
#include "block.h"
#include "summing.h"
#include "changes.h"
#include "similarity.h"
#include "registration.h"
#include "packing.h"

// ---- what an area of a frame becomes ----

// Weight both groups by similarity; returns how many samples are reused.
static double weigh(Block *b) {
    const Target *t = b->target;
    double reused = 0.0;
    EACH(g, GROUPS) {
        Sums *s = b->sums + g;
        similarity(b, s);
        In factor = b->a;
        EACH(c, t->channels) LANES(i, b->count) s->values[c][i] *= factor[i];
        EACH(c, 3 * t->parts) {
            Row part = part_plane(b, s, c);
            LANES(i, b->count) part[i] *= factor[i];
        }
        LANES(i, b->count) { s->weights[i] *= factor[i]; s->reused[i] *= factor[i]; }
        EACH(y, b->inner_rows) {
            const size_t row = (size_t)(b->inner_top - b->top + y) * b->width
                               + (b->inner_left - b->left);
            float sum = 0.0f;
            LANES(i, b->inner_width) sum += s->reused[row + i];
            reused += sum;
        }
    }
    return reused;
}

// Means of own values and sums: nothing is rounded where nothing is reused. NaN where no
// frame has samples.
INLINE float mean_of_all(float own, float sum, float weight, float total) {
    return own + (sum - own * weight) / total;
}

static void write_samples(Block *b) {
    const Target *t = b->target;
    In one = b->sums[0].weights, two = b->sums[1].weights;
    EACH(y, b->inner_rows) {
        const size_t row = (size_t)(b->inner_top - b->top + y) * b->width
                           + (b->inner_left - b->left);
        const size_t start = (size_t)(b->inner_top + y) * t->frame.width + b->inner_left;
        const half *counts = t->frame.counts;
        Row weights = b->b + row, total = b->c + row, known = b->known + row;
        LANES(i, b->inner_width) {
            const float own = counts ? from_half(counts[start + i]) : t->frame.samples;
            weights[i] = one[row + i] + two[row + i];
            total[i] = own * known[i] + weights[i];
        }
        if (t->samples) memcpy(t->samples + start, total, b->inner_width * sizeof(float));
    }
}

// Write a plane of `deep` interleaved channels.
static void write_means(const Block *b, float *to, float *const *own, float *const *one,
                        float *const *two, int deep) {
    EACH(y, b->inner_rows) {
        const size_t row = (size_t)(b->inner_top - b->top + y) * b->width
                           + (b->inner_left - b->left);
        const size_t start =
            (size_t)(b->inner_top + y) * b->target->frame.width + b->inner_left;
        In weights = b->b + row, total = b->c + row;
        EACH(k, deep) {
            In o = own[k] + row, s = one[k] + row, r = two[k] + row;
            Row at = to + start * deep + k;
            LANES(i, b->inner_width)
                at[i * deep] = mean_of_all(o[i], s[i] + r[i], weights[i], total[i]);
        }
    }
}

static float limited_half(float x) {
    return at_most(at_least(x, -LARGEST_HALF), LARGEST_HALF);
}

static void write_guess_plane(const Block *b, half *to, In own, In one, In two) {
    EACH(y, b->inner_rows) {
        const size_t row = (size_t)(b->inner_top - b->top + y) * b->width
                           + (b->inner_left - b->left);
        half *restrict at = to + (size_t)(b->inner_top + y) * b->target->frame.width
                            + b->inner_left;
        In o = own + row, s = one + row, r = two + row, w = b->b + row, total = b->c + row;
        LANES(i, b->inner_width) {
            const float mean = mean_of_all(o[i], s[i] + r[i], w[i], total[i]);
            at[i] = to_half(mean == mean ? limited_half(mean) : mean);
        }
    }
}

// The part's own pixels, 0 where it is dark, into `b->own`.
static void read_part(Block *b, const half *part) {
    const int w = b->width;
    EACH(k, 3) {
        if (!part) { memset(b->own[k], 0, b->count * sizeof(float)); continue; }
        EACH(y, b->rows) {
            const half *from =
                part + 3 * ((size_t)(b->top + y) * b->target->frame.width + b->left) + k;
            Row to = b->own[k] + (size_t)y * w;
            LANES(i, w) to[i] = from_half(from[3 * i]);
        }
    }
}

// Brightness of the guess, from its radiance, of the block's inner pixels.
static void write_brightness(const Block *b, half *to) {
    const Sums *s = b->sums, *r = b->sums + 1;
    EACH(y, b->inner_rows) {
        const size_t row = (size_t)(b->inner_top - b->top + y) * b->width
                           + (b->inner_left - b->left);
        half *restrict at = to + (size_t)(b->inner_top + y) * b->target->frame.width
                            + b->inner_left;
        LANES(i, b->inner_width) {
            const size_t p = row + i;
            float mean[3];
            EACH(c, 3) mean[c] = mean_of_all(b->own[c][p], s->values[c][p] + r->values[c][p],
                                             b->b[p], b->c[p]);
            const float root = root_of_luminance(mean[0], mean[1], mean[2]);
            at[i] = to_half(mean[0] == mean[0] ? at_most(root, LARGEST_HALF) : NAN);
        }
    }
}

static void write_guess(Block *b) {
    const Target *t = b->target;
    const size_t plane = (size_t)t->frame.width * t->frame.height;
    const Sums *s = b->sums, *r = b->sums + 1;
    half *to = t->guess_out;
    EACH(c, t->channels) {
        write_guess_plane(b, to, b->own[c], s->values[c], r->values[c]);
        to += plane;
    }
    half *parts = to;
    if (has_light(t)) write_brightness(b, to + 3 * t->parts * plane);
    EACH(p, t->parts) {
        read_part(b, t->frame.parts[p]);
        EACH(k, 3) write_guess_plane(b, parts + (3 * p + k) * plane, b->own[k],
                                     part_plane(b, s, 3 * p + k),
                                     part_plane(b, r, 3 * p + k));
    }
}

static void write_picture(Block *b) {
    const Target *t = b->target;
    const size_t plane = (size_t)t->frame.width * t->frame.height;
    const Sums *s = b->sums, *r = b->sums + 1;
    for (int c = 0; c < t->channels; c += 3)
        write_means(b, t->means + c * plane, b->own + c, s->values + c, r->values + c,
                    whole_at_most(t->channels - c, 3));
    EACH(p, t->parts) {
        read_part(b, t->frame.parts[p]);
        float *one[3], *two[3];
        EACH(k, 3) one[k] = part_plane(b, s, 3 * p + k), two[k] = part_plane(b, r, 3 * p + k);
        write_means(b, t->part_means + 3 * p * plane, b->own, one, two, 3);
    }
}

// ---- what dispatch.c exports ----

int64_t NAME(scratch_bytes)(const Target *t, Area area) {
    Block b = largest_block(t, area);
    char *const start = (char *)64;
    return lay_out(&b, start) - start + (int64_t)(registration_floats(&b) * sizeof(float));
}

double NAME(accumulate)(const Target *t, Area area, char *scratch) {
    Block b = block_of(t, area);
    float *further = (float *)lay_out(&b, scratch);
    prepare(&b);
    clear(&b);
    EACH(y, b.rows) EACH(k, t->neighbours) add_row(&b, k, y);
    if (t->guess) take_out_offsets(&b, further);
    if (has_light(t)) {
        EACH(k, t->neighbours) add_tiles(&b, b.tiles + 3 * b.plane * k);
        changes(&b);
    }
    const double reused = weigh(&b);
    write_samples(&b);
    if (t->guess_out) write_guess(&b); else write_picture(&b);
    return reused;
}

void NAME(find_rims)(const float *depth, uint8_t *out, int32_t w, int32_t h, int32_t top,
                     int32_t bottom, int32_t nearer_is_less) {
    rims_of(depth, out, w, h, top, bottom, nearer_is_less);
}

void NAME(find_moving)(const float *depth, const half *vectors, const Reprojection *forth,
                       int32_t w, int32_t h, int32_t top, int32_t bottom, float steps,
                       float least, uint8_t *out, float *scratch) {
    if (forth->columns) moving_of(depth, vectors, forth, w, h, top, bottom, steps, least, out, scratch, 1);
    else moving_of(depth, vectors, forth, w, h, top, bottom, steps, least, out, scratch, 0);
}

void NAME(find_ranges)(const float *depth, float *least, float *most, int32_t w, int32_t h,
                       int32_t top, int32_t bottom, float *scratch) {
    ranges_of(depth, least, most, w, h, top, bottom, scratch);
}

void NAME(find_spots)(const Target *t, const Neighbour *o, int32_t step, int32_t *pixel,
                      uint8_t *seen, uint8_t *in_frame, float *scratch) {
    const int wide = o->frame.width, high = o->frame.height, left = step / 2;
    const int count = (t->frame.width - left + step - 1) / step;
    for (int y = left; y < t->frame.height; y += step) {
        const Found f = {.x = scratch, .y = scratch + count, .apart = scratch + 2 * count,
                         .at_x = scratch + 3 * count, .at_y = scratch + 4 * count,
                         .column = (int32_t *)(scratch + 5 * count),
                         .row = (int32_t *)(scratch + 6 * count), .pixel = pixel};
        if (o->forth.columns) places_of(t, o, left, y, count, step, &f, 1);
        else places_of(t, o, left, y, count, step, &f, 0);
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

int64_t NAME(packing_bytes)(const Packing *p, int32_t rows) {
    return (int64_t)(packing_floats(p, rows) * sizeof(float));
}

int32_t NAME(pack)(const Packing *p, int32_t top, int32_t bottom, float *scratch) {
    int32_t any = 0;
    for (int y = top; y < bottom; y++) {
        uint8_t *invalid = p->invalid + (size_t)y * p->width;
        mark_invalid(p, y, invalid);
        pack_row(p, y, invalid);
        if (p->noise && p->halves[0].first) pack_noise(p, y, invalid);
        EACH(i, p->width) any |= invalid[i];
    }
    if (p->noise && p->signs) pack_noise_around(p, top, bottom, scratch);
    if (p->guide_noise) pack_guide_noise(p, top, bottom, scratch);
    return any;
}

int32_t NAME(to_halves)(const Pass *p, int32_t width, int32_t top, int32_t bottom,
                        int32_t keeps_infinities, half *out) {
    int32_t any = 0;
    for (int y = top; y < bottom; y++) EACH(c, p->channels) {
        const float *from = channel_of(p, y, c);
        half *restrict to = out + (size_t)y * width * p->channels + c;
        const int64_t step = p->column, deep = p->channels;
        LANES(i, width) {
            const float x = from[i * step];
            const half kept = to_half(x), zeroed = finite_half(is_finite(x) ? x : 0.0f);
            to[i * deep] = keeps_infinities ? kept : zeroed;
            any |= to[i * deep] & 0x7fff;
        }
    }
    return any;
}
