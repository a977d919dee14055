//! A table as a value: columns with their names, rows of cells.

/// A table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Stem of its file's name: `table-03`.
    pub id: String,
    /// Its title, with the paper's number where it is one of the paper's.
    pub title: String,
    /// A sentence or two on how to read it.
    pub caption: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows, each with one cell for every column.
    pub rows: Vec<Vec<Cell>>,
}

/// One column of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name in a file: `erm_signed`.
    pub name: String,
    /// Heading on a page, with the unit: `ERM (%)`.
    pub heading: String,
}

/// One cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A number: in full in a file, with three significant digits on a page.
    Number(f64),
    /// A whole number.
    Count(usize),
    /// Nothing.
    Empty,
}

impl Table {
    /// A table without rows; each column is (name, heading).
    pub fn new(id: &str, title: &str, caption: &str, columns: &[(&str, &str)]) -> Self {
        let column =
            |&(name, heading): &(&str, &str)| Column { name: name.to_owned(), heading: heading.to_owned() };
        Self {
            id: id.to_owned(),
            title: title.to_owned(),
            caption: caption.to_owned(),
            columns: columns.iter().map(column).collect(),
            rows: Vec::new(),
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        if value.is_finite() { Self::Number(value) } else { Self::Empty }
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count)
    }
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}
