/* What include/splitsnow.h refuses of its arguments, its getters and its tables.
 * Usage: arguments PLAIN BEYOND THICK VIEWS FOLDER, files of tests/c_header. */
#define SPLITSNOW_IMPLEMENTATION
#include "splitsnow.h"

#define EXPECT(condition) expect(condition, #condition, __LINE__)

static void expect(int condition, const char *what, int line) {
    if (condition) return;
    fprintf(stderr, "line %d failed: %s\n", line, what);
    exit(1);
}

static const splitsnow_snow SNOW = {0.3, 200.0, 300.0};

static splitsnow *opened(const char *path) {
    char message[256];
    splitsnow *database;
    splitsnow_open(path, &database, message, sizeof message);
    expect(database != NULL, message, __LINE__);
    return database;
}

static void opening(const char *plain, const char *folder) {
    splitsnow *database;
    char message[256], few[5];
    EXPECT(splitsnow_open(plain, NULL, NULL, 0) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_open(NULL, &database, NULL, 0) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_open_memory(NULL, 1, &database, NULL, 0) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_open_memory(NULL, 0, &database, NULL, 0) == SPLITSNOW_ERROR_FORMAT);
    EXPECT(splitsnow_open("not there", &database, message, sizeof message) == SPLITSNOW_ERROR_IO);
    EXPECT(database == NULL && strlen(message) > 0);
    EXPECT(splitsnow_open(folder, &database, message, sizeof message) == SPLITSNOW_ERROR_FORMAT);
    EXPECT(strcmp(message, "it is not a regular file") == 0);
    EXPECT(splitsnow_open_memory("abc", 3, &database, few, sizeof few) == SPLITSNOW_ERROR_FORMAT);
    EXPECT(strcmp(few, "it i") == 0);
    splitsnow_close(NULL);
    splitsnow_lookup_free(NULL);
    splitsnow_colour_free(NULL);
    splitsnow_anisotropy_free(NULL);
}

static void getters(const splitsnow *database) {
    size_t n;
    const float *nodes = splitsnow_nodes(database, SPLITSNOW_ANGLE_DEG, &n);
    EXPECT(n == 5 && nodes[1] == 30.0f);
    EXPECT(splitsnow_nodes(database, SPLITSNOW_SPHERICITY, &n) == NULL && n == 0);
    EXPECT(splitsnow_nodes(database, SPLITSNOW_AXES, &n) == NULL && n == 0);
    EXPECT(splitsnow_wavelengths(database, &n)[30] == 700.0f && n == 31);
    EXPECT(splitsnow_has(database, SPLITSNOW_REFLECTANCE));
    EXPECT(strcmp(splitsnow_metadata(database, "provenance"), "{}") == 0);
    EXPECT(splitsnow_metadata(database, "nothing") == NULL);
    EXPECT(strcmp(splitsnow_axis_name(SPLITSNOW_WATER_SATURATION), "water_saturation") == 0);
    for (int status = 0; status <= SPLITSNOW_ERROR_MISMATCH; status++) {
        EXPECT(strlen(splitsnow_error_string((splitsnow_status)status)) > 5);
        EXPECT(strcmp(splitsnow_error_string((splitsnow_status)status), "unknown status") != 0);
    }
    EXPECT(SPLITSNOW_SUBSTRATE_REFLECTANCE == 10 && SPLITSNOW_VIEW_DEG == 11);
}

