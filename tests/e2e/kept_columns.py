"""Condenses what the program writes into columns, and columns into a few figures each: for test_figures_kept.py.

A column is all values of one name in one file: of a table in SQLite or CSV, of a key of FITS headers over the units, of a
leaf of JSON over the elements of lists, of the numbers in lines of a text that begin with the same word, of an attribute
of an element of HTML. Images are columns of their statistics, one value an image. What depends on the machine or the day
(versions, durations, dates, paths) is left out."""
import base64
import csv
import datetime
import functools
import html.parser
import io
import json
import math
import os
import re
import sqlite3
import warnings
import zlib

import numpy as np
from astropy.io import fits

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
MOMENT = re.compile(r"(\d{4})-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)(\.\d+)?Z?")
SINCE = datetime.datetime(2022, 6, 1)
# Of the machine or the day, as whole words ("_" parts words): "conversion", "origin_x" and "DATE-OBS" are results.
OWN = re.compile(r"(?i)(?<![a-z])(?:versions?|wall|real_time|device|created|createdby|creation|creator|originator|revision|commit|software|"
                 r"compiler|library|hostname|cpu|processor|threads|pacing|lateness|checksum|datasum|date(?![-_])|program|page_bytes|digest|sha256|"
                 r"free_bytes|memory|token|took|pcount|theap|ztension|elapsed|uuid|nonce|meta\.content|says speed)(?![a-z])|"
                 r"columns\[\]\.(?:name|type|unit|doc)|kernels\.|_ms\b|\.bytes\b")
SIZE = re.compile(r"[\d.]+ [kMG]?B$")  # of a file, which compression of other numbers changes
MOST_TEXTS = 12
FIGURES = ("count", "nulls", "mean", "rms", "least", "greatest", "first", "last", "weighted")


def moment(match):
    """Seconds of a UTC since 2022-06-01; None of today's times, which differ from run to run."""
    year, month, day, hour, minute, second = (int(v) for v in match.groups()[:6])
    if year >= 2025:
        return None
    days = (datetime.datetime(year, month, day) - SINCE).days
    return days * 86400.0 + hour * 3600 + minute * 60 + second + float(match[7] or 0)


@functools.lru_cache(maxsize=None)
def is_own(name):
    return OWN.search(name) is not None


