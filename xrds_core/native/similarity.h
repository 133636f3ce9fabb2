// How far the neighbours show what the frame itself shows: see `accumulation/weighted_sums.py`.

// An error below this many times what noise could explain is discounted.
static const float UNSURE = 6.0f;
// Squared, summed over the channels: below this albedo the ratio of light to albedo is
// taken from the whole frame. Then the same of its luminance's root.
static const float DARKEST_ALBEDO = 0.02f, DARKEST_ROOT = 0.1f;
static const float EVEN_NOISE = 0.1f;  // added to albedo's luminance: noise is more even
static const float LIGHT = 4.0f;       // penalty of an error seen in light
static const float BEARABLE = 0.03f;   // guides alone: the error at which neighbours count half
// Of guides alone, whose noise is that of one sample: reusing too few is a loss there.
static const float GUIDES_FACTOR = 2.0493902f;  // the root of 1.2 (1 + 2.5)
enum { SMOOTH = 3, NOISE_AREA = 7, MEAN = 3, LIGHT_AREA = 5 };  // pixels across

INLINE float discounted(float error, float unsure) {
    error = at_least(error, 0.0f);
    return error * error / (error + unsure + TINY);
}

static void mean_of(Block *b, float *out, const float *x, float *part, int size) {
    box(out, x, part, b->wide, b->rows, b->width, size);
}

// The mean over squares of the pixels that are valid (0 or 1); `x` is overwritten.
static void valid_mean(Block *b, Row out, Row x, In valid, Row part, int size) {
    LANES(i, b->count) x[i] *= valid[i];
    mean_of(b, out, x, part, size);
    mean_of(b, x, valid, part, size);
    LANES(i, b->count) out[i] /= at_least(x[i], TINY);
}

static float guide_scale(const Target *t, int channel) {
    const int guide = channel - first_guide(t);
    return guide >= 3 && guide < 6 ? NORMAL_SHARE : 1.0f;
}

// ---- the frame's own pixels, and what is compared with its neighbours ----

static void read_own(Block *b) {
    const Target *t = b->target;
    const int channels = t->channels, w = b->width;
    EACH(y, b->rows) {
        const size_t start = (size_t)(b->top + y) * t->frame.width + b->left;
        const size_t row = (size_t)y * w;
        EACH(c, channels) {
            Row to = b->own[c] + row;
            const half *from = t->frame.picture + start * channels + c;
            LANES(i, w) to[i] = from_half(from[i * channels]);
        }
        Row known = b->known + row;
        const uint8_t *invalid = t->frame.invalid ? t->frame.invalid + start : NULL;
        LANES(i, w) known[i] = invalid ? !invalid[i] : 1.0f;
        if (!has_light(t)) continue;
        const half *noise = t->frame.noise + 2 * start, *guides = t->guide_noise + start;
        Row brightness = b->brightness + row, difference = b->d + row, guide = b->noise + row;
        LANES(i, w) {
            brightness[i] = from_half(noise[2 * i]);
            difference[i] = from_half(noise[2 * i + 1]);
            const float g = from_half(guides[i]);
            guide[i] = g * g;
        }
    }
}

// Transparent in a pixel or next to it: there is no noise to remove, and an outline of
// several frames is too wide.
static void find_clear(Block *b) {
    const size_t n = b->count;
    if (!has_alpha(b->target)) { LANES(i, n) b->clear[i] = 1.0f; return; }
    In alpha = b->own[b->target->channels - 1];
    LANES(i, n) b->c[i] = alpha[i] == 0.0f;
    mean_of(b, b->clear, b->c, b->a, 3);
    LANES(i, n) b->clear[i] = b->clear[i] > 0.0f ? 0.0f : 1.0f;
}

// What is compared where there is light.
static void prepare_light(Block *b) {
    const Target *t = b->target;
    const size_t n = b->count;
    In red = b->own[3], green = b->own[4], blue = b->own[5], difference = b->d;
    Row x = b->b, y = b->c;
    LANES(i, n) b->texture[i] = root_of_luminance(red[i], green[i], blue[i]);
    mean_of(b, b->unsure, b->noise, b->a, whole_at_least(t->guide_area, NOISE_AREA));
    LANES(i, n) b->unsure[i] *= UNSURE;
    // noise is proportional to albedo: a dark joint between bright stones has little
    LANES(i, n) x[i] = difference[i] * difference[i];
    mean_of(b, b->variance, x, b->a, NOISE_AREA);
    LANES(i, n) x[i] = b->texture[i] * b->texture[i] + EVEN_NOISE;
    mean_of(b, y, x, b->a, NOISE_AREA);
    LANES(i, n) b->variance[i] = b->variance[i] / y[i] * x[i] + TINY;
    mean_of(b, b->chance, difference, b->a, MEAN);
    LANES(i, n) b->chance[i] *= b->chance[i];
    LANES(i, n) {
        const float r = limited(red[i]), g = limited(green[i]), l = limited(blue[i]);
        x[i] = r * r + g * g + l * l;
    }
    mean_of(b, y, x, b->a, SMOOTH);
    mean_of(b, b->light, b->brightness, b->a, SMOOTH);
    LANES(i, n)
        b->light_for_albedo[i] = (b->light[i] * b->light[i] / 4 + DARKEST_ALBEDO * t->usual)
                                 / (y[i] + DARKEST_ALBEDO);
    mean_of(b, y, b->texture, b->a, SMOOTH);
    LANES(i, n) {
        b->light[i] /= y[i] + DARKEST_ROOT;
        b->untextured[i] = b->brightness[i] - b->light[i] * b->texture[i];
    }
}

