"""The figures of a run's summary, worked out from run.sqlite alone with numpy, ERFA and sgp4.

The definitions are those of docs/reference/summary.md. Nothing is taken from the
program but what it recorded: the target's true direction comes from its element set, the stellar
aberration is ERFA's.
"""
import erfa
import numpy as np
from sgp4.api import Satrec

RIGHT_TARGET_PX, SETTLED_PX = 5.0, 3.0
LIGHT_MPS, AU_M = 299792458.0, 149597870700.0
ARCSEC = np.radians(1 / 3600)
# a line of sight that passes the Earth's centre closer than the first is blocked, farther than the
# second is free: the polar radius less 7 km, and the equatorial one with 100 km of air
BLOCKED_M, FREE_M = 6350e3, 6478e3


def unit(ra_deg, dec_deg):
    ra, dec = np.radians(ra_deg), np.radians(dec_deg)
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)


def element_set(path, norad):
    with open(path, encoding="ascii") as file:
        lines = file.read().splitlines()
    for one, two in zip(lines, lines[1:]):
        if one.startswith("1 ") and int(one[2:7]) == norad:
            return Satrec.twoline2rv(one, two)
    raise AssertionError(f"{path}: no {norad}")


class Orbit:
    """GCRF positions by SGP4; TEME to GCRF by GMST82 and the intermediate origin of IAU 2006/2000A."""

    def __init__(self, path, norad, epoch_utc):
        self.satellite = element_set(path, norad)
        self.to_intermediate = {}  # by seconds
        day, clock = epoch_utc.rstrip("Z").split("T")
        year, month, date = map(int, day.split("-"))
        hour, minute, second = clock.split(":")
        self.utc = erfa.dtf2d("UTC", year, month, date, int(hour), int(minute), float(second))

    def position(self, seconds):
        utc = self.utc[0], self.utc[1] + seconds / 86400
        error, place, _ = self.satellite.sgp4(*utc)
        assert error == 0
        tt = erfa.taitt(*erfa.utctai(*utc))
        # UT1 cancels but for precession during its difference from UTC; the pole moves by 1e-11 rad in a second
        key = round(seconds)
        if key not in self.to_intermediate:
            self.to_intermediate[key] = erfa.c2i06a(*tt)
        to_intermediate = self.to_intermediate[key]
        teme_to_intermediate = erfa.rz(erfa.gmst82(*utc) - erfa.era00(*utc), np.eye(3))
        return to_intermediate.T @ (teme_to_intermediate @ (np.array(place) * 1e3))

    def direction(self, here_m, earth_mps, seconds):
        """Geometric direction with light time, and the position that it is of: where the target
        was about the barycentre, from where the Earth has moved on since."""
        delay = 0.0
        for _ in range(3):
            there = self.position(seconds - delay) - earth_mps * delay
            delay = np.linalg.norm(there - here_m) / LIGHT_MPS
        return (there - here_m) / np.linalg.norm(there - here_m), there


def track_direction(row, time_s):
    """Place of a row of `tracks` at another time, by its rates."""
    d = unit(row["ra_deg"], row["dec_deg"])
    east = np.array([-np.sin(np.radians(row["ra_deg"])), np.cos(np.radians(row["ra_deg"])), 0])
    north = np.cross(d, east)
    d = d + (time_s - row["time_s"]) * ARCSEC * (row["rate_east_arcsec_per_s"] * east +
                                                 row["rate_north_arcsec_per_s"] * north)
    return d / np.linalg.norm(d)


def vector(row, name, tail):
    return np.array([row[f"{name}_{k}_{tail}"] for k in "xyz"])


def apparent(exposure, direction):
    velocity = vector(exposure, "velocity_bary", "mps") / LIGHT_MPS
    sun_au = np.linalg.norm(vector(exposure, "sun", "m")) / AU_M
    return erfa.ab(direction, velocity, sun_au, np.sqrt(1 - velocity @ velocity))


