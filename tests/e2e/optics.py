"""Directions and pixels worked out with numpy and ERFA, from docs/reference/conventions.md and a scenario's camera: what the tests
compare the program's tables with. Vectors are rows of arrays, quaternions scalar last."""
import erfa
import numpy as np

LIGHT_MPS, AU_M = 299792458.0, 149597870700.0
ARCSEC = np.radians(1 / 3600)


def unit(ra_deg, dec_deg):
    ra, dec = np.radians(ra_deg), np.radians(dec_deg)
    return np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)


def cross(a, b):
    """numpy.cross of vectors of three, which takes ten times as long for one pair of them."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    return np.stack([a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1], a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
                     a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]], axis=-1)


def angle(a, b):
    """Radians between directions, good for small ones."""
    return np.arctan2(np.linalg.norm(cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def columns(row, name, axes="xyz", tail=""):
    return np.array([row[f"{name}_{k}{tail}"] for k in axes], float)


def quaternion(row, name):
    return columns(row, name, "xyzw")


def multiply(p, q):
    """Hamilton product."""
    (a, b, c, d), (e, f, g, h) = p.tolist(), q.tolist()
    return np.array([d * e + h * a + b * g - c * f, d * f + h * b + c * e - a * g, d * g + h * c + a * f - b * e,
                     d * h - a * e - b * f - c * g])


def conjugate(q):
    return q * np.array([-1, -1, -1, 1])


def rotate(q, v):
    """Coordinates of v after q: q_b_from_a takes those in a to those in b. Rows of q belong to rows of v."""
    v, q = np.asarray(v, float), np.asarray(q, float)
    return v + 2 * cross(q[..., :3], cross(q[..., :3], v) + q[..., 3:] * v)


def about(axis, angle_rad):
    return np.append(np.asarray(axis, float) * np.sin(angle_rad / 2), np.cos(angle_rad / 2))


def turn_between(a, b):
    """The rotation vector r of a = exp(r) b, radians."""
    d = multiply(a, conjugate(b))
    d = d if d[3] > 0 else -d
    length = np.linalg.norm(d[:3])
    return d[:3] * (2 * np.arctan2(length, d[3]) / length if length > 0 else 2)


class Camera:
    """Gnomonic projection, rotation of the focal plane, Brown's distortion, pixels."""

    def __init__(self, camera):
        offset = camera.get("boresight_offset_px", (0, 0))
        self.width, self.height = camera["width_px"], camera["height_px"]
        self.centre = np.array([(self.width - 1) / 2 + offset[0], (self.height - 1) / 2 + offset[1]])
        self.scale = camera["pixel_scale_arcsec"] * ARCSEC
        turn = np.radians(camera.get("rotation_deg", 0))
        self.turn = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        self.k = [camera.get("distortion", {}).get(key, 0) for key in ("k1", "k2", "k3", "p1", "p2")]

    def distort(self, u):
        x, y = u[..., 0], u[..., 1]
        k1, k2, k3, p1, p2 = self.k
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.stack([x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                         y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=-1)

    def pixels(self, v):
        """Places of directions in camera axes."""
        v = np.asarray(v, float)
        return self.centre + self.distort((v[..., :2] / v[..., 2:]) @ self.turn.T) / self.scale

    def directions(self, places):
        """Unit vectors in camera axes of places on the sensor."""
        wanted = (np.asarray(places, float) - self.centre) * self.scale
        u = wanted
        for _ in range(30):
            u = u + wanted - self.distort(u)
        v = u @ self.turn
        v = np.concatenate([v, np.ones(v.shape[:-1] + (1,))], axis=-1)
        return v / np.linalg.norm(v, axis=-1, keepdims=True)


def apparent(exposure, directions, star=False):
    """What the observer sees: stellar aberration, of stars the Sun's light deflection before it. `exposure` is a row of
    `exposures`."""
    velocity = columns(exposure, "velocity_bary", tail="_mps") / LIGHT_MPS
    sun = columns(exposure, "sun", tail="_m")
    sun_au = np.linalg.norm(sun) / AU_M
    directions = np.asarray(directions, float)
    if star:
        directions = erfa.ldsun(directions, -sun / np.linalg.norm(sun), sun_au)
    return erfa.ab(directions, velocity, sun_au, np.sqrt(1 - velocity @ velocity))


def geometric(exposure, seen, star=False):
    """The direction whose apparent one is seen."""
    guess = seen
    for _ in range(5):
        guess = guess + seen - apparent(exposure, guess, star)
        guess = guess / np.linalg.norm(guess, axis=-1, keepdims=True)
    return guess
