// Light through snow, over thickness and cosine. Made by @PROGRAM@; @NAME@.json describes it.
// Snow: @SNOW@.
// Colours: linear @PRIMARIES@, 1 is the light (@LIGHT@).
// table: @NAME@.exr (@WIDTH@ x @HEIGHT@), no mipmaps, no conversion of colours, not compressed;
// the sampler is linear and clamps. Shader model 4 or later.

// Whether v = 0 is the first row of the file, the top. Set it to 0 where the loader turns images over.
#ifndef SNOW_FIRST_ROW_AT_0
#define SNOW_FIRST_ROW_AT_0 1
#endif

// cosine: of the angle between the light and the normal where it enters the snow.
float3 snow_transmittance(Texture2D table, SamplerState linear_clamp, float thickness_cm, float cosine)
{
    float h = clamp(thickness_cm, @FIRST_CM@, @LAST_CM@);
    float u = @U_SCALE@ * sqrt(sqrt(h)) + @U_OFFSET@;
    float v = @V_SCALE@ * clamp(cosine, @FIRST_COSINE@, @LAST_COSINE@) + @V_OFFSET@;
#if !SNOW_FIRST_ROW_AT_0
    v = 1.0 - v;
#endif
    return @TEXEL@ * table.SampleLevel(linear_clamp, float2(u, v), 0.0).rgb;
}
@if reflectance@

// Reflectance of snow @THICKEST_CM@ cm thick. table: @NAME@_reflectance.exr, loaded in the same way.
float3 snow_reflectance(Texture2D table, SamplerState linear_clamp, float cosine)
{
    float u = @V_SCALE@ * clamp(cosine, @FIRST_COSINE@, @LAST_COSINE@) + @V_OFFSET@;
    return table.SampleLevel(linear_clamp, float2(u, 0.5), 0.0).rgb;
}
@end@