def camera_axes(exposure, direction):
    """A direction in the camera's axes, z the boresight, by the true attitude."""
    q = np.array([exposure[f"q_cam_from_gcrf_mid_{k}"] for k in "xyzw"])
    return direction + 2 * np.cross(q[:3], np.cross(q[:3], direction) + q[3] * direction)


def sight(here_m, there_m):
    """True: the line of sight is free; False: blocked by the Earth; None: too close to tell."""
    line = there_m - here_m
    along = np.clip(-(here_m @ line) / (line @ line), 0, 1)
    nearest = np.linalg.norm(here_m + along * line)
    return None if BLOCKED_M < nearest < FREE_M else bool(nearest >= FREE_M)


def lit(there_m, sun_m):
    """True: some of the Sun's disc is seen from there; False: none; None: too close to tell."""
    distance, sun_rad = np.linalg.norm(there_m), 6.957e8 / np.linalg.norm(sun_m)
    apart = angle(-there_m, sun_m) + sun_rad
    edges = [np.arcsin(radius / distance) for radius in (BLOCKED_M, FREE_M)]
    return None if edges[0] < apart < edges[1] else bool(apart >= edges[1])


def both(a, b):
    return False if a is False or b is False else None if a is None or b is None else True


class Frames:
    """What the tables say of each exposure of a run with one sensor."""

    def __init__(self, db, orbit, norad, rotation_deg=0.0):
        self.rate = db.execute("SELECT tick_rate_hz FROM run").fetchone()[0]
        exposures = db.execute("SELECT * FROM exposures ORDER BY exposure_id").fetchall()
        in_field = {row["exposure_id"]: row for row in db.execute(
            "SELECT * FROM truth WHERE kind = 'object' AND norad = ?", (norad,))}
        done = {row["exposure_id"]: row["written_tick"] / self.rate for row in db.execute(
            "SELECT exposure_id, written_tick FROM track_frames")}
        tracks = {}
        for row in db.execute("SELECT * FROM tracks WHERE status != 'tentative'"):
            tracks.setdefault(row["exposure_id"], []).append(row)
        modes = db.execute("SELECT tick, mode FROM control ORDER BY tick").fetchall()
        detections = {}
        for row in db.execute("SELECT exposure_id, x_px, y_px FROM detections"):
            detections.setdefault(row["exposure_id"], []).append((row["x_px"], row["y_px"]))
        turn = np.radians(rotation_deg)
        plane = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        self.list, self.disagreement = [], 0.0
        mode, k = None, 0
        for e in exposures:
            number, mid, px = e["exposure_id"], e["mid_s"], e["pixel_scale_arcsec"] * ARCSEC
            here = vector(e, "observer_gcrf", "m")
            earth = vector(e, "velocity_bary", "mps") - vector(e, "observer_gcrf", "mps")
            direction, there = orbit.direction(here, earth, mid)
            truth = in_field.get(number)
            if truth:  # the recorded one, once it is known to be right
                recorded = unit(truth["ra_deg"], truth["dec_deg"])
                self.disagreement = max(self.disagreement, angle(direction, recorded))
                direction = recorded
            while k < len(modes) and modes[k]["tick"] <= e["end_tick"]:
                mode, k = modes[k]["mode"], k + 1
            v = camera_axes(e, apparent(e, direction))
            across = np.hypot(v[0], v[1])
            error = np.arctan2(across, v[2]) / px * (plane @ v[:2] / across)
            sun = vector(e, "sun", "m") + here - there
            visible = both(sight(here, there), lit(there, sun))
            field = truth if truth and truth["in_field"] else None
            self.list.append(dict(
                number=number, start=e["start_tick"] / self.rate, mid=mid, px=px, mode=mode,
                direction=direction, visible=visible, error=error,
                size=np.hypot(*error), done=done.get(number), tracks=tracks.get(number, []),
                field=field, detections=detections.get(number, [])))


