// World coordinates of a frame: gnomonic projection with SIP polynomials (Calabretta and Greisen
// 2002, section 5.1.3; Shupe et al. 2005). Pixels start at 0 here, at 1 in FITS.

const DEG = Math.PI / 180;

function polynomial(terms, u, v) {
  let sum = 0;
  for (const [p, q, value] of terms) sum += value * u ** p * v ** q;
  return sum;
}

/** ICRS direction (deg) of a pixel. */
export function pixelToSky(wcs, x, y) {
  let u = x + 1 - wcs.crpix[0], v = y + 1 - wcs.crpix[1];
  const a = polynomial(wcs.A, u, v), b = polynomial(wcs.B, u, v);
  u += a; v += b;
  const xi = (wcs.cd_deg[0] * u + wcs.cd_deg[1] * v) * DEG;
  const eta = (wcs.cd_deg[2] * u + wcs.cd_deg[3] * v) * DEG;
  const ra0 = wcs.crval_deg[0] * DEG, dec0 = wcs.crval_deg[1] * DEG;
  const d = Math.cos(dec0) - eta * Math.sin(dec0);
  const ra = ra0 + Math.atan2(xi, d);
  const dec = Math.atan2(Math.sin(dec0) + eta * Math.cos(dec0), Math.hypot(xi, d));
  return { ra: ((ra / DEG) % 360 + 360) % 360, dec: dec / DEG };
}

/** Pixel of an ICRS direction (deg); null on the other half of the sky. */
export function skyToPixel(wcs, raDeg, decDeg) {
  const ra = raDeg * DEG - wcs.crval_deg[0] * DEG, dec = decDeg * DEG, dec0 = wcs.crval_deg[1] * DEG;
  const c = Math.sin(dec) * Math.sin(dec0) + Math.cos(dec) * Math.cos(dec0) * Math.cos(ra);
  if (c <= 0) return null;
  const xi = Math.cos(dec) * Math.sin(ra) / c / DEG;
  const eta = (Math.sin(dec) * Math.cos(dec0) - Math.cos(dec) * Math.sin(dec0) * Math.cos(ra)) / c / DEG;
  const [a, b, p, q] = wcs.cd_deg, determinant = a * q - b * p;
  const wantedU = (q * xi - b * eta) / determinant, wantedV = (a * eta - p * xi) / determinant;
  let u = wantedU, v = wantedV;
  for (let turn = 0; turn < 20; turn++) { // u + A(u, v) = wanted: fixed point, the distortion is small
    const nextU = wantedU - polynomial(wcs.A, u, v), nextV = wantedV - polynomial(wcs.B, u, v);
    const moved = Math.abs(nextU - u) + Math.abs(nextV - v);
    u = nextU; v = nextV;
    if (moved < 1e-9) break;
  }
  return { x: u + wcs.crpix[0] - 1, y: v + wcs.crpix[1] - 1 };
}

/** Scale of the frame, degrees per pixel. */
export function scaleOf(wcs) {
  const [a, b, c, d] = wcs.cd_deg;
  return Math.sqrt(Math.abs(a * d - b * c));
}

/** Directions on the frame of north and east, as unit vectors in pixels. */
export function compassOf(wcs) {
  const [a, b, c, d] = wcs.cd_deg, determinant = a * d - b * c;
  const unit = (x, y) => { const n = Math.hypot(x, y) || 1; return { x: x / n, y: y / n }; };
  return { north: unit(-b / determinant, a / determinant), east: unit(d / determinant, -c / determinant) };
}

function sexagesimal(value, digits) {
  const steps = 10 ** digits;
  const total = Math.round(Math.abs(value) * 3600 * steps);
  const seconds = (total / steps) % 60, minutes = Math.floor(total / steps / 60) % 60;
  const pad = (n, width) => n.padStart(width, '0');
  return [String(Math.floor(total / steps / 3600)).padStart(2, '0'), pad(String(minutes), 2),
    pad(seconds.toFixed(digits), digits + 3)];
}

/** "16h 48m 38.95s". @param {number} deg */
export function formatRa(deg) {
  const [h, m, s] = sexagesimal(deg / 15, 3);
  return `${h === '24' ? '00' : h}h ${m}m ${s}s`;
}

/** "−08° 17′ 11.6″". @param {number} deg */
export function formatDec(deg) {
  const [d, m, s] = sexagesimal(deg, 2);
  return `${deg < 0 ? '−' : '+'}${d}° ${m}′ ${s}″`;
}
