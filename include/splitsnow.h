/* SPLITSnow in C99 and C++17: look-ups in a compact file (`snow.safetensors`), and toward views
 * in a file of anisotropy factors (`views.safetensors`).
 *
 * A single header that depends only on libc and libm. Define SPLITSNOW_IMPLEMENTATION in
 * one source file before including it there; elsewhere include it without the definition.
 * docs/c.md has examples, docs/formats.md describes the file, docs/methods.md the method,
 * which is `smooth`. Results agree with the Rust library to 1e-6.
 *
 * Databases and all prepared objects are immutable, so any number of threads may share one.
 * Queries do not allocate, and there is no global state. Files are treated as untrusted
 * input: invalid bytes are refused.
 *
 * Licensed under MIT OR Apache-2.0, at your choice. */
#ifndef SPLITSNOW_H
#define SPLITSNOW_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Status returned by a function. */
typedef enum splitsnow_status {
    SPLITSNOW_OK = 0,
    SPLITSNOW_ERROR_IO,          /* the file cannot be read */
    SPLITSNOW_ERROR_MEMORY,      /* out of memory */
    SPLITSNOW_ERROR_FORMAT,      /* the file is not a compact file that this version can read */
    SPLITSNOW_ERROR_ARGUMENT,    /* an invalid argument */
    SPLITSNOW_ERROR_NO_QUANTITY, /* the file does not hold the quantity */
    SPLITSNOW_ERROR_NO_AXIS,     /* a condition on an axis that is not in the file */
    SPLITSNOW_ERROR_CONDITION,   /* no value is given for an optional axis with several nodes */
    SPLITSNOW_ERROR_OUTSIDE,     /* a coordinate is outside the database, or NaN */
    SPLITSNOW_ERROR_TOO_LARGE,   /* the look-up table would exceed 1 GB */
    SPLITSNOW_ERROR_NO_COLOUR,   /* the wavelengths have no colour under the illuminant */
    SPLITSNOW_ERROR_ABSENT,      /* a surrounding curve does not exist: grains do not fit the slab */
    SPLITSNOW_ERROR_CONTENT,     /* anisotropy factors instead of reflectance and transmittance, or
                                  * the other way round */
    SPLITSNOW_ERROR_MISMATCH     /* two objects that do not belong together */
} splitsnow_status;

/* Quantity of a spectrum; values are in [0, 1]. In a file of anisotropy factors: of transmitted
 * or of reflected light. */
typedef enum splitsnow_quantity {
    SPLITSNOW_TRANSMITTANCE = 0,
    SPLITSNOW_REFLECTANCE = 1
} splitsnow_quantity;

/* Axes. Every file has the first five; the others are optional. Files of anisotropy factors
 * have both axes of the view, other files have neither. The blocks between marks
 * are generated from crates/lookup/src/parameter (tests/c_header/parameters.rs). */
/* <axes> */
typedef enum splitsnow_axis {
    SPLITSNOW_FACETNESS = 0, /* mean facetness of the grains */
    SPLITSNOW_GRAIN_SIZE_UM, /* mean length of the grains' major axis, um */
    SPLITSNOW_DENSITY_KG_M3, /* density of the dry snow, kg m-3 */
    SPLITSNOW_THICKNESS_CM, /* thickness of the slab, cm */
    SPLITSNOW_ANGLE_DEG, /* polar angle of incidence from the surface normal, degree */
    SPLITSNOW_BLACK_CARBON_NG_G, /* mass of black carbon per mass of snow, ng g-1 */
    SPLITSNOW_ABSORBER_UG_G, /* mass of the listed absorber per mass of snow, ug g-1 */
    SPLITSNOW_WATER_SATURATION, /* share of the pore space that is water */
    SPLITSNOW_TEMPERATURE_C, /* temperature of the snow, degC */
    SPLITSNOW_SPHERICITY, /* mean sphericity of the grains */
    SPLITSNOW_SUBSTRATE_REFLECTANCE, /* Lambertian reflectance of the substrate */
    SPLITSNOW_VIEW_DEG, /* angle of the view from the surface normal, degree */
    SPLITSNOW_RELATIVE_AZIMUTH_DEG, /* azimuth of the view relative to the direction in which the light travels; 0 is forward, 180 back toward the light, degree */
    SPLITSNOW_AXES /* number of axes */
} splitsnow_axis;
/* </axes> */

/* Illuminants for colours. */
typedef enum splitsnow_illuminant {
    SPLITSNOW_D55 = 0,
    SPLITSNOW_D65,
    SPLITSNOW_E,
    SPLITSNOW_FL3_15,
    SPLITSNOW_LED_B5,
    SPLITSNOW_A,
    SPLITSNOW_D50
} splitsnow_illuminant;

/* The snow of a slab, in the units of the axes. */
typedef struct splitsnow_snow {
    double facetness;
    double grain_size_um;
    double density_kg_m3;
} splitsnow_snow;

/* A value on an optional axis. */
typedef struct splitsnow_condition {
    splitsnow_axis axis;
    double value;
} splitsnow_condition;

/* Directions of the light and of the view, degree. */
typedef struct splitsnow_angles {
    double incidence_angle_deg;  /* as in splitsnow_spectrum; 0 under diffuse light */
    double view_deg;             /* angle of the view from the surface normal */
    double relative_azimuth_deg; /* 0 is forward, 180 back toward the light; any finite angle, without
                                  * effect under diffuse light */
} splitsnow_angles;

typedef struct splitsnow splitsnow;                       /* a validated file in memory */
typedef struct splitsnow_lookup splitsnow_lookup;         /* one quantity, prepared for queries */
typedef struct splitsnow_anisotropy splitsnow_anisotropy; /* its anisotropy factors, prepared */
typedef struct splitsnow_colour splitsnow_colour;         /* an observer under an illuminant */

/* Reads the file at `path`. On an error `*database` is NULL and `message` (of
 * `message_size` bytes; may be NULL) describes the error. */
splitsnow_status splitsnow_open(const char *path, splitsnow **database, char *message,
                                size_t message_size);

/* Reads the content of a file from memory; `bytes` may be freed afterwards. */
splitsnow_status splitsnow_open_memory(const void *bytes, size_t size, splitsnow **database,
                                       char *message, size_t message_size);

/* Frees a database (or NULL); the objects prepared from it stay valid. */
void splitsnow_close(splitsnow *database);

/* Nodes of an axis, strictly increasing, and their number; NULL and 0 if the axis is not
 * in the file. Valid as long as the database. */
const float *splitsnow_nodes(const splitsnow *database, splitsnow_axis axis, size_t *count);

/* Wavelengths of a spectrum, nm, strictly increasing, and their number. Valid as long as
 * the database. */
const float *splitsnow_wavelengths(const splitsnow *database, size_t *count);

/* Whether the file holds the quantity. */
int splitsnow_has(const splitsnow *database, splitsnow_quantity quantity);

/* Whether the file holds anisotropy factors instead of reflectance and transmittance. */
int splitsnow_holds_anisotropy(const splitsnow *database);

/* Whether the slab lies on a black substrate, with no other layers. Queries then extend
 * down to thickness 0; otherwise they start at the first node. */
int splitsnow_has_black_substrate(const splitsnow *database);

#if defined(__GNUC__)
#define SPLITSNOW_DEPRECATED __attribute__((deprecated))
#elif defined(_MSC_VER)
#define SPLITSNOW_DEPRECATED __declspec(deprecated)
#else
#define SPLITSNOW_DEPRECATED
#endif

/* Deprecated: the former name of splitsnow_has_black_substrate. */
SPLITSNOW_DEPRECATED static inline int splitsnow_stands_free(const splitsnow *database) {
    return splitsnow_has_black_substrate(database);
}

/* A metadata value (`error_budget`, `provenance`, ...); NULL if the key is missing. */
const char *splitsnow_metadata(const splitsnow *database, const char *key);

/* Name of an axis in files. */
const char *splitsnow_axis_name(splitsnow_axis axis);

/* Description of a status. */
const char *splitsnow_error_string(splitsnow_status status);

/* Prepares queries of one quantity of one `snow` at any thickness and angle, in about a
 * millisecond. If `snow` is NULL it prepares queries of any snow within the axes, as long
 * as the table takes at most 1 GB. `conditions` (may be NULL if there are none) hold the
 * values on optional axes; an axis with a single node needs none. */
splitsnow_status splitsnow_prepare(const splitsnow *database, splitsnow_quantity quantity,
                                   const splitsnow_snow *snow,
                                   const splitsnow_condition *conditions, size_t n_conditions,
                                   splitsnow_lookup **lookup);

/* Frees a lookup (or NULL). */
void splitsnow_lookup_free(splitsnow_lookup *lookup);

/* The spectrum of a lookup of one snow at the `n` wavelengths of the database.
 *
 * The thickness may be any value from 0 if the substrate is black
 * (splitsnow_has_black_substrate), otherwise any value from its first node; if the file has a
 * single thickness, it must be that one. The incidence angle must be within its axis. For other values and for NaN the
 * status is SPLITSNOW_ERROR_OUTSIDE. A value within a relative 1e-6 of an end counts as
 * the end. */
splitsnow_status splitsnow_spectrum(const splitsnow_lookup *lookup, double thickness_cm,
                                    double incidence_angle_deg, float *spectrum, size_t n);

/* The spectrum of any snow, from a lookup prepared with `snow` NULL. */
splitsnow_status splitsnow_spectrum_of(const splitsnow_lookup *lookup, const splitsnow_snow *snow,
                                       double thickness_cm, double incidence_angle_deg, float *spectrum,
                                       size_t n);

/* The spectrum of a lookup of one snow at any `n` wavelengths, interpolated linearly
 * between those of the file and constant beyond its ends. Computes only the wavelengths
 * needed. */
splitsnow_status splitsnow_spectrum_at(const splitsnow_lookup *lookup, double thickness_cm,
                                       double incidence_angle_deg, const double *wavelength_nm, size_t n,
                                       float *spectrum);

/* The CIE 1931 2-degree observer under an illuminant. Spectra are interpolated linearly
 * between the wavelengths of the database and summed with the trapezoidal rule over `n`
 * wavelengths (nm, strictly increasing), or, if `wavelength_nm` is NULL, over those of the
 * database and every 5 nm between. */
splitsnow_status splitsnow_colour_new(const splitsnow *database, splitsnow_illuminant illuminant,
                                      const double *wavelength_nm, size_t n,
                                      splitsnow_colour **colour);

/* Frees a colour (or NULL). */
void splitsnow_colour_free(splitsnow_colour *colour);

/* Tristimulus values of one snow under the illuminant, scaled so that a spectrum of 1 has
 * Y = 1. Sums are in single precision; for 31 wavelengths they differ from sums in double
 * precision by less than 5e-7 of the largest value. */
splitsnow_status splitsnow_xyz(const splitsnow_lookup *lookup, const splitsnow_colour *colour,
                               double thickness_cm, double incidence_angle_deg, double xyz[3]);

/* Linear sRGB, not clamped; a spectrum of 1 is (1, 1, 1) under any illuminant. */
splitsnow_status splitsnow_linear_srgb(const splitsnow_lookup *lookup,
                                       const splitsnow_colour *colour, double thickness_cm,
                                       double incidence_angle_deg, double rgb[3]);

/* A table of linear sRGB of one snow for a texture: row-major [n_thickness][n_angle][3],
 * with at least 2 rows and columns. With v = row / (n_thickness - 1) and
 * u = column / (n_angle - 1):
 *   ln(1 + 2 thickness) = ln(1 + 2 first_cm) + v (ln(1 + 2 last_cm) - ln(1 + 2 first_cm)),
 *   cos(angle) = c1 + u (c0 - c1), where c0 and c1 are the cosines of the first and last
 *   node. */
splitsnow_status splitsnow_rgb_table(const splitsnow_lookup *lookup,
                                     const splitsnow_colour *colour, double first_cm,
                                     double last_cm, size_t n_thickness, size_t n_angle,
                                     float *rgb);

/* ---- Toward views ----
 *
 * The anisotropy factor of reflected light is the reflectance factor toward a view over the
 * reflectance; that of transmitted light, which leaves into the substrate, is defined in the
 * same way. The terms are those of Schaepman-Strub et al. (2006). */

/* Prepares queries of the anisotropy factors of one quantity. `database` is a file of
 * anisotropy factors; the other arguments are those of splitsnow_prepare, but there is no limit
 * of 1 GB. */
splitsnow_status splitsnow_prepare_anisotropy(const splitsnow *database, splitsnow_quantity quantity,
                                              const splitsnow_snow *snow,
                                              const splitsnow_condition *conditions,
                                              size_t n_conditions,
                                              splitsnow_anisotropy **anisotropy);

/* Frees anisotropy factors (or NULL). */
void splitsnow_anisotropy_free(splitsnow_anisotropy *anisotropy);

/* The anisotropy factors of one snow at the `n` wavelengths of the file.
 *
 * The thickness may be any value from 0; beyond its first and its last node the factors stay
 * constant. The other coordinates must be within their axes. For other values and for NaN the
 * status is SPLITSNOW_ERROR_OUTSIDE. A value within a relative 1e-6 of an end counts as the
 * end. */
splitsnow_status splitsnow_anisotropy_factor(const splitsnow_anisotropy *anisotropy,
                                             double thickness_cm, const splitsnow_angles *angles,
                                             float *spectrum, size_t n);

/* The anisotropy factors of any snow, prepared with `snow` NULL. */
splitsnow_status splitsnow_anisotropy_factor_of(const splitsnow_anisotropy *anisotropy,
                                                const splitsnow_snow *snow, double thickness_cm,
                                                const splitsnow_angles *angles, float *spectrum,
                                                size_t n);

/* The reflectance factor toward a view, or the transmittance factor, of one snow at the `n`
 * wavelengths: the anisotropy factor times the reflectance, or the transmittance. Under
 * collimated light these are the bidirectional factors (BRF, BTF), under diffuse light the
 * hemispherical-directional ones (HDRF, HDTF). The radiance is the factor times the
 * irradiance over pi.
 *
 * `lookup` and `anisotropy` must have been prepared for one quantity, with the same snow and
 * conditions, from two files with the same wavelengths and axes; otherwise the status is
 * SPLITSNOW_ERROR_MISMATCH. The coordinates must be within both files. */
splitsnow_status splitsnow_directional_factor(const splitsnow_lookup *lookup,
                                              const splitsnow_anisotropy *anisotropy,
                                              double thickness_cm, const splitsnow_angles *angles,
                                              float *spectrum, size_t n);

/* The same factors of any snow, if both were prepared with `snow` NULL. */
splitsnow_status splitsnow_directional_factor_of(const splitsnow_lookup *lookup,
                                                 const splitsnow_anisotropy *anisotropy,
                                                 const splitsnow_snow *snow, double thickness_cm,
                                                 const splitsnow_angles *angles, float *spectrum,
                                                 size_t n);

#ifdef __cplusplus
}
#endif
#endif /* SPLITSNOW_H */

#ifdef SPLITSNOW_IMPLEMENTATION
#ifndef SPLITSNOW_IMPLEMENTED
#define SPLITSNOW_IMPLEMENTED

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined(__unix__) || defined(__APPLE__)
#include <sys/stat.h>
#endif

#define SPLITSNOW__MAX_HEADER ((uint64_t)16 << 20)
#define SPLITSNOW__MAX_NUMBER 1e9f
#define SPLITSNOW__MAX_TABLE ((size_t)1 << 30)
#define SPLITSNOW__MAX_DEPTH 127 /* nesting depth of JSON containers */
#define SPLITSNOW__FEW 64        /* components summed at a time */
#define SPLITSNOW__THIN 7        /* extra nodes below the first thickness */
/* Largest y taken from spectra of a `linear` file, and up to which slopes of a `log` file are limited. */
#define SPLITSNOW__DARKEST 16.0f

/* ---- A file in memory ---- */

/* A string that may contain zero bytes and is followed by one. */
typedef struct splitsnow__text {
    const char *at;
    size_t size;
} splitsnow__text;

typedef struct splitsnow__pair {
    splitsnow__text key, value;
    size_t order;
} splitsnow__pair;

struct splitsnow {
    int logarithmic;
    int has_black_substrate;
    size_t counts[SPLITSNOW_AXES];
    float *axes[SPLITSNOW_AXES];
    size_t wavelengths;
    float *wavelength_nm;
    size_t curves;          /* of one combination of the optional axes */
    size_t *absent;         /* by grain size: number of thinnest thicknesses without a curve, or NULL */
    size_t components[2];   /* 0 for a quantity that is not in the file */
    float *coefficients[2]; /* [combination][curve][component] */
    float *basis[2];        /* [wavelength][component] */
    splitsnow__pair *metadata;
    size_t n_metadata;
    char *strings;
};

/* Coordinates that increase with the value x of a parameter. */
typedef enum splitsnow__scale {
    SPLITSNOW__LINEAR,     /* x */
    SPLITSNOW__LOG,        /* ln x */
    SPLITSNOW__SHIFTED,    /* ln(1 + x / s) */
    SPLITSNOW__ROOT,       /* sqrt(x + s) */
    SPLITSNOW__COMPLEMENT, /* -ln(1 - s x) */
    SPLITSNOW__SATURATING, /* -exp(-x / s) */
    SPLITSNOW__GRAZING     /* a exp(-mu / s) - mu, where mu is the cosine of x degrees */
} splitsnow__scale;

typedef struct splitsnow__parameter {
    const char *name;
    double min, max;
    int open_min, open_max; /* whether the ends themselves are excluded */
    splitsnow__scale scale;
    double s, a;
} splitsnow__parameter;

/* <parameters> */
#define SPLITSNOW__CORE "facetness,grain_size_um,density_kg_m3,thickness_cm,angle_deg"
#define SPLITSNOW__FIRST_OPTIONAL SPLITSNOW_BLACK_CARBON_NG_G
#define SPLITSNOW__FIRST_VIEW SPLITSNOW_VIEW_DEG

static const splitsnow__parameter splitsnow__parameters[SPLITSNOW_AXES] = {
    {"facetness", 0.0, 1.0, 0, 0, SPLITSNOW__SATURATING, 0.18, 0.0},
    {"grain_size_um", 0.0, 1000000.0, 1, 0, SPLITSNOW__LOG, 1.0, 0.0},
    {"density_kg_m3", 0.0, 1000.0, 1, 1, SPLITSNOW__LOG, 1.0, 0.0},
    {"thickness_cm", 0.0, 1000000.0, 1, 0, SPLITSNOW__SHIFTED, 0.5, 0.0},
    {"angle_deg", 0.0, 90.0, 0, 1, SPLITSNOW__GRAZING, 0.02, 0.4},
    {"black_carbon_ng_g", 0.0, 1000000000.0, 0, 0, SPLITSNOW__ROOT, 20.0, 0.0},
    {"absorber_ug_g", 0.0, 1000000.0, 0, 0, SPLITSNOW__ROOT, 10.0, 0.0},
    {"water_saturation", 0.0, 0.5, 0, 0, SPLITSNOW__COMPLEMENT, 1.0, 0.0},
    {"temperature_c", -40.0, 0.0, 0, 0, SPLITSNOW__LINEAR, 1.0, 0.0},
    {"sphericity", 0.0, 1.0, 1, 0, SPLITSNOW__LOG, 1.0, 0.0},
    {"substrate_reflectance", 0.0, 1.0, 0, 0, SPLITSNOW__COMPLEMENT, 0.95, 0.0},
    {"view_deg", 0.0, 88.0, 0, 0, SPLITSNOW__LINEAR, 1.0, 0.0},
    {"relative_azimuth_deg", 0.0, 180.0, 0, 0, SPLITSNOW__LINEAR, 1.0, 0.0},
};
/* </parameters> */

static const char *const splitsnow__quantities[2] = {"transmittance", "reflectance"};

const char *splitsnow_axis_name(splitsnow_axis axis) {
    return (unsigned)axis < SPLITSNOW_AXES ? splitsnow__parameters[axis].name : "unknown axis";
}

const char *splitsnow_error_string(splitsnow_status status) {
    switch (status) {
    case SPLITSNOW_OK: return "no error";
    case SPLITSNOW_ERROR_IO: return "the file cannot be read";
    case SPLITSNOW_ERROR_MEMORY: return "out of memory";
    case SPLITSNOW_ERROR_FORMAT: return "the file is not a compact file that this version can read";
    case SPLITSNOW_ERROR_ARGUMENT: return "an argument is invalid";
    case SPLITSNOW_ERROR_NO_QUANTITY: return "the file does not hold this quantity";
    case SPLITSNOW_ERROR_NO_AXIS: return "a condition is on an axis that is not in the file";
    case SPLITSNOW_ERROR_CONDITION: return "the file has an optional axis with several nodes: give a condition for it";
    case SPLITSNOW_ERROR_OUTSIDE: return "a coordinate is outside the database";
    case SPLITSNOW_ERROR_TOO_LARGE: return "the look-up table would take more than 1 GB";
    case SPLITSNOW_ERROR_ABSENT: return "the file has no curve: grains of a surrounding node do not fit into the slab";
    case SPLITSNOW_ERROR_CONTENT: return "the file holds anisotropy factors instead of reflectance and transmittance, or the other way round";
    case SPLITSNOW_ERROR_MISMATCH: return "the look-up and the anisotropy factors differ in quantity, snow, conditions, wavelengths or axes";
    case SPLITSNOW_ERROR_NO_COLOUR: return "the wavelengths have no colour under the illuminant";
    }
    return "unknown status";
}

