/* What the header answers, for tests/c_header to compare with Rust.
 *
 *   answers points FILE QUANTITY POINTS OUT   answers at points
 *   answers files PACK OUT                    which files are refused
 *
 * Files of numbers hold doubles: POINTS the number of conditions and for each its axis
 * and value, then five coordinates per point; OUT what `answer` writes. */
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

static void points(char **argv) {
    char message[256];
    splitsnow *database;
    size_t size, n_conditions;
    double *numbers = (double *)read_whole(argv[4], &size);
    splitsnow_condition conditions[5];
    FILE *out = fopen(argv[5], "wb");
    expect(out != NULL, argv[5]);
    expect(splitsnow_open(argv[2], &database, message, sizeof message) == SPLITSNOW_OK, message);
    n_conditions = (size_t)numbers[0];
    for (size_t i = 0; i < n_conditions; i++) {
        conditions[i].axis = (splitsnow_axis)(int)numbers[1 + 2 * i];
        conditions[i].value = numbers[2 + 2 * i];
    }
    size = size / sizeof(double) - 1 - 2 * n_conditions;
    answer(database, argv[3][0] == 't' ? SPLITSNOW_TRANSMITTANCE : SPLITSNOW_REFLECTANCE, conditions,
           n_conditions, numbers + 1 + 2 * n_conditions, size / 5, out);
    splitsnow_close(database);
    free(numbers);
    fclose(out);
}

/* An accepted file answers in [0, 1] on its first node and halfway. */
static void ask(const splitsnow *database) {
    splitsnow_condition conditions[5];
    size_t n = 0, wavelengths;
    float *spectrum;
    splitsnow_wavelengths(database, &wavelengths);
    spectrum = (float *)malloc(wavelengths * sizeof(float));
    for (int axis = SPLITSNOW_BLACK_CARBON_NG_G; axis < SPLITSNOW_AXES; axis++) {
        size_t count;
        const float *nodes = splitsnow_nodes(database, (splitsnow_axis)axis, &count);
        if (count == 0) continue;
        conditions[n].axis = (splitsnow_axis)axis;
        conditions[n++].value = 0.5 * ((double)nodes[0] + (double)nodes[count - 1]);
    }
    for (int quantity = 0; quantity < 2; quantity++) {
        splitsnow_lookup *all;
        splitsnow_status status = splitsnow_prepare(database, (splitsnow_quantity)quantity, NULL,
                                                    conditions, n, &all);
        if (!splitsnow_has(database, (splitsnow_quantity)quantity)) {
            expect(status == SPLITSNOW_ERROR_NO_QUANTITY, "no quantity");
            continue;
        }
        expect(status == SPLITSNOW_OK, "preparing a mutated file");
        for (int half = 0; half < 2; half++) {
            double p[5];
            splitsnow_snow snow;
            for (int axis = 0; axis < 5; axis++) {
                size_t count;
                const float *nodes = splitsnow_nodes(database, (splitsnow_axis)axis, &count);
                p[axis] = (double)nodes[0] + 0.5 * half * ((double)nodes[count - 1] - (double)nodes[0]);
            }
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
    else if (strcmp(argv[1], "files") == 0 && argc == 4) files(argv);
    else expect(0, "arguments");
    return 0;
}
