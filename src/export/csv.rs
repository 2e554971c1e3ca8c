//! CSV: a long table with one row for each node and wavelength.
use std::fmt::Write;

use ndarray::IxDyn;

use super::ExportTable;

/// `table` as CSV, with a column for each axis and then one for each quantity. The rows have
/// the order of the axes; the last axis varies fastest. Numbers are the shortest decimals that
/// read back as the same float.
#[must_use]
pub fn csv(table: &ExportTable) -> String {
    let axes = table.axes.iter().map(|(name, _)| *name);
    let quantities = table.quantities.iter();
    let names = axes.chain(quantities.map(|(variable, _)| variable.name()));
    let mut text = names.collect::<Vec<_>>().join(",");
    text.push('\n');
    let shape: Vec<usize> = table.axes.iter().map(|(_, values)| values.len()).collect();
    // a quantity without an axis is the same at all its nodes
    let columns = table.quantities.iter();
    let columns: Vec<_> = columns
        .filter_map(|(_, a)| a.broadcast(IxDyn(&shape)))
        .collect();
    let mut values: Vec<_> = columns.iter().map(|column| column.iter()).collect();
    let rows: usize = shape.iter().product();
    let mut position = vec![0; table.axes.len()];
    for _ in 0..rows {
        for (i, (_, nodes)) in position.iter().zip(&table.axes) {
            // Writing to a string cannot fail.
            let _ = write!(text, "{},", nodes[*i]);
        }
        for (column, values) in values.iter_mut().enumerate() {
            let comma = if column > 0 { "," } else { "" };
            if let Some(value) = values.next() {
                let _ = write!(text, "{comma}{value}");
            }
        }
        text.push('\n');
        for (i, (_, nodes)) in position.iter_mut().zip(&table.axes).rev() {
            *i += 1;
            if *i < nodes.len() {
                break;
            }
            *i = 0;
        }
    }
    text
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::export::table::tests::database;

    #[test]
    fn each_row_is_a_node_and_a_wavelength() {
        let text = csv(&ExportTable::of_compact(&database()).unwrap());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 1 + 144 * 4);
        assert_eq!(
            lines[0],
            "temperature_c,facetness,grain_size_um,density_kg_m3,thickness_cm,angle_deg,wavelength_nm,transmittance,reflectance"
        );
        assert_eq!(lines[1], "-10,0.1,100,200,1,0,400,0,0.1");
        // Row 142 differs from the last node by one angle, row 140 by one thickness.
        let row = |curve: usize| lines[1 + 4 * curve + 3].to_owned();
        assert!(
            row(142).starts_with("-1,0.9,500,400,5,40,700,"),
            "{}",
            row(142)
        );
        assert!(
            row(140).starts_with("-1,0.9,500,400,1,80,700,"),
            "{}",
            row(140)
        );
        assert!(row(140).ends_with(",0.01121023,0.11121023"), "{}", row(140));
    }
}
