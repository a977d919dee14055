//! A table of the library as CSV and as HTML.

use anyhow::Result;
use egomotion::study::{Cell, Table};
use maud::{Markup, html};

use crate::chart::number::significant;

/// Most rows on a page; the file holds all.
const MOST_ROWS: usize = 500;

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

/// Three significant digits; words to the left, numbers to the right.
pub fn html(table: &Table) -> Markup {
    let shown = &table.rows[..table.rows.len().min(MOST_ROWS)];
    let words = |k: usize| table.rows.iter().any(|row| matches!(row.get(k), Some(Cell::Text(_))));
    let class: Vec<Option<&str>> = (0..table.columns.len()).map(|k| words(k).then_some("words")).collect();
    html! {
        div class="scroll" tabindex="0" {
            table class="values" {
                thead { tr {
                    @for (column, class) in table.columns.iter().zip(&class) { th scope="col" class=[*class] { (column.heading) } }
                } }
                tbody {
                    @for row in shown {
                        tr {
                            @for (cell, class) in row.iter().zip(&class) { td class=[*class] { (in_short(cell)) } }
                        }
                    }
                }
            }
        }
        @if shown.len() < table.rows.len() {
            p class="small" { "The first " (shown.len()) " of " (table.rows.len()) " rows; the file holds all." }
        }
    }
}

fn in_short(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) => text.clone(),
        Cell::Number(value) if *value == f64::INFINITY => "∞".into(),
        Cell::Number(value) if *value == f64::NEG_INFINITY => "−∞".into(),
        Cell::Number(value) => significant(*value, 3),
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

    #[test]
    fn a_page_shows_three_digits() {
        let mut table = Table::new("t", "T", "", &[("a", "A < B"), ("b", "B")]);
        table.rows = vec![vec!["x".into(), 0.123_456.into()], vec!["y".into(), Cell::Number(-1234.5)]];
        let page = html(&table).into_string();
        assert!(
            page.contains("<th scope=\"col\" class=\"words\">A &lt; B</th><th scope=\"col\">B</th>"),
            "{page}"
        );
        assert!(page.contains("<td>0.123</td>") && page.contains("<td>−1234</td>"), "{page}");
    }
}
