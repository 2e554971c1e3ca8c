//! Measured and computed factors in the principal plane, as SVG.
use std::path::Path;

use plotters::prelude::*;
use plotters::style::register_font;

use crate::Result;
use crate::directions::INCIDENCES_DEG;

const INK: RGBColor = RGBColor(40, 40, 40);
const FAINT: RGBColor = RGBColor(225, 225, 225);
/// Variants in the picture, with their labels, and colours of Okabe and Ito's palette, which is
/// safe for colour-blind readers.
const DRAWN: [(&str, &str, RGBColor); 3] = [
    ("varsa2025", "preset varsa2025", RGBColor(213, 94, 0)),
    ("measured", "preset measured", RGBColor(0, 114, 178)),
    (
        "measured: prolate .5, F 0.3",
        "preset measured, sphericity 0.5",
        RGBColor(0, 158, 115),
    ),
];
/// Snow of the picture.
const SAMPLE: f64 = 3.0;

/// A row of `plane.csv`: the variant, then the numbers.
type Row = (String, [f64; 7]);

fn rows(path: &Path) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for row in csv::Reader::from_path(path)?.deserialize() {
        rows.push(row?);
    }
    Ok(rows)
}

fn text(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// Draws a panel for each wavelength and incidence angle from the table `plane.csv`.
pub(crate) fn plane(table: &Path, path: &Path) -> Result<()> {
    let rows = rows(table)?;
    register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| "unreadable font")?;
    let root = SVGBackend::new(path, (1200, 760)).into_drawing_area();
    root.fill(&WHITE)?;
    let panels = root.split_evenly((2, 3));
    let places = [600.0, 1030.0]
        .into_iter()
        .flat_map(|nm| INCIDENCES_DEG.map(|deg| (nm, deg)));
    for (panel, (nm, incidence_deg)) in panels.iter().zip(places) {
        let here = |variant: &'static str| {
            let is_here = move |(name, [sample, row_nm, deg, ..]): &&Row| {
                name == variant && (*sample, *row_nm, *deg) == (SAMPLE, nm, incidence_deg)
            };
            let mut rows: Vec<_> = rows.iter().filter(is_here).map(|(_, row)| *row).collect();
            rows.sort_by(|a, b| a[3].total_cmp(&b[3]));
            rows
        };
        let mut chart = ChartBuilder::on(panel)
            .caption(
                format!("{nm} nm, light at {incidence_deg} degrees"),
                text(18),
            )
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(52)
            .build_cartesian_2d(-75.0..75.0, 0.5..2.25)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(FAINT)
            .axis_style(INK)
            .label_style(text(14))
            .x_label_formatter(&|x| format!("{x:.0}"))
            .x_desc("view, degrees (forward positive)")
            .y_desc("anisotropy factor")
            .axis_desc_style(text(14))
            .draw()?;
        for (variant, label, colour) in DRAWN {
            let rows = here(variant);
            chart.draw_series(rows.iter().map(|[.., view, _, y, se]| {
                let ends = [y - 2.0 * se, y + 2.0 * se];
                PathElement::new(ends.map(|y| (*view, y)).to_vec(), colour.mix(0.5))
            }))?;
            let points = rows.iter().map(|[.., view, _, y, _]| (*view, *y));
            chart
                .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
                .label(label)
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(3))
                });
        }
        let rows = here(DRAWN[0].0);
        let points = rows
            .iter()
            .map(|[.., view, factor, _, _]| Circle::new((*view, *factor), 4, INK.filled()));
        chart
            .draw_series(points)?
            .label("Dumont et al. (2010), sample 3")
            .legend(|(x, y)| Circle::new((x + 11, y), 4, INK.filled()));
        if (nm, incidence_deg) == (600.0, 0.0) {
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::UpperLeft)
                .background_style(WHITE.mix(0.8))
                .label_font(text(13))
                .draw()?;
        }
    }
    root.present()?;
    Ok(())
}
