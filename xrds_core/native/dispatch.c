// What the library exports: the kernels for this processor, on x86-64 those of AVX2 where
// it has them.
#include "accumulate.h"
#ifdef _WIN32
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif

// kind, name, parameters, arguments
#define KERNELS(DO) \
    DO(int64_t, scratch_bytes, (const Target *t, Area area), (t, area)) \
    DO(double, accumulate, (const Target *t, Area area, char *scratch), (t, area, scratch)) \
    DO(void, find_rims, (const float *depth, uint8_t *out, int32_t w, int32_t h, int32_t top, \
                         int32_t bottom, int32_t nearer_is_less), \
       (depth, out, w, h, top, bottom, nearer_is_less)) \
    DO(void, find_ranges, (const float *depth, float *least, float *most, int32_t w, int32_t h, \
                           int32_t top, int32_t bottom, float *scratch), \
       (depth, least, most, w, h, top, bottom, scratch)) \
    DO(void, find_moving, (const float *depth, const half *vectors, const Reprojection *forth, \
                           int32_t w, int32_t h, int32_t top, int32_t bottom, float steps, \
                           float least, uint8_t *out, float *scratch), \
       (depth, vectors, forth, w, h, top, bottom, steps, least, out, scratch)) \
    DO(void, find_spots, (const Target *t, const Neighbour *o, int32_t step, int32_t *pixel, \
                          uint8_t *seen, uint8_t *in_frame, float *scratch), \
       (t, o, step, pixel, seen, in_frame, scratch)) \
    DO(int64_t, packing_bytes, (const Packing *p, int32_t rows), (p, rows)) \
    DO(int32_t, pack, (const Packing *p, int32_t top, int32_t bottom, float *scratch), \
       (p, top, bottom, scratch)) \
    DO(int32_t, to_halves, (const Pass *p, int32_t width, int32_t top, int32_t bottom, \
                            int32_t keeps_infinities, half *out), \
       (p, width, top, bottom, keeps_infinities, out))

#ifdef __x86_64__
#include <cpuid.h>

static int finds_avx2(void) {
    const unsigned fma_xsave_avx_f16c = 1u << 12 | 1u << 27 | 1u << 28 | 1u << 29;
    const unsigned avx2_bmi2 = 1u << 5 | 1u << 8;
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & fma_xsave_avx_f16c) != fma_xsave_avx_f16c)
        return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & 6) != 6) return 0;  // the system does not keep the wide registers
    return __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & avx2_bmi2) == avx2_bmi2;
}

static int most_level = 3;

#define EXPORT(kind, name, parameters, arguments) \
    kind name##_v1 parameters; \
    kind name##_v3 parameters; \
    API kind name parameters { \
        return level() == 3 ? name##_v3 arguments : name##_v1 arguments; \
    }
#else
static int finds_avx2(void) { return 0; }
static int most_level = 1;

#define EXPORT(kind, name, parameters, arguments) \
    kind name##_v1 parameters; \
    API kind name parameters { return name##_v1 arguments; }
#endif

// The level of the kernels that run: 1, or 3 for those of AVX2.
API int32_t level(void) {
    static int found = 0;  // threads that find it at once find the same
    if (!found) found = finds_avx2() ? 3 : 1;
    return found < most_level ? found : most_level;
}

// Use no kernels above a level: tests compare them.
API void limit_level(int32_t most) { most_level = most; }

// By which Python finds out whether it has the same structures: a library left over from
// another version would read beyond them.
API int64_t struct_size(int32_t which) {
    const int64_t sizes[] = {sizeof(Frame), sizeof(Reprojection), sizeof(Places),
                             sizeof(Neighbour), sizeof(Target), sizeof(Pass),
                             sizeof(Packing)};
    return which >= 0 && which < 7 ? sizes[which] : -1;
}

KERNELS(EXPORT)
