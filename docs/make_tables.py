#!/usr/bin/env python3
"""Writes the tables of a run's run.sqlite as Markdown, from its own dictionary of columns.

usage: docs/make_tables.py RUN_FOLDER/run.sqlite
"""
import sqlite3
import sys


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    run = sqlite3.connect(sys.argv[1])
    for name, doc in run.execute('SELECT "table", doc FROM tables'):
        print(f"**`{name}`**: {doc}\n")
        print("| column | type | unit | meaning |\n|---|---|---|---|")
        columns = run.execute('SELECT "column", type, unit, doc FROM columns WHERE "table" = ? '
                              "ORDER BY position", (name,))
        for column, kind, unit, meaning in columns:
            print(f"| `{column}` | {kind.lower()} | {unit} | {meaning} |")
        print()


if __name__ == "__main__":
    main()
