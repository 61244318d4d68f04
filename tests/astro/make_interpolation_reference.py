#!/usr/bin/env python3
"""Writes tests/astro/interpolation_reference.h: interpolants of sin t in exact rational arithmetic.

Usage: python3 tests/astro/make_interpolation_reference.py > tests/astro/interpolation_reference.h
Values and slopes at 2.3 of the polynomials through the rows around it of a table at 0, 1 .. 5, by
Lagrange's and Hermite's own formulas.
"""
from fractions import Fraction as F
from math import cos, sin

T = F(2.3)


def multiply(a, b):
    out = [F(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return out


def add(a, b):
    n = max(len(a), len(b))
    return [(a[i] if i < len(a) else F(0)) + (b[i] if i < len(b) else F(0)) for i in range(n)]


def value(p, t):
    return sum(c * t**i for i, c in enumerate(p))


def slope(p):
    return [i * c for i, c in enumerate(p)][1:] or [F(0)]


def basis(nodes, k):
    p = [F(1)]
    for j in nodes:
        if j != k:
            p = multiply(p, [F(-j, k - j), F(1, k - j)])
    return p


def polynomial(nodes, hermite):
    out = [F(0)]
    for k in nodes:
        y, dy, p = F(sin(k)), F(cos(k)), basis(nodes, k)
        if not hermite:
            out = add(out, [y * c for c in p])
            continue
        square, d = multiply(p, p), value(slope(p), F(k))
        # (1 - 2 d (t - k)) y + (t - k) dy, times the square of the basis
        out = add(out, multiply(square, [y * (1 + 2 * d * k) - k * dy, dy - 2 * d * y]))
    return out


print("/* Made by make_interpolation_reference.py: points, Hermite, value, slope. */")
for nodes, hermite in (((2, 3), 0), ((1, 2, 3), 0), ((1, 2, 3, 4), 0), ((0, 1, 2, 3, 4, 5), 0),
                       ((2, 3), 1), ((1, 2, 3), 1), ((1, 2, 3, 4), 1), ((0, 1, 2, 3, 4, 5), 1)):
    p = polynomial(nodes, hermite)
    print("{%d, %d, %r, %r}," % (len(nodes), hermite, float(value(p, T)), float(value(slope(p), T))))
