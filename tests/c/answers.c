/* What the header answers, for tests/c_header to compare with Rust.
 *
 *   answers points FILE QUANTITY POINTS OUT   answers at points
 *   answers views FILE VIEWS QUANTITY POINTS OUT   answers toward views
 *   answers files PACK OUT                    which files are refused
 *
 * Files of numbers hold doubles: POINTS the number of conditions and for each its axis
 * and value, then five coordinates per point, or seven with a view; OUT what `answer` or
 * `toward` writes. */
#define SPLITSNOW_IMPLEMENTATION
#include "splitsnow.h"

#define AT 6 /* wavelengths that spectra are asked at */

static void expect(int condition, const char *what) {
    if (condition) return;
    fprintf(stderr, "failed: %s\n", what);
    exit(1);
}

static void *read_whole(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    void *bytes;
    long end;
    expect(file != NULL && fseek(file, 0, SEEK_END) == 0, path);
    end = ftell(file);
    rewind(file);
    *size = (size_t)end;
    bytes = malloc(*size + 1);
    expect(bytes != NULL && fread(bytes, 1, *size, file) == *size, path);
    fclose(file);
    return bytes;
}

static void put(FILE *out, const float *values, size_t n, splitsnow_status status) {
    for (size_t i = 0; i < n; i++) {
        double value = status == SPLITSNOW_OK ? (double)values[i] : -(double)status;
        expect(fwrite(&value, sizeof value, 1, out) == 1, "writing");
    }
}

/* Per point: its spectrum from a lookup of all snow, and from one of its own; that at AT
 * wavelengths; X, Y, Z under each illuminant; linear sRGB under the first, seen at the wavelengths of
 * the file alone. Minus the
 * status instead where there is none. */
static void answer(const splitsnow *database, splitsnow_quantity quantity,
                   const splitsnow_condition *conditions, size_t n_conditions,
                   const double *points, size_t n_points, FILE *out) {
    static const double at[AT] = {100.0, 433.3, 433.4, 555.0, 700.0, 3000.0};
    splitsnow_lookup *all, *one = NULL;
    splitsnow_colour *colours[8];
    splitsnow_status prepared = SPLITSNOW_OK;
    size_t n;
    const float *nm = splitsnow_wavelengths(database, &n);
    float *spectrum = (float *)malloc(n * sizeof(float));
    double *own = (double *)malloc(n * sizeof(double));
    for (size_t l = 0; l < n; l++) own[l] = (double)nm[l];
    expect(splitsnow_prepare(database, quantity, NULL, conditions, n_conditions, &all) == SPLITSNOW_OK,
           "preparing all snow");
    for (int i = 0; i < 8; i++) {
        splitsnow_illuminant light = (splitsnow_illuminant)(i % 7);
        splitsnow_status status =
            splitsnow_colour_new(database, light, i < 7 ? NULL : own, i < 7 ? 0 : n, &colours[i]);
        expect(status == SPLITSNOW_OK || status == SPLITSNOW_ERROR_NO_COLOUR, "a colour");
    }
    for (size_t i = 0; i < n_points; i++) {
        const double *p = points + 5 * i;
        splitsnow_snow snow;
        splitsnow_status status;
        float few[AT];
        double colour[3];
        snow.facetness = p[0];
        snow.grain_size_um = p[1];
        snow.density_kg_m3 = p[2];
        status = splitsnow_spectrum_of(all, &snow, p[3], p[4], spectrum, n);
        put(out, spectrum, n, status);
        if (i == 0 || memcmp(p - 5, p, 3 * sizeof *p) != 0) {
            splitsnow_lookup_free(one);
            prepared = splitsnow_prepare(database, quantity, &snow, conditions, n_conditions, &one);
        }
        status = prepared;
        if (status == SPLITSNOW_OK) status = splitsnow_spectrum(one, p[3], p[4], spectrum, n);
        put(out, spectrum, n, status);
        if (one != NULL) status = splitsnow_spectrum_at(one, p[3], p[4], at, AT, few);
        put(out, few, AT, status);
        for (int light = 0; light < 8; light++) {
            if (one != NULL && light < 7) status = splitsnow_xyz(one, colours[light], p[3], p[4], colour);
            if (one != NULL && light == 7) {
                status = splitsnow_linear_srgb(one, colours[7], p[3], p[4], colour);
            }
            for (int c = 0; c < 3; c++) {
                double value = status == SPLITSNOW_OK ? colour[c] : -(double)status;
                expect(fwrite(&value, sizeof value, 1, out) == 1, "writing");
            }
        }
    }
    splitsnow_lookup_free(one);
    for (int i = 0; i < 8; i++) splitsnow_colour_free(colours[i]);
    splitsnow_lookup_free(all);
    free(spectrum);
    free(own);
}

