/* Time of a look-up through include/splitsnow.h on one core with warm caches, at the
 * points of benches/lookup.rs:
 *
 *   cc -O2 -Iinclude benches/lookup.c -lm -o target/lookup_c && target/lookup_c FILE [VIEWS]
 *
 * VIEWS is the file of anisotropy factors with the axes of FILE that benches/lookup.rs writes to
 * target/tmp/views.safetensors. */
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

/* Fills `points`, which are scattered within the axes of the file. */
static void scatter(const splitsnow *database, const splitsnow_axis *axes, size_t n_axes,
                    double points[POINTS][7]) {
    static const double step[7] = {0.8567, 0.7339, 0.6287, 0.5386, 0.4614, 0.3953, 0.3387};
    double u[7] = {0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5};
    for (int i = 0; i < POINTS; i++) {
        for (size_t axis = 0; axis < n_axes; axis++) {
            size_t n;
            const float *nodes = splitsnow_nodes(database, axes[axis], &n);
            u[axis] = fmod(u[axis] + step[axis], 1.0);
            points[i][axis] = (double)nodes[0] + u[axis] * ((double)nodes[n - 1] - (double)nodes[0]);
        }
    }
}

/* What is prepared for look-ups toward views. */
typedef struct toward {
    splitsnow_lookup *lookup;
    splitsnow_anisotropy *anisotropy;
} toward;

static int prepare(const splitsnow *database, const splitsnow *views, const splitsnow_snow *snow,
                   toward *prepared) {
    splitsnow_quantity quantity = SPLITSNOW_REFLECTANCE;
    splitsnow_status status = splitsnow_prepare(database, quantity, snow, NULL, 0, &prepared->lookup);
    if (status == SPLITSNOW_OK) {
        status = splitsnow_prepare_anisotropy(views, quantity, snow, NULL, 0, &prepared->anisotropy);
    }
    if (status != SPLITSNOW_OK) fprintf(stderr, "%s\n", splitsnow_error_string(status));
    return status == SPLITSNOW_OK;
}

static void release(toward *prepared) {
    splitsnow_lookup_free(prepared->lookup);
    splitsnow_anisotropy_free(prepared->anisotropy);
}

/* Times look-ups toward views. Returns 0 if the files do not serve. */
static int time_views(const splitsnow *database, const splitsnow *views) {
    static double points[POINTS][7];
    static float spectrum[4096];
    static const splitsnow_axis axes[7] = {
        SPLITSNOW_FACETNESS, SPLITSNOW_GRAIN_SIZE_UM, SPLITSNOW_DENSITY_KG_M3, SPLITSNOW_THICKNESS_CM,
        SPLITSNOW_ANGLE_DEG, SPLITSNOW_VIEW_DEG,      SPLITSNOW_RELATIVE_AZIMUTH_DEG};
    static const char *const names[] = {"anisotropy factor, anywhere", "BRF, anywhere",
                                        "anisotropy factor, of one snow", "BRF, of one snow",
                                        "preparing one snow, both files"};
    double seconds[RUNS], sum = 0.0;
    toward any = {NULL, NULL}, one = {NULL, NULL};
    splitsnow_snow snow;
    size_t n;
    int failures = 0;
    scatter(views, axes, 7, points);
    splitsnow_wavelengths(views, &n);
    snow.facetness = points[0][0];
    snow.grain_size_um = points[0][1];
    snow.density_kg_m3 = points[0][2];
    if (!prepare(database, views, NULL, &any) || !prepare(database, views, &snow, &one)) return 0;
    for (int kind = 0; kind < 5; kind++) {
        int count = kind == 4 ? 256 : 4 * POINTS;
        for (int run = 0; run < RUNS; run++) {
            double begin = now();
            for (int i = 0; i < count; i++) {
                const double *p = points[i % POINTS];
                splitsnow_status status = SPLITSNOW_OK;
                splitsnow_angles angles;
                splitsnow_snow other;
                other.facetness = p[0];
                other.grain_size_um = p[1];
                other.density_kg_m3 = p[2];
                angles.incidence_angle_deg = p[4];
                angles.view_deg = p[5];
                angles.relative_azimuth_deg = p[6];
                if (kind == 0) {
                    status = splitsnow_anisotropy_factor_of(any.anisotropy, &other, p[3], &angles,
                                                            spectrum, n);
                } else if (kind == 1) {
                    status = splitsnow_directional_factor_of(any.lookup, any.anisotropy, &other, p[3],
                                                             &angles, spectrum, n);
                } else if (kind == 2) {
                    status = splitsnow_anisotropy_factor(one.anisotropy, p[3], &angles, spectrum, n);
                } else if (kind == 3) {
                    status = splitsnow_directional_factor(one.lookup, one.anisotropy, p[3], &angles,
                                                          spectrum, n);
                } else {
                    toward third = {NULL, NULL};
                    failures += !prepare(database, views, &snow, &third);
                    release(&third);
                }
                failures += status != SPLITSNOW_OK;
                sum += (double)spectrum[0];
            }
            seconds[run] = now() - begin;
        }
        report(names[kind], seconds, count);
    }
    printf("(sum %g)\n", sum);
    release(&any);
    release(&one);
    return failures == 0;
}

int main(int argc, char **argv) {
    static double points[POINTS][7];
    static float spectrum[4096];
    static const splitsnow_axis axes[5] = {SPLITSNOW_FACETNESS, SPLITSNOW_GRAIN_SIZE_UM,
                                           SPLITSNOW_DENSITY_KG_M3, SPLITSNOW_THICKNESS_CM,
                                           SPLITSNOW_ANGLE_DEG};
    static const double hero[4] = {440.0, 520.0, 600.0, 680.0};
    double seconds[RUNS], sum = 0.0;
    char message[256] = "usage: lookup_c FILE [VIEWS], where FILE and VIEWS are compact files";
    splitsnow *database, *views;
    int served = 1;
    splitsnow_lookup *any_snow, *one_snow;
    splitsnow_colour *colour;
    splitsnow_snow snow;
    size_t n;
    if (argc < 2 || argc > 3 ||
        splitsnow_open(argv[1], &database, message, sizeof message) != SPLITSNOW_OK) {
        fprintf(stderr, "%s\n", message);
        return 1;
    }
    scatter(database, axes, 5, points);
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
    if (argc == 3) {
        if (splitsnow_open(argv[2], &views, message, sizeof message) != SPLITSNOW_OK) {
            fprintf(stderr, "%s\n", message);
            return 1;
        }
        served = time_views(database, views);
        splitsnow_close(views);
    }
    splitsnow_close(database);
    return served ? 0 : 1;
}
