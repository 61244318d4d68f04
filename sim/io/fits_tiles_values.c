/* Values of numbers in compressed tiles, and the random numbers that were subtracted from them. */
#include <math.h>
#include <pthread.h>

#include "sim/io/fits_tiles_internal.h"

/* Numbers in the list, and the reach of the first place in it. */
enum { RANDOM_COUNT = 10000, FIRST_REACH = 500 };
/* Number of a pixel that is exactly 0 with SUBTRACTIVE_DITHER_2. */
static const int32_t ZERO_NUMBER = -2147483646;

static float random_values[RANDOM_COUNT];

/* The list of FITS Standard 4.0, appendix I: Park and Miller (1988) from seed 1. */
static void fill_random(void) {
    int64_t seed = 1;
    for (int i = 0; i < RANDOM_COUNT; i++) {
        seed = seed * 16807 % 2147483647;
        random_values[i] = (float)((double)seed / 2147483647.0);
    }
}

void bst_fits_tile_values(const bst_fits_tile_scale *s, int64_t tile, const int32_t *numbers,
                          size_t count, float *values) {
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    (void)pthread_once(&once, fill_random);
    int64_t first = (tile - 1 + s->seed - 1) % RANDOM_COUNT;
    first = first < 0 ? first + RANDOM_COUNT : first;
    int next = (int)(random_values[first] * (float)FIRST_REACH);
    for (size_t i = 0; i < count; i++) {
        if (s->has_blank && numbers[i] == s->blank) {
            values[i] = NAN;
        } else if (s->dithered && s->zero_kept && numbers[i] == ZERO_NUMBER) {
            values[i] = 0.0F;
        } else {
            double shift = s->dithered ? 0.5 - (double)random_values[next] : 0.0;
            values[i] = (float)(((double)numbers[i] + shift) * s->scale + s->zero);
        }
        if (s->dithered && ++next == RANDOM_COUNT) {
            first = first + 1 < RANDOM_COUNT ? first + 1 : 0;
            next = (int)(random_values[first] * (float)FIRST_REACH);
        }
    }
}
