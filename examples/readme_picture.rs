//! Draws the picture of the README, `docs/snow.svg`: light through one snow at five
//! thicknesses. `cargo run --release --example readme_picture` takes less than a minute.
use std::error::Error;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64};

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use splitsnow::colour::Colorimeter;
use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
use splitsnow::transport::{Illumination, Model, Snow};
use splitsnow::units::{cm_to_m, um_to_m};

const THICKNESSES_CM: [f64; 5] = [2.0, 5.0, 10.0, 20.0, 40.0];
const RAYS: u64 = 100_000;
/// Twice the displayed size, because the backend rounds to whole pixels.
const SIZE_PX: (u32, u32) = (2000, 860);
/// Okabe and Ito's palette, which is safe for colour-blind readers.
const COLOURS: [RGBColor; 5] = [
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
];
const INK: RGBColor = RGBColor(40, 40, 40);
const FAINT: RGBColor = RGBColor(225, 225, 225);
/// Luminance, relative to white, at which hues are compared.
const EQUAL_LUMINANCE: f64 = 0.3;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let wavelengths_nm: Vec<f64> = (0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
    let curves = transmittances(&wavelengths_nm)?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/snow.svg");
    let font = dejavu::sans::regular();
    register_font("sans-serif", FontStyle::Normal, font).map_err(|_| "unreadable font")?;
    let root = SVGBackend::new(&path, SIZE_PX).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, right) = root.split_horizontally(1120);
    spectra(&left, &wavelengths_nm, &curves)?;
    swatches(&right, &wavelengths_nm, &curves)?;
    root.present()?;
    Ok(())
}

/// Transmittance per thickness and wavelength at normal incidence, of dry snow with grains
/// of 350-450 um, facetness 0.3 and 300 kg/m3 (the swatches of Varsa 2025, section 8.6).
fn transmittances(wavelengths_nm: &[f64]) -> Result<Vec<Vec<f64>>> {
    let snow = Snow::dry(
        GrainType {
            size: SizeRange::new(um_to_m(350.0), um_to_m(450.0))?,
            facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072)?,
            shape: Shape::Spheroid,
            proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064)?,
        },
        300.0,
        -1.0,
    );
    let request = Request {
        snowpack: &snow.clone().into(),
        thicknesses_m: &THICKNESSES_CM.map(cm_to_m),
        illuminations: &[Illumination::Collimated {
            polar_angle_rad: 0.0,
        }],
        resolution: Resolution::default(),
        max_error: MaxError::default(),
        wavelengths_nm,
        model: &Model::default(),
        rays: RAYS,
        seed: 1,
        cell: 0,
    };
    let control = Control {
        parallel: true,
        cancel: &AtomicBool::new(false),
        rays_done: &AtomicU64::new(0),
        cache: &Cache::default(),
    };
    let spectra = Engine::Spectral.run(&request, &control)?;
    let values = |spectrum: &splitsnow::measurement::Spectrum| {
        spectrum.transmittance.iter().map(|m| m.value).collect()
    };
    Ok(spectra.iter().map(values).collect())
}

/// Draws curves against wavelength, each labelled at its end.
fn spectra<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    wavelengths_nm: &[f64],
    curves: &[Vec<f64>],
) -> Result<()>
where
    DB::ErrorType: 'static,
{
    let mut chart = ChartBuilder::on(area)
        .caption("Light through snow", text(38))
        .margin(24)
        .margin_right(150)
        .x_label_area_size(88)
        .y_label_area_size(130)
        .build_cartesian_2d(400.0..700.0, (1e-6..1.0).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(FAINT)
        .axis_style(INK)
        .x_labels(7)
        .x_label_formatter(&|nm| format!("{nm:.0}"))
        .y_label_formatter(&|t| power_of_ten(*t))
        .label_style(text(28))
        .x_desc("wavelength, nm")
        .y_desc("transmittance")
        .axis_desc_style(text(30))
        .draw()?;
    for ((curve, cm), colour) in curves.iter().zip(THICKNESSES_CM).zip(COLOURS) {
        let points = wavelengths_nm.iter().copied().zip(curve.iter().copied());
        chart.draw_series(LineSeries::new(points, colour.stroke_width(6)))?;
        let end = (700.0, curve.last().copied().unwrap_or_default());
        let label = chart.backend_coord(&end);
        let style = text(30).color(&INK).pos(Pos::new(HPos::Left, VPos::Center));
        let (x, y) = area.get_base_pixel();
        area.draw(&Text::new(
            format!("{cm} cm"),
            (label.0 - x + 16, label.1 - y),
            style,
        ))?;
    }
    Ok(())
}

/// Draws the colours of the slabs in front of a white light: as they are, and at equal
/// luminance, which shows the hue.
fn swatches<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    wavelengths_nm: &[f64],
    curves: &[Vec<f64>],
) -> Result<()>
where
    DB::ErrorType: 'static,
{
    let colorimeter = Colorimeter::new(wavelengths_nm)?.ok_or("no visible wavelengths")?;
    let write = |words: &str, size: i32, position: (i32, i32), align: HPos| {
        let style = text(size).pos(Pos::new(align, VPos::Center));
        area.draw(&Text::new(words.to_owned(), position, style))
    };
    let (top, height, left, width, gap) = (164, 118, 152, 300, 16);
    let column = |i: i32| left + i * (width + gap);
    write(
        "Slabs against the light, in sRGB",
        38,
        (left + width + gap / 2, 46),
        HPos::Center,
    )?;
    for (i, words) in ["as bright as they are", "at equal luminance"]
        .iter()
        .enumerate()
    {
        write(
            words,
            30,
            (column(i as i32) + width / 2, top - 40),
            HPos::Center,
        )?;
    }
    for (row, (curve, cm)) in (0..).zip(curves.iter().zip(THICKNESSES_CM)) {
        let y = top + row * (height + gap);
        write(
            &format!("{cm} cm"),
            30,
            (left - 24, y + height / 2),
            HPos::Right,
        )?;
        for (i, spectrum) in [curve.clone(), equal_luminance(&colorimeter, curve)]
            .iter()
            .enumerate()
        {
            let [r, g, b] = colorimeter.srgb(spectrum);
            let x = column(i as i32);
            let corners = [(x, y), (x + width, y + height)];
            area.draw(&Rectangle::new(corners, RGBColor(r, g, b).filled()))?;
        }
    }
    Ok(())
}

/// The spectrum scaled to [`EQUAL_LUMINANCE`].
fn equal_luminance(colorimeter: &Colorimeter, spectrum: &[f64]) -> Vec<f64> {
    // with a maximum of 1, the lightness is in the cubic part of its definition
    let scale = |factor: f64| spectrum.iter().map(|t| t * factor).collect::<Vec<_>>();
    let largest = spectrum.iter().copied().fold(0.0, f64::max);
    let lightness = colorimeter.lab(&scale(1.0 / largest)).l;
    scale(EQUAL_LUMINANCE / (largest * ((lightness + 16.0) / 116.0).powi(3)))
}

/// Formats a power of ten: `1`, `10⁻¹`, `10⁻²`, ...
fn power_of_ten(value: f64) -> String {
    const SUPERSCRIPTS: [&str; 7] = ["", "¹", "²", "³", "⁴", "⁵", "⁶"];
    let exponent = (-value.log10()).round() as usize;
    match SUPERSCRIPTS.get(exponent) {
        Some(&"") => "1".to_owned(),
        Some(digit) => format!("10⁻{digit}"),
        None => format!("{value:e}"),
    }
}

fn text(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}
