// Light through snow, over thickness and cosine. Made by @PROGRAM@; @NAME@.json describes it.
// Snow: @SNOW@.
// Colours: linear @PRIMARIES@, 1 is the light (@LIGHT@).
// table: @NAME@.exr (@WIDTH@ x @HEIGHT@) as rgba16float, one mip level; the sampler is linear and
// clamps to the edges.

// Whether v = 0 is the first row of the file, the top. False where the loader turns images over.
const SNOW_FIRST_ROW_AT_0: bool = true;

// cosine: of the angle between the light and the normal where it enters the snow.
fn snow_transmittance(table: texture_2d<f32>, linear_clamp: sampler, thickness_cm: f32, cosine: f32) -> vec3<f32> {
    let h = clamp(thickness_cm, @FIRST_CM@, @LAST_CM@);
    let u = @U_SCALE@ * sqrt(sqrt(h)) + @U_OFFSET@;
    let down = @V_SCALE@ * clamp(cosine, @FIRST_COSINE@, @LAST_COSINE@) + @V_OFFSET@;
    let v = select(1.0 - down, down, SNOW_FIRST_ROW_AT_0);
    return @TEXEL@ * textureSampleLevel(table, linear_clamp, vec2<f32>(u, v), 0.0).rgb;
}
@if reflectance@

// Reflectance of snow @THICKEST_CM@ cm thick. table: @NAME@_reflectance.exr, loaded in the same way.
fn snow_reflectance(table: texture_2d<f32>, linear_clamp: sampler, cosine: f32) -> vec3<f32> {
    let u = @V_SCALE@ * clamp(cosine, @FIRST_COSINE@, @LAST_COSINE@) + @V_OFFSET@;
    return textureSampleLevel(table, linear_clamp, vec2<f32>(u, 0.5), 0.0).rgb;
}
@end@
