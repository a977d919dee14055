//! A table of a study as HTML.

use egomotion_study::{Cell, Table};
use maud::{Markup, html};

use crate::chart::number::significant;

/// Most rows on a page, so that a browser lays it out at once; the file holds all.
const MAX_ROWS: usize = 500;

/// Three significant digits; words to the left, numbers to the right.
pub(crate) fn html(table: &Table) -> Markup {
    let shown = &table.rows[..table.rows.len().min(MAX_ROWS)];
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
