"""Tables of reports."""

import csv


def rows_of(path):
    """Rows of a CSV file by their headings."""
    return list(csv.DictReader(path.read_text("utf-8").splitlines()))
