"""Tables of runs and studies: columns of SQLite tables as arrays."""
from __future__ import annotations

import html
import pathlib
import sqlite3
from typing import Any, Dict, Iterator, List, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from .errors import FormatError, NotFoundError

Column = npt.NDArray[Any]


class Table(Mapping[str, Column]):
    """A table: arrays by the names of its columns. Missing numbers are NaN, missing texts "".

    `units` and `docs` describe the columns. Columns are attributes too: table.x_px.
    """

    def __init__(self, name: str, columns: Dict[str, Column], units: Mapping[str, str],
                 docs: Mapping[str, str]):
        self.name, self._columns = name, columns
        self.units, self.docs = dict(units), dict(docs)

    def __getitem__(self, column: str) -> Column:
        try:
            return self._columns[column]
        except KeyError:
            raise NotFoundError(f"the table {self.name} has no column {column!r} (it has: "
                                f"{', '.join(self._columns)})") from None

    def __getattr__(self, column: str) -> Column:
        if column.startswith("_"):
            raise AttributeError(column)
        try:
            return self._columns[column]
        except KeyError:
            raise AttributeError(f"the table {self.name} has no column {column!r} (it has: "
                                 f"{', '.join(self._columns)})") from None

    def __dir__(self) -> List[str]:
        return [*super().__dir__(), *self._columns]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        """Number of columns; `rows` is the number of rows."""
        return len(self._columns)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self._columns.values()))) if self._columns else 0

    def where(self, mask: Any) -> "Table":
        """The rows for which a mask is true, or of these indices."""
        return Table(self.name, {n: c[mask] for n, c in self._columns.items()}, self.units,
                     self.docs)

    def to_pandas(self) -> Any:
        """A pandas.DataFrame."""
        return data_frame(self._columns)

    def to_xarray(self) -> Any:
        """An xarray.Dataset along the dimension "row", with units."""
        try:
            import xarray
        except ImportError:
            raise ImportError("to_xarray needs xarray: pip install boresight[xarray]") from None
        return xarray.Dataset({n: ("row", c, {"units": self.units.get(n, ""),
                                              "long_name": self.docs.get(n, "")})
                               for n, c in self._columns.items()})

    def to_astropy(self) -> Any:
        """An astropy.table.Table with units where astropy knows them."""
        try:
            from astropy import table, units
        except ImportError:
            raise ImportError("to_astropy needs astropy: pip install boresight[astropy]") from None
        out = table.Table(self._columns)
        for name in self._columns:
            out[name].description = self.docs.get(name)
            try:
                out[name].unit = units.Unit(self.units[name]) if self.units.get(name) else None
            except ValueError:
                pass  # a unit that astropy does not know, such as px2
        return out

    def __repr__(self) -> str:
        return f"<Table {self.name}: {self.rows} rows of {', '.join(self._columns)}>"

    def _repr_html_(self) -> str:
        head = "".join(f"<th title='{html.escape(self.docs.get(n, ''))}'>{n}"
                       f"<br>{html.escape(self.units.get(n, ''))}</th>" for n in self._columns)
        rows = "".join("<tr>" + "".join(f"<td>{html.escape(str(c[k]))}</td>"
                                        for c in self._columns.values()) + "</tr>"
                       for k in range(min(self.rows, 20)))
        more = f"<p>{self.rows - 20} more rows</p>" if self.rows > 20 else ""
        return f"<b>{html.escape(self.name)}</b><table><tr>{head}</tr>{rows}</table>{more}"


class Store:
    """The tables of an SQLite file, read-only."""

    def __init__(self, path: pathlib.Path):
        self.path = path

    def _rows(self, statement: str) -> List[Sequence[Any]]:
        if not self.path.exists():
            raise NotFoundError(f"{self.path}: there is no such file")
        store = sqlite3.connect(f"{self.path.absolute().as_uri()}?mode=ro", uri=True)
        try:
            return store.execute(statement).fetchall()
        except sqlite3.DatabaseError as error:
            raise FormatError(f"{self.path}: {error}") from None
        finally:
            store.close()

    @property
    def names(self) -> List[str]:
        """Names of the tables."""
        return [str(row[0]) for row in self._rows(
            "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]

    def table(self, name: str) -> Table:
        """A table by name."""
        names = self.names
        if name not in names:
            raise NotFoundError(f"{self.path} has no table {name!r} (it has: {', '.join(names)})")
        about = self._rows(f'PRAGMA table_info("{name}")')
        rows = self._rows(f'SELECT * FROM "{name}" ORDER BY rowid')
        columns = {str(c[1]): _column(str(c[2]), [row[k] for row in rows])
                   for k, c in enumerate(about)}
        units: Dict[str, str] = {}
        docs: Dict[str, str] = {}
        if "columns" in names:
            for table, column, unit, doc in self._rows(
                    'SELECT "table", "column", unit, doc FROM "columns"'):
                if table == name:
                    units[column], docs[column] = unit or "", doc or ""
        return Table(name, columns, units, docs)


def _column(kind: str, values: List[Any]) -> Column:
    """Values of a column as an array of its SQL type."""
    if kind == "TEXT":
        return np.array([v or "" for v in values], dtype=str)
    if kind == "INTEGER" and None not in values:
        return np.array(values, dtype=np.int64)
    return np.array([np.nan if v is None else v for v in values], float)


def data_frame(columns: Mapping[str, Column]) -> Any:
    """A pandas.DataFrame of columns."""
    try:
        import pandas
    except ImportError:
        raise ImportError("to_pandas needs pandas: pip install boresight[pandas]") from None
    return pandas.DataFrame(dict(columns))


class HasTables:
    """A folder with a store of tables."""

    _store: Store

    @property
    def tables(self) -> List[str]:
        """Names of the tables."""
        return self._store.names

    def table(self, name: str) -> Table:
        """A table by name."""
        return self._store.table(name)
