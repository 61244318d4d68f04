#!/usr/bin/env python3
"""Writes the tables of a run's run.sqlite as Markdown, from its own dictionary of columns.

usage: docs/make_tables.py RUN_FOLDER/run.sqlite
"""
import sqlite3
import sys

INTRO = """# Tables of run.sqlite

Generated from the database of a run. The file describes itself: table `tables` describes the tables, and table
`columns` gives type, unit and meaning of each column. Column names carry the unit: degrees and arcseconds for angles,
pixels of the whole sensor with (0, 0) at the centre of the first pixel. `sensor` is a row of `sensors`.
`exposure_id` counts from 0. Join tables on both.
"""


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    print(INTRO)
    run = sqlite3.connect(sys.argv[1])
    for name, doc in run.execute('SELECT "table", doc FROM tables'):
        print(f"## Table {name}\n\n{doc}\n")
        print("| column | type | unit | meaning |\n|---|---|---|---|")
        columns = run.execute('SELECT "column", type, unit, doc FROM columns WHERE "table" = ? '
                              "ORDER BY position", (name,))
        for column, kind, unit, meaning in columns:
            print(f"| `{column}` | {kind.lower()} | {unit} | {meaning} |")
        print()


if __name__ == "__main__":
    main()