/* Multiplies `total`, unless it would overflow. */
static int splitsnow__times(size_t *total, size_t factor) {
    if (factor != 0 && *total > SIZE_MAX / factor) return 0;
    *total *= factor;
    return 1;
}

static void *splitsnow__allocate(size_t count, size_t size) {
    if (!splitsnow__times(&size, count)) return NULL;
    return malloc(size > 0 ? size : 1);
}

static float *splitsnow__floats(size_t count) {
    return (float *)splitsnow__allocate(count, sizeof(float));
}

static int splitsnow__is(splitsnow__text text, const char *other) {
    return text.size == strlen(other) && memcmp(text.at, other, text.size) == 0;
}

/* Converts to single precision; values that are too large become infinite. */
static float splitsnow__single(double value) {
    if (value > 3.4028235677973362e38) return HUGE_VALF;
    if (value < -3.4028235677973362e38) return -HUGE_VALF;
    return (float)value;
}

/* ---- JSON ---- */

/* A parser that accepts the same JSON as the Rust reader (serde_json). */
typedef struct splitsnow__json {
    const unsigned char *at, *end;
    char *strings; /* unescaped, each followed by a zero; never longer than the JSON */
} splitsnow__json;

static unsigned splitsnow__peek(const splitsnow__json *json) {
    return json->at < json->end ? *json->at : 0;
}

static unsigned splitsnow__next(splitsnow__json *json) {
    while (json->at < json->end &&
           (*json->at == ' ' || *json->at == '\n' || *json->at == '\t' || *json->at == '\r')) {
        json->at++;
    }
    return splitsnow__peek(json);
}

static int splitsnow__accept(splitsnow__json *json, char expected) {
    if (splitsnow__next(json) != (unsigned char)expected || json->at == json->end) return 0;
    json->at++;
    return 1;
}

static int splitsnow__word(splitsnow__json *json, const char *word) {
    size_t size = strlen(word);
    if ((size_t)(json->end - json->at) < size || memcmp(json->at, word, size) != 0) return 0;
    json->at += size;
    return 1;
}

static int splitsnow__hex(splitsnow__json *json, unsigned *value) {
    *value = 0;
    for (int i = 0; i < 4; i++) {
        unsigned c = splitsnow__peek(json), digit;
        if (c >= '0' && c <= '9') digit = c - '0';
        else if (c >= 'a' && c <= 'f') digit = c - 'a' + 10;
        else if (c >= 'A' && c <= 'F') digit = c - 'A' + 10;
        else return 0;
        *value = *value * 16 + digit;
        json->at++;
    }
    return 1;
}

static char *splitsnow__utf8(char *to, unsigned c) {
    if (c < 0x80) {
        *to++ = (char)c;
        return to;
    }
    if (c < 0x800) {
        *to++ = (char)(0xc0 | c >> 6);
    } else {
        if (c < 0x10000) {
            *to++ = (char)(0xe0 | c >> 12);
        } else {
            *to++ = (char)(0xf0 | c >> 18);
            *to++ = (char)(0x80 | (c >> 12 & 0x3f));
        }
        *to++ = (char)(0x80 | (c >> 6 & 0x3f));
    }
    *to++ = (char)(0x80 | (c & 0x3f));
    return to;
}

/* The length of the UTF-8 sequence at `at`; 0 if it is invalid. */
static size_t splitsnow__sequence(const unsigned char *at, const unsigned char *end) {
    unsigned c = at[0];
    size_t size = c < 0x80 ? 1 : c >= 0xc2 && c < 0xe0 ? 2 : c >= 0xe0 && c < 0xf0 ? 3
                  : c >= 0xf0 && c < 0xf5 ? 4 : 0;
    if ((size_t)(end - at) < size) return 0;
    for (size_t i = 1; i < size; i++) {
        if ((at[i] & 0xc0) != 0x80) return 0;
    }
    if ((c == 0xe0 && at[1] < 0xa0) || (c == 0xed && at[1] > 0x9f) ||
        (c == 0xf0 && at[1] < 0x90) || (c == 0xf4 && at[1] > 0x8f)) {
        return 0;
    }
    return size;
}

static int splitsnow__escape(splitsnow__json *json) {
    static const char from[] = "\"\\/bfnrt", to[] = "\"\\/\b\f\n\r\t";
    unsigned c = splitsnow__peek(json), low;
    const char *plain = c != 0 ? strchr(from, (int)c) : NULL;
    if (c == 0) return 0;
    json->at++;
    if (plain != NULL) {
        *json->strings++ = to[plain - from];
        return 1;
    }
    if (c != 'u' || !splitsnow__hex(json, &c) || (c >= 0xdc00 && c < 0xe000)) return 0;
    if (c >= 0xd800 && c < 0xdc00) {
        if (!splitsnow__word(json, "\\u") || !splitsnow__hex(json, &low)) return 0;
        if (low < 0xdc00 || low > 0xdfff) return 0;
        c = 0x10000 + ((c - 0xd800) << 10 | (low - 0xdc00));
    }
    json->strings = splitsnow__utf8(json->strings, c);
    return 1;
}

static int splitsnow__string(splitsnow__json *json, splitsnow__text *text) {
    if (!splitsnow__accept(json, '"')) return 0;
    text->at = json->strings;
    while (json->at < json->end) {
        unsigned c = *json->at;
        if (c == '"') {
            json->at++;
            text->size = (size_t)(json->strings - text->at);
            *json->strings++ = 0;
            return 1;
        }
        if (c == '\\') {
            json->at++;
            if (!splitsnow__escape(json)) return 0;
        } else {
            size_t size = splitsnow__sequence(json->at, json->end);
            if (c < 0x20 || size == 0) return 0;
            memcpy(json->strings, json->at, size);
            json->strings += size;
            json->at += size;
        }
    }
    return 0;
}

static int splitsnow__digit(const splitsnow__json *json) {
    unsigned c = splitsnow__peek(json);
    return c >= '0' && c <= '9';
}

/* Whether the number with digits from `at` exceeds the range of a double. The first digit
 * is not 0 and stands for 10^308. */
static int splitsnow__huge(const unsigned char *at, const unsigned char *end) {
    static const char limit[] = "17976931348623158079";
    size_t i = 0;
    for (; at < end && limit[i] != 0; at++) {
        if (*at == '.') continue;
        if (*at < '0' || *at > '9') break;
        if (*at != (unsigned char)limit[i]) return *at > (unsigned char)limit[i];
        i++;
    }
    return limit[i] == 0;
}

/* Parses a number. If it is an unsigned 64-bit integer, `*integer` is set and `*whole` is 1. */
static int splitsnow__number(splitsnow__json *json, uint64_t *integer, int *whole) {
    const unsigned char *leading = NULL;
    long before = 0, after = 0, exponent = 0; /* digits from the leading one to the point */
    uint64_t value = 0;
    *whole = splitsnow__next(json) != '-';
    if (!*whole) json->at++;
    if (!splitsnow__digit(json)) return 0;
    if (splitsnow__peek(json) == '0') {
        json->at++;
        if (splitsnow__digit(json)) return 0;
    }
    for (; splitsnow__digit(json); json->at++) {
        unsigned digit = splitsnow__peek(json) - '0';
        if (leading == NULL) leading = json->at;
        before++; /* at most the length of a header */
        if (value > (UINT64_MAX - digit) / 10) *whole = 0;
        else value = value * 10 + digit;
    }
    if (splitsnow__peek(json) == '.') {
        json->at++;
        *whole = 0;
        if (!splitsnow__digit(json)) return 0;
        for (; splitsnow__digit(json); json->at++) {
            if (leading == NULL && splitsnow__peek(json) == '0') after++;
            else if (leading == NULL) leading = json->at;
        }
    }
    if (splitsnow__peek(json) == 'e' || splitsnow__peek(json) == 'E') {
        int negative;
        json->at++;
        *whole = 0;
        negative = splitsnow__peek(json) == '-';
        if (negative || splitsnow__peek(json) == '+') json->at++;
        if (!splitsnow__digit(json)) return 0;
        for (; splitsnow__digit(json); json->at++) {
            if (exponent < 100000000) exponent = exponent * 10 + (long)(splitsnow__peek(json) - '0');
        }
        if (negative) exponent = -exponent;
    }
    *integer = value;
    if (*whole || leading == NULL) return 1;
    exponent += before > 0 ? before - 1 : -after - 1;
    return exponent < 308 || (exponent == 308 && !splitsnow__huge(leading, json->at));
}

/* Skips any value nested inside `depth` containers. */
static int splitsnow__skip(splitsnow__json *json, int depth) {
    unsigned c = splitsnow__next(json);
    char close = c == '{' ? '}' : ']';
    splitsnow__text text;
    uint64_t integer;
    int whole;
    if (c == '"') return splitsnow__string(json, &text);
    if (c == 't') return splitsnow__word(json, "true");
    if (c == 'f') return splitsnow__word(json, "false");
    if (c == 'n') return splitsnow__word(json, "null");
    if (c != '[' && c != '{') return splitsnow__number(json, &integer, &whole);
    json->at++;
    if (depth >= SPLITSNOW__MAX_DEPTH) return 0;
    if (splitsnow__accept(json, close)) return 1;
    do {
        if (c == '{' && !(splitsnow__string(json, &text) && splitsnow__accept(json, ':'))) return 0;
        if (!splitsnow__skip(json, depth + 1)) return 0;
    } while (splitsnow__accept(json, ','));
    return splitsnow__accept(json, close);
}

/* ---- The safetensors header ---- */

typedef struct splitsnow__tensor {
    splitsnow__text name;
    size_t order;      /* of two tensors with one name, the later counts */
    int type;          /* index in splitsnow__types */
    size_t dimensions; /* may exceed the two that are stored */
    uint64_t shape[2];
    uint64_t elements;
    int overflow;
    uint64_t begin, end;
} splitsnow__tensor;

enum { SPLITSNOW__U8, SPLITSNOW__U16, SPLITSNOW__F16, SPLITSNOW__F32, SPLITSNOW__F64 };

static const struct {
    const char *name;
    unsigned bits;
} splitsnow__types[] = {
    {"U8", 8},       {"U16", 16},        {"F16", 16},        {"F32", 32},        {"F64", 64},
    {"BOOL", 8},     {"F4", 4},          {"F6_E2M3", 6},     {"F6_E3M2", 6},
    {"I8", 8},       {"F8_E5M2", 8},     {"F8_E4M3", 8},     {"F8_E8M0", 8},
    {"I16", 16},     {"F8_E4M3FNUZ", 8}, {"F8_E5M2FNUZ", 8}, {"BF16", 16},
    {"I32", 32},     {"U32", 32},        {"C64", 64},
    {"I64", 64},     {"U64", 64}};

/* A header: tensors and metadata sorted by name. */
typedef struct splitsnow__header {
    splitsnow__tensor *tensors;
    size_t n_tensors, room_tensors;
    splitsnow__pair *metadata;
    size_t n_metadata, room_metadata;
    uint64_t data_size;
    int no_memory;
} splitsnow__header;

/* Buffer for an error message. */
typedef struct splitsnow__report {
    char *message;
    size_t size;
} splitsnow__report;

static splitsnow_status splitsnow__refuse(const splitsnow__report *report, const char *format, ...) {
    va_list arguments;
    if (report->message != NULL && report->size > 0) {
        va_start(arguments, format);
        vsnprintf(report->message, report->size, format, arguments);
        va_end(arguments);
    }
    return SPLITSNOW_ERROR_FORMAT;
}

static splitsnow_status splitsnow__no_memory(const splitsnow__report *report) {
    splitsnow__refuse(report, "%s", splitsnow_error_string(SPLITSNOW_ERROR_MEMORY));
    return SPLITSNOW_ERROR_MEMORY;
}

/* A string from a file for a message: its beginning, in printable ASCII. */
typedef struct splitsnow__shown {
    char text[64];
} splitsnow__shown;

static splitsnow__shown splitsnow__show(splitsnow__text text) {
    splitsnow__shown shown;
    size_t i = 0;
    for (; i < text.size && i + 1 < sizeof shown.text; i++) {
        char c = text.at[i];
        shown.text[i] = c >= ' ' && c <= '~' ? c : '?';
    }
    shown.text[i] = 0;
    return shown;
}

/* Makes room for one more entry of `size` bytes in an array with `used` entries. */
static int splitsnow__grow(void **array, size_t used, size_t *room, size_t size) {
    void *longer;
    size_t more = *room > 0 ? *room : 16;
    if (used < *room) return 1;
    if (!splitsnow__times(&more, 2) || more > SIZE_MAX / size) return 0;
    longer = realloc(*array, more * size);
    if (longer == NULL) return 0;
    *array = longer;
    *room = more;
    return 1;
}

static int splitsnow__integer(splitsnow__json *json, uint64_t *value) {
    int whole;
    unsigned c = splitsnow__next(json);
    return c >= '0' && c <= '9' && splitsnow__number(json, value, &whole) && whole;
}

static int splitsnow__type(splitsnow__json *json, splitsnow__tensor *tensor) {
    splitsnow__text name;
    size_t count = sizeof splitsnow__types / sizeof splitsnow__types[0];
    /* {"F32": null} is also accepted as F32 */
    int object = splitsnow__accept(json, '{');
    if (!splitsnow__string(json, &name)) return 0;
    if (object) {
        if (!splitsnow__accept(json, ':') || splitsnow__next(json) != 'n') return 0;
        if (!splitsnow__word(json, "null") || !splitsnow__accept(json, '}')) return 0;
    }
    for (size_t i = 0; i < count; i++) {
        tensor->type = (int)i;
        if (splitsnow__is(name, splitsnow__types[i].name)) return 1;
    }
    return 0;
}

static int splitsnow__shape(splitsnow__json *json, splitsnow__tensor *tensor) {
    tensor->elements = 1;
    tensor->overflow = 0;
    tensor->dimensions = 0;
    if (!splitsnow__accept(json, '[')) return 0;
    if (splitsnow__accept(json, ']')) return 1;
    do {
        uint64_t n;
        if (!splitsnow__integer(json, &n)) return 0;
        if (tensor->dimensions < 2) tensor->shape[tensor->dimensions] = n;
        tensor->dimensions++;
        if (n != 0 && tensor->elements > UINT64_MAX / n) tensor->overflow = 1;
        tensor->elements *= n;
    } while (splitsnow__accept(json, ','));
    return splitsnow__accept(json, ']');
}

static int splitsnow__offsets(splitsnow__json *json, splitsnow__tensor *tensor) {
    return splitsnow__accept(json, '[') && splitsnow__integer(json, &tensor->begin) &&
           splitsnow__accept(json, ',') && splitsnow__integer(json, &tensor->end) &&
           splitsnow__accept(json, ']');
}

static int splitsnow__field(splitsnow__json *json, splitsnow__tensor *tensor, int field) {
    if (field == 0) return splitsnow__type(json, tensor);
    if (field == 1) return splitsnow__shape(json, tensor);
    return splitsnow__offsets(json, tensor);
}

/* Parses the entry of one tensor: an object, or a list of its three values. */
static int splitsnow__tensor_entry(splitsnow__json *json, splitsnow__tensor *tensor) {
    static const char *const names[3] = {"dtype", "shape", "data_offsets"};
    int seen[3] = {0, 0, 0};
    if (splitsnow__accept(json, '[')) {
        return splitsnow__field(json, tensor, 0) && splitsnow__accept(json, ',') &&
               splitsnow__field(json, tensor, 1) && splitsnow__accept(json, ',') &&
               splitsnow__field(json, tensor, 2) && splitsnow__accept(json, ']');
    }
    if (!splitsnow__accept(json, '{')) return 0;
    if (splitsnow__accept(json, '}')) return 0;
    do {
        splitsnow__text name;
        int field = 0;
        if (!splitsnow__string(json, &name) || !splitsnow__accept(json, ':')) return 0;
        while (field < 3 && !splitsnow__is(name, names[field])) field++;
        if (field == 3) {
            if (!splitsnow__skip(json, 2)) return 0;
        } else if (seen[field]++ || !splitsnow__field(json, tensor, field)) {
            return 0;
        }
    } while (splitsnow__accept(json, ','));
    return seen[0] && seen[1] && seen[2] && splitsnow__accept(json, '}');
}

static int splitsnow__pairs(splitsnow__json *json, splitsnow__header *header) {
    if (splitsnow__next(json) == 'n') return splitsnow__word(json, "null");
    if (!splitsnow__accept(json, '{')) return 0;
    if (splitsnow__accept(json, '}')) return 1;
    do {
        splitsnow__pair pair;
        void *array = header->metadata;
        header->no_memory = !splitsnow__grow(&array, header->n_metadata, &header->room_metadata,
                                             sizeof(splitsnow__pair));
        header->metadata = (splitsnow__pair *)array;
        if (header->no_memory) return 0;
        if (!splitsnow__string(json, &pair.key) || !splitsnow__accept(json, ':')) return 0;
        if (!splitsnow__string(json, &pair.value)) return 0;
        pair.order = header->n_metadata;
        header->metadata[header->n_metadata++] = pair;
    } while (splitsnow__accept(json, ','));
    return splitsnow__accept(json, '}');
}

static int splitsnow__entries(splitsnow__json *json, splitsnow__header *header) {
    int metadata = 0;
    if (!splitsnow__accept(json, '{')) return 0;
    if (splitsnow__accept(json, '}')) return 1;
    do {
        splitsnow__tensor tensor;
        memset(&tensor, 0, sizeof tensor);
        if (!splitsnow__string(json, &tensor.name) || !splitsnow__accept(json, ':')) return 0;
        if (splitsnow__is(tensor.name, "__metadata__")) {
            if (metadata++ || !splitsnow__pairs(json, header)) return 0;
        } else {
            void *array = header->tensors;
            header->no_memory = !splitsnow__grow(&array, header->n_tensors, &header->room_tensors,
                                                 sizeof(splitsnow__tensor));
            header->tensors = (splitsnow__tensor *)array;
            if (header->no_memory || !splitsnow__tensor_entry(json, &tensor)) return 0;
            tensor.order = header->n_tensors;
            header->tensors[header->n_tensors++] = tensor;
        }
    } while (splitsnow__accept(json, ','));
    return splitsnow__accept(json, '}');
}

static int splitsnow__compare(splitsnow__text a, splitsnow__text b) {
    size_t shorter = a.size < b.size ? a.size : b.size;
    int order = memcmp(a.at, b.at, shorter);
    return order != 0 ? order : (a.size > b.size) - (a.size < b.size);
}

static int splitsnow__by_name(const void *a, const void *b) {
    const splitsnow__tensor *x = (const splitsnow__tensor *)a;
    const splitsnow__tensor *y = (const splitsnow__tensor *)b;
    int order = splitsnow__compare(x->name, y->name);
    return order != 0 ? order : (x->order > y->order) - (x->order < y->order);
}

static int splitsnow__by_key(const void *a, const void *b) {
    const splitsnow__pair *x = (const splitsnow__pair *)a;
    const splitsnow__pair *y = (const splitsnow__pair *)b;
    int order = splitsnow__compare(x->key, y->key);
    return order != 0 ? order : (x->order > y->order) - (x->order < y->order);
}

static int splitsnow__by_place(const void *a, const void *b) {
    const splitsnow__tensor *x = (const splitsnow__tensor *)a;
    const splitsnow__tensor *y = (const splitsnow__tensor *)b;
    if (x->begin != y->begin) return x->begin < y->begin ? -1 : 1;
    return (x->end > y->end) - (x->end < y->end);
}

/* Sorts by name and keeps the last entry of each name. */
static void splitsnow__last_of_each(splitsnow__header *header) {
    size_t unique = 0;
    if (header->n_tensors > 1) {
        qsort(header->tensors, header->n_tensors, sizeof(splitsnow__tensor), splitsnow__by_name);
    }
    for (size_t i = 0; i < header->n_tensors; i++) {
        const splitsnow__tensor *tensors = header->tensors;
        if (i + 1 < header->n_tensors &&
            splitsnow__compare(tensors[i].name, tensors[i + 1].name) == 0) {
            continue;
        }
        header->tensors[unique++] = header->tensors[i];
    }
    header->n_tensors = unique;
    unique = 0;
    if (header->n_metadata > 1) {
        qsort(header->metadata, header->n_metadata, sizeof(splitsnow__pair), splitsnow__by_key);
    }
    for (size_t i = 0; i < header->n_metadata; i++) {
        const splitsnow__pair *pairs = header->metadata;
        if (i + 1 < header->n_metadata &&
            splitsnow__compare(pairs[i].key, pairs[i + 1].key) == 0) {
            continue;
        }
        header->metadata[unique++] = header->metadata[i];
    }
    header->n_metadata = unique;
}

