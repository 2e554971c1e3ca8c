/* Time of a look-up through include/splitsnow.h on one core with warm caches, at the
 * points of benches/lookup.rs:
 *
 *   cc -O2 -Iinclude benches/lookup.c -lm -o target/lookup_c && target/lookup_c FILE */
#define SPLITSNOW_IMPLEMENTATION
#include "splitsnow.h"

#include <time.h>

#define POINTS 4096
#define RUNS 15

/* CPU seconds, which depend less on other programs on the machine than wall time. */
static double now(void) { return (double)clock() / CLOCKS_PER_SEC; }

/* Sorts `seconds`, the times of RUNS runs of `count` look-ups, and prints the median and
 * the smallest time per look-up. */
static void report(const char *what, double *seconds, int count) {
    for (int i = 1; i < RUNS; i++) {
        for (int j = i; j > 0 && seconds[j] < seconds[j - 1]; j--) {
            double t = seconds[j];
            seconds[j] = seconds[j - 1];
            seconds[j - 1] = t;
        }
    }
    printf("%-32s %8.0f ns, least %.0f\n", what, 1e9 * seconds[RUNS / 2] / count,
           1e9 * seconds[0] / count);
}

int main(int argc, char **argv) {
    static double points[POINTS][5];
    static float spectrum[4096];
    static const double step[5] = {0.8567, 0.7339, 0.6287, 0.5386, 0.4614};
    static const double hero[4] = {440.0, 520.0, 600.0, 680.0};
    double u[5] = {0.5, 0.5, 0.5, 0.5, 0.5}, seconds[RUNS], sum = 0.0;
    char message[256] = "usage: lookup_c FILE, where FILE is a compact file";
    splitsnow *database;
    splitsnow_lookup *any_snow, *one_snow;
    splitsnow_colour *colour;
    splitsnow_snow snow;
    size_t n;
    if (argc != 2 || splitsnow_open(argv[1], &database, message, sizeof message) != SPLITSNOW_OK) {
        fprintf(stderr, "%s\n", message);
        return 1;
    }
    for (int i = 0; i < POINTS; i++) {
        for (int axis = 0; axis < 5; axis++) {
            const float *nodes = splitsnow_nodes(database, (splitsnow_axis)axis, &n);
            u[axis] = fmod(u[axis] + step[axis], 1.0);
            points[i][axis] = (double)nodes[0] + u[axis] * ((double)nodes[n - 1] - (double)nodes[0]);
        }
    }
    splitsnow_wavelengths(database, &n);
    snow.facetness = points[0][0];
    snow.grain_size_um = points[0][1];
    snow.density_kg_m3 = points[0][2];
    if (n > 4096 || splitsnow_colour_new(database, SPLITSNOW_D65, NULL, 0, &colour) != SPLITSNOW_OK ||
        splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, NULL, NULL, 0, &any_snow) != SPLITSNOW_OK ||
        splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, &snow, NULL, 0, &one_snow) != SPLITSNOW_OK) {
        fprintf(stderr, "the file must have the five core axes, transmittance and visible wavelengths\n");
        return 1;
    }
    printf("%zu wavelengths\n", n);
    for (int kind = 0; kind < 5; kind++) {
        static const char *const names[] = {"anywhere", "of one snow", "of one snow, 4 wavelengths",
                                            "of one snow, linear sRGB", "preparing one snow"};
        int count = kind == 4 ? 256 : 16 * POINTS;
        for (int run = 0; run < RUNS; run++) {
            double begin = now();
            for (int i = 0; i < count; i++) {
                const double *p = points[i % POINTS];
                double rgb[3];
                if (kind == 0) {
                    snow.facetness = p[0];
                    snow.grain_size_um = p[1];
                    snow.density_kg_m3 = p[2];
                    splitsnow_spectrum_of(any_snow, &snow, p[3], p[4], spectrum, n);
                } else if (kind == 1) {
                    splitsnow_spectrum(one_snow, p[3], p[4], spectrum, n);
                } else if (kind == 2) {
                    splitsnow_spectrum_at(one_snow, p[3], p[4], hero, 4, spectrum);
                } else if (kind == 3) {
                    splitsnow_linear_srgb(one_snow, colour, p[3], p[4], rgb);
                    spectrum[0] = (float)rgb[0];
                } else {
                    splitsnow_lookup *other;
                    splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, &snow, NULL, 0, &other);
                    splitsnow_lookup_free(other);
                }
                sum += (double)spectrum[0];
            }
            seconds[run] = now() - begin;
        }
        report(names[kind], seconds, count);
    }
    printf("(sum %g)\n", sum);
    splitsnow_colour_free(colour);
    splitsnow_lookup_free(any_snow);
    splitsnow_lookup_free(one_snow);
    splitsnow_close(database);
    return 0;
}
