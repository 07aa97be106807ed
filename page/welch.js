// Power spectral densities by Welch's method: means over segments that overlap by half, each less its mean and under a
// Hann window. P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70, doi:10.1109/TAU.1967.1161901.

/**
 * The discrete Fourier transform in place, of a power of two of numbers (J. W. Cooley and J. W. Tukey, Math. Comp. 19
 * (1965) 297).
 * @param {Float64Array} re
 * @param {Float64Array} im
 */
export function transform(re, im) {
  const count = re.length;
  for (let i = 1, j = 0; i < count; i += 1) {
    let bit = count >> 1;
    for (; j & bit; bit >>= 1) {
      j ^= bit;
    }
    j ^= bit;
    if (i < j) {
      [re[i], re[j]] = [re[j], re[i]];
      [im[i], im[j]] = [im[j], im[i]];
    }
  }
  for (let size = 2; size <= count; size *= 2) {
    const half = size / 2;
    for (let k = 0; k < half; k += 1) {
      const angle = (-2 * Math.PI * k) / size;
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      for (let i = k; i < count; i += size) {
        const j = i + half;
        const [x, y] = [re[j] * c - im[j] * s, re[j] * s + im[j] * c];
        [re[j], im[j]] = [re[i] - x, im[i] - y];
        re[i] += x;
        im[i] += y;
      }
    }
  }
}

/**
 * Samples in a segment: the power of two of which at least four, overlapping by half, are in so many samples.
 * @param {number} samples
 */
export function segmentLength(samples) {
  const most = Math.min(Math.max((2 * samples) / 5, 64), 1 << 16);
  return 2 ** Math.floor(Math.log2(most));
}

/** The density of one signal, whose samples come one after the other. */
export class Welch {
  /** @param {number} length of a segment, a power of two */
  constructor(length) {
    this.length = length;
    this.window = Float64Array.from({ length }, (_, i) => 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / length));
    this.samples = new Float64Array(length);
    this.filled = 0;
    this.sum = new Float64Array(length / 2 + 1);
    this.segments = 0;
  }

  /** @param {number} value */
  push(value) {
    const { samples, length, window, sum } = this;
    samples[this.filled] = value;
    this.filled += 1;
    if (this.filled < length) {
      return;
    }
    const mean = samples.reduce((total, sample) => total + sample, 0) / length;
    const [re, im] = [samples.map((sample, i) => (sample - mean) * window[i]), new Float64Array(length)];
    transform(re, im);
    for (let line = 0; line < sum.length; line += 1) {
      sum[line] += re[line] * re[line] + im[line] * im[line];
    }
    this.segments += 1;
    samples.copyWithin(0, length / 2);
    this.filled = length / 2;
  }

  /** Samples are missing: a new segment begins. */
  restart() {
    this.filled = 0;
  }

  /**
   * The one-sided density (unit of the samples squared, per Hz) at multiples of `rate_hz / length`.
   * @param {number} rate_hz
   */
  density(rate_hz) {
    const power = this.window.reduce((total, w) => total + w * w, 0);
    const last = this.length / 2;
    const scale = 1 / (rate_hz * power * Math.max(1, this.segments));
    return this.sum.map((value, line) => value * scale * (line === 0 || line === last ? 1 : 2));
  }
}
