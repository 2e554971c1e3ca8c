//! The files of a table: images, sidecar, and the look-up in shading languages.
use std::io::Cursor;

use exr::meta::attribute::Chromaticities;
use exr::prelude::{Encoding, Image, SpecificChannels, Vec2, WritableImage};
use serde_json::{Map, Value, json};

use crate::parameter::Parameter;

use super::super::ExportError;
use super::primaries::Primaries;
use super::{HalfImage, Lut};

const FORMAT: &str = "splitsnow look-up table";
const VERSION: u32 = 1;
const PROGRAM: &str = concat!("splitsnow ", env!("CARGO_PKG_VERSION"));
/// The look-up by the ending of its file.
const SHADERS: [(&str, &str); 5] = [
    ("osl", include_str!("shaders/look_up.osl")),
    ("glsl", include_str!("shaders/look_up.glsl")),
    ("hlsl", include_str!("shaders/look_up.hlsl")),
    ("wgsl", include_str!("shaders/look_up.wgsl")),
    ("mtlx", include_str!("shaders/look_up.mtlx")),
];

impl Lut {
    /// The files by their names, which begin with `name`: images (`.exr`, `_reflectance.exr`),
    /// look-ups (`.osl`, `.glsl`, `.hlsl`, `.wgsl`, `.mtlx`) and the sidecar (`.json`).
    ///
    /// # Errors
    /// [`ExportError::Lut`] unless `name` consists of letters, digits, `.`, `_` and `-`: it is
    /// written into the look-ups. [`ExportError::Encoding`] if the library for images fails.
    pub fn files(&self, name: &str) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
        if name.is_empty() || !name.chars().all(allowed) {
            return Err(ExportError::Lut(format!(
                "the name `{name}` goes into shaders; give --out a name of letters, digits, `.`, `_` and `-`"
            )));
        }
        let primaries = self.options.primaries;
        let mut files = vec![(format!("{name}.exr"), exr(&self.transmittance, primaries)?)];
        if let Some((_, strip)) = &self.reflectance {
            files.push((format!("{name}_reflectance.exr"), exr(strip, primaries)?));
        }
        for (end, template) in SHADERS {
            let text = self.shader(template, name);
            files.push((format!("{name}.{end}"), text.into_bytes()));
        }
        let sidecar = serde_json::to_string_pretty(&self.sidecar(name));
        let sidecar = sidecar.map_err(ExportError::encoding("json"))? + "\n";
        files.push((format!("{name}.json"), sidecar.into_bytes()));
        Ok(files)
    }

    /// The content of the sidecar.
    fn sidecar(&self, name: &str) -> Value {
        let options = &self.options;
        let [red, green, blue, white] = options.primaries.chromaticities();
        let snow: Map<_, _> = (self.snow.iter())
            .filter(|(axis, _)| ![Parameter::Thickness, Parameter::Incidence].contains(axis))
            .map(|(axis, value)| (axis.name().to_owned(), value.into()))
            .collect();
        let [u_scale, u_offset] = self.depth.coordinate();
        let [v_scale, v_offset] = self.cosine.coordinate();
        let reflectance = self.reflectance.as_ref().map(|(thickness_cm, strip)| {
            json!({
                "file": format!("{name}_reflectance.exr"),
                "width": strip.width,
                "height": strip.height(),
                "value": "share of the light that is reflected; the texel itself",
                "scale": strip.scale,
                "thickness_cm": thickness_cm,
                "u": {
                    "axis": "cosine",
                    "mapping": "u = scale * clamp(cosine, first, last) + offset",
                    "scale": v_scale, "offset": v_offset,
                    "first": self.cosine.ends[0], "last": self.cosine.ends[1],
                },
            })
        });
        json!({
            "format": FORMAT,
            "version": VERSION,
            "program": PROGRAM,
            "snow": snow,
            "wavelengths_nm": self.wavelengths_nm,
            "light": options.light.to_string(),
            "observer": "CIE 1931, 2 degrees",
            "primaries": {
                "name": options.primaries.name(),
                "red_xy": red, "green_xy": green, "blue_xy": blue, "white_xy": white,
                "white": "X, Y and Z relative to the light are multiplied by those of D65, and adapted to the white of the primaries (Bradford) if it is another; a transmittance of 1 at all wavelengths is white",
                "from_xyz_d65": rows(&options.primaries.matrix()),
                "to_linear_rec709": rows(&options.primaries.to(Primaries::Rec709)),
            },
            "transmittance": {
                "file": format!("{name}.exr"),
                "width": self.transmittance.width,
                "height": self.transmittance.height(),
                "value": "share of the light that passes, linear; the texel divided by scale",
                "scale": self.transmittance.scale,
                "row_order": "the first row of the file, the top, is at v = 0; where the program counts v from the bottom, take 1 - v",
                "filter": "linear, clamped to the edges, no mipmaps, no conversion of colours",
                "u": {
                    "axis": "thickness_cm",
                    "mapping": "u = scale * clamp(thickness_cm, first, last)^(1/4) + offset",
                    "scale": u_scale, "offset": u_offset,
                    "first": self.depth.ends_cm[0], "last": self.depth.ends_cm[1],
                },
                "v": {
                    "axis": "cosine of the angle between the light and the normal",
                    "mapping": "v = scale * clamp(cosine, first, last) + offset",
                    "scale": v_scale, "offset": v_offset,
                    "first": self.cosine.ends[0], "last": self.cosine.ends[1],
                },
            },
            "reflectance": reflectance,
            "certificate": self.certificate,
            "clipping": self.clipping,
        })
    }

    /// A look-up with the numbers of this table.
    fn shader(&self, template: &str, name: &str) -> String {
        let [u_scale, u_offset] = self.depth.coordinate();
        let [v_scale, v_offset] = self.cosine.coordinate();
        let number = |value: f64| format!("{value:?}");
        let strip_cm = self.reflectance.as_ref().map_or(0.0, |(cm, _)| *cm);
        let primaries = self.options.primaries;
        let words = [
            ("NAME", name.to_owned()),
            ("PROGRAM", PROGRAM.to_owned()),
            ("SNOW", self.snow.to_string()),
            ("LIGHT", self.options.light.name().replace("--", "- -")),
            ("PRIMARIES", primaries.name().to_owned()),
            ("SPACE", material_x_space(primaries).to_owned()),
            ("WIDTH", self.transmittance.width.to_string()),
            ("HEIGHT", self.transmittance.height().to_string()),
            ("FIRST_CM", number(self.depth.ends_cm[0])),
            ("LAST_CM", number(self.depth.ends_cm[1])),
            ("U_SCALE", number(u_scale)),
            ("U_OFFSET", number(u_offset)),
            ("FIRST_COSINE", number(self.cosine.ends[0])),
            ("LAST_COSINE", number(self.cosine.ends[1])),
            ("V_SCALE", number(v_scale)),
            ("V_OFFSET", number(v_offset)),
            ("V_SCALE_UP", number(-v_scale)),
            ("V_OFFSET_UP", number(1.0 - v_offset)),
            ("SCALE", number(self.transmittance.scale)),
            ("TEXEL", number(self.transmittance.scale.recip())),
            ("THICKEST_CM", strip_cm.to_string()),
        ];
        let mut text = String::new();
        let mut kept = true;
        for line in template.lines() {
            match line.trim() {
                "@if reflectance@" => kept = self.reflectance.is_some(),
                "@end@" => kept = true,
                _ if kept => text = text + line + "\n",
                _ => {}
            }
        }
        for (word, value) in words {
            text = text.replace(&format!("@{word}@"), &value);
        }
        text
    }
}

