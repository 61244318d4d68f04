#!/usr/bin/env python3
"""Prints the manoeuvres of scenarios/inspection.json.

    python3 scenarios/orbits/make_inspection.py

Burns that lead the inspector along the way-points below, by shooting with two-body motion. Positions are relative to
the target: R outward, T along its velocity, N normal to the orbit. Perturbations of the scenario differ between the two
satellites by less than 2e-8 m/s^2.
"""
import json

import numpy as np

GM = 3.986004418e14  # m^3/s^2
RADIUS_M = 42164170.0
START_S = 30.0
# time of arrival, s; position relative to the target along R, T, N, m; length of the burn before, s
LEGS = [(1230.0, (0.0, -2000.0, 0.0), 60.0), (1830.0, (0.0, -200.0, 0.0), 60.0), (2130.0, (0.0, -40.0, 0.0), 30.0),
        (2240.0, (0.0, -20.0, 0.0), 20.0), (2260.0, (0.0, -20.0, 0.0), 0.0)]
# then on a circle of 20 m towards the Earth, faster from step to step up to 1.2 deg in 10 s
ANGLES_DEG = np.cumsum([min(0.1 * k, 1.2) for k in range(1, 51)])
LEGS += [(2270.0 + 10.0 * k, (-20.0 * np.sin(a), -20.0 * np.cos(a), 0.0), 0.0)
         for k, a in enumerate(np.radians(ANGLES_DEG))]


def propagate(state, seconds, dv=(0.0, 0.0), burn_s=0.0):
    """Two-body motion in the plane with a constant acceleration along R and T, or an impulse, at first; Runge-Kutta of
    order 4."""
    if burn_s == 0.0:
        state = np.concatenate([state[:2], state[2:] + axes(state).T @ np.array(dv)])
    for length, push in ((burn_s, np.array(dv) / max(burn_s, 1e-9)), (seconds - burn_s, np.zeros(2))):
        steps = max(int(length / 5.0), 1)
        h = length / steps

        def rate(s, push=push):
            r = np.hypot(s[0], s[1])
            radial = s[:2] / r
            thrust = push[0] * radial + push[1] * np.array([-radial[1], radial[0]])
            return np.array([s[2], s[3], -GM * s[0] / r**3 + thrust[0], -GM * s[1] / r**3 + thrust[1]])

        for _ in range(steps if length > 0.0 else 0):
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
    for time, place, burn_s in LEGS:
        end = propagate(target, time - now)
        goal = end[:2] + axes(end).T @ np.array(place[:2])
        dv = np.zeros(2)
        for _ in range(6):  # Newton
            def miss(v):
                return propagate(inspector, time - now, v, burn_s)[:2] - goal
            m = miss(dv)
            jacobian = np.column_stack([(miss(dv + e) - m) / 1e-3 for e in 1e-3 * np.eye(2)])
            dv = dv - np.linalg.solve(jacobian, m)
        rtn = [round(float(v), 5) for v in dv]
        burns.append({"time_s": now, "duration_s": burn_s, "dv_rtn_mps": [rtn[0], rtn[1], 0]})
        inspector = propagate(inspector, time - now, rtn, burn_s)
        target, now = end, time
    for burn in burns:
        print(json.dumps(burn) + ",")


if __name__ == "__main__":
    main()