// The variance of the noise of guides, where they are alone.
static void prepare_guides(Block *b) {
    const Target *t = b->target;
    const size_t n = b->count;
    float *scaled[MOST_CHANNELS];
    EACH(c, t->channels) {  // the sums are cleared after this
        const float scale = guide_scale(t, c);
        In own = b->own[c];
        Row to = scaled[c] = b->sums[0].values[c];
        LANES(i, n) to[i] = limited(own[i] * scale);
    }
    noise_of_guides(b->b, scaled, t->channels, GUIDES_FACTOR, b->rows, b->width,
                    0, b->rows);
    LANES(i, n) b->b[i] *= b->b[i];
    mean_of(b, b->variance, b->b, b->a, NOISE_AREA);
}

static void prepare(Block *b) {
    read_own(b);
    find_clear(b);
    if (has_light(b->target)) prepare_light(b); else prepare_guides(b);
}

// ---- judging a group of neighbours ----

// Squared differences of guides from the frame's own, where the sums have any weight.
static void guides_apart(const Block *b, const Sums *s, Row apart) {
    const Target *t = b->target;
    In weights = s->weights;
    LANES(i, b->count) apart[i] = 0.0f;
    for (int c = first_guide(t); c < t->channels; c++) {
        const float scale = guide_scale(t, c);
        In sum = s->values[c], own = b->own[c];
        LANES(i, b->count) {
            const float mean = sum[i] / at_least(weights[i], TINY);
            const float d = limited(mean * scale) - limited(own[i] * scale);
            apart[i] += d * d;
        }
    }
}

// The share of the frame's own variance in it and the error, into `b->c`.
static void judge_light(Block *b, const Sums *s, In valid) {
    const Target *t = b->target;
    const size_t n = b->count;
    In weights = s->weights, bright = s->brightness;
    Row apart = b->b, error = b->c, part = b->a, other = b->d;
    guides_apart(b, s, apart);
    LANES(i, n) apart[i] -= b->noise[i];
    valid_mean(b, error, apart, valid, part, t->guide_area);
    LANES(i, n)
        error[i] = t->guide_penalty * b->light_for_albedo[i] * discounted(error[i], b->unsure[i])
                   + t->change_penalty * b->changed[i];
    LANES(i, n)
        apart[i] = (b->brightness[i] - bright[i] / at_least(weights[i], TINY)) * valid[i];
    mean_of(b, other, apart, part, MEAN);
    LANES(i, n) other[i] = other[i] * other[i] - b->chance[i];
    mean_of(b, apart, other, part, LIGHT_AREA);
    LANES(i, n) {
        const float v = b->variance[i];
        error[i] += LIGHT * discounted(apart[i], UNSURE / (MEAN * MEAN) * v);
        error[i] = v / (v + error[i]);
    }
}

static void judge_guides(Block *b, const Sums *s, In valid) {
    Row apart = b->b, like = b->c;
    guides_apart(b, s, apart);
    valid_mean(b, like, apart, valid, b->a, SMOOTH);
    LANES(i, b->count) {
        const float v = b->variance[i] + BEARABLE * BEARABLE;
        like[i] = v / (v + at_least(like[i] - b->variance[i], 0.0f));
    }
}

// The weight in [0, 1] of a group of neighbours, into `b->a`.
static void similarity(Block *b, const Sums *s) {
    const size_t n = b->count;
    In weights = s->weights, known = b->known;
    Row valid = b->texture;  // not needed any more
    LANES(i, n) valid[i] = weights[i] > 0.0f ? known[i] : 0.0f;
    if (has_light(b->target)) judge_light(b, s, valid); else judge_guides(b, s, valid);
    valid_mean(b, b->d, b->c, valid, b->a, SMOOTH);
    LANES(i, n) {
        const float like = known[i] > 0.0f ? b->d[i] : 1.0f;
        b->a[i] = weights[i] > 0.0f ? like * b->clear[i] : 0.0f;
    }
}