/* Checks that the tensors tile the data; leaves them sorted by name. */
static splitsnow_status splitsnow__tile(splitsnow__header *header, const splitsnow__report *report) {
    uint64_t place = 0;
    splitsnow_status status = SPLITSNOW_OK;
    if (header->n_tensors > 1) {
        qsort(header->tensors, header->n_tensors, sizeof(splitsnow__tensor), splitsnow__by_place);
    }
    for (size_t i = 0; i < header->n_tensors && status == SPLITSNOW_OK; i++) {
        const splitsnow__tensor *tensor = &header->tensors[i];
        unsigned bits = splitsnow__types[tensor->type].bits;
        const char *wrong = NULL;
        if (tensor->begin != place || tensor->end < place) {
            wrong = "does not begin where the previous tensor ends";
        } else if (tensor->overflow || tensor->elements > UINT64_MAX / bits) {
            wrong = "is larger than any file";
        } else if (tensor->elements * bits % 8 != 0 ||
                   tensor->elements * bits / 8 != tensor->end - place) {
            wrong = "has a size that does not match its type and shape";
        }
        if (wrong != NULL) {
            status = splitsnow__refuse(report, "its safetensors header is damaged: the tensor `%s` %s",
                                       splitsnow__show(tensor->name).text, wrong);
        }
        place = tensor->end;
    }
    if (header->n_tensors > 1) {
        qsort(header->tensors, header->n_tensors, sizeof(splitsnow__tensor), splitsnow__by_name);
    }
    header->data_size = place;
    return status;
}

static splitsnow_status splitsnow__parse(splitsnow__header *header, const unsigned char *text,
                                         size_t size, char *strings,
                                         const splitsnow__report *report) {
    splitsnow__json json;
    json.at = text;
    json.end = text + size;
    json.strings = strings;
    if (!splitsnow__entries(&json, header) || splitsnow__next(&json) != 0 || json.at != json.end) {
        if (header->no_memory) return splitsnow__no_memory(report);
        return splitsnow__refuse(
            report, "its safetensors header is damaged: invalid JSON at byte %zu of %zu",
            (size_t)(json.at - text) + 1, size);
    }
    splitsnow__last_of_each(header);
    return splitsnow__tile(header, report);
}

/* ---- Reading a database from bytes ---- */

typedef struct splitsnow__source {
    splitsnow__header header;
    const unsigned char *data;
    const splitsnow__report *report;
} splitsnow__source;

static const splitsnow__text *splitsnow__value(const splitsnow__pair *pairs, size_t n,
                                               const char *key) {
    for (size_t i = 0; i < n; i++) {
        if (splitsnow__is(pairs[i].key, key)) return &pairs[i].value;
    }
    return NULL;
}

/* Refuses a file whose metadata `key` does not have the `expected` value. */
static splitsnow_status splitsnow__unexpected(const splitsnow__source *source, const char *key,
                                              const char *expected) {
    const splitsnow__header *header = &source->header;
    const splitsnow__text *found = splitsnow__value(header->metadata, header->n_metadata, key);
    if (found == NULL) {
        return splitsnow__refuse(source->report, "its metadata `%s` is missing, expected `%s`", key,
                                 expected);
    }
    return splitsnow__refuse(source->report,
                             "its metadata `%s` is \"%s\", expected `%s`: this version cannot read that",
                             key, splitsnow__show(*found).text, expected);
}

/* The index of the value of metadata `key` in `choices`; `absent` without the key, -1 for
 * any other value. */
static int splitsnow__choice(const splitsnow__source *source, const char *key, int absent,
                             const char *const *choices, int n) {
    const splitsnow__header *header = &source->header;
    const splitsnow__text *found = splitsnow__value(header->metadata, header->n_metadata, key);
    if (found == NULL) return absent;
    for (int i = 0; i < n; i++) {
        if (splitsnow__is(*found, choices[i])) return i;
    }
    return -1;
}

static uint32_t splitsnow__little(const unsigned char *at, int bytes) {
    uint32_t value = 0;
    while (bytes-- > 0) value = value << 8 | at[bytes];
    return value;
}

