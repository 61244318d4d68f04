"""Cramér-Rao bound of the path of the line of sight in a frame of star streaks."""
import numpy

# Nodes of the path over which light is summed, and half the side of a node's stamp in standard deviations of the PSF.
NODES, REACH = 240, 4.5


def basis(count, u):
    """Uniform cubic B-splines on [0, 1] at u: [count, len(u)] (de Boor, A Practical Guide to Splines, 1978, chapter IX)."""
    x = u[None, :] * (count - 3) - numpy.arange(-3, count - 3)[:, None]
    y = numpy.abs(x - 2)
    return numpy.where(y < 1, 2 / 3 - y * y + y**3 / 2, numpy.where(y < 2, (2 - y)**3 / 6, 0.0))


def path_bound_px(paths, fluxes, sigma_px, noise_e, shape, coefficients):
    """RMS over both axes and all times of the least standard deviation of the path, px.

    Unknown are two splines of time (displacement in x and y, common to all stars), a roll that is linear in time, the light
    of each star and the background. The pixels have normal noise: noise_e, and the shot noise of the stars.

    paths         [stars, NODES, 2] places of the stars at the middles of NODES equal times, px
    fluxes        [stars] electrons of a star's path, the part beside the frame included
    shape         (rows, columns)
    coefficients  of each spline
    Reference: Kay, Fundamentals of Statistical Signal Processing: Estimation Theory (1993), section 3.9
    """
    u = (numpy.arange(NODES) + 0.5) / NODES
    splines = basis(coefficients, u)
    stars, half = len(fluxes), int(numpy.ceil(REACH * sigma_px)) + 1
    columns = 2 * coefficients + 1
    light = numpy.zeros(shape)
    motion = numpy.zeros((columns, *shape))
    of_star = numpy.zeros((stars, *shape))
    middle = (numpy.array(shape[::-1]) - 1) / 2
    offsets = numpy.arange(-half, half + 1)
    for s in range(stars):
        for k in range(NODES):
            place = paths[s, k]
            corner = numpy.rint(place).astype(int)
            x, y = corner[0] + offsets, corner[1] + offsets
            keep_x, keep_y = (x >= 0) & (x < shape[1]), (y >= 0) & (y < shape[0])
            if not keep_x.any() or not keep_y.any():
                continue
            x, y = x[keep_x], y[keep_y]
            profile = [gaussian(x - place[0], sigma_px), gaussian(y - place[1], sigma_px)]
            stamp = (slice(y[0], y[-1] + 1), slice(x[0], x[-1] + 1))
            image = numpy.outer(profile[1][0], profile[0][0]) / NODES
            slope = (fluxes[s] * numpy.outer(profile[1][0], profile[0][1]) / NODES,
                     fluxes[s] * numpy.outer(profile[1][1], profile[0][0]) / NODES)
            of_star[(s, *stamp)] += image
            for i in numpy.flatnonzero(splines[:, k]):
                motion[(i, *stamp)] += splines[i, k] * slope[0]
                motion[(coefficients + i, *stamp)] += splines[i, k] * slope[1]
            arm = place - middle
            motion[(2 * coefficients, *stamp)] += (u[k] - 0.5) * (arm[0] * slope[1] - arm[1] * slope[0])
        light += fluxes[s] * of_star[s]
    rows = numpy.concatenate((motion, of_star, numpy.ones((1, *shape)))).reshape(columns + stars + 1, -1)
    scale = numpy.sqrt((rows**2).sum(1))
    keep = scale > 0
    rows = rows[keep] / scale[keep, None]
    covariance = numpy.linalg.pinv((rows / (noise_e**2 + light.reshape(-1))) @ rows.T, rcond=1e-12, hermitian=True)
    n = coefficients
    covariance = covariance[:2 * n, :2 * n] / numpy.outer(scale[:2 * n], scale[:2 * n])
    variance = sum(numpy.einsum("iu,ij,ju->u", splines, covariance[a:a + n, a:a + n], splines) for a in (0, n))
    return float(numpy.sqrt(variance.mean()))


def gaussian(away, sigma_px):
    """Part of a Gaussian on pixels `away` from its centre, and its derivative by the centre's place."""
    edges = numpy.append(away - 0.5, away[-1] + 0.5)
    density = numpy.exp(-0.5 * (edges / sigma_px)**2) / (sigma_px * numpy.sqrt(2 * numpy.pi))
    return numpy.diff(normal_share(edges / sigma_px)), -numpy.diff(density)


def normal_share(z):
    """Cumulative normal distribution by Abramowitz and Stegun 26.2.17, to 7.5e-8."""
    t = 1 / (1 + 0.2316419 * numpy.abs(z))
    tail = t * (0.319381530 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))))
    tail *= numpy.exp(-0.5 * z * z) / numpy.sqrt(2 * numpy.pi)
    return numpy.where(z > 0, 1 - tail, tail)
