//! The reference tables of `tests/reference`.

use std::path::Path;

/// A CSV file without quotes, with the names of its columns in the first line.
#[derive(Debug)]
pub(crate) struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// One line of a [`Table`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row<'a> {
    columns: &'a [String],
    cells: &'a [String],
}

impl Table {
    /// Reads `tests/reference/<name>.csv`.
    pub(crate) fn read(name: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../tests/reference/{name}.csv"));
        let text = std::fs::read_to_string(path).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        let columns = lines.next().unwrap();
        let rows: Vec<_> = lines.collect();
        assert!(!rows.is_empty() && rows.iter().all(|row| row.len() == columns.len()), "{name}.csv");
        Self { columns, rows }
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(|cells| Row { columns: &self.columns, cells })
    }
}

impl<'a> Row<'a> {
    pub(crate) fn text(self, column: &str) -> &'a str {
        &self.cells[self.columns.iter().position(|name| name == column).unwrap()]
    }

    pub(crate) fn number(self, column: &str) -> f64 {
        self.text(column).parse().unwrap()
    }

    pub(crate) fn count(self, column: &str) -> u64 {
        self.text(column).parse().unwrap()
    }
}
