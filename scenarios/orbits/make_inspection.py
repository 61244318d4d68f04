#!/usr/bin/env python3
"""Prints the manoeuvres of scenarios/inspection.json.

    python3 scenarios/orbits/make_inspection.py

Impulses that lead the inspector along the way-points below, by shooting with two-body motion. Positions are relative to
the target: R outward, T along its velocity, N normal to the orbit. Perturbations of the scenario differ between the two
satellites by less than 2e-8 m/s^2.
"""
import json

import numpy as np

GM = 3.986004418e14  # m^3/s^2
RADIUS_M = 42164170.0
START_S = 30.0
# time of arrival, s; position relative to the target along R, T, N, m
LEGS = [(1230.0, (0.0, -2000.0, 0.0)), (1830.0, (0.0, -200.0, 0.0)), (2130.0, (0.0, -40.0, 0.0)),
        (2230.0, (0.0, -20.0, 0.0))]
# then on a circle of 20 m towards the Earth, faster from step to step up to 2 deg in 10 s
ANGLES_DEG = np.cumsum([min(0.4 * k, 2.0) for k in range(1, 33)])
LEGS += [(2240.0 + 10.0 * k, (-20.0 * np.sin(a), -20.0 * np.cos(a), 0.0)) for k, a in enumerate(np.radians(ANGLES_DEG))]


def propagate(state, seconds):
    """Two-body motion in the plane, Runge-Kutta of order 4."""
    steps = max(int(abs(seconds) / 5.0), 1)
    h = seconds / steps

    def rate(s):
        r = np.hypot(s[0], s[1])
        return np.array([s[2], s[3], -GM * s[0] / r**3, -GM * s[1] / r**3])

    for _ in range(steps):
        a = rate(state)
        b = rate(state + 0.5 * h * a)
        c = rate(state + 0.5 * h * b)
        d = rate(state + h * c)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return state


def axes(state):
    radial = state[:2] / np.hypot(*state[:2])
    return np.array([radial, [-radial[1], radial[0]]])


def main():
    rate = np.sqrt(GM / RADIUS_M**3)
    target = np.array([RADIUS_M, 0.0, 0.0, RADIUS_M * rate])
    angle = -50000.0 / RADIUS_M
    inspector = RADIUS_M * np.array([np.cos(angle), np.sin(angle), -rate * np.sin(angle), rate * np.cos(angle)])
    offset = axes(target) @ (inspector[:2] - target[:2])
    print(json.dumps({"offset_rtn_m": [round(offset[0], 3), round(offset[1], 3), 0]}))
    now, burns = START_S, []
    target, inspector = propagate(target, now), propagate(inspector, now)
    for time, place in LEGS:
        end = propagate(target, time - now)
        goal = end[:2] + axes(end).T @ np.array(place[:2])
        dv = np.zeros(2)
        for _ in range(6):  # Newton
            def miss(v):
                return propagate(inspector + np.array([0.0, 0.0, v[0], v[1]]), time - now)[:2] - goal
            m = miss(dv)
            jacobian = np.column_stack([(miss(dv + e) - m) / 1e-3 for e in 1e-3 * np.eye(2)])
            dv = dv - np.linalg.solve(jacobian, m)
        rtn = axes(inspector) @ dv
        rtn = [round(float(v), 5) for v in rtn]
        burns.append({"time_s": now, "dv_rtn_mps": [rtn[0], rtn[1], 0]})
        inspector[2:] += axes(inspector).T @ np.array(rtn)
        target, inspector = end, propagate(inspector, time - now)
        now = time
    for burn in burns:
        print(json.dumps(burn) + ",")


if __name__ == "__main__":
    main()