/// The name of a linear colour space in `MaterialX`; `none` where it has no name.
fn material_x_space(primaries: Primaries) -> &'static str {
    match primaries {
        Primaries::Rec709 => "lin_rec709",
        Primaries::P3 => "lin_displayp3",
        Primaries::AcesCg => "acescg",
        Primaries::Rec2020 | Primaries::Xyz => "none",
    }
}

/// The rows of a matrix.
fn rows(matrix: &nalgebra::Matrix3<f64>) -> Vec<[f64; 3]> {
    let rows = matrix.row_iter();
    rows.map(|row| [row[0], row[1], row[2]]).collect()
}

/// An `OpenEXR` file of half floats R, G and B, not compressed.
fn exr(image: &HalfImage, primaries: Primaries) -> Result<Vec<u8>, ExportError> {
    let pixel = |at: Vec2<usize>| {
        let [red, green, blue] = image.pixels[at.y() * image.width + at.x()];
        (red, green, blue)
    };
    let size = Vec2(image.width, image.height());
    let mut picture =
        Image::from_encoded_channels(size, Encoding::UNCOMPRESSED, SpecificChannels::rgb(pixel));
    let [red, green, blue, white] = primaries.chromaticities();
    let xy = |[x, y]: [f64; 2]| Vec2(x as f32, y as f32);
    picture.attributes.chromaticities = Some(Chromaticities {
        red: xy(red),
        green: xy(green),
        blue: xy(blue),
        white: xy(white),
    });
    let mut bytes = Cursor::new(Vec::new());
    let written = picture.write().non_parallel().to_buffered(&mut bytes);
    written.map_err(ExportError::encoding("exr"))?;
    Ok(bytes.into_inner())
}
