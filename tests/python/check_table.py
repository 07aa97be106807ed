"""Reads one of Beadline's Parquet tables with pyarrow, and compares it with the same table as CSV.

    pip install -r requirements.txt
    python check_table.py TABLE.parquet TABLE.csv

Columns must have the same names in the same order, and every value must be the same: doubles bit for bit,
whole numbers and words as they are written, a value that does not exist null here and empty there. Exit code 0
if all is well, 1 with the first difference if not.
"""

import csv
import struct
import sys

import pyarrow.parquet as parquet


def same(value, text):
    if value is None:
        return text == ""
    if isinstance(value, float):
        return text != "" and struct.pack("<d", value) == struct.pack("<d", float(text))
    return str(value) == text


def main(parquet_path, csv_path):
    table = parquet.read_table(parquet_path)
    with open(csv_path, newline="") as file:
        head, *rows = csv.reader(file)
    if table.column_names != head:
        sys.exit(f"columns {table.column_names}, expected {head}")
    if table.num_rows != len(rows):
        sys.exit(f"{table.num_rows} rows, expected {len(rows)}")
    for name, column in zip(head, zip(*rows)):
        for number, (value, text) in enumerate(zip(table[name].to_pylist(), column)):
            if not same(value, text):
                sys.exit(f"row {number}, {name}: {value!r}, expected {text!r}")
    types = {str(field.type) for field in table.schema}
    if not types <= {"uint64", "double", "string"}:
        sys.exit(f"unexpected types {types}")
    print(f"{table.num_rows} rows of {len(head)} columns are the same")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