def nees(frames):
    """NEES of the direction of the track of interest, of the frames that gave it a detection."""
    out = []
    for f in frames.list:
        for track in f["tracks"]:
            if not track["target_of_interest"] or track["last_update_tick"] != track["tick"]:
                continue
            ra, dec = np.radians(track["ra_deg"]), np.radians(track["dec_deg"])
            axes = np.array([[-np.sin(ra), np.cos(ra), 0],
                             [-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)]])
            error = axes @ (track_direction(track, f["mid"]) - f["direction"])
            covariance = np.array([[track["cov_d1_d1_rad2"], track["cov_d1_d2_rad2"]],
                                   [track["cov_d1_d2_rad2"], track["cov_d2_d2_rad2"]]])
            out.append(error @ np.linalg.solve(covariance, error))
    return np.array(out)


def judge(frames):
    """The summary, and how many frames could be visible or not: the Earth's limb decides."""
    confirmed = acquired = settled = latest = None
    visible = in_track = visible_after = in_track_after = breaks = unclear = found = in_field = 0
    was_in_track = False
    errors, track_errors = [], []
    for f in frames.list:
        def off_px(track):
            return angle(track_direction(track, f["mid"]), f["direction"]) / f["px"]
        had = acquired is not None
        if settled is None and had and f["mode"] == "track" and f["size"] < SETTLED_PX:
            settled = f["start"]
        if f["done"] is not None:
            latest = None
            for track in f["tracks"]:
                if track["target_of_interest"]:
                    latest = track
                if (confirmed is None and track["status"] == "confirmed" and
                        off_px(track) <= RIGHT_TARGET_PX):
                    confirmed = f["done"]
        on_target = latest is not None and off_px(latest) <= RIGHT_TARGET_PX
        if on_target and not had:
            acquired = f["done"]
        if on_target and f["field"] and f["done"] is not None:
            track_errors.append(off_px(latest))
        unclear += f["visible"] is None
        if f["visible"]:
            visible += 1
            in_track += on_target
            breaks += was_in_track and not on_target
            was_in_track = on_target
            if had and f["mid"] >= acquired:
                visible_after += 1
                in_track_after += on_target
            if settled is not None and f["mode"] == "track":
                errors.append(f["error"])
            if f["field"] and f["field"]["snr"] > 0:
                in_field += 1
                x, y = f["field"]["x_centroid_px"], f["field"]["y_centroid_px"]
                found += any(np.hypot(dx - x, dy - y) <= RIGHT_TARGET_PX
                             for dx, dy in f["detections"])
    errors, track_errors = np.array(errors).reshape(-1, 2), np.array(track_errors)
    sizes = np.hypot(errors[:, 0], errors[:, 1])

    def rank(values, share):
        return np.sort(values)[int(np.ceil(share * len(values))) - 1] if len(values) else None

    def rms(values):
        return np.sqrt(np.mean(values ** 2)) if len(values) else None

    def ratio(part, whole):
        return part / whole if whole else None
    return dict(
        frames=len(frames.list), time_to_confirm_s=confirmed, time_to_acquire_s=acquired,
        time_to_settle_s=settled, visible_frames=visible, custody=ratio(in_track, visible),
        track_fraction=ratio(in_track_after, visible_after), breaks=breaks,
        pointing_frames=len(sizes), pointing_rms_px=rms(sizes), pointing_median_px=rank(sizes, 0.5),
        pointing_p95_px=rank(sizes, 0.95), pointing_p99_px=rank(sizes, 0.99),
        pointing_max_px=rank(sizes, 1.0),
        pointing_bias_px=np.hypot(*errors.mean(axis=0)) if len(sizes) else None,
        detected_fraction=ratio(found, in_field), track_frames=len(track_errors),
        track_rms_px=rms(track_errors), track_median_px=rank(track_errors, 0.5),
        track_p95_px=rank(track_errors, 0.95), track_max_px=rank(track_errors, 1.0)), unclear
