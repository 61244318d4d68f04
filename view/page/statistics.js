// Statistics of the pixels of a frame, and the limits of its stretch.

const SAMPLES = 10000;

/** Counts of every digital number. @param {Uint16Array} pixels */
export function countValues(pixels) {
  const counts = new Uint32Array(65536);
  for (let i = 0; i < pixels.length; i++) counts[pixels[i]]++;
  return counts;
}

/** Value below which a share of the pixels lies. @param {Uint32Array} counts @param {number} total @param {number} share */
export function quantile(counts, total, share) {
  let seen = 0;
  for (let value = 0; value < counts.length; value++) {
    seen += counts[value];
    if (seen > share * (total - 1)) return value;
  }
  return counts.length - 1;
}

/**
 * Limits of a linear stretch that shows the background: a line is fitted to the sorted samples
 * around their median (IRAF's zscale; Tody 1986). @param {Uint16Array} pixels
 */
export function zscale(pixels, contrast = 0.25) {
  const step = Math.max(1, Math.floor(pixels.length / SAMPLES));
  const sorted = new Float64Array(Math.floor((pixels.length - 1) / step) + 1);
  for (let i = 0; i < sorted.length; i++) sorted[i] = pixels[i * step];
  sorted.sort();
  const n = sorted.length;
  const low = sorted[0], high = sorted[n - 1], median = sorted[n >> 1];
  let keep = new Uint8Array(n).fill(1), kept = n, slope = 0;
  for (let turn = 0; turn < 5; turn++) {
    let sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (let i = 0; i < n; i++) {
      if (keep[i]) { sx += i; sy += sorted[i]; sxx += i * i; sxy += i * sorted[i]; }
    }
    const determinant = kept * sxx - sx * sx;
    if (determinant <= 0) break;
    slope = (kept * sxy - sx * sy) / determinant;
    const start = (sy - slope * sx) / kept;
    let squares = 0;
    for (let i = 0; i < n; i++) if (keep[i]) squares += (sorted[i] - start - slope * i) ** 2;
    const limit = 2.5 * Math.sqrt(squares / kept);
    let left = 0;
    for (let i = 0; i < n; i++) {
      if (keep[i] && Math.abs(sorted[i] - start - slope * i) > limit) keep[i] = 0;
      left += keep[i];
    }
    if (left === kept || left < n / 2) break;
    kept = left;
  }
  if (kept < n / 2) return { black: low, white: high };
  const reach = slope / contrast;
  return {
    black: Math.max(low, median - reach * (n >> 1)),
    white: Math.max(Math.min(high, median + reach * (n - (n >> 1))), low + 1),
  };
}

/**
 * What the stretches and the histogram need. `sigma` is that of the background: half of the width
 * of the central 68 % below the median. @param {Uint16Array} pixels
 */
export function describePixels(pixels) {
  const counts = countValues(pixels), total = pixels.length;
  const median = quantile(counts, total, 0.5);
  return {
    counts, total, median,
    sigma: Math.max(1, median - quantile(counts, total, 0.1587)),
    low: quantile(counts, total, 0), high: quantile(counts, total, 1),
    bright: quantile(counts, total, 0.9995),
  };
}

/** Limits of a stretch. @param {string} law @param {Uint16Array} pixels @param {ReturnType<typeof describePixels>} d */
export function limitsOf(law, pixels, d) {
  if (law === 'zscale') return zscale(pixels);
  if (law === 'linear') return { black: d.low, white: Math.max(d.high, d.low + 1) };
  return { black: Math.max(0, d.median - 2 * d.sigma), white: Math.max(d.bright, d.median + 40 * d.sigma) };
}