static float splitsnow__float32(const unsigned char *at) {
    uint32_t bits = splitsnow__little(at, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static double splitsnow__float64(const unsigned char *at) {
    uint64_t bits = splitsnow__little(at, 4) | (uint64_t)splitsnow__little(at + 4, 4) << 32;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static float splitsnow__float16(const unsigned char *at) {
    uint32_t bits = splitsnow__little(at, 2);
    int exponent = (int)(bits >> 10 & 31);
    float mantissa = (float)(bits & 1023), value;
    if (exponent == 31) value = mantissa > 0.0f ? NAN : HUGE_VALF;
    else if (exponent == 0) value = ldexpf(mantissa, -24);
    else value = ldexpf(mantissa + 1024.0f, exponent - 25);
    return bits >> 15 ? -value : value;
}

static const splitsnow__tensor *splitsnow__find(const splitsnow__source *source, const char *name) {
    splitsnow__text key;
    size_t low = 0, high = source->header.n_tensors;
    key.at = name;
    key.size = strlen(name);
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        int order = splitsnow__compare(source->header.tensors[middle].name, key);
        if (order == 0) return &source->header.tensors[middle];
        if (order < 0) low = middle + 1;
        else high = middle;
    }
    return NULL;
}

/* The bytes of a tensor with the given `type` (U8 also accepts U16, F64 also accepts F32)
 * and shape: [a], or [a, b] if b > 0; a = 0 accepts any length. On a mismatch reports it
 * and returns NULL. */
static const unsigned char *splitsnow__bytes(const splitsnow__source *source, const char *name,
                                             int type, size_t a, size_t b,
                                             const splitsnow__tensor **tensor) {
    const splitsnow__tensor *found = splitsnow__find(source, name);
    char expected[64];
    *tensor = found;
    if (found == NULL) {
        splitsnow__refuse(source->report, "it has no tensor `%s`", name);
        return NULL;
    }
    if ((found->type == type || (type == SPLITSNOW__U8 && found->type == SPLITSNOW__U16) ||
         (type == SPLITSNOW__F64 && found->type == SPLITSNOW__F32)) &&
        found->dimensions == (b > 0 ? 2u : 1u) && (a == 0 || found->shape[0] == a) &&
        (b == 0 || found->shape[1] == b)) {
        return source->data + found->begin;
    }
    if (b > 0) snprintf(expected, sizeof expected, "[%zu, %zu]", a, b);
    else if (a > 0) snprintf(expected, sizeof expected, "[%zu]", a);
    else snprintf(expected, sizeof expected, "[n]");
    splitsnow__refuse(source->report,
                      "its tensor `%s` is %s of %zu dimensions, %llu values; expected %s %s", name,
                      splitsnow__types[found->type].name, found->dimensions,
                      (unsigned long long)found->elements,
                      type == SPLITSNOW__U8    ? "U8 or U16"
                      : type == SPLITSNOW__F64 ? "F64 or F32"
                                               : splitsnow__types[type].name,
                      expected);
    return NULL;
}

/* Whether a node of `axis` may have the value `v`; SPLITSNOW_AXES stands for wavelengths
 * in nm. */
static int splitsnow__allowed(int axis, double v) {
    const splitsnow__parameter *parameter;
    if (axis == SPLITSNOW_AXES) return v > 0.0 && v <= 1e6;
    parameter = &splitsnow__parameters[axis];
    return v >= parameter->min && v <= parameter->max &&
           !(parameter->open_min && v == parameter->min) &&
           !(parameter->open_max && v == parameter->max);
}

/* Reads coordinates: f64, or f32 in files of version 1. Look-ups use single precision. */
static splitsnow_status splitsnow__coordinate(const splitsnow__source *source, const char *name,
                                              int axis, float **values, size_t *count) {
    const splitsnow__tensor *tensor;
    const unsigned char *bytes = splitsnow__bytes(source, name, SPLITSNOW__F64, 0, 0, &tensor);
    if (bytes == NULL) return SPLITSNOW_ERROR_FORMAT;
    if (tensor->elements == 0) {
        return splitsnow__refuse(source->report, "its tensor %s has no values", name);
    }
    *count = (size_t)tensor->elements;
    *values = splitsnow__floats(*count);
    if (*values == NULL) return splitsnow__no_memory(source->report);
    for (size_t i = 0; i < *count; i++) {
        double value = tensor->type == SPLITSNOW__F64
                           ? splitsnow__float64(bytes + 8 * i)
                           : (double)splitsnow__float32(bytes + 4 * i);
        (*values)[i] = splitsnow__single(value);
        if (!splitsnow__allowed(axis, value) || !splitsnow__allowed(axis, (double)(*values)[i]) ||
            (i > 0 && !((*values)[i - 1] < (*values)[i]))) {
            return splitsnow__refuse(source->report,
                                     "its tensor %s has the value %g, number %zu, which is outside "
                                     "the allowed range or not above the value before",
                                     name, value, i + 1);
        }
    }
    return SPLITSNOW_OK;
}

/* Checks that all values are finite and within the allowed magnitude. */
static splitsnow_status splitsnow__check(const splitsnow__source *source, const char *name,
                                         const float *values, size_t count, size_t stride) {
    for (size_t i = 0; i < count; i++) {
        if (!(fabsf(values[i * stride]) <= SPLITSNOW__MAX_NUMBER)) {
            return splitsnow__refuse(source->report,
                                     "its tensor %s has the value %g; expected finite numbers up to "
                                     "1e9 in magnitude",
                                     name, (double)values[i * stride]);
        }
    }
    return SPLITSNOW_OK;
}

static splitsnow_status splitsnow__matrix(const splitsnow__source *source, const char *name,
                                          int type, size_t rows, size_t columns, float **values) {
    const splitsnow__tensor *tensor;
    const unsigned char *bytes = splitsnow__bytes(source, name, type, rows, columns, &tensor);
    size_t count;
    if (bytes == NULL) return SPLITSNOW_ERROR_FORMAT;
    count = (size_t)tensor->elements;
    *values = splitsnow__floats(count);
    if (*values == NULL) return splitsnow__no_memory(source->report);
    for (size_t i = 0; i < count; i++) {
        (*values)[i] = type == SPLITSNOW__F16 ? splitsnow__float16(bytes + 2 * i)
                                              : splitsnow__float32(bytes + 4 * i);
    }
    return splitsnow__check(source, name, *values, count, 1);
}

/* Reads quantised coefficients, converted to float. */
static splitsnow_status splitsnow__integers(const splitsnow__source *source, int quantity,
                                            size_t rows, size_t columns, float **values) {
    char name[80];
    float *scales = NULL;
    size_t count = rows;
    splitsnow_status status;
    snprintf(name, sizeof name, "%s.quantisation", splitsnow__quantities[quantity]);
    status = splitsnow__matrix(source, name, SPLITSNOW__F32, columns, 2, &scales);
    for (size_t k = 0; k < columns && status == SPLITSNOW_OK; k++) {
        const splitsnow__tensor *tensor;
        const unsigned char *bytes;
        snprintf(name, sizeof name, "%s.coefficients.%zu", splitsnow__quantities[quantity], k);
        bytes = splitsnow__bytes(source, name, SPLITSNOW__U8, rows, 0, &tensor);
        status = bytes == NULL ? SPLITSNOW_ERROR_FORMAT : SPLITSNOW_OK;
        /* allocate only after the first tensor confirms the number of rows */
        if (status == SPLITSNOW_OK && *values == NULL) {
            *values = splitsnow__times(&count, columns) ? splitsnow__floats(count) : NULL;
            if (*values == NULL) status = splitsnow__no_memory(source->report);
        }
        for (size_t row = 0; row < rows && status == SPLITSNOW_OK; row++) {
            int width = tensor->type == SPLITSNOW__U8 ? 1 : 2;
            double integer = splitsnow__little(bytes + (size_t)width * row, width);
            (*values)[row * columns + k] =
                splitsnow__single((double)scales[2 * k] + (double)scales[2 * k + 1] * integer);
        }
        if (status == SPLITSNOW_OK) {
            status = splitsnow__check(source, name, *values + k, rows, columns);
        }
    }
    free(scales);
    return status;
}

/* The number of components of a quantity, from the metadata. */
static splitsnow_status splitsnow__components(const splitsnow__source *source, splitsnow *database,
                                              int quantity) {
    char key[40], expected[40];
    const splitsnow__header *header = &source->header;
    const splitsnow__text *found;
    size_t n = 0, i;
    snprintf(key, sizeof key, "%s.components", splitsnow__quantities[quantity]);
    snprintf(expected, sizeof expected, "1 to %zu", database->wavelengths);
    found = splitsnow__value(header->metadata, header->n_metadata, key);
    if (found == NULL) return splitsnow__unexpected(source, key, expected);
    for (i = found->size > 1 && found->at[0] == '+'; i < found->size; i++) {
        char c = found->at[i];
        size_t digit = (size_t)(c - '0');
        if (c < '0' || c > '9') break;
        if (n <= database->wavelengths) n = n * 10 + digit; /* stop once it is too large */
    }
    if (i < found->size || n < 1 || n > database->wavelengths) {
        return splitsnow__unexpected(source, key, expected);
    }
    database->components[quantity] = n;
    return SPLITSNOW_OK;
}

/* Whether the file may have a tensor of this name. */
static int splitsnow__known(const splitsnow *database, const unsigned char *present, int quantised,
                            splitsnow__text name) {
    char other[80];
    for (int axis = 0; axis < SPLITSNOW_AXES; axis++) {
        if (present[axis] && splitsnow__is(name, splitsnow__parameters[axis].name)) return 1;
    }
    if (splitsnow__is(name, "wavelength_nm") || splitsnow__is(name, "absent")) return 1;
    for (int quantity = 0; quantity < 2; quantity++) {
        const char *word = splitsnow__quantities[quantity];
        size_t size = (size_t)snprintf(other, sizeof other, "%s.coefficients.", word), n = 0;
        if (database->components[quantity] == 0) continue;
        if (quantised && name.size > size && memcmp(name.at, other, size) == 0) {
            for (size_t i = size; i < name.size && n < database->components[quantity]; i++) {
                n = n * 10 + (unsigned char)name.at[i] - '0';
            }
            if (n >= database->components[quantity]) continue;
            snprintf(other, sizeof other, "%s.coefficients.%zu", word, n);
            if (splitsnow__is(name, other)) return 1;
        }
        snprintf(other, sizeof other, "%s.basis", word);
        if (splitsnow__is(name, other)) return 1;
        snprintf(other, sizeof other, quantised ? "%s.quantisation" : "%s.coefficients", word);
        if (splitsnow__is(name, other)) return 1;
    }
    return 0;
}

/* Reads the counts of curves that do not exist, if any. */
static splitsnow_status splitsnow__absent(const splitsnow__source *source, splitsnow *database) {
    const splitsnow__tensor *tensor;
    const unsigned char *bytes;
    size_t sizes = database->counts[SPLITSNOW_GRAIN_SIZE_UM];
    if (splitsnow__find(source, "absent") == NULL) return SPLITSNOW_OK;
    bytes = splitsnow__bytes(source, "absent", SPLITSNOW__U16, sizes, 0, &tensor);
    if (bytes == NULL) return SPLITSNOW_ERROR_FORMAT;
    database->absent = (size_t *)splitsnow__allocate(sizes, sizeof(size_t));
    if (database->absent == NULL) return splitsnow__no_memory(source->report);
    for (size_t i = 0; i < sizes; i++) {
        database->absent[i] = splitsnow__little(bytes + 2 * i, 2);
        if (database->absent[i] > database->counts[SPLITSNOW_THICKNESS_CM]) {
            return splitsnow__refuse(source->report,
                                     "its tensor absent has the value %zu; expected at most %zu, the "
                                     "number of thicknesses",
                                     database->absent[i], database->counts[SPLITSNOW_THICKNESS_CM]);
        }
    }
    return SPLITSNOW_OK;
}

/* The place of an axis that is not of the core, in a file with all of them: views come first. */
static int splitsnow__place_in_file(int axis) {
    int views = SPLITSNOW_AXES - SPLITSNOW__FIRST_VIEW;
    if (axis >= SPLITSNOW__FIRST_VIEW) return axis - SPLITSNOW__FIRST_VIEW;
    return views + axis - SPLITSNOW__FIRST_OPTIONAL;
}

/* Reads from the metadata which axes are in the file. */
static splitsnow_status splitsnow__axis_order(const splitsnow__source *source,
                                              unsigned char present[SPLITSNOW_AXES]) {
    const splitsnow__header *header = &source->header;
    const splitsnow__text *found =
        splitsnow__value(header->metadata, header->n_metadata, "axis_order");
    static const char five[] = SPLITSNOW__CORE;
    size_t size = sizeof five - 1, at = 0;
    int least = 0, ordered = 1;
    for (int axis = 0; axis < SPLITSNOW_AXES; axis++) present[axis] = axis < SPLITSNOW__FIRST_OPTIONAL;
    if (found == NULL || found->size < size ||
        memcmp(found->at + found->size - size, five, size) != 0) {
        return splitsnow__unexpected(source, "axis_order", five);
    }
    while (at < found->size - size) {
        splitsnow__text name;
        const char *end = (const char *)memchr(found->at + at, ',', found->size - size - at);
        int axis = SPLITSNOW__FIRST_OPTIONAL;
        name.at = found->at + at;
        name.size = (end != NULL ? (size_t)(end - found->at) : found->size - size) - at;
        while (axis < SPLITSNOW_AXES && !splitsnow__is(name, splitsnow__parameters[axis].name)) axis++;
        if (axis == SPLITSNOW_AXES) {
            return splitsnow__refuse(source->report,
                                     "it has an axis `%s`, which this version does not know",
                                     splitsnow__show(name).text);
        }
        if (splitsnow__place_in_file(axis) < least || end == NULL) ordered = 0;
        least = splitsnow__place_in_file(axis) + 1;
        present[axis] = 1;
        at += name.size + 1;
    }
    if (!ordered) return splitsnow__unexpected(source, "axis_order", "the axes in storage order");
    return SPLITSNOW_OK;
}

/* Refuses a file unless it has the axes of views if, and only if, it holds anisotropy factors. */
static splitsnow_status splitsnow__content(const splitsnow__source *source,
                                           const unsigned char present[SPLITSNOW_AXES]) {
    static const char *const anisotropy[] = {"anisotropy_factor"};
    const splitsnow__header *header = &source->header;
    int views = present[SPLITSNOW_VIEW_DEG] + present[SPLITSNOW_RELATIVE_AZIMUTH_DEG];
    if (views == 1) {
        return splitsnow__unexpected(source, "axis_order", "view_deg,relative_azimuth_deg");
    }
    if (views == 2 && splitsnow__choice(source, "content", -1, anisotropy, 1) < 0) {
        return splitsnow__unexpected(source, "content", anisotropy[0]);
    }
    if (views == 0 && splitsnow__value(header->metadata, header->n_metadata, "content") != NULL) {
        return splitsnow__unexpected(source, "content", "missing");
    }
    return SPLITSNOW_OK;
}

/* Reads the database from a header and data of the declared size. */
static splitsnow_status splitsnow__read_database(splitsnow *database, const splitsnow__source *source) {
    static const char *const format[] = {"splitsnow-compact"};
    static const char *const versions[] = {"2", "1"};
    static const char *const substrates[] = {"black", "reflecting", "layers"};
    static const char *const bases[] = {"linear", "log"};
    static const char *const precisions[] = {"f32", "f16", "quantised"};
    static const char *const both[] = {"transmittance,reflectance", "transmittance", "reflectance"};
    const splitsnow__header *header = &source->header;
    const splitsnow__text *bottom;
    unsigned char present[SPLITSNOW_AXES];
    int basis, precision, quantities, version;
    size_t rows = 1;
    splitsnow_status status;

    if (splitsnow__choice(source, "format", -1, format, 1) < 0) {
        return splitsnow__unexpected(source, "format", format[0]);
    }
    version = splitsnow__choice(source, "format_version", -1, versions, 2);
    if (version < 0) return splitsnow__unexpected(source, "format_version", "2` or `1");
    status = splitsnow__axis_order(source, present);
    if (status == SPLITSNOW_OK) status = splitsnow__content(source, present);
    if (status != SPLITSNOW_OK) return status;
    basis = splitsnow__choice(source, "basis", -1, bases, 2);
    if (basis < 0) return splitsnow__unexpected(source, "basis", "linear` or `log");
    if (basis != 0 && present[SPLITSNOW_VIEW_DEG]) {
        return splitsnow__unexpected(source, "basis", bases[0]); /* factors have no such logarithm */
    }
    precision = splitsnow__choice(source, "precision", 0, precisions, 3);
    if (precision < 0) {
        return splitsnow__unexpected(source, "precision", "f32` or `f16` or `quantised");
    }
    quantities = splitsnow__choice(source, "quantities", 0, both, 3);
    if (quantities < 0) {
        return splitsnow__unexpected(
            source, "quantities", "transmittance,reflectance` or `transmittance` or `reflectance");
    }
    database->logarithmic = basis;
    if (version == 0) {
        int substrate = splitsnow__choice(source, "substrate", -1, substrates, 3);
        if (substrate < 0) {
            return splitsnow__unexpected(source, "substrate", "black` or `reflecting` or `layers");
        }
        database->has_black_substrate = substrate == 0;
    } else {
        bottom = splitsnow__value(header->metadata, header->n_metadata, "bottom_boundary");
        database->has_black_substrate =
            bottom == NULL || (bottom->size >= 5 && memcmp(bottom->at, "black", 5) == 0);
    }

    status = splitsnow__coordinate(source, "wavelength_nm", SPLITSNOW_AXES,
                                   &database->wavelength_nm, &database->wavelengths);
    if (status != SPLITSNOW_OK) return status;
    for (int quantity = 0; quantity < 2; quantity++) {
        if (quantities == 0 || quantities == quantity + 1) {
            status = splitsnow__components(source, database, quantity);
            if (status != SPLITSNOW_OK) return status;
        }
    }
    for (size_t i = 0; i < header->n_tensors; i++) {
        if (!splitsnow__known(database, present, precision == 2, header->tensors[i].name)) {
            return splitsnow__refuse(source->report,
                                     "it has a tensor `%s`, which this version does not know",
                                     splitsnow__show(header->tensors[i].name).text);
        }
    }
    for (int axis = 0; axis < SPLITSNOW_AXES; axis++) {
        if (!present[axis]) continue;
        status = splitsnow__coordinate(source, splitsnow__parameters[axis].name, axis,
                                       &database->axes[axis], &database->counts[axis]);
        if (status != SPLITSNOW_OK) return status;
        if (!splitsnow__times(&rows, database->counts[axis])) rows = SIZE_MAX;
        if (axis == SPLITSNOW_ANGLE_DEG) database->curves = rows;
    }
    status = splitsnow__absent(source, database);
    if (status != SPLITSNOW_OK) return status;
    for (int quantity = 0; quantity < 2; quantity++) {
        char name[40];
        size_t components = database->components[quantity];
        if (components == 0) continue;
        if (precision == 2) {
            status = splitsnow__integers(source, quantity, rows, components,
                                         &database->coefficients[quantity]);
        } else {
            snprintf(name, sizeof name, "%s.coefficients", splitsnow__quantities[quantity]);
            status = splitsnow__matrix(source, name,
                                       precision == 1 ? SPLITSNOW__F16 : SPLITSNOW__F32, rows,
                                       components, &database->coefficients[quantity]);
        }
        if (status != SPLITSNOW_OK) return status;
        snprintf(name, sizeof name, "%s.basis", splitsnow__quantities[quantity]);
        status = splitsnow__matrix(source, name, SPLITSNOW__F32, database->wavelengths, components,
                                   &database->basis[quantity]);
        if (status != SPLITSNOW_OK) return status;
    }
    return SPLITSNOW_OK;
}

void splitsnow_close(splitsnow *database) {
    if (database == NULL) return;
    for (int axis = 0; axis < SPLITSNOW_AXES; axis++) free(database->axes[axis]);
    for (int quantity = 0; quantity < 2; quantity++) {
        free(database->coefficients[quantity]);
        free(database->basis[quantity]);
    }
    free(database->wavelength_nm);
    free(database->absent);
    free(database->metadata);
    free(database->strings);
    free(database);
}

/* The length of the header, from the first 8 bytes of a file. */
static splitsnow_status splitsnow__header_size(const unsigned char *bytes, size_t size,
                                               uint64_t *header, const splitsnow__report *report) {
    *header = 0;
    if (size >= 8) {
        *header = splitsnow__little(bytes, 4) | (uint64_t)splitsnow__little(bytes + 4, 4) << 32;
    }
    if (*header >= 2 && *header <= SPLITSNOW__MAX_HEADER) return SPLITSNOW_OK;
    return splitsnow__refuse(report, "it is not a safetensors file: its first 8 bytes must be a "
                                     "header length of 2 to 16777216");
}

static splitsnow_status splitsnow__open_bytes(const unsigned char *bytes, size_t size,
                                              splitsnow *database, splitsnow__source *source) {
    uint64_t header, declared;
    splitsnow_status status = splitsnow__header_size(bytes, size, &header, source->report);
    if (status != SPLITSNOW_OK) return status;
    if (header > size - 8) {
        return splitsnow__refuse(source->report, "it is truncated: its header is longer than the file");
    }
    database->strings = (char *)splitsnow__allocate((size_t)header, 1);
    if (database->strings == NULL) return splitsnow__no_memory(source->report);
    status = splitsnow__parse(&source->header, bytes + 8, (size_t)header, database->strings,
                              source->report);
    if (status != SPLITSNOW_OK) return status;
    declared = source->header.data_size;
    if (declared != size - 8 - header) {
        return splitsnow__refuse(
            source->report, "%s: its header declares %llu bytes of data, but it has %llu",
            declared > size - 8 - header ? "it is truncated" : "something was appended to it",
            (unsigned long long)declared, (unsigned long long)(size - 8 - header));
    }
    source->data = bytes + 8 + header;
    return splitsnow__read_database(database, source);
}

splitsnow_status splitsnow_open_memory(const void *bytes, size_t size, splitsnow **database,
                                       char *message, size_t message_size) {
    splitsnow__report report;
    splitsnow__source source;
    splitsnow_status status;
    splitsnow *opened;
    if (database == NULL) return SPLITSNOW_ERROR_ARGUMENT;
    *database = NULL;
    if (bytes == NULL && size > 0) return SPLITSNOW_ERROR_ARGUMENT;
    report.message = message;
    report.size = message_size;
    memset(&source, 0, sizeof source);
    source.report = &report;
    if (message != NULL && message_size > 0) message[0] = 0;
    opened = (splitsnow *)calloc(1, sizeof *opened);
    if (opened == NULL) return splitsnow__no_memory(&report);
    status = splitsnow__open_bytes((const unsigned char *)bytes, size, opened, &source);
    free(source.header.tensors);
    opened->metadata = source.header.metadata;
    opened->n_metadata = source.header.n_metadata;
    if (status == SPLITSNOW_OK) *database = opened;
    else splitsnow_close(opened);
    return status;
}

/* Reads a whole file; a file of another kind is refused by its first bytes. */
static splitsnow_status splitsnow__read_file(FILE *file, unsigned char **bytes, size_t *size,
                                        const splitsnow__report *report) {
    size_t room = 0, target = 8;
    for (;;) {
        void *array = *bytes;
        size_t found;
        if (room < target) {
            array = realloc(array, target);
            if (array == NULL) return splitsnow__no_memory(report);
            *bytes = (unsigned char *)array;
            room = target;
        }
        found = fread(*bytes + *size, 1, room - *size, file);
        *size += found;
        if (ferror(file)) {
            splitsnow__refuse(report, "it cannot be read");
            return SPLITSNOW_ERROR_IO;
        }
        if (*size < room) return SPLITSNOW_OK;
        if (room == 8) {
            uint64_t header;
            splitsnow_status status = splitsnow__header_size(*bytes, *size, &header, report);
            if (status != SPLITSNOW_OK) return status;
            target = 1 << 16;
        } else if (!splitsnow__times(&target, 2)) {
            return splitsnow__no_memory(report);
        }
    }
}

splitsnow_status splitsnow_open(const char *path, splitsnow **database, char *message,
                                size_t message_size) {
    splitsnow__report report;
    unsigned char *bytes = NULL;
    size_t size = 0;
    splitsnow_status status;
    FILE *file;
    if (database == NULL) return SPLITSNOW_ERROR_ARGUMENT;
    *database = NULL;
    if (path == NULL) return SPLITSNOW_ERROR_ARGUMENT;
    report.message = message;
    report.size = message_size;
#ifdef S_ISREG
    {
        /* check before opening: opening a pipe waits for its writer */
        struct stat about;
        if (stat(path, &about) == 0 && !S_ISREG(about.st_mode)) {
            return splitsnow__refuse(&report, "it is not a regular file");
        }
    }
#endif
    file = fopen(path, "rb");
    if (file == NULL) {
        splitsnow__refuse(&report, "it cannot be opened");
        return SPLITSNOW_ERROR_IO;
    }
    status = splitsnow__read_file(file, &bytes, &size, &report);
    fclose(file);
    if (status == SPLITSNOW_OK) {
        status = splitsnow_open_memory(bytes, size, database, message, message_size);
    }
    free(bytes);
    return status;
}

const float *splitsnow_nodes(const splitsnow *database, splitsnow_axis axis, size_t *count) {
    int known = (unsigned)axis < SPLITSNOW_AXES;
    if (count != NULL) *count = known ? database->counts[axis] : 0;
    return known ? database->axes[axis] : NULL;
}

const float *splitsnow_wavelengths(const splitsnow *database, size_t *count) {
    if (count != NULL) *count = database->wavelengths;
    return database->wavelength_nm;
}

int splitsnow_has(const splitsnow *database, splitsnow_quantity quantity) {
    return (unsigned)quantity < 2 && database->components[quantity] > 0;
}

int splitsnow_holds_anisotropy(const splitsnow *database) {
    return database->counts[SPLITSNOW_VIEW_DEG] > 0;
}

int splitsnow_has_black_substrate(const splitsnow *database) { return database->has_black_substrate; }

const char *splitsnow_metadata(const splitsnow *database, const char *key) {
    const splitsnow__text *found =
        splitsnow__value(database->metadata, database->n_metadata, key);
    return found != NULL ? found->at : NULL;
}

/* ---- Coordinates in which snow is smooth ---- */

static double splitsnow__place_of(int axis, double x) {
    const splitsnow__parameter *parameter = &splitsnow__parameters[axis];
    double mu;
    switch (parameter->scale) {
    case SPLITSNOW__LINEAR: return x;
    case SPLITSNOW__LOG: return log(x);
    case SPLITSNOW__SHIFTED: return log(1.0 + x / parameter->s);
    case SPLITSNOW__ROOT: return sqrt(x + parameter->s);
    case SPLITSNOW__COMPLEMENT: return -log(1.0 - parameter->s * x);
    case SPLITSNOW__SATURATING: return -exp(-x / parameter->s);
    case SPLITSNOW__GRAZING: break;
    }
    mu = cos(x * (3.14159265358979323846 / 180.0));
    return parameter->a * exp(-mu / parameter->s) - mu;
}

static float splitsnow__place(int axis, float value) {
    return (float)splitsnow__place_of(axis, (double)value);
}

/* Derivative of the coordinate of the thickness, 1/cm. */
static float splitsnow__slope_at(float thickness_cm) {
    return 1.0f / ((float)splitsnow__parameters[SPLITSNOW_THICKNESS_CM].s + thickness_cm);
}

/* Whether `value` is on `node`: within the tolerance, or equal in single precision. (The
 * shortest decimal of a subnormal number differs from it by more than the tolerance.) */
static int splitsnow__is_on(float node, double value) {
    double scale;
    if (fabs(value) <= 3.4e38 && (float)value == node) return 1;
    scale = node == 0.0f ? 1.0 : fabs((double)node);
    return fabs((double)node - value) <= 1e-6 * scale;
}

/* Index of the node below `place`: the largest node not above it, at most the last but
 * one. */
static size_t splitsnow__below(const float *nodes, size_t n, float place) {
    size_t below = 0;
    for (size_t i = 1; i + 1 < n; i++) below += nodes[i] <= place;
    return below;
}

/* Position of `place` between node `cell` and the next, 0 to 1. */
static float splitsnow__fraction(const float *nodes, size_t n, size_t cell, float place) {
    float t;
    if (cell + 1 >= n || !(nodes[cell + 1] > nodes[cell])) return 0.0f;
    t = (place - nodes[cell]) / (nodes[cell + 1] - nodes[cell]);
    return t < 0.0f ? 0.0f : t > 1.0f ? 1.0f : t;
}

/* ---- Conditions: weighted parts of the file ---- */

typedef struct splitsnow__mix {
    size_t part[32];
    double weight[32];
    size_t count;
} splitsnow__mix;

/* The node below `value`, and the position of `value` between it and the next, 0 to 1. */
static int splitsnow__bracket(int axis, const float *nodes, size_t n, double value, size_t *below,
                           double *share) {
    size_t above = 0;
    double from, to;
    *share = 0.0;
    if (!(value >= (double)nodes[0]) && !splitsnow__is_on(nodes[0], value)) return 0;
    while (above < n && (double)nodes[above] < value) above++;
    *below = above;
    if (above > 0 && (above == n || value - (double)nodes[above - 1] < (double)nodes[above] - value)) {
        *below = above - 1;
    }
    if (splitsnow__is_on(nodes[*below], value)) return 1;
    if (above == n) return 0;
    *below = above - 1;
    from = splitsnow__place_of(axis, (double)nodes[*below]);
    to = splitsnow__place_of(axis, (double)nodes[above]);
    *share = (splitsnow__place_of(axis, value) - from) / (to - from);
    return 1;
}

/* Splits each part along an axis of `nodes` nodes, which is faster than those before it. */
static void splitsnow__refine(splitsnow__mix *mix, size_t nodes, size_t below, double share) {
    splitsnow__mix finer;
    size_t count = 0;
    for (size_t corner = 0; corner < mix->count; corner++) {
        for (size_t step = 0; step < 2; step++) {
            double weight = step == 0 ? 1.0 - share : share;
            if (!(weight > 0.0)) continue;
            finer.part[count] = mix->part[corner] * nodes + below + step;
            finer.weight[count++] = mix->weight[corner] * weight;
        }
    }
    finer.count = count;
    *mix = finer;
}

static splitsnow_status splitsnow__conditions(const splitsnow *database,
                                              const splitsnow_condition *conditions, size_t n,
                                              splitsnow__mix *mix) {
    for (size_t i = 0; i < n; i++) {
        unsigned axis = (unsigned)conditions[i].axis;
        if (axis < SPLITSNOW__FIRST_OPTIONAL || axis >= SPLITSNOW__FIRST_VIEW) {
            return SPLITSNOW_ERROR_ARGUMENT;
        }
        for (size_t j = 0; j < i; j++) {
            if (conditions[j].axis == conditions[i].axis) return SPLITSNOW_ERROR_ARGUMENT;
        }
        if (database->counts[axis] == 0) return SPLITSNOW_ERROR_NO_AXIS;
    }
    mix->part[0] = 0;
    mix->weight[0] = 1.0;
    mix->count = 1;
    for (int axis = SPLITSNOW__FIRST_OPTIONAL; axis < SPLITSNOW__FIRST_VIEW; axis++) {
        size_t nodes = database->counts[axis], below = 0, i = 0;
        double share = 0.0;
        if (nodes == 0) continue;
        while (i < n && conditions[i].axis != (splitsnow_axis)axis) i++;
        if (i < n) {
            if (!splitsnow__bracket(axis, database->axes[axis], nodes, conditions[i].value, &below,
                                 &share)) {
                return SPLITSNOW_ERROR_OUTSIDE;
            }
        } else if (nodes > 1) {
            return SPLITSNOW_ERROR_CONDITION;
        }
        splitsnow__refine(mix, nodes, below, share);
    }
    return SPLITSNOW_OK;
}

/* Adds `size` bytes to a hash (FNV-1a). */
static uint64_t splitsnow__hash(uint64_t hash, const void *bytes, size_t size) {
    const unsigned char *at = (const unsigned char *)bytes;
    for (size_t i = 0; i < size; i++) hash = (hash ^ at[i]) * 1099511628211u;
    return hash;
}

/* A number for what is prepared, the same for spectra and for their anisotropy factors: the
 * quantity, the snow, the conditions, the wavelengths and the axes except those of views. */
static uint64_t splitsnow__key(const splitsnow *database, splitsnow_quantity quantity,
                               const splitsnow_snow *snow, const splitsnow__mix *mix) {
    uint64_t key = 14695981039346656037u;
    int number = (int)quantity;
    key = splitsnow__hash(key, &number, sizeof number);
    key = splitsnow__hash(key, mix->part, mix->count * sizeof *mix->part);
    key = splitsnow__hash(key, mix->weight, mix->count * sizeof *mix->weight);
    if (snow != NULL) {
        double values[3];
        values[0] = snow->facetness + 0.0; /* without the sign of a zero */
        values[1] = snow->grain_size_um;
        values[2] = snow->density_kg_m3;
        key = splitsnow__hash(key, values, sizeof values);
    }
    key = splitsnow__hash(key, &database->wavelengths, sizeof database->wavelengths);
    key = splitsnow__hash(key, database->wavelength_nm, database->wavelengths * sizeof(float));
    for (int axis = 0; axis < SPLITSNOW__FIRST_VIEW; axis++) {
        size_t n = database->counts[axis];
        key = splitsnow__hash(key, &n, sizeof n);
        if (n > 0) key = splitsnow__hash(key, database->axes[axis], n * sizeof(float));
    }
    return key;
}

/* ---- Along the thickness ---- */

/* Diffusion through a slab: y and its slope at a node, and y at `step_cm` before it. */
typedef struct splitsnow__diffusion {
    double y, slope_per_cm, before, step_cm;
} splitsnow__diffusion;

/* ln(r / r0) at `h_cm` from the node, where r0 is r at the node; positive `h_cm` is
 * thicker. */
static double splitsnow__growth(const splitsnow__diffusion *node, double k, double h_cm) {
    double s = node->slope_per_cm, rising, falling, sum;
    if (k * fabs(h_cm) < 1e-6) {
        double x = s * h_cm;
        return log1p(x > -1.0 ? x : -1.0);
    }
    /* ln(cosh kh + s/k sinh kh), without overflow */
    rising = 0.5 * (1.0 + s / k);
    falling = 0.5 * (1.0 - s / k);
    sum = h_cm > 0.0 ? rising + falling * exp(-2.0 * k * h_cm)
                     : rising * exp(2.0 * k * h_cm) + falling;
    return sum <= 0.0 ? -HUGE_VAL : k * fabs(h_cm) + log(sum);
}

/* The decay constant k, 1/cm, from y before the node. */
static double splitsnow__decay_constant(const splitsnow__diffusion *node) {
    double slope = node->slope_per_cm, step = node->step_cm, rise = node->y - node->before;
    /* r before the node, relative to r there */
    double ratio = exp(-(rise > 0.0 ? rise : 0.0));
    double low = 0.0, high = slope > 0.0 ? slope : 0.0;
    for (int i = 0; i < 24; i++) {
        double k = 0.5 * (low + high), found = 1.0 - slope * step, expected = ratio;
        if (k * step >= 1e-6) {
            /* cosh kh - s/k sinh kh, times exp(-kh) on both sides */
            double decay = exp(-k * step);
            found = 0.5 * ((1.0 + slope / k) * decay * decay + (1.0 - slope / k));
            expected = ratio * decay;
        }
        /* a larger k curves more and gives a larger r before the node */
        if (found > expected) high = k;
        else low = k;
    }
    return high;
}

/* y at `h_cm` (0 or more) beyond the node. */
static double splitsnow__deeper(const splitsnow__diffusion *node, double h_cm) {
    double growth = splitsnow__growth(node, splitsnow__decay_constant(node), h_cm);
    return node->y + (growth > 0.0 ? growth : 0.0);
}

static const float splitsnow__thin[SPLITSNOW__THIN] = {0.0f,   0.015625f, 0.03125f, 0.0625f,
                                                       0.125f, 0.25f,     0.5f};

/* y at the thin nodes, which are fractions of the way from `step_cm` before the node to
 * it. */
static void splitsnow__thinner(const splitsnow__diffusion *node, double y[SPLITSNOW__THIN]) {
    double k = splitsnow__decay_constant(node);
    double whole = splitsnow__growth(node, k, -node->step_cm);
    for (int i = 0; i < SPLITSNOW__THIN; i++) {
        double part = (double)splitsnow__thin[i];
        if (whole >= 0.0) {
            y[i] = node->before + (node->y - node->before) * part;
        } else {
            double stretch = (node->y - node->before) / whole;
            y[i] = node->y - stretch * splitsnow__growth(node, k, (part - 1.0) * node->step_cm);
        }
    }
}

/* A column of values: value `i` of node `h` is values[h * stride + i]. */
typedef struct splitsnow__column {
    const float *x, *values;
    size_t n, stride;
} splitsnow__column;

static float splitsnow__secant(const splitsnow__column *column, size_t h, size_t i) {
    float step = column->x[h + 1] - column->x[h];
    const float *value = column->values + h * column->stride + i;
    return step > 0.0f ? (value[column->stride] - value[0]) / step : 0.0f;
}

/* Slope at node `h` of the parabola through the node and its two neighbours. */
static float splitsnow__slope(const splitsnow__column *column, size_t h, size_t i) {
    size_t last = column->n - 1, middle;
    const float *x = column->x;
    float left, right, before, after, at_middle;
    if (last == 1) return splitsnow__secant(column, 0, i);
    middle = h < 1 ? 1 : h > last - 1 ? last - 1 : h;
    left = splitsnow__secant(column, middle - 1, i);
    right = splitsnow__secant(column, middle, i);
    before = x[middle] - x[middle - 1];
    after = x[middle + 1] - x[middle];
    at_middle = before + after > 0.0f ? (left * after + right * before) / (before + after) : 0.0f;
    if (h == 0) return 2.0f * left - at_middle;
    return h == last ? 2.0f * right - at_middle : at_middle;
}

/* Fraction of the slope at node `h` that keeps the curve monotone (Fritsch and Carlson
 * 1980). */
static float splitsnow__share(const splitsnow__column *column, size_t h, size_t i) {
    size_t last = column->n - 1;
    float left = splitsnow__secant(column, h < 1 ? 0 : h - 1, i);
    float right = splitsnow__secant(column, h < last ? h : last - 1, i);
    float upward = left < 0.0f && right < 0.0f ? -1.0f : 1.0f;
    float most = 3.0f * upward * (upward * left < upward * right ? left : right);
    float slope = upward * splitsnow__slope(column, h, i);
    if (slope <= most) return slope >= 0.0f ? 1.0f : 0.0f;
    return most > 0.0f ? most / slope : 0.0f;
}

/* ---- Preparing ---- */

struct splitsnow_lookup {
    int quantity;
    uint64_t key; /* of what is prepared */
    size_t n[5];      /* number of nodes of each axis */
    float *axes[5];   /* nodes, as in the file */
    float *places[5]; /* coordinates of the nodes; those of the thickness begin with the thin nodes */
    size_t thin;      /* extra nodes below the first thickness; 0 if the substrate is not black */
    size_t rows;      /* number of thickness nodes, including thin nodes */
    size_t width;     /* vectors per node */
    /* [node][width][8]: y of four components and their slopes along the thickness */
    float *table;
    size_t components; /* number of components; 0 if the wavelengths are the components */
    float *basis;      /* [wavelength / 8][component][8] */
    size_t wavelengths;
    float *wavelength_nm;
    float *numbers; /* memory that holds all of these arrays */
    size_t *absent; /* by grain size: number of thinnest thicknesses without a curve, or NULL */
};

/* The columns around a point: table index of the node, and weight. */
typedef struct splitsnow__corners {
    size_t index[16];
    float weight[16];
    int count;
} splitsnow__corners;

/* Splits corners along an axis whose nodes are `stride` apart. */
static void splitsnow__split(splitsnow__corners *corners, float above, size_t stride) {
    int count = corners->count;
    for (int i = 0; i < count; i++) {
        corners->index[count + i] = corners->index[i] + stride;
        corners->weight[count + i] = corners->weight[i] * above;
        corners->weight[i] *= 1.0f - above;
    }
    corners->count = 2 * count;
}

/* exp(-x) of eight numbers, with x clamped to 0 to 87 (NaN counts as 0). A polynomial, so
 * that it vectorises; its error is below 2e-7 times max(1, x). */
static void splitsnow__exp_neg(float x[8]) {
    const float round = 12582912.0f; /* adding it rounds to an integer */
    uint32_t shifts[8], bits[8];
    float clamped[8], shifted[8], powers[8];
    for (int i = 0; i < 8; i++) {
        float c = x[i] > 0.0f ? x[i] : 0.0f;
        clamped[i] = c < 87.0f ? c : 87.0f;
    }
    for (int i = 0; i < 8; i++) {
        float k, r, p = 1.0f / 5040.0f;
        shifted[i] = clamped[i] * 1.44269504f + round;
        k = shifted[i] - round;
        r = (k * 0.6933594f - clamped[i]) + k * -2.1219444e-4f;
        p = p * r + 1.0f / 720.0f;
        p = p * r + 1.0f / 120.0f;
        p = p * r + 1.0f / 24.0f;
        p = p * r + 1.0f / 6.0f;
        p = p * r + 0.5f;
        powers[i] = p * r * r + r + 1.0f;
    }
    memcpy(shifts, shifted, sizeof shifts);
    memcpy(bits, powers, sizeof bits);
    /* 2^-k by subtracting k from the exponent */
    for (int i = 0; i < 8; i++) bits[i] -= shifts[i] << 23;
    memcpy(x, bits, sizeof bits);
}

/* Scratch memory for preparing one column. */
typedef struct splitsnow__scratch {
    float *y;       /* [row][depth] */
    float *spectra; /* [row][wavelength]; equal to y without a basis */
    float *excess;  /* [wavelength]; only with a basis */
    float *memory;
    size_t depth;
} splitsnow__scratch;

/* Computes y per wavelength from a row of components. */
static void splitsnow__rebuild(const splitsnow_lookup *lookup, const float *components,
                               float *spectrum) {
    for (size_t l = 0; l < lookup->wavelengths; l++) {
        const float *basis = lookup->basis + l / 8 * lookup->components * 8 + l % 8;
        float sum = 0.0f;
        for (size_t k = 0; k < lookup->components; k++) sum += components[k] * basis[8 * k];
        spectrum[l] = sum;
    }
}

/* y of a value of a `linear` file. */
static float splitsnow__depth(int quantity, double value) {
    float left = splitsnow__single(value);
    const float least = 1.12535175e-7f; /* exp(-16) */
    if (quantity == SPLITSNOW_REFLECTANCE) left = 1.0f - left;
    return -logf(left < least ? least : left > 1.0f ? 1.0f : left);
}

/* The value at wavelength `l` of curve `row` of a `linear` file. */
static double splitsnow__curve(const splitsnow *database, int quantity, size_t row, size_t l) {
    size_t components = database->components[quantity];
    const float *coefficients = database->coefficients[quantity] + row * components;
    const float *basis = database->basis[quantity] + l * components;
    double sum = 0.0;
    for (size_t k = 0; k < components; k++) sum += (double)coefficients[k] * (double)basis[k];
    return (double)splitsnow__single(sum);
}

/* As splitsnow__curve, at conditions between nodes, where y is a weighted mean. */
static double splitsnow__mixed(const splitsnow *database, int quantity, const splitsnow__mix *mix,
                               size_t row, size_t l) {
    double sum = 0.0;
    if (mix->count == 1) {
        return splitsnow__curve(database, quantity, mix->part[0] * database->curves + row, l);
    }
    for (size_t i = 0; i < mix->count; i++) {
        double value =
            splitsnow__curve(database, quantity, mix->part[i] * database->curves + row, l), y;
        if (quantity == SPLITSNOW_TRANSMITTANCE) y = -log(value > 1e-30 ? value : 1e-30);
        else y = -log(1.0 - value > 1e-9 ? 1.0 - value : 1e-9);
        y = y > 0.0 ? y : 0.0;
        sum += mix->weight[i] * (y < (double)SPLITSNOW__DARKEST ? y : (double)SPLITSNOW__DARKEST);
    }
    return quantity == SPLITSNOW_TRANSMITTANCE ? exp(-sum) : -expm1(-sum);
}

/* Reads the nodes of a column from the file. `row` is the curve of its first thickness; the
 * first `absent` thicknesses have no curve. */
static void splitsnow__read_column(const splitsnow_lookup *lookup, const splitsnow *database,
                                   const splitsnow__mix *mix, size_t row, size_t absent,
                                   const splitsnow__scratch *scratch) {
    int quantity = lookup->quantity;
    size_t depth = scratch->depth;
    for (size_t h = 0; h < lookup->n[3]; h++, row += lookup->n[4]) {
        float *y = scratch->y + (lookup->thin + h) * depth;
        for (size_t i = 0; i < depth; i++) {
            if (h < absent) {
                y[i] = 0.0f;
                continue;
            }
            if (lookup->components == 0) {
                float here = splitsnow__depth(
                    quantity, splitsnow__mixed(database, quantity, mix, row, i));
                /* Noise must not make a slab transmit more, or reflect less, than a thinner
                 * slab. Over a substrate, more snow may reflect less. */
                float least = h > 0 && lookup->thin > 0 ? (y - depth)[i] : 0.0f;
                y[i] = here > least ? here : least;
                continue;
            }
            y[i] = 0.0f;
            for (size_t part = 0; part < mix->count; part++) {
                size_t curve = mix->part[part] * database->curves + row;
                float c = database->coefficients[quantity][curve * depth + i];
                y[i] += (float)mix->weight[part] * c;
            }
        }
    }
}

/* Fills the extra nodes below the first thickness of a column. */
static void splitsnow__fill_thin(const splitsnow_lookup *lookup,
                                 const splitsnow__scratch *scratch) {
    size_t depth = scratch->depth, nodes = lookup->n[3] < 3 ? lookup->n[3] : 3;
    float first_cm = lookup->axes[3][0];
    splitsnow__column column;
    column.x = lookup->places[3] + SPLITSNOW__THIN;
    column.values = scratch->spectra + SPLITSNOW__THIN * lookup->wavelengths;
    column.n = nodes;
    column.stride = lookup->wavelengths;
    memset(scratch->y, 0, SPLITSNOW__THIN * depth * sizeof(float));
    for (size_t l = 0; l < lookup->wavelengths; l++) {
        double thin[SPLITSNOW__THIN];
        float y = column.values[l], slope;
        splitsnow__diffusion node;
        if (nodes == 1) slope = y / (column.x[0] > FLT_MIN ? column.x[0] : FLT_MIN);
        else slope = splitsnow__slope(&column, 0, l);
        if (nodes > 1 && !(slope > 0.0f)) slope = 0.0f;
        node.y = (double)y;
        node.slope_per_cm = (double)(slope * splitsnow__slope_at(first_cm));
        node.before = 0.0;
        node.step_cm = (double)first_cm;
        splitsnow__thinner(&node, thin);
        for (size_t h = 0; h < SPLITSNOW__THIN; h++) {
            float *to = scratch->y + h * depth, part = splitsnow__single(thin[h]);
            const float *basis = lookup->basis + l / 8 * lookup->components * 8 + l % 8;
            if (lookup->components == 0) to[l] = part;
            for (size_t k = 0; k < lookup->components; k++) to[k] += part * basis[8 * k];
        }
    }
}

/* Writes what the limit adds to the slopes of the wavelengths at node `h`, and returns whether
 * it is other than 0. Adding the nearest spectrum of the basis limits slopes of coefficients. A
 * wavelength darker than e^-16 is left as it is, since its overshoot is invisible. */
static int splitsnow__excess(const splitsnow__column *spectra, size_t h, float *excess) {
    int any = 0;
    for (size_t l = 0; l < spectra->stride; l++) {
        float less = splitsnow__share(spectra, h, l) - 1.0f;
        int visible = spectra->values[h * spectra->stride + l] < SPLITSNOW__DARKEST;
        excess[l] = visible ? less * splitsnow__slope(spectra, h, l) : 0.0f;
        any |= excess[l] != 0.0f;
    }
    return any;
}

/* Adds `weight` times a column to the table, with its first node at index `start`. The
 * first `absent` thicknesses and the thin nodes before them are left out, also from the
 * slopes. */
static void splitsnow__add_column(splitsnow_lookup *lookup, size_t start, float weight,
                                  size_t absent, const splitsnow__scratch *scratch) {
    size_t depth = scratch->depth, begin = absent > 0 ? lookup->thin + absent : 0;
    splitsnow__column y, spectra;
    y.x = spectra.x = lookup->places[3] + begin;
    y.n = spectra.n = lookup->rows - begin;
    y.values = scratch->y + begin * depth;
    y.stride = depth;
    spectra.values = scratch->spectra + begin * lookup->wavelengths;
    spectra.stride = lookup->wavelengths;
    for (size_t h = 0; h < y.n; h++) {
        float *node = lookup->table + start + (begin + h) * lookup->n[4] * lookup->width * 8;
        int limited = lookup->components > 0 && y.n > 1 &&
                      splitsnow__excess(&spectra, h, scratch->excess);
        for (size_t i = 0; i < depth; i++) {
            float slope = y.n > 1 ? splitsnow__slope(&y, h, i) : 0.0f;
            if (y.n > 1 && lookup->components == 0) slope *= splitsnow__share(&y, h, i);
            for (size_t l = 0; l < lookup->wavelengths && limited; l++) {
                size_t vector = l / 8 * lookup->components + i;
                slope += scratch->excess[l] * lookup->basis[vector * 8 + l % 8];
            }
            if (!(fabsf(slope) <= FLT_MAX)) slope = 0.0f; /* numbers from a malicious file */
            node[i / 4 * 8 + i % 4] += y.values[h * depth + i] * weight;
            node[i / 4 * 8 + 4 + i % 4] += slope * weight;
        }
    }
}

/* Whether `value` is within an axis; values beyond an end by at most the tolerance are
 * clamped. */
static int splitsnow__inside(const splitsnow_lookup *lookup, int axis, double value, float *clamped_value) {
    float first = lookup->axes[axis][0], last = lookup->axes[axis][lookup->n[axis] - 1];
    if (axis == SPLITSNOW_THICKNESS_CM && lookup->n[axis] > 1) {
        if (lookup->thin > 0) first = 0.0f;
        last = FLT_MAX;
    }
    *clamped_value = splitsnow__single(value);
    if (*clamped_value >= first && *clamped_value <= last) return 1;
    if (!splitsnow__is_on(first, value) && !splitsnow__is_on(last, value)) return 0;
    *clamped_value = *clamped_value < first ? first : last;
    return 1;
}

/* Fills the table for one snow (`corners` are the columns around it), or for all snow. */
static void splitsnow__fill_table(splitsnow_lookup *lookup, const splitsnow *database,
                                  const splitsnow__mix *mix, const splitsnow__corners *corners,
                                  const splitsnow__scratch *scratch) {
    size_t n_h = lookup->n[3], n_a = lookup->n[4], node = lookup->width * 8;
    size_t snows = lookup->n[0] * lookup->n[1] * lookup->n[2];
    size_t columns = corners != NULL ? (size_t)corners->count : snows;
    for (size_t column = 0; column < columns; column++) {
        size_t from = corners != NULL ? corners->index[column] : column;
        size_t to = corners != NULL ? 0 : column;
        float weight = corners != NULL ? corners->weight[column] : 1.0f;
        size_t size = from / database->counts[2] % database->counts[1];
        size_t absent = database->absent != NULL ? database->absent[size] : 0;
        for (size_t angle = 0; angle < n_a && weight > 0.0f; angle++) {
            const float *y = scratch->y + lookup->thin * scratch->depth;
            float *spectra = scratch->spectra + lookup->thin * lookup->wavelengths;
            splitsnow__read_column(lookup, database, mix, from * n_h * n_a + angle, absent,
                                   scratch);
            for (size_t h = 0; h < n_h && lookup->components > 0; h++) {
                splitsnow__rebuild(lookup, y + h * scratch->depth,
                                   spectra + h * lookup->wavelengths);
            }
            if (lookup->thin > 0 && absent == 0) splitsnow__fill_thin(lookup, scratch);
            for (size_t h = 0; h < lookup->thin && lookup->components > 0 && absent == 0; h++) {
                splitsnow__rebuild(lookup, scratch->y + h * scratch->depth,
                                   scratch->spectra + h * lookup->wavelengths);
            }
            splitsnow__add_column(lookup, (to * lookup->rows * n_a + angle) * node, weight, absent,
                                  scratch);
        }
    }
}

/* Allocates the table and fills the axes, their coordinates and the basis. */
static splitsnow_status splitsnow__shape_lookup(splitsnow_lookup *lookup, const splitsnow *database,
                                                int one, splitsnow__scratch *scratch) {
    size_t chunks = (database->wavelengths + 7) / 8, components = database->components[lookup->quantity];
    size_t nodes = 1, basis = 0, need, scratch_need;
    const float *columns = database->basis[lookup->quantity];
    float *at;
    lookup->wavelengths = database->wavelengths;
    lookup->components = database->logarithmic ? components : 0;
    scratch->depth = database->logarithmic ? components : database->wavelengths;
    lookup->width = (scratch->depth + 3) / 4;
    /* a single thickness needs a second node */
    lookup->thin = database->has_black_substrate || database->counts[3] == 1 ? SPLITSNOW__THIN : 0;
    lookup->rows = lookup->thin + database->counts[3];
    need = SPLITSNOW__THIN + database->wavelengths;
    for (int axis = 0; axis < 5; axis++) {
        size_t n = one && axis < 3 ? 1 : database->counts[axis];
        lookup->n[axis] = n;
        need += 2 * n;
        if (!splitsnow__times(&nodes, axis == 3 ? lookup->rows : n)) return SPLITSNOW_ERROR_TOO_LARGE;
    }
    if (!splitsnow__times(&nodes, 8) || !splitsnow__times(&nodes, lookup->width) ||
        nodes > SPLITSNOW__MAX_TABLE / sizeof(float)) {
        return SPLITSNOW_ERROR_TOO_LARGE;
    }
    basis = chunks * 8;
    if (!splitsnow__times(&basis, lookup->components)) return SPLITSNOW_ERROR_MEMORY;
    need += nodes; /* cannot overflow: axes are part of a file in memory, the table is at most 1 GB */
    if (basis > SIZE_MAX - need) return SPLITSNOW_ERROR_MEMORY;
    need += basis;
    lookup->numbers = (float *)calloc(need, sizeof(float));
    scratch_need = scratch->depth + (lookup->components > 0 ? lookup->wavelengths : 0);
    /* one row more, for excess */
    scratch->memory = splitsnow__times(&scratch_need, lookup->rows + 1) ? splitsnow__floats(scratch_need) : NULL;
    if (lookup->numbers == NULL || scratch->memory == NULL) return SPLITSNOW_ERROR_MEMORY;
    scratch->y = scratch->memory;
    scratch->spectra = lookup->components > 0 ? scratch->y + lookup->rows * scratch->depth : scratch->y;
    scratch->excess = scratch->spectra + lookup->rows * lookup->wavelengths;

    at = lookup->numbers;
    lookup->table = at;
    at += nodes;
    lookup->basis = at;
    at += basis;
    lookup->wavelength_nm = at;
    memcpy(at, database->wavelength_nm, database->wavelengths * sizeof(float));
    at += database->wavelengths;
    for (int axis = 0; axis < 5; axis++) {
        lookup->axes[axis] = at;
        memcpy(at, database->axes[axis], lookup->n[axis] * sizeof(float));
        at += lookup->n[axis];
        lookup->places[axis] = at;
        for (size_t i = 0; axis == 3 && i < lookup->thin; i++) {
            *at++ = splitsnow__place(3, splitsnow__thin[i] * lookup->axes[3][0]);
        }
        for (size_t i = 0; i < lookup->n[axis]; i++) {
            *at++ = splitsnow__place(axis, lookup->axes[axis][i]);
        }
    }
    for (size_t l = 0; l < database->wavelengths && lookup->components > 0; l++) {
        for (size_t k = 0; k < components; k++) {
            lookup->basis[(l / 8 * components + k) * 8 + l % 8] = columns[l * components + k];
        }
    }
    return SPLITSNOW_OK;
}

/* Finds the columns of the file around one snow. */
static splitsnow_status splitsnow__find_columns(splitsnow_lookup *lookup, const splitsnow *database,
                                          const splitsnow_snow *snow, splitsnow__corners *corners) {
    double requested[3];
    size_t stride = 1;
    requested[0] = snow->facetness;
    requested[1] = snow->grain_size_um;
    requested[2] = snow->density_kg_m3;
    corners->index[0] = 0;
    corners->weight[0] = 1.0f;
    corners->count = 1;
    for (int axis = 2; axis >= 0; axis--) {
        size_t n = database->counts[axis], below;
        float value, here, cell[2];
        splitsnow_lookup whole; /* a lookup with the axis of the file */
        whole.axes[axis] = database->axes[axis];
        whole.n[axis] = n;
        if (!splitsnow__inside(&whole, axis, requested[axis], &value)) return SPLITSNOW_ERROR_OUTSIDE;
        here = splitsnow__place(axis, value);
        for (below = 0; below + 2 < n; below++) {
            if (!(splitsnow__place(axis, database->axes[axis][below + 1]) <= here)) break;
        }
        for (int i = 0; i < corners->count; i++) corners->index[i] += below * stride;
        if (n > 1) {
            cell[0] = splitsnow__place(axis, database->axes[axis][below]);
            cell[1] = splitsnow__place(axis, database->axes[axis][below + 1]);
            splitsnow__split(corners, splitsnow__fraction(cell, 2, 0, here), stride);
        }
        lookup->axes[axis][0] = value;
        lookup->places[axis][0] = here;
        stride *= n;
    }
    return SPLITSNOW_OK;
}

void splitsnow_lookup_free(splitsnow_lookup *lookup) {
    if (lookup == NULL) return;
    free(lookup->numbers);
    free(lookup->absent);
    free(lookup);
}

/* Copies the counts of curves that do not exist, for all grain sizes or for those around
 * one snow. */
static splitsnow_status splitsnow__copy_absent(splitsnow_lookup *lookup, const splitsnow *database,
                                         const splitsnow__corners *corners) {
    size_t sizes = database->counts[1];
    if (database->absent == NULL) return SPLITSNOW_OK;
    lookup->absent = (size_t *)splitsnow__allocate(lookup->n[1], sizeof(size_t));
    if (lookup->absent == NULL) return SPLITSNOW_ERROR_MEMORY;
    if (corners == NULL) {
        memcpy(lookup->absent, database->absent, sizes * sizeof(size_t));
        return SPLITSNOW_OK;
    }
    lookup->absent[0] = 0;
    for (int i = 0; i < corners->count; i++) {
        size_t absent = database->absent[corners->index[i] / database->counts[2] % sizes];
        if (corners->weight[i] > 0.0f && absent > lookup->absent[0]) lookup->absent[0] = absent;
    }
    return SPLITSNOW_OK;
}

splitsnow_status splitsnow_prepare(const splitsnow *database, splitsnow_quantity quantity,
                                   const splitsnow_snow *snow,
                                   const splitsnow_condition *conditions, size_t n_conditions,
                                   splitsnow_lookup **lookup) {
    splitsnow__mix mix;
    splitsnow__corners corners;
    splitsnow__scratch scratch;
    splitsnow_lookup *prepared;
    splitsnow_status status;
    if (lookup == NULL) return SPLITSNOW_ERROR_ARGUMENT;
    *lookup = NULL;
    if (database == NULL || (unsigned)quantity > 1 || (conditions == NULL && n_conditions > 0)) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    if (splitsnow_holds_anisotropy(database)) return SPLITSNOW_ERROR_CONTENT;
    if (!splitsnow_has(database, quantity)) return SPLITSNOW_ERROR_NO_QUANTITY;
    status = splitsnow__conditions(database, conditions, n_conditions, &mix);
    if (status != SPLITSNOW_OK) return status;
    prepared = (splitsnow_lookup *)calloc(1, sizeof *prepared);
    if (prepared == NULL) return SPLITSNOW_ERROR_MEMORY;
    memset(&scratch, 0, sizeof scratch);
    prepared->quantity = (int)quantity;
    prepared->key = splitsnow__key(database, quantity, snow, &mix);
    status = splitsnow__shape_lookup(prepared, database, snow != NULL, &scratch);
    if (status == SPLITSNOW_OK && snow != NULL) {
        status = splitsnow__find_columns(prepared, database, snow, &corners);
    }
    if (status == SPLITSNOW_OK) {
        status = splitsnow__copy_absent(prepared, database, snow != NULL ? &corners : NULL);
    }
    if (status == SPLITSNOW_OK) {
        splitsnow__fill_table(prepared, database, &mix, snow != NULL ? &corners : NULL, &scratch);
        *lookup = prepared;
    } else {
        splitsnow_lookup_free(prepared);
    }
    free(scratch.memory);
    return status;
}

/* ---- Queries ---- */

/* A query at one point: the surrounding nodes and their weights. */
typedef struct splitsnow__query {
    splitsnow__corners corners;
    int sets;            /* 1, or 3 if y is extrapolated beyond the last thickness */
    float weights[3][4]; /* value and slope at the node below, then at the node above */
    float components[3][SPLITSNOW__FEW];
    float past_cm; /* distance beyond the last thickness node */
} splitsnow__query;

/* Sums `vectors` vectors of components, starting with vector `first`, to four floats each. */
static void splitsnow__sums(const splitsnow_lookup *lookup, const splitsnow__query *query, int set,
                            size_t first, size_t vectors, float *sums) {
    size_t next = lookup->n[4] * lookup->width * 8;
    const float *weights = query->weights[set];
    for (size_t v = 0; v < vectors; v++) {
        float below[8] = {0}, above[8] = {0}, four[4];
        for (int i = 0; i < query->corners.count; i++) {
            const float *node = lookup->table + query->corners.index[i] + (first + v) * 8;
            float weight = query->corners.weight[i];
            for (int j = 0; j < 8; j++) below[j] += node[j] * weight;
            for (int j = 0; j < 8; j++) above[j] += node[next + (size_t)j] * weight;
        }
        /* an array of its own, so that compilers see that it overlaps no other */
        for (int j = 0; j < 4; j++) {
            four[j] = (below[j] * weights[0] + above[j] * weights[2]) +
                      (below[4 + j] * weights[1] + above[4 + j] * weights[3]);
        }
        memcpy(sums + 4 * v, four, sizeof four);
    }
}

static void splitsnow__set(splitsnow__query *query, int set, float below, float slope_below,
                           float above, float slope_above) {
    query->weights[set][0] = below;
    query->weights[set][1] = slope_below;
    query->weights[set][2] = above;
    query->weights[set][3] = slope_above;
}

/* The thinnest thickness node that a query at this thickness needs: the node below, or that at
 * the thickness. */
static size_t splitsnow__lowest_needed(const float *nodes, size_t n, float cm) {
    size_t lowest = 0;
    while (lowest < n && nodes[lowest] <= cm) lowest++;
    /* beyond the last thickness, the last two nodes are needed */
    lowest = lowest == n && n > 1 ? n - 2 : lowest > 0 ? lowest - 1 : 0;
    for (size_t i = n; i-- > 0;) {
        if (splitsnow__is_on(nodes[i], (double)cm)) lowest = i;
    }
    return lowest;
}

/* The largest count of absent curves at the grain sizes that a query at this size needs: those
 * on both sides, or that at the size. */
static size_t splitsnow__most_absent(const size_t *absent, const float *sizes, size_t n, float size) {
    size_t first = 0, last, most = 0;
    while (first < n && sizes[first] <= size) first++;
    last = first < n ? first : n - 1;
    first = first > 0 ? first - 1 : 0;
    for (size_t i = n; i-- > 0;) {
        if (splitsnow__is_on(sizes[i], (double)size)) first = last = i;
    }
    for (size_t i = first; i <= last; i++) most = absent[i] > most ? absent[i] : most;
    return most;
}

/* Starts a query: finds the nodes around the requested point and their weights. */
static splitsnow_status splitsnow__start_query(const splitsnow_lookup *lookup, const double requested[5],
                                         splitsnow__query *query) {
    size_t stride = lookup->width * 8;
    float values[5];
    splitsnow__corners *corners = &query->corners;
    corners->index[0] = 0;
    corners->weight[0] = 1.0f;
    corners->count = 1;
    query->sets = 1;
    for (int axis = 4; axis >= 0; axis--) {
        const float *nodes = lookup->places[axis];
        size_t n = axis == 3 ? lookup->rows : lookup->n[axis], below;
        float place;
        if (!splitsnow__inside(lookup, axis, requested[axis], &values[axis])) {
            return SPLITSNOW_ERROR_OUTSIDE;
        }
        if (n == 1) continue;
        place = splitsnow__place(axis, values[axis]);
        below = splitsnow__below(nodes, n, place);
        for (int i = 0; i < corners->count; i++) corners->index[i] += below * stride;
        if (axis != 3) {
            splitsnow__split(corners, splitsnow__fraction(nodes, n, below, place), stride);
        } else if (place <= nodes[n - 1]) {
            float t = splitsnow__fraction(nodes, n, below, place), left = 1.0f - t;
            float step = nodes[below + 1] - nodes[below];
            splitsnow__set(query, 0, (1.0f + 2.0f * t) * left * left, t * left * left * step,
                           t * t * (3.0f - 2.0f * t), -t * t * left * step);
        } else {
            query->sets = lookup->quantity == SPLITSNOW_TRANSMITTANCE ? 3 : 1;
            query->past_cm = splitsnow__single(requested[3]) - lookup->axes[3][lookup->n[3] - 1];
            splitsnow__set(query, 0, 0.0f, 0.0f, 1.0f, 0.0f);
            splitsnow__set(query, 1, 1.0f, 0.0f, 0.0f, 0.0f);
            splitsnow__set(query, 2, 0.0f, 0.0f, 0.0f, 1.0f);
        }
        stride *= n;
    }
    if (lookup->absent != NULL &&
        splitsnow__lowest_needed(lookup->axes[3], lookup->n[3], values[3]) <
            splitsnow__most_absent(lookup->absent, lookup->axes[1], lookup->n[1], values[1])) {
        return SPLITSNOW_ERROR_ABSENT;
    }
    for (int set = 0; set < query->sets && lookup->width * 4 <= SPLITSNOW__FEW; set++) {
        splitsnow__sums(lookup, query, set, 0, lookup->components > 0 ? lookup->width : 0,
                        query->components[set]);
    }
    return SPLITSNOW_OK;
}

/* y at the eight wavelengths from index 8 `chunk`. */
static void splitsnow__depths(const splitsnow_lookup *lookup, const splitsnow__query *query,
                              int set, size_t chunk, float y[8]) {
    const float *basis = lookup->basis + chunk * lookup->components * 8;
    float few[SPLITSNOW__FEW], total[8] = {0};
    if (lookup->components == 0) {
        size_t vectors = lookup->width - 2 * chunk;
        splitsnow__sums(lookup, query, set, 2 * chunk, vectors < 2 ? vectors : 2, total);
        memcpy(y, total, sizeof total);
        return;
    }
    for (size_t first = 0; first < lookup->components; first += SPLITSNOW__FEW) {
        size_t count = lookup->components - first;
        const float *components = query->components[set];
        if (lookup->width * 4 > SPLITSNOW__FEW) {
            count = count < SPLITSNOW__FEW ? count : SPLITSNOW__FEW;
            splitsnow__sums(lookup, query, set, first / 4, (count + 3) / 4, few);
            components = few;
        }
        for (size_t k = 0; k < count; k++, basis += 8) {
            float c = components[k];
            for (int i = 0; i < 8; i++) total[i] += c * basis[i];
        }
    }
    memcpy(y, total, sizeof total);
}

/* Values at the eight wavelengths from index 8 `chunk`; beyond the last wavelength, those of y = 0. */
static void splitsnow__values(const splitsnow_lookup *lookup, const splitsnow__query *query,
                              size_t chunk, float y[8]) {
    splitsnow__depths(lookup, query, 0, chunk, y);
    if (query->sets == 3) {
        float before[8], slopes[8];
        const float *nodes = lookup->axes[3] + lookup->n[3] - 1;
        splitsnow__depths(lookup, query, 1, chunk, before);
        splitsnow__depths(lookup, query, 2, chunk, slopes);
        for (size_t i = 0; i < 8 && 8 * chunk + i < lookup->wavelengths; i++) {
            splitsnow__diffusion end;
            end.y = (double)y[i];
            end.slope_per_cm = (double)(slopes[i] * splitsnow__slope_at(nodes[0]));
            end.before = (double)before[i];
            end.step_cm = (double)(nodes[0] - nodes[-1]);
            y[i] = splitsnow__single(splitsnow__deeper(&end, (double)query->past_cm));
        }
    }
    splitsnow__exp_neg(y);
    for (int i = 0; i < 8 && lookup->quantity == SPLITSNOW_REFLECTANCE; i++) y[i] = 1.0f - y[i];
}

/* Starts a query of a lookup of one snow. */
static splitsnow_status splitsnow__start_query_of_one(const splitsnow_lookup *lookup, double thickness_cm,
                                             double incidence_angle_deg, splitsnow__query *query) {
    double requested[5];
    for (int axis = 0; axis < 3; axis++) {
        if (lookup->n[axis] != 1) return SPLITSNOW_ERROR_ARGUMENT;
        requested[axis] = (double)lookup->axes[axis][0];
    }
    requested[3] = thickness_cm;
    requested[4] = incidence_angle_deg;
    return splitsnow__start_query(lookup, requested, query);
}

static void splitsnow__write(const splitsnow_lookup *lookup, const splitsnow__query *query,
                             float *spectrum) {
    size_t n = lookup->wavelengths;
    for (size_t l = 0; l < n; l += 8) {
        float y[8];
        splitsnow__values(lookup, query, l / 8, y);
        if (n - l >= 8) memcpy(spectrum + l, y, sizeof y);
        else memcpy(spectrum + l, y, (n - l) * sizeof(float));
    }
}

splitsnow_status splitsnow_spectrum(const splitsnow_lookup *lookup, double thickness_cm,
                                    double incidence_angle_deg, float *spectrum, size_t n) {
    splitsnow__query query;
    splitsnow_status status;
    if (lookup == NULL || spectrum == NULL || n != lookup->wavelengths) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    status = splitsnow__start_query_of_one(lookup, thickness_cm, incidence_angle_deg, &query);
    if (status == SPLITSNOW_OK) splitsnow__write(lookup, &query, spectrum);
    return status;
}

splitsnow_status splitsnow_spectrum_of(const splitsnow_lookup *lookup, const splitsnow_snow *snow,
                                       double thickness_cm, double incidence_angle_deg, float *spectrum,
                                       size_t n) {
    splitsnow__query query;
    splitsnow_status status;
    double requested[5];
    if (lookup == NULL || snow == NULL || spectrum == NULL || n != lookup->wavelengths) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    requested[0] = snow->facetness;
    requested[1] = snow->grain_size_um;
    requested[2] = snow->density_kg_m3;
    requested[3] = thickness_cm;
    requested[4] = incidence_angle_deg;
    status = splitsnow__start_query(lookup, requested, &query);
    if (status == SPLITSNOW_OK) splitsnow__write(lookup, &query, spectrum);
    return status;
}

/* The index of the wavelength below `nm`, and the weight of the next. */
static size_t splitsnow__between(const float *wavelength_nm, size_t n, double nm, double *share) {
    float single = splitsnow__single(nm);
    size_t low = 0, high = n;
    *share = 0.0;
    while (low < high) { /* number of wavelengths not above `nm` */
        size_t middle = low + (high - low) / 2;
        if (wavelength_nm[middle] <= single) low = middle + 1;
        else high = middle;
    }
    if (low == 0) return 0;
    if (low < n) {
        double here = (double)wavelength_nm[low - 1];
        *share = ((double)single - here) / ((double)wavelength_nm[low] - here);
    }
    return low - 1;
}

splitsnow_status splitsnow_spectrum_at(const splitsnow_lookup *lookup, double thickness_cm,
                                       double incidence_angle_deg, const double *wavelength_nm, size_t n,
                                       float *spectrum) {
    splitsnow__query query;
    splitsnow_status status;
    float cache[2][8]; /* the last even chunk and the last odd chunk */
    size_t number[2] = {SIZE_MAX, SIZE_MAX};
    if (lookup == NULL || ((wavelength_nm == NULL || spectrum == NULL) && n > 0)) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    for (size_t i = 0; i < n; i++) {
        if (wavelength_nm[i] != wavelength_nm[i]) return SPLITSNOW_ERROR_ARGUMENT;
    }
    status = splitsnow__start_query_of_one(lookup, thickness_cm, incidence_angle_deg, &query);
    for (size_t i = 0; i < n && status == SPLITSNOW_OK; i++) {
        double share, value[2];
        size_t below = splitsnow__between(lookup->wavelength_nm, lookup->wavelengths,
                                          wavelength_nm[i], &share);
        value[1] = 0.0;
        for (size_t j = 0; j < (share > 0.0 ? 2u : 1u); j++) {
            size_t chunk = (below + j) / 8, slot = chunk % 2;
            if (number[slot] != chunk) splitsnow__values(lookup, &query, chunk, cache[slot]);
            number[slot] = chunk;
            value[j] = (double)cache[slot][(below + j) % 8];
        }
        spectrum[i] = (float)(share > 0.0 ? value[0] + share * (value[1] - value[0]) : value[0]);
    }
    return status;
}

/* ---- Anisotropy factors ---- */

/* The nodes of an angle, degrees. They go on beyond an end with their mirror image. */
typedef struct splitsnow__angle {
    const float *nodes;
    size_t n;
    int before, after; /* whether there is a mirror image before the first node, after the last */
    int other_side;    /* whether the mirror images are on the other side of the normal */
} splitsnow__angle;

/* Up to four nodes with their weights. */
typedef struct splitsnow__stencil {
    size_t node[4];
    int other_side[4];
    double weight[4];
    size_t count;
} splitsnow__stencil;

struct splitsnow_anisotropy {
    uint64_t key; /* of what is prepared */
    int is_axial; /* whether the light is symmetric about the normal: the azimuth has no effect */
    size_t n[5];  /* number of nodes of each axis */
    float *axes[5];
    splitsnow__angle incidence, view, azimuth;
    size_t block; /* combinations of nodes of `axes` */
    size_t width; /* components of a row: a multiple of four */
    float *table; /* [view][azimuth][combination][component] */
    size_t components;
    float *basis; /* [wavelength / 8][component][8] */
    size_t wavelengths;
    float *numbers; /* memory that holds all of these arrays */
    size_t *absent; /* by grain size: number of thinnest thicknesses without a curve, or NULL */
};

/* The nodes around a direction and a slab, with their weights. */
typedef struct splitsnow__toward {
    splitsnow__mix slab; /* facetness, grain size, density and thickness */
    splitsnow__stencil incidence, view;
    splitsnow__stencil azimuth[2]; /* on the side of the view, on the other side of the normal */
} splitsnow__toward;

/* The node at place `i` of an angle, counted with the mirror images. */
static size_t splitsnow__node_at(const splitsnow__angle *angle, size_t i) {
    if (angle->before && i == 0) return 1;
    i -= (size_t)angle->before;
    return i < angle->n ? i : angle->n - 2;
}

static double splitsnow__angle_at(const splitsnow__angle *angle, size_t i) {
    const float *nodes = angle->nodes;
    size_t n = angle->n;
    if (angle->before && i == 0) return 2.0 * (double)nodes[0] - (double)nodes[1];
    i -= (size_t)angle->before;
    return i < n ? (double)nodes[i] : 2.0 * (double)nodes[n - 1] - (double)nodes[n - 2];
}

/* The nodes around `x` and their weights in a cubic Hermite curve, whose slopes are those of
 * parabolas through three places. */
static void splitsnow__stencil_at(const splitsnow__angle *angle, double x,
                                  splitsnow__stencil *stencil) {
    size_t n = angle->n + (size_t)angle->before + (size_t)angle->after, cell = 0, first, last;
    double places[4] = {0}, step, t, far, slopes[2];
    double *weight = stencil->weight;
    while (cell + 2 < n && splitsnow__angle_at(angle, cell + 1) <= x) cell++;
    memset(weight, 0, sizeof stencil->weight);
    first = cell > 0 ? cell - 1 : 0;
    last = cell + 2 < n ? cell + 2 : n - 1;
    if (n < 2 || splitsnow__angle_at(angle, cell) == x) {
        first = last = cell;
        weight[0] = 1.0;
    }
    stencil->count = last - first + 1;
    for (size_t i = first; i <= last; i++) {
        int mirrored = (angle->before && i == 0) || i - (size_t)angle->before >= angle->n;
        stencil->node[i - first] = splitsnow__node_at(angle, i);
        stencil->other_side[i - first] = angle->other_side && mirrored;
        places[i - first] = splitsnow__angle_at(angle, i);
    }
    if (first == last) return;
    cell -= first; /* from here, places count from `first` */
    step = places[cell + 1] - places[cell];
    t = (x - places[cell]) / step;
    far = t * t * (3.0 - 2.0 * t);
    weight[cell] += 1.0 - far;
    weight[cell + 1] += far;
    slopes[0] = t * (1.0 - t) * (1.0 - t) * step;
    slopes[1] = -t * t * (1.0 - t) * step;
    for (size_t side = 0; side < 2; side++) {
        size_t place = cell + side, from = place > 0 ? place - 1 : 0;
        double left, right, shares[2] = {1.0, 0.0};
        if (stencil->count > 2) {
            /* the slope at an end is that of the parabola through the last three places */
            if (place + 1 == stencil->count) from = place - 2;
            left = places[from + 1] - places[from];
            right = places[from + 2] - places[from + 1];
            if (place == from) {
                shares[0] = 1.0 + left / (left + right);
                shares[1] = -(left / (left + right));
            } else if (place == from + 1) {
                shares[0] = right / (left + right);
                shares[1] = 1.0 - shares[0];
            } else {
                shares[1] = 1.0 + right / (left + right);
                shares[0] = -(right / (left + right));
            }
        } else {
            from = 0;
        }
        for (size_t i = 0; i < 2; i++) {
            double share;
            if (shares[i] == 0.0) continue;
            share = shares[i] * slopes[side] / (places[from + i + 1] - places[from + i]);
            weight[from + i + 1] += share;
            weight[from + i] -= share;
        }
    }
}

/* Allocates the table, and fills the axes and the basis. */
static splitsnow_status splitsnow__shape_anisotropy(splitsnow_anisotropy *anisotropy,
                                                    const splitsnow *database,
                                                    splitsnow_quantity quantity, int one) {
    const int views[2] = {SPLITSNOW_VIEW_DEG, SPLITSNOW_RELATIVE_AZIMUTH_DEG};
    size_t components = database->components[quantity], chunks = (database->wavelengths + 7) / 8;
    size_t table = 1, basis = chunks * 8, need = 0;
    const float *columns = database->basis[quantity];
    float *at;
    anisotropy->wavelengths = database->wavelengths;
    anisotropy->components = components;
    anisotropy->width = (components + 3) / 4 * 4;
    anisotropy->block = 1;
    for (int axis = 0; axis < 5; axis++) {
        anisotropy->n[axis] = one && axis < 3 ? 1 : database->counts[axis];
        anisotropy->block *= anisotropy->n[axis]; /* at most the number of curves of the file */
        need += anisotropy->n[axis];
    }
    for (int i = 0; i < 2; i++) need += database->counts[views[i]];
    if (!splitsnow__times(&table, anisotropy->block) || !splitsnow__times(&basis, components) ||
        !splitsnow__times(&table, database->counts[views[0]]) ||
        !splitsnow__times(&table, database->counts[views[1]]) ||
        !splitsnow__times(&table, anisotropy->width) || basis > SIZE_MAX - need ||
        table > SIZE_MAX - need - basis) {
        return SPLITSNOW_ERROR_MEMORY;
    }
    anisotropy->numbers = (float *)calloc(need + basis + table, sizeof(float));
    if (anisotropy->numbers == NULL) return SPLITSNOW_ERROR_MEMORY;
    at = anisotropy->numbers;
    anisotropy->table = at;
    at += table;
    anisotropy->basis = at;
    at += basis;
    for (int axis = 0; axis < 5; axis++) {
        anisotropy->axes[axis] = at;
        memcpy(at, database->axes[axis], anisotropy->n[axis] * sizeof(float));
        at += anisotropy->n[axis];
    }
    for (int i = 0; i < 2; i++) {
        splitsnow__angle *angle = i == 0 ? &anisotropy->view : &anisotropy->azimuth;
        angle->nodes = at;
        angle->n = database->counts[views[i]];
        memcpy(at, database->axes[views[i]], angle->n * sizeof(float));
        at += angle->n;
    }
    anisotropy->incidence.nodes = anisotropy->axes[4];
    anisotropy->incidence.n = anisotropy->n[4];
    for (size_t l = 0; l < database->wavelengths; l++) {
        for (size_t k = 0; k < components; k++) {
            anisotropy->basis[(l / 8 * components + k) * 8 + l % 8] = columns[l * components + k];
        }
    }
    return SPLITSNOW_OK;
}

/* Finds where the angles go on beyond their ends: the factors are symmetric about the plane of
 * incidence, and a view (or light) at the angle -x is one at x from the other side. */
static void splitsnow__mirror(splitsnow_anisotropy *anisotropy) {
    splitsnow__angle *azimuth = &anisotropy->azimuth;
    int first = azimuth->nodes[0] == 0.0f, last = azimuth->nodes[azimuth->n - 1] == 180.0f, sides;
    anisotropy->is_axial = azimuth->n == 1 && anisotropy->incidence.n == 1 &&
                           anisotropy->incidence.nodes[0] == 0.0f;
    /* what is on the other side of the normal must be within the azimuths */
    sides = anisotropy->is_axial || (first && last);
    azimuth->before = azimuth->n > 1 && first;
    azimuth->after = azimuth->n > 1 && last;
    for (int i = 0; i < 2; i++) {
        splitsnow__angle *angle = i == 0 ? &anisotropy->view : &anisotropy->incidence;
        angle->before = angle->n > 1 && sides && angle->nodes[0] == 0.0f;
        angle->other_side = 1;
    }
}

/* Fills the table for the combinations `snows` of the nodes of one snow, or for all snow. */
static void splitsnow__fill_anisotropy(splitsnow_anisotropy *anisotropy, const splitsnow *database,
                                       splitsnow_quantity quantity, const splitsnow__mix *mix,
                                       const splitsnow__mix *snows) {
    size_t views = anisotropy->view.n * anisotropy->azimuth.n, slabs = anisotropy->n[3] * anisotropy->n[4];
    size_t parts = 1, components = anisotropy->components;
    float *row = anisotropy->table;
    for (int axis = SPLITSNOW__FIRST_OPTIONAL; axis < SPLITSNOW__FIRST_VIEW; axis++) {
        if (database->counts[axis] > 0) parts *= database->counts[axis];
    }
    for (size_t i = 0; i < views * anisotropy->block; i++, row += anisotropy->width) {
        size_t view = i / anisotropy->block, curve = i % anisotropy->block;
        for (size_t k = 0; k < components; k++) {
            double sum = 0.0;
            for (size_t corner = 0; corner < (snows != NULL ? snows->count : 1); corner++) {
                size_t place = snows != NULL ? snows->part[corner] * slabs + curve : curve;
                float mean = 0.0f;
                for (size_t part = 0; part < mix->count; part++) {
                    size_t block = view * parts + mix->part[part];
                    mean += (float)mix->weight[part] *
                            database->coefficients[quantity][(block * database->curves + place) * components + k];
                }
                sum += (snows != NULL ? snows->weight[corner] : 1.0) * (double)mean;
            }
            row[k] = (float)sum;
        }
    }
}

void splitsnow_anisotropy_free(splitsnow_anisotropy *anisotropy) {
    if (anisotropy == NULL) return;
    free(anisotropy->numbers);
    free(anisotropy->absent);
    free(anisotropy);
}

/* Finds the combinations of nodes around one snow, and puts it on the axes. */
static splitsnow_status splitsnow__find_snow(splitsnow_anisotropy *anisotropy, const splitsnow *database,
                                             const splitsnow_snow *snow, splitsnow__mix *snows) {
    double requested[3];
    requested[0] = snow->facetness;
    requested[1] = snow->grain_size_um;
    requested[2] = snow->density_kg_m3;
    snows->part[0] = 0;
    snows->weight[0] = 1.0;
    snows->count = 1;
    for (int axis = 0; axis < 3; axis++) {
        size_t below, n = database->counts[axis];
        double share;
        if (!splitsnow__bracket(axis, database->axes[axis], n, requested[axis], &below, &share)) {
            return SPLITSNOW_ERROR_OUTSIDE;
        }
        splitsnow__refine(snows, n, below, share);
        anisotropy->axes[axis][0] = (float)requested[axis];
    }
    return SPLITSNOW_OK;
}

/* Copies the counts of curves that do not exist, for all grain sizes or for one snow. */
static splitsnow_status splitsnow__keep_absent(splitsnow_anisotropy *anisotropy,
                                               const splitsnow *database, int one) {
    size_t n = anisotropy->n[1];
    if (database->absent == NULL) return SPLITSNOW_OK;
    anisotropy->absent = (size_t *)splitsnow__allocate(n, sizeof(size_t));
    if (anisotropy->absent == NULL) return SPLITSNOW_ERROR_MEMORY;
    memcpy(anisotropy->absent, database->absent, n * sizeof(size_t));
    if (one) {
        anisotropy->absent[0] = splitsnow__most_absent(database->absent, database->axes[1],
                                                       database->counts[1], anisotropy->axes[1][0]);
    }
    return SPLITSNOW_OK;
}

splitsnow_status splitsnow_prepare_anisotropy(const splitsnow *database, splitsnow_quantity quantity,
                                              const splitsnow_snow *snow,
                                              const splitsnow_condition *conditions,
                                              size_t n_conditions,
                                              splitsnow_anisotropy **anisotropy) {
    splitsnow__mix mix, snows;
    splitsnow_anisotropy *prepared;
    splitsnow_status status;
    if (anisotropy == NULL) return SPLITSNOW_ERROR_ARGUMENT;
    *anisotropy = NULL;
    if (database == NULL || (unsigned)quantity > 1 || (conditions == NULL && n_conditions > 0)) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    if (!splitsnow_holds_anisotropy(database)) return SPLITSNOW_ERROR_CONTENT;
    if (!splitsnow_has(database, quantity)) return SPLITSNOW_ERROR_NO_QUANTITY;
    status = splitsnow__conditions(database, conditions, n_conditions, &mix);
    if (status != SPLITSNOW_OK) return status;
    prepared = (splitsnow_anisotropy *)calloc(1, sizeof *prepared);
    if (prepared == NULL) return SPLITSNOW_ERROR_MEMORY;
    prepared->key = splitsnow__key(database, quantity, snow, &mix);
    status = splitsnow__shape_anisotropy(prepared, database, quantity, snow != NULL);
    if (status == SPLITSNOW_OK && snow != NULL) {
        status = splitsnow__find_snow(prepared, database, snow, &snows);
    }
    if (status == SPLITSNOW_OK) status = splitsnow__keep_absent(prepared, database, snow != NULL);
    if (status == SPLITSNOW_OK) {
        splitsnow__mirror(prepared);
        splitsnow__fill_anisotropy(prepared, database, quantity, &mix, snow != NULL ? &snows : NULL);
        *anisotropy = prepared;
    } else {
        splitsnow_anisotropy_free(prepared);
    }
    return status;
}

/* Whether `x` is within the nodes; clamps a value beyond an end by at most the tolerance. */
static int splitsnow__within(const splitsnow__angle *angle, double *x) {
    float first = angle->nodes[0], last = angle->nodes[angle->n - 1];
    if (*x >= (double)first && *x <= (double)last) return 1;
    if (!splitsnow__is_on(first, *x) && !splitsnow__is_on(last, *x)) return 0;
    *x = *x < (double)first ? (double)first : (double)last;
    return 1;
}

/* Finds the nodes around a slab and the directions. */
static splitsnow_status splitsnow__start_toward(const splitsnow_anisotropy *anisotropy,
                                                const splitsnow_snow *snow, double thickness_cm,
                                                const splitsnow_angles *angles,
                                                splitsnow__toward *toward) {
    double values[4], view = angles->view_deg, incidence = angles->incidence_angle_deg;
    double azimuth = anisotropy->is_axial ? (double)anisotropy->azimuth.nodes[0]
                                          : fmod(angles->relative_azimuth_deg, 360.0);
    const float *nodes = anisotropy->axes[3];
    size_t n = anisotropy->n[3];
    values[0] = snow != NULL ? snow->facetness : (double)anisotropy->axes[0][0];
    values[1] = snow != NULL ? snow->grain_size_um : (double)anisotropy->axes[1][0];
    values[2] = snow != NULL ? snow->density_kg_m3 : (double)anisotropy->axes[2][0];
    values[3] = thickness_cm;
    if (values[3] >= 0.0 && values[3] < (double)nodes[0]) values[3] = (double)nodes[0];
    if (values[3] > (double)nodes[n - 1]) values[3] = (double)nodes[n - 1];
    toward->slab.part[0] = 0;
    toward->slab.weight[0] = 1.0;
    toward->slab.count = 1;
    for (int axis = 0; axis < 4; axis++) {
        size_t below;
        double share;
        if (!splitsnow__bracket(axis, anisotropy->axes[axis], anisotropy->n[axis], values[axis], &below,
                                &share)) {
            return SPLITSNOW_ERROR_OUTSIDE;
        }
        splitsnow__refine(&toward->slab, anisotropy->n[axis], below, share);
    }
    if (anisotropy->absent != NULL &&
        splitsnow__lowest_needed(nodes, n, (float)values[3]) <
            splitsnow__most_absent(anisotropy->absent, anisotropy->axes[1], anisotropy->n[1],
                                   (float)values[1])) {
        return SPLITSNOW_ERROR_ABSENT;
    }
    if (azimuth < 0.0) azimuth += 360.0;
    azimuth = azimuth < 360.0 - azimuth || anisotropy->is_axial ? azimuth : 360.0 - azimuth;
    if (!splitsnow__within(&anisotropy->view, &view) ||
        !splitsnow__within(&anisotropy->incidence, &incidence) ||
        !splitsnow__within(&anisotropy->azimuth, &azimuth)) {
        return SPLITSNOW_ERROR_OUTSIDE;
    }
    splitsnow__stencil_at(&anisotropy->view, view, &toward->view);
    splitsnow__stencil_at(&anisotropy->incidence, incidence, &toward->incidence);
    splitsnow__stencil_at(&anisotropy->azimuth, azimuth, &toward->azimuth[0]);
    /* without effect if no node is on the other side */
    splitsnow__stencil_at(&anisotropy->azimuth, 180.0 - azimuth, &toward->azimuth[1]);
    return SPLITSNOW_OK;
}

/* Adds `weight` times the components from `row` of the slab to `sums`. */
static void splitsnow__add_slab(const splitsnow_anisotropy *anisotropy, const splitsnow__mix *slab,
                                const float *row, double weight, size_t count, double *sums) {
    size_t stride = anisotropy->n[4] * anisotropy->width;
    for (size_t corner = 0; corner < slab->count; corner++) {
        const float *from = row + slab->part[corner] * stride;
        double share = weight * slab->weight[corner];
        for (size_t k = 0; k < count; k += 4) {
            for (size_t j = 0; j < 4; j++) sums[k + j] += share * (double)from[k + j];
        }
    }
}

/* The `count` components (a multiple of four) from `first`, summed over the nodes. */
static void splitsnow__add_views(const splitsnow_anisotropy *anisotropy,
                                 const splitsnow__toward *toward, size_t first, size_t count,
                                 double *sums) {
    const splitsnow__stencil *views = &toward->view, *lights = &toward->incidence;
    for (size_t v = 0; v < views->count; v++) {
        for (size_t i = 0; i < lights->count; i++) {
            const splitsnow__stencil *azimuths =
                &toward->azimuth[views->other_side[v] != lights->other_side[i]];
            for (size_t a = 0; a < azimuths->count; a++) {
                size_t view = views->node[v] * anisotropy->azimuth.n + azimuths->node[a];
                size_t row = view * anisotropy->block + lights->node[i];
                splitsnow__add_slab(anisotropy, &toward->slab,
                                    anisotropy->table + row * anisotropy->width + first,
                                    views->weight[v] * lights->weight[i] * azimuths->weight[a], count,
                                    sums);
            }
        }
    }
}

/* A factor in single precision. Curves through nodes that are very close together may exceed it;
 * below 0 are only noise and the overshoot of curves. */
static float splitsnow__factor(double value) {
    return value > (double)FLT_MAX ? FLT_MAX : value < 0.0 ? 0.0f : (float)value;
}

static void splitsnow__write_factors(const splitsnow_anisotropy *anisotropy,
                                     const splitsnow__toward *toward, float *spectrum) {
    for (size_t first = 0; first < anisotropy->components; first += SPLITSNOW__FEW) {
        double sums[SPLITSNOW__FEW] = {0};
        size_t count = anisotropy->components - first;
        if (count > SPLITSNOW__FEW) count = SPLITSNOW__FEW;
        splitsnow__add_views(anisotropy, toward, first, (count + 3) / 4 * 4, sums);
        for (size_t l = 0; l < anisotropy->wavelengths; l += 8) {
            const float *basis = anisotropy->basis + (l * anisotropy->components + 8 * first);
            double values[8] = {0};
            for (size_t k = 0; k < count; k++, basis += 8) {
                for (int j = 0; j < 8; j++) values[j] += sums[k] * (double)basis[j];
            }
            for (size_t j = 0; j < 8 && l + j < anisotropy->wavelengths; j++) {
                double before = first > 0 ? (double)spectrum[l + j] : 0.0;
                spectrum[l + j] = splitsnow__factor(before + values[j]);
            }
        }
    }
}

/* Whether queries of one snow are possible. */
static int splitsnow__is_one(const splitsnow_anisotropy *anisotropy) {
    return anisotropy->n[0] == 1 && anisotropy->n[1] == 1 && anisotropy->n[2] == 1;
}

splitsnow_status splitsnow_anisotropy_factor(const splitsnow_anisotropy *anisotropy,
                                             double thickness_cm, const splitsnow_angles *angles,
                                             float *spectrum, size_t n) {
    splitsnow__toward toward;
    splitsnow_status status;
    if (anisotropy == NULL || angles == NULL || spectrum == NULL || n != anisotropy->wavelengths ||
        !splitsnow__is_one(anisotropy)) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    status = splitsnow__start_toward(anisotropy, NULL, thickness_cm, angles, &toward);
    if (status == SPLITSNOW_OK) splitsnow__write_factors(anisotropy, &toward, spectrum);
    return status;
}

splitsnow_status splitsnow_anisotropy_factor_of(const splitsnow_anisotropy *anisotropy,
                                                const splitsnow_snow *snow, double thickness_cm,
                                                const splitsnow_angles *angles, float *spectrum,
                                                size_t n) {
    splitsnow__toward toward;
    splitsnow_status status;
    if (anisotropy == NULL || snow == NULL || angles == NULL || spectrum == NULL ||
        n != anisotropy->wavelengths) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    status = splitsnow__start_toward(anisotropy, snow, thickness_cm, angles, &toward);
    if (status == SPLITSNOW_OK) splitsnow__write_factors(anisotropy, &toward, spectrum);
    return status;
}

/* Multiplies the values of a query into a spectrum. */
static void splitsnow__multiply(const splitsnow_lookup *lookup, const splitsnow__query *query,
                                float *spectrum) {
    for (size_t l = 0; l < lookup->wavelengths; l += 8) {
        float values[8];
        splitsnow__values(lookup, query, l / 8, values);
        for (size_t j = 0; j < 8 && l + j < lookup->wavelengths; j++) spectrum[l + j] *= values[j];
    }
}

splitsnow_status splitsnow_directional_factor(const splitsnow_lookup *lookup,
                                              const splitsnow_anisotropy *anisotropy,
                                              double thickness_cm, const splitsnow_angles *angles,
                                              float *spectrum, size_t n) {
    splitsnow__query query;
    splitsnow__toward toward;
    splitsnow_status status;
    if (lookup == NULL || anisotropy == NULL || angles == NULL || spectrum == NULL ||
        n != anisotropy->wavelengths || !splitsnow__is_one(anisotropy)) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    if (lookup->key != anisotropy->key) return SPLITSNOW_ERROR_MISMATCH;
    status = splitsnow__start_toward(anisotropy, NULL, thickness_cm, angles, &toward);
    if (status != SPLITSNOW_OK) return status;
    status = splitsnow__start_query_of_one(lookup, thickness_cm, angles->incidence_angle_deg, &query);
    if (status != SPLITSNOW_OK) return status;
    splitsnow__write_factors(anisotropy, &toward, spectrum);
    splitsnow__multiply(lookup, &query, spectrum);
    return SPLITSNOW_OK;
}

splitsnow_status splitsnow_directional_factor_of(const splitsnow_lookup *lookup,
                                                 const splitsnow_anisotropy *anisotropy,
                                                 const splitsnow_snow *snow, double thickness_cm,
                                                 const splitsnow_angles *angles, float *spectrum,
                                                 size_t n) {
    splitsnow__query query;
    splitsnow__toward toward;
    splitsnow_status status;
    double requested[5];
    if (lookup == NULL || anisotropy == NULL || snow == NULL || angles == NULL || spectrum == NULL ||
        n != anisotropy->wavelengths) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    if (lookup->key != anisotropy->key) return SPLITSNOW_ERROR_MISMATCH;
    status = splitsnow__start_toward(anisotropy, snow, thickness_cm, angles, &toward);
    if (status != SPLITSNOW_OK) return status;
    requested[0] = snow->facetness;
    requested[1] = snow->grain_size_um;
    requested[2] = snow->density_kg_m3;
    requested[3] = thickness_cm;
    requested[4] = angles->incidence_angle_deg;
    status = splitsnow__start_query(lookup, requested, &query);
    if (status != SPLITSNOW_OK) return status;
    splitsnow__write_factors(anisotropy, &toward, spectrum);
    splitsnow__multiply(lookup, &query, spectrum);
    return SPLITSNOW_OK;
}

/* ---- Colour ---- */

/* The CIE 1931 2-degree observer, 360-830 nm every 5 nm: x, y, z (from crates/spectra/data/cie_1931_2deg.csv). */
enum { SPLITSNOW__OBSERVED = 95, SPLITSNOW__LIT = 85 };

static const float splitsnow__observer[3 * SPLITSNOW__OBSERVED] = {
    0.0001299f, 3.917e-06f, 0.0006061f, 0.0002321f, 6.965e-06f, 0.001086f, 0.0004149f, 1.239e-05f,
    0.001946f, 0.0007416f, 2.202e-05f, 0.003486f, 0.001368f, 3.9e-05f, 0.006450001f, 0.002236f,
    6.4e-05f, 0.01054999f, 0.004243f, 0.00012f, 0.02005001f, 0.00765f, 0.000217f, 0.03621f,
    0.01431f, 0.000396f, 0.06785001f, 0.02319f, 0.00064f, 0.1102f, 0.04351f, 0.00121f, 0.2074f,
    0.07763f, 0.00218f, 0.3713f, 0.13438f, 0.004f, 0.6456f, 0.21477f, 0.0073f, 1.0390501f, 0.2839f,
    0.0116f, 1.3856f, 0.3285f, 0.01684f, 1.62296f, 0.34828f, 0.023f, 1.74706f, 0.34806f, 0.0298f,
    1.7826f, 0.3362f, 0.038f, 1.77211f, 0.3187f, 0.048f, 1.7441f, 0.2908f, 0.06f, 1.6692f, 0.2511f,
    0.0739f, 1.5281f, 0.19536f, 0.09098f, 1.28764f, 0.1421f, 0.1126f, 1.0419f, 0.09564f, 0.13902f,
    0.8129501f, 0.05795001f, 0.1693f, 0.6162f, 0.03201f, 0.20802f, 0.46518f, 0.0147f, 0.2586f,
    0.3533f, 0.0049f, 0.323f, 0.272f, 0.0024f, 0.4073f, 0.2123f, 0.0093f, 0.503f, 0.1582f, 0.0291f,
    0.6082f, 0.1117f, 0.06327f, 0.71f, 0.07824999f, 0.1096f, 0.7932f, 0.05725001f, 0.1655f, 0.862f,
    0.04216f, 0.2257499f, 0.9148501f, 0.02984f, 0.2904f, 0.954f, 0.0203f, 0.3597f, 0.9803f, 0.0134f,
    0.4334499f, 0.9949501f, 0.008749999f, 0.5120501f, 1.0f, 0.005749999f, 0.5945f, 0.995f, 0.0039f,
    0.6784f, 0.9786f, 0.002749999f, 0.7621f, 0.952f, 0.0021f, 0.8425f, 0.9154f, 0.0018f, 0.9163f,
    0.87f, 0.001650001f, 0.9786f, 0.8163f, 0.0014f, 1.0263f, 0.757f, 0.0011f, 1.0567f, 0.6949f,
    0.001f, 1.0622f, 0.631f, 0.0008f, 1.0456f, 0.5668f, 0.0006f, 1.0026f, 0.503f, 0.00034f, 0.9384f,
    0.4412f, 0.00024f, 0.8544499f, 0.381f, 0.00019f, 0.7514f, 0.321f, 0.0001f, 0.6424f, 0.265f,
    4.999999e-05f, 0.5419f, 0.217f, 3e-05f, 0.4479f, 0.175f, 2e-05f, 0.3608f, 0.1382f, 1e-05f,
    0.2835f, 0.107f, 0.0f, 0.2187f, 0.0816f, 0.0f, 0.1649f, 0.061f, 0.0f, 0.1212f, 0.04458f, 0.0f,
    0.0874f, 0.032f, 0.0f, 0.0636f, 0.0232f, 0.0f, 0.04677f, 0.017f, 0.0f, 0.0329f, 0.01192f, 0.0f,
    0.0227f, 0.00821f, 0.0f, 0.01584f, 0.005723f, 0.0f, 0.01135916f, 0.004102f, 0.0f, 0.008110916f,
    0.002929f, 0.0f, 0.005790346f, 0.002091f, 0.0f, 0.004109457f, 0.001484f, 0.0f, 0.002899327f,
    0.001047f, 0.0f, 0.00204919f, 0.00074f, 0.0f, 0.001439971f, 0.00052f, 0.0f, 0.0009999493f,
    0.0003611f, 0.0f, 0.0006900786f, 0.0002492f, 0.0f, 0.0004760213f, 0.0001719f, 0.0f,
    0.0003323011f, 0.00012f, 0.0f, 0.0002348261f, 8.48e-05f, 0.0f, 0.0001661505f, 6e-05f, 0.0f,
    0.000117413f, 4.24e-05f, 0.0f, 8.307527e-05f, 3e-05f, 0.0f, 5.870652e-05f, 2.12e-05f, 0.0f,
    4.150994e-05f, 1.499e-05f, 0.0f, 2.935326e-05f, 1.06e-05f, 0.0f, 2.067383e-05f, 7.4657e-06f,
    0.0f, 1.455977e-05f, 5.2578e-06f, 0.0f, 1.025398e-05f, 3.7029e-06f, 0.0f, 7.221456e-06f,
    2.6078e-06f, 0.0f, 5.085868e-06f, 1.8366e-06f, 0.0f, 3.581652e-06f, 1.2934e-06f, 0.0f,
    2.522525e-06f, 9.1093e-07f, 0.0f, 1.776509e-06f, 6.4153e-07f, 0.0f, 1.251141e-06f, 4.5181e-07f,
    0.0f};

/* Illuminants of CIE 015:2018, every 5 nm up to 780 nm: daylights and A from 360 nm, other
 * lamps from 380 nm. */
static const float splitsnow__d55[SPLITSNOW__LIT] = {
    30.621f, 32.464f, 34.308f, 33.446f, 32.584f, 35.335f, 38.087f, 49.518f, 60.949f, 64.751f,
    68.554f, 70.065f, 71.577f, 69.746f, 67.914f, 76.76f, 85.605f, 91.799f, 97.993f, 99.228f,
    100.463f, 100.188f, 99.913f, 101.326f, 102.739f, 100.409f, 98.078f, 99.379f, 100.68f, 100.688f,
    100.695f, 100.341f, 99.987f, 102.098f, 104.21f, 103.156f, 102.102f, 102.535f, 102.968f,
    101.484f, 100.f, 98.608f, 97.216f, 97.482f, 97.749f, 94.59f, 91.432f, 92.926f, 94.419f, 94.78f,
    95.14f, 94.68f, 94.22f, 92.334f, 90.448f, 91.389f, 92.33f, 90.592f, 88.854f, 89.586f, 90.317f,
    92.133f, 93.95f, 91.953f, 89.956f, 84.817f, 79.677f, 81.258f, 82.84f, 83.842f, 84.844f, 77.539f,
    70.235f, 74.768f, 79.301f, 82.147f, 84.993f, 78.437f, 71.88f, 62.337f, 52.793f, 64.36f, 75.927f,
    73.872f, 71.818f};
static const float splitsnow__d65[SPLITSNOW__LIT] = {
    46.6383f, 49.3637f, 52.0891f, 51.0323f, 49.9755f, 52.3118f, 54.6482f, 68.7015f, 82.7549f,
    87.1204f, 91.486f, 92.4589f, 93.4318f, 90.057f, 86.6823f, 95.7736f, 104.865f, 110.936f,
    117.008f, 117.41f, 117.812f, 116.336f, 114.861f, 115.392f, 115.923f, 112.367f, 108.811f,
    109.082f, 109.354f, 108.578f, 107.802f, 106.296f, 104.79f, 106.239f, 107.689f, 106.047f,
    104.405f, 104.225f, 104.046f, 102.023f, 100.f, 98.1671f, 96.3342f, 96.0611f, 95.788f, 92.2368f,
    88.6856f, 89.3459f, 90.0062f, 89.8026f, 89.5991f, 88.6489f, 87.6987f, 85.4936f, 83.2886f,
    83.4939f, 83.6992f, 81.863f, 80.0268f, 80.1207f, 80.2146f, 81.2462f, 82.2778f, 80.281f,
    78.2842f, 74.0027f, 69.7213f, 70.6652f, 71.6091f, 72.979f, 74.349f, 67.9765f, 61.604f, 65.7448f,
    69.8856f, 72.4863f, 75.087f, 69.3398f, 63.5927f, 55.0054f, 46.4182f, 56.6118f, 66.8054f,
    65.0941f, 63.3828f};
static const float splitsnow__fl3_15[SPLITSNOW__LIT - 4] = {
    300.f, 286.f, 268.f, 244.f, 304.f, 581.f, 225.f, 155.f, 152.f, 170.f, 295.f, 1417.f, 607.f,
    343.f, 386.f, 430.f, 469.f, 502.f, 531.f, 552.f, 567.f, 572.f, 575.f, 561.f, 548.f, 527.f,
    507.f, 482.f, 461.f, 438.f, 418.f, 404.f, 429.f, 1016.f, 581.f, 370.f, 368.f, 371.f, 377.f,
    490.f, 525.f, 402.f, 404.f, 412.f, 418.f, 425.f, 428.f, 432.f, 433.f, 431.f, 427.f, 420.f,
    410.f, 399.f, 385.f, 370.f, 352.f, 336.f, 317.f, 298.f, 277.f, 260.f, 242.f, 223.f, 202.f,
    187.f, 167.f, 152.f, 136.f, 125.f, 113.f, 103.f, 93.f, 84.f, 75.f, 66.f, 58.f, 51.f, 46.f, 41.f,
    37.f};
static const float splitsnow__led_b5[SPLITSNOW__LIT - 4] = {
    0.0f, 0.01f, 0.01f, 0.03f, 0.07f, 0.16f, 0.35f, 0.78f, 1.67f, 3.3f, 5.94f, 9.92f, 16.15f,
    25.15f, 32.34f, 31.18f, 23.46f, 16.39f, 12.08f, 9.08f, 7.21f, 6.48f, 6.49f, 7.05f, 8.1f, 9.45f,
    10.88f, 12.22f, 13.38f, 14.29f, 14.98f, 15.48f, 15.81f, 16.01f, 16.1f, 16.13f, 16.1f, 15.98f,
    15.77f, 15.5f, 15.15f, 14.76f, 14.31f, 13.79f, 13.22f, 12.59f, 11.91f, 11.2f, 10.47f, 9.73f,
    9.0f, 8.27f, 7.57f, 6.9f, 6.25f, 5.65f, 5.08f, 4.55f, 4.06f, 3.61f, 3.22f, 2.86f, 2.54f, 2.26f,
    2.0f, 1.75f, 1.54f, 1.36f, 1.2f, 1.05f, 0.93f, 0.82f, 0.72f, 0.64f, 0.56f, 0.49f, 0.44f, 0.39f,
    0.35f, 0.31f, 0.27f};
static const float splitsnow__a[SPLITSNOW__LIT] = {
    6.14462f, 6.9472f, 7.82135f, 8.7698f, 9.7951f, 10.8996f, 12.0853f, 13.3543f, 14.708f, 16.148f,
    17.6753f, 19.2907f, 20.995f, 22.7883f, 24.6709f, 26.6425f, 28.7027f, 30.8508f, 33.0859f,
    35.4068f, 37.8121f, 40.3002f, 42.8693f, 45.5174f, 48.2423f, 51.0418f, 53.9132f, 56.8539f,
    59.8611f, 62.932f, 66.0635f, 69.2525f, 72.4959f, 75.7903f, 79.1326f, 82.5193f, 85.947f,
    89.4124f, 92.912f, 96.4423f, 100.f, 103.582f, 107.184f, 110.803f, 114.436f, 118.08f, 121.731f,
    125.386f, 129.043f, 132.697f, 136.346f, 139.988f, 143.618f, 147.235f, 150.836f, 154.418f,
    157.979f, 161.516f, 165.028f, 168.51f, 171.963f, 175.383f, 178.769f, 182.118f, 185.429f,
    188.701f, 191.931f, 195.118f, 198.261f, 201.359f, 204.409f, 207.411f, 210.365f, 213.268f,
    216.12f, 218.92f, 221.667f, 224.361f, 227.f, 229.585f, 232.115f, 234.589f, 237.008f, 239.37f,
    241.675f};
static const float splitsnow__d50[SPLITSNOW__LIT] = {
    23.942f, 25.451f, 26.961f, 25.724f, 24.488f, 27.179f, 29.871f, 39.589f, 49.308f, 52.91f,
    56.513f, 58.273f, 60.034f, 58.926f, 57.818f, 66.321f, 74.825f, 81.036f, 87.247f, 88.93f,
    90.612f, 90.99f, 91.368f, 93.238f, 95.109f, 93.536f, 91.963f, 93.843f, 95.724f, 96.169f,
    96.613f, 96.871f, 97.129f, 99.614f, 102.099f, 101.427f, 100.755f, 101.536f, 102.317f, 101.159f,
    100.f, 98.868f, 97.735f, 98.327f, 98.918f, 96.208f, 93.499f, 95.593f, 97.688f, 98.478f, 99.269f,
    99.155f, 99.042f, 97.382f, 95.722f, 97.29f, 98.857f, 97.262f, 95.667f, 96.929f, 98.19f,
    100.597f, 103.003f, 101.068f, 99.133f, 93.257f, 87.381f, 89.492f, 91.604f, 92.246f, 92.889f,
    84.872f, 76.854f, 81.683f, 86.511f, 89.546f, 92.58f, 85.405f, 78.23f, 67.961f, 57.692f, 70.307f,
    82.923f, 80.599f, 78.274f};

/* The table of an illuminant: index of its first 5 nm step, number of steps, values. */
typedef struct splitsnow__light {
    int first, count;
    const float *power; /* NULL for 100 everywhere */
} splitsnow__light;

static splitsnow__light splitsnow__light_of(splitsnow_illuminant illuminant) {
    splitsnow__light light = {0, SPLITSNOW__OBSERVED, NULL};
    if (illuminant == SPLITSNOW_E) return light;
    light.count = SPLITSNOW__LIT;
    light.power = illuminant == SPLITSNOW_D55      ? splitsnow__d55
                  : illuminant == SPLITSNOW_D65    ? splitsnow__d65
                  : illuminant == SPLITSNOW_A      ? splitsnow__a
                  : illuminant == SPLITSNOW_D50    ? splitsnow__d50
                  : illuminant == SPLITSNOW_FL3_15 ? splitsnow__fl3_15
                                                   : splitsnow__led_b5;
    if (illuminant == SPLITSNOW_FL3_15 || illuminant == SPLITSNOW_LED_B5) {
        light.first = 4; /* 380 nm */
        light.count = SPLITSNOW__LIT - 4;
    }
    return light;
}

static double splitsnow__nm(int step) { return 360.0 + 5.0 * step; }

/* Linear interpolation in a table of `count` 5 nm steps starting with step `first`; values
 * are `stride` apart. */
static double splitsnow__linear(const float *table, int stride, int first, int count, double nm) {
    int step = (int)((nm - splitsnow__nm(first)) / 5.0);
    double here, next;
    if (step > count - 2) step = count - 2;
    here = (double)table[step * stride];
    next = (double)table[(step + 1) * stride];
    return here + (nm - splitsnow__nm(first + step)) / 5.0 * (next - here);
}

struct splitsnow_colour {
    size_t wavelengths; /* number of wavelengths of the spectra */
    double white[3];
    /* [wavelength / 8][3][8]: contributions to X, Y, Z relative to white; 0 past the last wavelength */
    float *weights;
};

/* Computes the weights at `nm` and maps them to the wavelengths of the file, [n][3]. */
static splitsnow_status splitsnow__weigh(splitsnow_colour *colour, const splitsnow *database,
                                         splitsnow_illuminant illuminant, const double *nm,
                                         size_t n) {
    splitsnow__light light = splitsnow__light_of(illuminant);
    double low = splitsnow__nm(light.first), high = splitsnow__nm(light.first + light.count - 1);
    double sums[3] = {0.0, 0.0, 0.0};
    double *weights = (double *)calloc(database->wavelengths, 3 * sizeof(double)); /* [wavelength][3] */
    size_t seen = 0;
    if (weights == NULL) return SPLITSNOW_ERROR_MEMORY;
    for (size_t i = 0; i < n; i++) {
        double left, right, power = 100.0, share;
        size_t below = splitsnow__between(database->wavelength_nm, database->wavelengths, nm[i],
                                          &share);
        if (nm[i] < low || nm[i] > high) continue;
        left = i > 0 && nm[i - 1] >= low ? nm[i - 1] : nm[i];
        right = i + 1 < n && nm[i + 1] <= high ? nm[i + 1] : nm[i];
        if (light.power != NULL) {
            power = splitsnow__linear(light.power, 1, light.first, light.count, nm[i]);
        }
        for (int c = 0; c < 3; c++) {
            double weight = (right - left) / 2.0 * power *
                            splitsnow__linear(splitsnow__observer + c, 3, 0, SPLITSNOW__OBSERVED,
                                              nm[i]);
            sums[c] += weight;
            seen += c == 1 && weight > 0.0;
            weights[3 * below + (size_t)c] += (1.0 - share) * weight;
            if (share > 0.0) weights[3 * (below + 1) + (size_t)c] += share * weight;
        }
    }
    if (seen < 3 || !(sums[0] > 0.0) || !(sums[1] > 0.0) || !(sums[2] > 0.0)) {
        free(weights);
        return SPLITSNOW_ERROR_NO_COLOUR;
    }
    for (size_t i = 0; i < 3 * database->wavelengths; i++) {
        size_t l = i / 3, c = i % 3;
        colour->weights[(l / 8 * 3 + c) * 8 + l % 8] = (float)(weights[i] / sums[c]);
    }
    free(weights);
    for (int c = 0; c < 3; c++) colour->white[c] = sums[c] / sums[1];
    return SPLITSNOW_OK;
}

void splitsnow_colour_free(splitsnow_colour *colour) {
    if (colour == NULL) return;
    free(colour->weights);
    free(colour);
}

/* The wavelengths of the file, and every 5 nm between. */
static double *splitsnow__default_wavelengths(const splitsnow *database, size_t *count) {
    const float *file = database->wavelength_nm;
    int step = 0;
    double *nm = (double *)splitsnow__allocate(database->wavelengths + SPLITSNOW__LIT, sizeof *nm);
    *count = 0;
    for (size_t i = 0; nm != NULL && i < database->wavelengths; i++) {
        for (; step < SPLITSNOW__LIT && splitsnow__nm(step) <= (double)file[i]; step++) {
            if (i > 0 && splitsnow__nm(step) < (double)file[i]) nm[(*count)++] = splitsnow__nm(step);
        }
        nm[(*count)++] = (double)file[i];
    }
    return nm;
}

splitsnow_status splitsnow_colour_new(const splitsnow *database, splitsnow_illuminant illuminant,
                                      const double *wavelength_nm, size_t n,
                                      splitsnow_colour **colour) {
    splitsnow_colour *new_colour;
    splitsnow_status status = SPLITSNOW_ERROR_MEMORY;
    double *own = NULL;
    if (colour == NULL) return SPLITSNOW_ERROR_ARGUMENT;
    *colour = NULL;
    if (database == NULL || (unsigned)illuminant > SPLITSNOW_D50) return SPLITSNOW_ERROR_ARGUMENT;
    for (size_t i = 0; i < n && wavelength_nm != NULL; i++) {
        double before = i > 0 ? wavelength_nm[i - 1] : -HUGE_VAL;
        if (!(wavelength_nm[i] > before && wavelength_nm[i] < HUGE_VAL)) {
            return SPLITSNOW_ERROR_ARGUMENT;
        }
    }
    new_colour = (splitsnow_colour *)calloc(1, sizeof *new_colour);
    if (new_colour == NULL) return SPLITSNOW_ERROR_MEMORY;
    new_colour->wavelengths = database->wavelengths;
    new_colour->weights = (float *)calloc((database->wavelengths + 7) / 8, 24 * sizeof(float));
    if (wavelength_nm == NULL) {
        own = splitsnow__default_wavelengths(database, &n);
        wavelength_nm = own;
    }
    if (new_colour->weights != NULL && wavelength_nm != NULL) {
        status = splitsnow__weigh(new_colour, database, illuminant, wavelength_nm, n);
    }
    free(own);
    if (status == SPLITSNOW_OK) *colour = new_colour;
    else splitsnow_colour_free(new_colour);
    return status;
}

/* X, Y, Z relative to white. */
static splitsnow_status splitsnow__relative(const splitsnow_lookup *lookup,
                                            const splitsnow_colour *colour, double thickness_cm,
                                            double incidence_angle_deg, double sums[3]) {
    splitsnow__query query;
    splitsnow_status status;
    float lanes[3][8] = {{0.0f}};
    if (lookup == NULL || colour == NULL || lookup->wavelengths != colour->wavelengths) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    status = splitsnow__start_query_of_one(lookup, thickness_cm, incidence_angle_deg, &query);
    if (status != SPLITSNOW_OK) return status;
    for (size_t chunk = 0; 8 * chunk < lookup->wavelengths; chunk++) {
        const float *weights = colour->weights + 24 * chunk;
        float y[8];
        splitsnow__values(lookup, &query, chunk, y);
        for (int i = 0; i < 8; i++) lanes[0][i] += weights[i] * y[i];
        for (int i = 0; i < 8; i++) lanes[1][i] += weights[8 + i] * y[i];
        for (int i = 0; i < 8; i++) lanes[2][i] += weights[16 + i] * y[i];
    }
    for (int c = 0; c < 3; c++) {
        const float *lane = lanes[c];
        sums[c] = (double)(((lane[0] + lane[4]) + (lane[1] + lane[5])) +
                           ((lane[2] + lane[6]) + (lane[3] + lane[7])));
    }
    return SPLITSNOW_OK;
}

splitsnow_status splitsnow_xyz(const splitsnow_lookup *lookup, const splitsnow_colour *colour,
                               double thickness_cm, double incidence_angle_deg, double xyz[3]) {
    splitsnow_status status =
        splitsnow__relative(lookup, colour, thickness_cm, incidence_angle_deg, xyz);
    for (int c = 0; c < 3 && status == SPLITSNOW_OK; c++) xyz[c] *= colour->white[c];
    return status;
}

splitsnow_status splitsnow_linear_srgb(const splitsnow_lookup *lookup,
                                       const splitsnow_colour *colour, double thickness_cm,
                                       double incidence_angle_deg, double rgb[3]) {
    static const double d65[3] = {0.95047, 1.0, 1.08883};
    static const double matrix[3][3] = {{3.2404542, -1.5371385, -0.4985314},
                                        {-0.9692660, 1.8760108, 0.0415560},
                                        {0.0556434, -0.2040259, 1.0572252}};
    double sums[3];
    splitsnow_status status =
        splitsnow__relative(lookup, colour, thickness_cm, incidence_angle_deg, sums);
    for (int i = 0; i < 3 && status == SPLITSNOW_OK; i++) {
        rgb[i] = 0.0;
        for (int c = 0; c < 3; c++) rgb[i] += matrix[i][c] * sums[c] * d65[c];
    }
    return status;
}

splitsnow_status splitsnow_rgb_table(const splitsnow_lookup *lookup,
                                     const splitsnow_colour *colour, double first_cm,
                                     double last_cm, size_t n_thickness, size_t n_angle,
                                     float *rgb) {
    const double degree = 3.14159265358979323846 / 180.0;
    double v[2], u[2], angles[2];
    if (lookup == NULL || rgb == NULL || n_thickness < 2 || n_angle < 2) {
        return SPLITSNOW_ERROR_ARGUMENT;
    }
    if (!(first_cm >= 0.0 && last_cm >= first_cm)) return SPLITSNOW_ERROR_OUTSIDE;
    angles[0] = (double)lookup->axes[4][0];
    angles[1] = (double)lookup->axes[4][lookup->n[4] - 1];
    for (int end = 0; end < 2; end++) {
        v[end] = log1p(2.0 * (end == 0 ? first_cm : last_cm));
        u[end] = cos(angles[1 - end] * degree);
    }
    for (size_t i = 0; i < n_thickness; i++) {
        double row = (double)i / (double)(n_thickness - 1);
        double thickness_cm = i == 0                 ? first_cm
                              : i + 1 == n_thickness ? last_cm
                                                     : 0.5 * expm1(v[0] + row * (v[1] - v[0]));
        for (size_t j = 0; j < n_angle; j++) {
            double column = (double)j / (double)(n_angle - 1), colours[3];
            double incidence_angle_deg = j == 0             ? angles[1]
                               : j + 1 == n_angle ? angles[0]
                                                  : acos(u[0] + column * (u[1] - u[0])) / degree;
            splitsnow_status status =
                splitsnow_linear_srgb(lookup, colour, thickness_cm, incidence_angle_deg, colours);
            if (status != SPLITSNOW_OK) return status;
            for (int c = 0; c < 3; c++) *rgb++ = (float)colours[c];
        }
    }
    return SPLITSNOW_OK;
}

#endif /* SPLITSNOW_IMPLEMENTED */
#endif /* SPLITSNOW_IMPLEMENTATION */