static void queries(const splitsnow *database) {
    const double nan = NAN, nm[2] = {450.0, 500.0}, bad[2] = {500.0, 450.0};
    splitsnow_lookup *all, *one;
    splitsnow_colour *colour;
    float spectrum[31];
    double xyz[3];
    splitsnow_snow other = SNOW;
    const splitsnow_condition condition = {SPLITSNOW_SPHERICITY, 0.8};
    EXPECT(splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, NULL, &condition, 1, &all) ==
           SPLITSNOW_ERROR_NO_AXIS);
    EXPECT(splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, NULL, NULL, 0, &all) == SPLITSNOW_OK);
    EXPECT(splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, &SNOW, NULL, 0, &one) == SPLITSNOW_OK);
    EXPECT(splitsnow_spectrum(all, 5.0, 0.0, spectrum, 31) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_spectrum(one, 5.0, 0.0, spectrum, 30) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_spectrum(one, 5.0, 89.1, spectrum, 31) == SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(splitsnow_spectrum(one, nan, 0.0, spectrum, 31) == SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(splitsnow_spectrum(one, 5.0, nan, spectrum, 31) == SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(splitsnow_spectrum(one, -1e-3, 0.0, spectrum, 31) == SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(splitsnow_spectrum(one, 0.0, 0.0, spectrum, 31) == SPLITSNOW_OK && spectrum[7] == 1.0f);
    EXPECT(splitsnow_spectrum_of(one, &SNOW, 5.0, 0.0, spectrum, 31) == SPLITSNOW_OK);
    EXPECT(splitsnow_spectrum_at(one, 5.0, 0.0, &nan, 1, spectrum) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_spectrum_at(one, 5.0, 0.0, NULL, 0, NULL) == SPLITSNOW_OK);
    other.density_kg_m3 = nan;
    EXPECT(splitsnow_spectrum_of(all, &other, 5.0, 0.0, spectrum, 31) == SPLITSNOW_ERROR_OUTSIDE);
    splitsnow_lookup_free(all);
    EXPECT(splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, &other, NULL, 0, &all) ==
           SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(all == NULL);
    EXPECT(splitsnow_colour_new(database, SPLITSNOW_E, bad, 2, &colour) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_colour_new(database, SPLITSNOW_E, nm, 2, &colour) == SPLITSNOW_ERROR_NO_COLOUR);
    EXPECT(splitsnow_xyz(one, NULL, 5.0, 0.0, xyz) == SPLITSNOW_ERROR_ARGUMENT);
    splitsnow_lookup_free(one);
}

static void conditions(const splitsnow *database) {
    splitsnow_condition all[5] = {{SPLITSNOW_SUBSTRATE_REFLECTANCE, 0.25},
                                  {SPLITSNOW_BLACK_CARBON_NG_G, 30.0},
                                  {SPLITSNOW_SPHERICITY, 0.7},
                                  {SPLITSNOW_TEMPERATURE_C, -7.0},
                                  {SPLITSNOW_WATER_SATURATION, 0.02}};
    splitsnow_lookup *lookup;
    const splitsnow_quantity quantity = SPLITSNOW_TRANSMITTANCE;
    EXPECT(splitsnow_prepare(database, quantity, NULL, all, 5, &lookup) == SPLITSNOW_OK);
    splitsnow_lookup_free(lookup);
    /* an axis of one node may be left out */
    EXPECT(splitsnow_prepare(database, quantity, NULL, all + 1, 4, &lookup) == SPLITSNOW_OK);
    splitsnow_lookup_free(lookup);
    EXPECT(splitsnow_prepare(database, quantity, NULL, all, 4, &lookup) == SPLITSNOW_ERROR_CONDITION);
    EXPECT(splitsnow_prepare(database, quantity, NULL, NULL, 1, &lookup) == SPLITSNOW_ERROR_ARGUMENT);
    all[0] = all[1];
    EXPECT(splitsnow_prepare(database, quantity, NULL, all, 5, &lookup) == SPLITSNOW_ERROR_ARGUMENT);
    all[0].axis = SPLITSNOW_ANGLE_DEG;
    EXPECT(splitsnow_prepare(database, quantity, NULL, all, 5, &lookup) == SPLITSNOW_ERROR_ARGUMENT);
    all[1].value = NAN;
    EXPECT(splitsnow_prepare(database, quantity, NULL, all + 1, 4, &lookup) == SPLITSNOW_ERROR_OUTSIDE);
    all[1].value = 200.1;
    EXPECT(splitsnow_prepare(database, quantity, NULL, all + 1, 4, &lookup) == SPLITSNOW_ERROR_OUTSIDE);
}

static void one_thickness(const splitsnow *database) {
    splitsnow_lookup *lookup;
    splitsnow_colour *colour;
    float value;
    EXPECT(splitsnow_prepare(database, SPLITSNOW_REFLECTANCE, &SNOW, NULL, 0, &lookup) ==
           SPLITSNOW_ERROR_NO_QUANTITY);
    EXPECT(splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, &SNOW, NULL, 0, &lookup) == SPLITSNOW_OK);
    EXPECT(splitsnow_spectrum(lookup, 15.0, 30.0, &value, 1) == SPLITSNOW_OK);
    EXPECT(splitsnow_spectrum(lookup, 14.0, 30.0, &value, 1) == SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(splitsnow_spectrum(lookup, 15.0, 29.0, &value, 1) == SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(splitsnow_colour_new(database, SPLITSNOW_D65, NULL, 0, &colour) == SPLITSNOW_ERROR_NO_COLOUR);
    splitsnow_lookup_free(lookup);
}

static void directions(const splitsnow *plain, const splitsnow *views) {
    const splitsnow_quantity r = SPLITSNOW_REFLECTANCE;
    const splitsnow_condition view = {SPLITSNOW_VIEW_DEG, 0.0};
    const splitsnow_angles angles = {30.0, 41.7, 90.0};
    const splitsnow_snow other = {0.3, 201.0, 300.0};
    splitsnow_angles bad = angles;
    splitsnow_lookup *all, *one, *through;
    splitsnow_anisotropy *factors, *own, *moved;
    float spectrum[31], product[31], whole[31];
    EXPECT(splitsnow_holds_anisotropy(views) && !splitsnow_holds_anisotropy(plain));
    EXPECT(splitsnow_prepare(views, r, NULL, NULL, 0, &all) == SPLITSNOW_ERROR_CONTENT && all == NULL);
    EXPECT(splitsnow_prepare_anisotropy(plain, r, NULL, NULL, 0, &own) == SPLITSNOW_ERROR_CONTENT);
    EXPECT(own == NULL);
    EXPECT(splitsnow_prepare_anisotropy(views, r, NULL, NULL, 0, NULL) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_prepare_anisotropy(NULL, r, NULL, NULL, 0, &own) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_prepare_anisotropy(views, r, NULL, NULL, 1, &own) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_prepare_anisotropy(views, r, NULL, &view, 1, &own) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_prepare(plain, r, NULL, NULL, 0, &all) == SPLITSNOW_OK);
    EXPECT(splitsnow_prepare(plain, r, &SNOW, NULL, 0, &one) == SPLITSNOW_OK);
    EXPECT(splitsnow_prepare(plain, SPLITSNOW_TRANSMITTANCE, &SNOW, NULL, 0, &through) == SPLITSNOW_OK);
    EXPECT(splitsnow_prepare_anisotropy(views, r, NULL, NULL, 0, &factors) == SPLITSNOW_OK);
    EXPECT(splitsnow_prepare_anisotropy(views, r, &SNOW, NULL, 0, &own) == SPLITSNOW_OK);
    EXPECT(splitsnow_prepare_anisotropy(views, r, &other, NULL, 0, &moved) == SPLITSNOW_OK);
    EXPECT(splitsnow_anisotropy_factor(factors, 5.0, &angles, spectrum, 31) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_anisotropy_factor(own, 5.0, &angles, spectrum, 30) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_anisotropy_factor(own, 5.0, NULL, spectrum, 31) == SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_anisotropy_factor_of(factors, NULL, 5.0, &angles, spectrum, 31) ==
           SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_directional_factor(one, factors, 5.0, &angles, spectrum, 31) ==
           SPLITSNOW_ERROR_ARGUMENT);
    EXPECT(splitsnow_directional_factor(all, own, 5.0, &angles, spectrum, 31) == SPLITSNOW_ERROR_MISMATCH);
    EXPECT(splitsnow_directional_factor(one, moved, 5.0, &angles, spectrum, 31) ==
           SPLITSNOW_ERROR_MISMATCH);
    EXPECT(splitsnow_directional_factor(through, own, 5.0, &angles, spectrum, 31) ==
           SPLITSNOW_ERROR_MISMATCH);
    EXPECT(splitsnow_directional_factor_of(one, factors, &SNOW, 5.0, &angles, spectrum, 31) ==
           SPLITSNOW_ERROR_MISMATCH);
    EXPECT(splitsnow_anisotropy_factor(own, 5.0, &angles, spectrum, 31) == SPLITSNOW_OK);
    EXPECT(splitsnow_spectrum(one, 5.0, 30.0, whole, 31) == SPLITSNOW_OK);
    EXPECT(splitsnow_directional_factor(one, own, 5.0, &angles, product, 31) == SPLITSNOW_OK);
    for (int l = 0; l < 31; l++) EXPECT(product[l] == spectrum[l] * whole[l]);
    EXPECT(splitsnow_directional_factor_of(all, factors, &SNOW, 5.0, &angles, product, 31) ==
           SPLITSNOW_OK);
    EXPECT(splitsnow_anisotropy_factor(own, -1.0, &angles, spectrum, 31) == SPLITSNOW_ERROR_OUTSIDE);
    bad.view_deg = 80.1;
    EXPECT(splitsnow_anisotropy_factor(own, 5.0, &bad, spectrum, 31) == SPLITSNOW_ERROR_OUTSIDE);
    bad = angles;
    bad.relative_azimuth_deg = NAN;
    EXPECT(splitsnow_anisotropy_factor(own, 5.0, &bad, spectrum, 31) == SPLITSNOW_ERROR_OUTSIDE);
    splitsnow_lookup_free(all);
    splitsnow_lookup_free(one);
    splitsnow_lookup_free(through);
    splitsnow_anisotropy_free(factors);
    splitsnow_anisotropy_free(own);
    splitsnow_anisotropy_free(moved);
}

/* Texels are the colours at the coordinates that the header tells, and straight lines
 * between them are near the colours there. */
static void tables(const splitsnow *database) {
    enum { ROWS = 64, COLUMNS = 32 };
    static float table[ROWS][COLUMNS][3];
    const double degree = acos(-1.0) / 180.0, c0 = 1.0, c1 = cos(89.0 * degree);
    const double v0 = log(1.0 + 2.0 * 0.1), v1 = log(1.0 + 2.0 * 50.0);
    splitsnow_lookup *lookup;
    splitsnow_colour *colour;
    double worst = 0.0;
    EXPECT(splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, &SNOW, NULL, 0, &lookup) == SPLITSNOW_OK);
    EXPECT(splitsnow_colour_new(database, SPLITSNOW_D65, NULL, 0, &colour) == SPLITSNOW_OK);
    EXPECT(splitsnow_rgb_table(lookup, colour, 0.1, 50.0, ROWS, COLUMNS, &table[0][0][0]) == SPLITSNOW_OK);
    for (int i = 0; i < 2 * ROWS - 1; i++) {
        double h = 0.5 * (exp(v0 + 0.5 * i / (ROWS - 1) * (v1 - v0)) - 1.0);
        for (int j = 0; j < 2 * COLUMNS - 1; j++) {
            double a = acos(c1 + 0.5 * j / (COLUMNS - 1) * (c0 - c1)) / degree, rgb[3];
            EXPECT(splitsnow_linear_srgb(lookup, colour, h, a < 89.0 ? a : 89.0, rgb) == SPLITSNOW_OK);
            for (int c = 0; c < 3; c++) {
                double texel = 0.25 * ((double)table[i / 2][j / 2][c] + (double)table[(i + 1) / 2][j / 2][c] +
                                       (double)table[i / 2][(j + 1) / 2][c] +
                                       (double)table[(i + 1) / 2][(j + 1) / 2][c]);
                double error = fabs(texel - rgb[c]);
                if (i % 2 == 0 && j % 2 == 0) EXPECT(error < 1e-6);
                if (error > worst) worst = error;
            }
        }
    }
    printf("between texels at most %.5f off\n", worst);
    EXPECT(worst < 0.01);
    EXPECT(splitsnow_rgb_table(lookup, colour, -1.0, 50.0, 2, 2, &table[0][0][0]) == SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(splitsnow_rgb_table(lookup, colour, NAN, 50.0, 2, 2, &table[0][0][0]) == SPLITSNOW_ERROR_OUTSIDE);
    EXPECT(splitsnow_rgb_table(lookup, colour, 1.0, 50.0, 1, 2, &table[0][0][0]) == SPLITSNOW_ERROR_ARGUMENT);
    splitsnow_colour_free(colour);
    splitsnow_lookup_free(lookup);
}

int main(int argc, char **argv) {
    splitsnow *plain, *beyond, *thick, *views;
    EXPECT(argc == 6);
    opening(argv[1], argv[5]);
    plain = opened(argv[1]);
    beyond = opened(argv[2]);
    thick = opened(argv[3]);
    views = opened(argv[4]);
    getters(plain);
    queries(plain);
    conditions(beyond);
    one_thickness(thick);
    directions(plain, views);
    tables(plain);
    splitsnow_close(plain);
    splitsnow_close(beyond);
    splitsnow_close(thick);
    splitsnow_close(views);
    return 0;
}