static splitsnow *opened(const char *path) {
    char message[256];
    splitsnow *database;
    expect(splitsnow_open(path, &database, message, sizeof message) == SPLITSNOW_OK, message);
    return database;
}

static splitsnow_quantity named(const char *quantity) {
    return quantity[0] == 't' ? SPLITSNOW_TRANSMITTANCE : SPLITSNOW_REFLECTANCE;
}

/* Reads conditions and points; returns the points, `width` coordinates each. */
static const double *read_points(double *numbers, size_t size, size_t width,
                                 splitsnow_condition conditions[5], size_t *n_conditions, size_t *n) {
    *n_conditions = (size_t)numbers[0];
    for (size_t i = 0; i < *n_conditions; i++) {
        conditions[i].axis = (splitsnow_axis)(int)numbers[1 + 2 * i];
        conditions[i].value = numbers[2 + 2 * i];
    }
    *n = (size / sizeof(double) - 1 - 2 * *n_conditions) / width;
    return numbers + 1 + 2 * *n_conditions;
}

static void points(char **argv) {
    splitsnow *database = opened(argv[2]);
    size_t size, n_conditions, n;
    double *numbers = (double *)read_whole(argv[4], &size);
    splitsnow_condition conditions[5];
    const double *at = read_points(numbers, size, 5, conditions, &n_conditions, &n);
    FILE *out = fopen(argv[5], "wb");
    expect(out != NULL, argv[5]);
    answer(database, named(argv[3]), conditions, n_conditions, at, n, out);
    splitsnow_close(database);
    free(numbers);
    fclose(out);
}

/* Per point: its anisotropy factors from those of all snow, and from those of its own; then its
 * directional factors likewise. Minus the status instead where there are none. */
