// Loops that become vector instructions, and the functions of one number they use. No
// function of a C library is among them: all processors give equal bits.
#include <math.h>
#include <stddef.h>
#include <string.h>

#define EACH(i, n) for (int i = 0; i < (n); i++)
#define LANES(i, n) \
    _Pragma("clang loop vectorize(assume_safety)") for (int64_t i = 0; i < (int64_t)(n); i++)
// Calls are in the way of vector instructions.
#define INLINE static inline __attribute__((always_inline))
typedef float *restrict Row;
typedef const float *restrict In;

static const float TINY = 1e-9f, LARGEST_HALF = 65504.0f, PI = 3.14159265f;

INLINE float as_float(uint32_t bits) { float f; memcpy(&f, &bits, 4); return f; }
INLINE uint32_t as_bits(float f) { uint32_t b; memcpy(&b, &f, 4); return b; }
INLINE float at_most(float x, float most) { return x < most ? x : most; }
INLINE float at_least(float x, float least) { return x > least ? x : least; }
INLINE int whole_at_most(int x, int most) { return x < most ? x : most; }
INLINE int whole_at_least(int x, int least) { return x > least ? x : least; }
INLINE int clamped(int x, int end) { return whole_at_least(whole_at_most(x, end - 1), 0); }

INLINE float from_half(uint32_t h) {
#if defined(__F16C__) || defined(__aarch64__)
    const half bits = (half)h;
    _Float16 x;
    memcpy(&x, &bits, 2);
    return x;
#else
    const uint32_t magnitude = (h & 0x7fff) << 13, sign = (h & 0x8000) << 16;
    const uint32_t tiny = as_bits(as_float(magnitude + (113u << 23)) - 0x1p-14f);
    const uint32_t usual = magnitude + (112u << 23);
    const uint32_t beyond = magnitude < 31u << 23 ? usual : usual + (112u << 23);
    return as_float((magnitude < 1u << 23 ? tiny : beyond) | sign);
#endif
}

// To the nearest half, the even one of two; infinite beyond the largest.
INLINE half to_half(float f) {
#if defined(__F16C__) || defined(__aarch64__)
    const _Float16 x = (_Float16)f;
    half bits;
    memcpy(&bits, &x, 2);
    return bits;
#else
    const uint32_t sign = as_bits(f) >> 16 & 0x8000, b = as_bits(f) & 0x7fffffff;
    const uint32_t usual = (b + 0xfff + (b >> 13 & 1) - (112u << 23)) >> 13;
    const uint32_t tiny = as_bits(as_float(b) + 0.5f) - (126u << 23);
    const uint32_t finite = b < 113u << 23 ? tiny : whole_at_most((int)usual, 0x7c00);
    return (half)((b > 255u << 23 ? 0x7e00 : finite) | sign);
#endif
}

// The nearest number that a half holds; not of NaN.
INLINE float limited_half(float x) { return at_most(at_least(x, -LARGEST_HALF), LARGEST_HALF); }

// Two halves that lie side by side.
INLINE uint32_t pair_at(const half *from) { uint32_t p; memcpy(&p, from, 4); return p; }

INLINE float exponential(float x) {  // of 0 and below (Cephes' expf)
    x = x < -87.0f ? -87.0f : x;
    const float n = (x * 1.44269504f + 12582912.0f) - 12582912.0f;
    const float r = (x - n * 0.693359375f) + n * 2.12194440e-4f;
    float p = 1.9875691500e-4f;
    p = p * r + 1.3981999507e-3f;
    p = p * r + 8.3334519073e-3f;
    p = p * r + 4.1665795894e-2f;
    p = p * r + 1.6666665459e-1f;
    p = p * r + 5.0000001201e-1f;
    return (p * r * r + r + 1.0f) * as_float((uint32_t)((int32_t)n + 127) << 23);
}

INLINE float arc_tangent(float y, float x) {  // atan2 (Cephes' atanf)
    const float high = at_least(fabsf(x), fabsf(y)), low = at_most(fabsf(x), fabsf(y));
    const int steep = low > 0.41421356f * high;
    const float a = steep ? (low - high) / (low + high) : low / high, s = a * a;
    float p = 8.05374449538e-2f;
    p = p * s - 1.38776856032e-1f;
    p = p * s + 1.99777106478e-1f;
    p = p * s - 3.33329491539e-1f;
    float angle = p * s * a + a + (steep ? PI / 4 : 0.0f);
    angle = fabsf(y) > fabsf(x) ? PI / 2 - angle : angle;
    return copysignf(x < 0.0f ? PI - angle : angle, y);
}

// Beyond this albedo is a lamp, which must not dominate the pixels around it; normals
// change where nothing else does, so they weigh less.
static const float BRIGHTEST = 4.0f, NORMAL_SHARE = 0.31622776f;

INLINE float limited(float x) { return at_most(at_least(x, -BRIGHTEST), BRIGHTEST); }

// The square root of luminance (Rec.709).
INLINE float root_of_luminance(float r, float g, float b) {
    return sqrtf(at_least(r * 0.2126f + g * 0.7152f + b * 0.0722f, 0.0f));
}