class Columns:
    """{name: values}, in the order in which they came."""

    def __init__(self, roots=()):
        self.columns, self.roots = {}, [r for r in roots if r]

    def put(self, name, value):
        if not is_own(name):
            self.columns.setdefault(name, []).append(value)

    def without_roots(self, text):
        """Without the folders of this machine and run."""
        for root in self.roots:
            text = text.replace(root, "")
        return text

    def put_text(self, name, text):
        """A text: its numbers are values of their own, its times of other columns, the rest is a value with # and @ for them."""
        if is_own(name):
            return
        text = self.without_roots(text)
        moments = []

        def moment_of(match):
            value = moment(match)
            if value is not None:
                moments.append(value)
            return "@"
        rest = MOMENT.sub(moment_of, text)
        numbers = [float(v) for v in NUMBER.findall(rest)]
        rest = NUMBER.sub("#", rest)
        if rest not in ("#", "@"):
            self.columns.setdefault(name + "~", []).append(rest)
        for v in numbers:
            self.columns.setdefault(name, []).append(v)
        for v in moments:  # since the first one of the column: what is of the size of a run is seen
            first = self.columns.setdefault(name + "@", [v])[0]
            self.columns.setdefault(name + "@ since", []).append(v - first)

    def put_value(self, name, value):
        if isinstance(value, bool):
            self.put(name, float(value))
        elif value is None or isinstance(value, (int, float)):
            self.put(name, None if value is None else float(value))
        elif isinstance(value, bytes):
            self.put_array(name, np.frombuffer(value, np.uint8))
        else:
            self.put_text(name, str(value))

    def put_array(self, name, array):
        """Statistics of an array of up to three axes: they change where values, their places or signs do."""
        v = np.nan_to_num(np.asarray(array, float).reshape((array.shape or (1,))), posinf=0, neginf=0)
        while v.ndim > 2:
            v = v.reshape((-1,) + v.shape[2:])
        v = np.atleast_2d(v)
        self.put(name + " size", float(v.size))
        if v.size:
            x, y = np.arange(v.shape[1]), np.arange(v.shape[0])[:, None]
            excess = v - np.median(v)
            for k, number in (("mean", v.mean()), ("sigma", v.std()), ("least", v.min()), ("greatest", v.max()),
                              ("x", (excess * x).mean() / v.shape[1]), ("y", (excess * y).mean() / v.shape[0]),
                              ("xy", (excess * x * y).mean() / v.size),
                              ("wave", (excess * np.sin(0.7 * x + 1.9 * y)).mean()),
                              ("column", (v[:, 1:] - v[:, :-1]).std() if v.shape[1] > 1 else 0.0)):
                self.put(f"{name} {k}", float(number))

    def put_json(self, name, value):
        if isinstance(value, dict):
            for key, item in value.items():
                self.put_json(f"{name}.{key}", item)
        elif isinstance(value, list):
            if not value:
                self.put(name + "[]", None)
            for item in value:
                self.put_json(name + "[]", item)
        else:
            self.put_value(name, value)

    def put_csv(self, name, text):
        rows = list(csv.reader(io.StringIO(text)))
        for row in rows[1:]:
            for key, value in zip(rows[0], row):
                self.put_text(f"{name}.{key}", value)
            self.put(f"{name} cells", float(len(row)))

    def put_lines(self, name, text):
        """Lines by the word with which they begin."""
        for line in text.split("\n"):
            word = re.match(r"\s*([A-Za-z_][\w /()-]{0,30}?)\s*(?:[=:,]|\s\s|$|\s(?=[-\d]))", line)
            if line.strip() and not SIZE.search(line):
                self.put_text(f"{name} {word[1] if word else ''}", line.strip())

    def put_html(self, name, text):
        columns = self

        class Parser(html.parser.HTMLParser):
            def __init__(self):
                super().__init__()
                self.tag, self.key, self.label = "", None, ""

            def handle_starttag(self, tag, attrs):
                self.tag, self.key = tag, dict(attrs).get("data-key")
                for key, value in attrs:
                    if not value or key in ("id", "href", "xmlns") or OWN.search(value):
                        continue
                    if value.startswith("data:image/png;base64,"):
                        columns.put_png(f"{name} {tag}.{key}", value.split(",", 1)[1])
                    else:
                        columns.put_text(f"{name} {tag}.{key}", value)

            def handle_data(self, data):
                if self.tag == "script":
                    columns.put_packed(name, self.key, data)
                elif self.tag != "style" and data.strip():
                    if not OWN.search(data) and not OWN.search(self.label) and not ("speed" in self.label and self.tag == "b"):
                        columns.put_text(f"{name} {self.tag}", data.strip())
                    self.label = data
        Parser().feed(self.without_roots(text))

    def put_packed(self, name, key, data):
        """What a page of `export --page` holds under a key: packed JSON or bytes. The programs of a page are no results."""
        if key is None or not key.startswith("api/"):
            return
        content = zlib.decompress(base64.b64decode(data), 47)
        name = f"{name} {NUMBER.sub('#', key.split('?')[0])}"
        self.put_bytes(name, content, ".json" if content[:1] in (b"{", b"[") else "")

    def put_png(self, name, encoded):
        self.put_array(name, png_pixels(base64.b64decode(encoded)))

    def put_sqlite(self, name, path):
        db = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
        for (table,) in sorted(db.execute("SELECT name FROM sqlite_master WHERE type = 'table' AND name != 'columns'").fetchall()):
            cursor = db.execute(f'SELECT * FROM "{table}" ORDER BY rowid')
            keys = [d[0] for d in cursor.description]
            for row in cursor:
                pairs = [(row[0], row[1])] if len(keys) == 2 and keys[1] == "value" else zip(keys, row)
                for key, value in pairs:
                    self.put_value(f"{name} {table}.{key}", value)
        db.close()

    def put_fits(self, name, path):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with fits.open(path) as units:
                for unit in units:
                    for key, value in unit.header.items():
                        if key not in ("COMMENT", "HISTORY", ""):
                            self.put_value(f"{name} {key}", value)
                    if isinstance(unit, fits.BinTableHDU) and not isinstance(unit, fits.CompImageHDU):
                        for column in unit.columns.names:
                            values = np.asarray(unit.data[column])
                            if values.dtype.kind in "biuf":
                                self.put_array(f"{name} {column}", values)
                            else:
                                for value in values.ravel():
                                    self.put_value(f"{name} {column}", str(value))
                    elif unit.data is not None:
                        planes = unit.data if np.ndim(unit.data) == 3 else [unit.data]
                        for plane in planes:
                            self.put_array(f"{name} pixels", plane)

    def put_file(self, name, path):
        """A file by the end of its name."""
        end = os.path.splitext(path)[1]
        if end == ".sqlite":
            self.put_sqlite(name, path)
        elif end == ".fits":
            self.put_fits(name, path)
        else:
            with open(path, "rb") as file:
                self.put_bytes(name, file.read(), end)

    def put_bytes(self, name, data, end):
        if end in (".json", ".czml"):
            try:
                self.put_json(name, json.loads(data))
            except ValueError:  # it only begins like JSON
                self.put_array(name, np.frombuffer(data, np.uint8))
        elif end == ".png":
            self.put_array(name, png_pixels(data))
        elif end == ".f8":
            self.put_array(name, np.frombuffer(data, "<f8"))
        elif end in (".csv", ".html", ".txt", ".oem", ".tdm", ".yaml", ".svg", ".tle"):
            text = data.decode()
            {".csv": self.put_csv, ".html": self.put_html, ".svg": self.put_html}.get(end, self.put_lines)(name, text)
        else:
            self.put_array(name, np.frombuffer(data, np.uint8))

    def figures(self):
        """{name: figures}: [count, value] of a column of equal numbers, all FIGURES of another, {text: count} of texts."""
        found = {}
        for name, values in self.columns.items():
            texts = [v for v in values if isinstance(v, str)]
            if texts:
                found[name] = text_figures(texts)
            if len(texts) < len(values):
                found[name] = number_figures([v for v in values if not isinstance(v, str)])
        return found