static void toward(char **argv) {
    splitsnow *database = opened(argv[2]), *views = opened(argv[3]);
    splitsnow_quantity quantity = named(argv[4]);
    splitsnow_lookup *all, *one = NULL;
    splitsnow_anisotropy *factors, *own = NULL;
    splitsnow_status prepared = SPLITSNOW_OK, found;
    size_t size, n_conditions, n_points, n;
    double *numbers = (double *)read_whole(argv[5], &size);
    splitsnow_condition conditions[5];
    const double *p = read_points(numbers, size, 7, conditions, &n_conditions, &n_points);
    FILE *out = fopen(argv[6], "wb");
    float *spectrum;
    expect(out != NULL, argv[6]);
    splitsnow_wavelengths(database, &n);
    spectrum = (float *)malloc(n * sizeof(float));
    found = splitsnow_prepare(database, quantity, NULL, conditions, n_conditions, &all);
    expect(found == SPLITSNOW_OK, "preparing all snow");
    found = splitsnow_prepare_anisotropy(views, quantity, NULL, conditions, n_conditions, &factors);
    expect(found == SPLITSNOW_OK, "preparing factors of all snow");
    for (size_t i = 0; i < n_points; i++, p += 7) {
        splitsnow_snow snow;
        splitsnow_angles angles;
        splitsnow_status status;
        snow.facetness = p[0];
        snow.grain_size_um = p[1];
        snow.density_kg_m3 = p[2];
        angles.incidence_angle_deg = p[4];
        angles.view_deg = p[5];
        angles.relative_azimuth_deg = p[6];
        if (i == 0 || memcmp(p - 7, p, 3 * sizeof *p) != 0) {
            splitsnow_lookup_free(one);
            splitsnow_anisotropy_free(own);
            prepared = splitsnow_prepare_anisotropy(views, quantity, &snow, conditions, n_conditions, &own);
            status = splitsnow_prepare(database, quantity, &snow, conditions, n_conditions, &one);
            expect(status == prepared, "the same snow is outside");
        }
        status = splitsnow_anisotropy_factor_of(factors, &snow, p[3], &angles, spectrum, n);
        put(out, spectrum, n, status);
        status = prepared;
        if (own != NULL) status = splitsnow_anisotropy_factor(own, p[3], &angles, spectrum, n);
        put(out, spectrum, n, status);
        status = splitsnow_directional_factor_of(all, factors, &snow, p[3], &angles, spectrum, n);
        put(out, spectrum, n, status);
        status = prepared;
        if (own != NULL) status = splitsnow_directional_factor(one, own, p[3], &angles, spectrum, n);
        put(out, spectrum, n, status);
    }
    splitsnow_lookup_free(one);
    splitsnow_lookup_free(all);
    splitsnow_anisotropy_free(own);
    splitsnow_anisotropy_free(factors);
    splitsnow_close(database);
    splitsnow_close(views);
    free(spectrum);
    free(numbers);
    fclose(out);
}

/* The first node of an axis, or halfway to the last. */
static double node(const splitsnow *database, splitsnow_axis axis, int half) {
    size_t count;
    const float *nodes = splitsnow_nodes(database, axis, &count);
    return (double)nodes[0] + 0.5 * half * ((double)nodes[count - 1] - (double)nodes[0]);
}

/* An accepted file of anisotropy factors answers on its first node. */
static void ask_views(const splitsnow *database, splitsnow_quantity quantity,
                      const splitsnow_condition *conditions, size_t n, float *spectrum,
                      size_t wavelengths) {
    splitsnow_anisotropy *factors;
    splitsnow_lookup *lookup;
    splitsnow_status status = splitsnow_prepare(database, quantity, NULL, conditions, n, &lookup);
    expect(status == SPLITSNOW_ERROR_CONTENT, "anisotropy factors in place of spectra");
    status = splitsnow_prepare_anisotropy(database, quantity, NULL, conditions, n, &factors);
    if (!splitsnow_has(database, quantity)) {
        expect(status == SPLITSNOW_ERROR_NO_QUANTITY, "no quantity");
        return;
    }
    expect(status == SPLITSNOW_OK, "preparing a mutated file of factors");
    for (int half = 0; half < 2; half++) {
        splitsnow_snow snow;
        splitsnow_angles angles;
        snow.facetness = node(database, SPLITSNOW_FACETNESS, half);
        snow.grain_size_um = node(database, SPLITSNOW_GRAIN_SIZE_UM, half);
        snow.density_kg_m3 = node(database, SPLITSNOW_DENSITY_KG_M3, half);
        angles.incidence_angle_deg = node(database, SPLITSNOW_ANGLE_DEG, half);
        angles.view_deg = node(database, SPLITSNOW_VIEW_DEG, half);
        angles.relative_azimuth_deg = node(database, SPLITSNOW_RELATIVE_AZIMUTH_DEG, half);
        status = splitsnow_anisotropy_factor_of(factors, &snow, node(database, SPLITSNOW_THICKNESS_CM, half),
                                                &angles, spectrum, wavelengths);
        expect(status == SPLITSNOW_OK || status == SPLITSNOW_ERROR_ABSENT,
               "a node of a mutated file of factors");
        for (size_t l = 0; l < wavelengths && status == SPLITSNOW_OK; l++) {
            expect(spectrum[l] == spectrum[l], "a number");
        }
    }
    splitsnow_anisotropy_free(factors);
}

