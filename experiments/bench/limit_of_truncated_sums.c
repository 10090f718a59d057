/* How many terms min(c, |x - y|) in float64 a core adds per second when nothing but the instructions counts.

   gcc -O2 bench/limit_of_truncated_sums.c -o limit && ./limit     (a processor with AVX-512)

   Four independent sums, all on registers; the best of many runs, by processor time. See README.md. */
#include <stdio.h>
#include <time.h>

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(void) {
    const long repeats = 1000000, terms = 4 * 8;
    double best = 1e9;
    for (int run = 0; run < 50; run++) {
        double begin = seconds();
        for (long i = 0; i < repeats; i++)
            __asm__ volatile(
                "vsubpd %%zmm20, %%zmm21, %%zmm0\n vsubpd %%zmm22, %%zmm21, %%zmm1\n"
                "vsubpd %%zmm23, %%zmm21, %%zmm2\n vsubpd %%zmm24, %%zmm21, %%zmm3\n"
                "vpandq %%zmm30, %%zmm0, %%zmm0\n vpandq %%zmm30, %%zmm1, %%zmm1\n"
                "vpandq %%zmm30, %%zmm2, %%zmm2\n vpandq %%zmm30, %%zmm3, %%zmm3\n"
                "vminpd %%zmm31, %%zmm0, %%zmm0\n vminpd %%zmm31, %%zmm1, %%zmm1\n"
                "vminpd %%zmm31, %%zmm2, %%zmm2\n vminpd %%zmm31, %%zmm3, %%zmm3\n"
                "vaddpd %%zmm0, %%zmm8, %%zmm8\n vaddpd %%zmm1, %%zmm9, %%zmm9\n"
                "vaddpd %%zmm2, %%zmm10, %%zmm10\n vaddpd %%zmm3, %%zmm11, %%zmm11\n"
                ::: "memory");
        double taken = seconds() - begin;
        if (taken < best) best = taken;
    }
    printf("%.1f thousand million terms a second\n", 1e-9 * repeats * terms / best);
    return 0;
}