def text_figures(texts):
    counts = {}
    for v in texts:
        counts[v[:60]] = counts.get(v[:60], 0) + 1
    if len(counts) > MOST_TEXTS:
        return [len(texts), f"{len(counts)} texts"]
    return counts


def rounded(value):
    return float(f"{value:.7g}") if math.isfinite(value) else str(value)


def number_figures(values):
    v = np.array([x if x is None or abs(x) < 1e100 else math.copysign(1e100, x) for x in values if x is not None], float)
    bad = len(values) - len(v) + int(np.sum(~np.isfinite(v)))
    v = v[np.isfinite(v)]
    if not len(v):
        return [len(values)]
    if bad == 0 and np.all(v == v[0]):
        return [len(values), rounded(v[0])]
    # weights without period: a value in another place changes the sum
    weights = 2.0 * np.modf(0.6180339887498949 * (1.0 + np.arange(len(v))))[0] - 1.0
    return [len(values), bad] + [rounded(float(x)) for x in (v.mean(), np.sqrt(np.mean(v * v)), v.min(), v.max(), v[0], v[-1],
                                                               np.mean(v * weights))]


def png_pixels(data):
    """Rows of a PNG (ISO 15948) as they are packed, differences and all: no picture is needed to see that one changed."""
    at, body, height = 8, b"", 1
    while at < len(data):
        size, kind = int.from_bytes(data[at:at + 4], "big"), data[at + 4:at + 8]
        part = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            height = int.from_bytes(part[4:8], "big")
        body += part if kind == b"IDAT" else b""
        at += 12 + size
    return np.frombuffer(zlib.decompress(body), np.uint8).reshape(height, -1)
