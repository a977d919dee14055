//! A table of a study as CSV.

use anyhow::Result;
use egomotion_study::{Cell, Table};

/// Numbers in full, so that they are read back as they were; nothing for an empty cell.
pub fn csv(table: &Table) -> Result<Vec<u8>> {
    let mut file = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    file.write_record(table.columns.iter().map(|column| &column.name))?;
    for row in &table.rows {
        file.write_record(row.iter().map(in_full))?;
    }
    Ok(file.into_inner().map_err(|e| e.into_error())?)
}

fn in_full(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) => text.clone(),
        Cell::Number(value) => format!("{value:?}"),
        Cell::Count(count) => count.to_string(),
        Cell::Empty => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_a_file_are_read_back_as_they_were() {
        let mut table = Table::new("t", "T", "", &[("name", "Name"), ("erm", "ERM (%)"), ("n", "n")]);
        let values = [0.1 + 0.2, -1.0 / 3.0, 1e-300, 123_456_789.0, f64::INFINITY, f64::NEG_INFINITY, -0.0];
        table.rows =
            values.iter().map(|&v| vec!["a, \"b\"\nc".into(), Cell::Number(v), 7_usize.into()]).collect();
        table.rows.push(vec![Cell::Empty, f64::NAN.into(), Cell::Empty]);
        let content = csv(&table).unwrap();
        let mut file = ::csv::Reader::from_reader(content.as_slice());
        assert_eq!(file.headers().unwrap(), vec!["name", "erm", "n"]);
        let rows: Vec<::csv::StringRecord> = file.records().map(Result::unwrap).collect();
        for (row, value) in rows.iter().zip(values) {
            assert_eq!(&row[0], "a, \"b\"\nc");
            assert_eq!(row[1].parse::<f64>().unwrap().to_bits(), value.to_bits());
            assert_eq!(&row[2], "7");
        }
        assert_eq!(rows[values.len()], vec!["", "", ""]);
    }
}
