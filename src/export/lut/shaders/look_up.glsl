// Light through snow, over thickness and cosine. Made by @PROGRAM@; @NAME@.json describes it.
// Snow: @SNOW@.
// Colours: linear @PRIMARIES@, 1 is the light (@LIGHT@).
// table: @NAME@.exr (@WIDTH@ x @HEIGHT@), linear filter, clamped to the edges, no mipmaps,
// no conversion of colours. GLSL 1.30 or later, ES 3.00 or later.

#ifdef GL_ES
precision highp float;
precision highp sampler2D;
#endif

// Whether v = 0 is the first row of the file, the top. Set it to 0 where the loader turns images over.
#ifndef SNOW_FIRST_ROW_AT_0
#define SNOW_FIRST_ROW_AT_0 1
#endif

// cosine: of the angle between the light and the normal where it enters the snow.
vec3 snow_transmittance(sampler2D table, float thickness_cm, float cosine)
{
    float h = clamp(thickness_cm, @FIRST_CM@, @LAST_CM@);
    float u = @U_SCALE@ * sqrt(sqrt(h)) + @U_OFFSET@;
    float v = @V_SCALE@ * clamp(cosine, @FIRST_COSINE@, @LAST_COSINE@) + @V_OFFSET@;
#if !SNOW_FIRST_ROW_AT_0
    v = 1.0 - v;
#endif
    return @TEXEL@ * textureLod(table, vec2(u, v), 0.0).rgb;
}
@if reflectance@

// Reflectance of snow @THICKEST_CM@ cm thick. table: @NAME@_reflectance.exr, loaded in the same way.
vec3 snow_reflectance(sampler2D table, float cosine)
{
    float u = @V_SCALE@ * clamp(cosine, @FIRST_COSINE@, @LAST_COSINE@) + @V_OFFSET@;
    return textureLod(table, vec2(u, 0.5), 0.0).rgb;
}
@end@