/* An accepted file answers in [0, 1] on its first node and halfway. */
static void ask(const splitsnow *database) {
    splitsnow_condition conditions[5];
    size_t n = 0, wavelengths;
    float *spectrum;
    splitsnow_wavelengths(database, &wavelengths);
    spectrum = (float *)malloc(wavelengths * sizeof(float));
    for (int axis = SPLITSNOW_BLACK_CARBON_NG_G; axis < SPLITSNOW_VIEW_DEG; axis++) {
        size_t count;
        const float *nodes = splitsnow_nodes(database, (splitsnow_axis)axis, &count);
        if (count == 0) continue;
        conditions[n].axis = (splitsnow_axis)axis;
        conditions[n++].value = 0.5 * ((double)nodes[0] + (double)nodes[count - 1]);
    }
    for (int quantity = 0; quantity < 2; quantity++) {
        splitsnow_lookup *all;
        splitsnow_status status;
        if (splitsnow_holds_anisotropy(database)) {
            ask_views(database, (splitsnow_quantity)quantity, conditions, n, spectrum, wavelengths);
            continue;
        }
        status = splitsnow_prepare(database, (splitsnow_quantity)quantity, NULL, conditions, n, &all);
        if (!splitsnow_has(database, (splitsnow_quantity)quantity)) {
            expect(status == SPLITSNOW_ERROR_NO_QUANTITY, "no quantity");
            continue;
        }
        expect(status == SPLITSNOW_OK, "preparing a mutated file");
        for (int half = 0; half < 2; half++) {
            double p[5];
            splitsnow_snow snow;
            for (int axis = 0; axis < 5; axis++) p[axis] = node(database, (splitsnow_axis)axis, half);
            snow.facetness = p[0];
            snow.grain_size_um = p[1];
            snow.density_kg_m3 = p[2];
            status = splitsnow_spectrum_of(all, &snow, p[3], p[4], spectrum, wavelengths);
            expect(status == SPLITSNOW_OK || status == SPLITSNOW_ERROR_ABSENT || half == 1,
                   "the first node of a mutated file");
            for (size_t l = 0; l < wavelengths && status == SPLITSNOW_OK; l++) {
                expect(spectrum[l] >= 0.0f && spectrum[l] <= 1.0f, "a value in [0, 1]");
            }
        }
        splitsnow_lookup_free(all);
    }
    free(spectrum);
}

/* PACK: per file 8 bytes of size, then the file. OUT: a line per file, `ok` or why not. */
static void files(char **argv) {
    size_t size, at = 0;
    unsigned char *pack = (unsigned char *)read_whole(argv[2], &size);
    FILE *out = fopen(argv[3], "wb");
    expect(out != NULL, argv[3]);
    while (at < size) {
        char message[256];
        splitsnow *database;
        size_t length = 0;
        unsigned char *bytes;
        splitsnow_status status;
        for (int i = 7; i >= 0; i--) length = length << 8 | pack[at + (size_t)i];
        /* a copy, so that reading past its end is seen */
        bytes = (unsigned char *)malloc(length > 0 ? length : 1);
        memcpy(bytes, pack + at + 8, length);
        at += 8 + length;
        status = splitsnow_open_memory(bytes, length, &database, message, sizeof message);
        free(bytes);
        expect((status == SPLITSNOW_OK) == (database != NULL), "a database or an error");
        expect(status == SPLITSNOW_OK || strlen(message) > 10, "a message");
        fprintf(out, "%s\n", status == SPLITSNOW_OK ? "ok" : message);
        if (database != NULL) ask(database);
        splitsnow_close(database);
    }
    free(pack);
    fclose(out);
}

int main(int argc, char **argv) {
    expect(argc > 1, "arguments");
    if (strcmp(argv[1], "points") == 0 && argc == 6) points(argv);
    else if (strcmp(argv[1], "views") == 0 && argc == 7) toward(argv);
    else if (strcmp(argv[1], "files") == 0 && argc == 4) files(argv);
    else expect(0, "arguments");
    return 0;
}
