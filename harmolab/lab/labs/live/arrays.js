// Numbers as numpy has them, so that the page and Python agree to the last digit.
const EDGE = 1e-9;  // as in harmolab.score: a beat exactly at the delay stays a hit
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const sum = values => values.reduce((total, value) => total + value, 0);
const mean = values => sum(values) / values.length;
const quotient = (above, below) => (below > 0 ? above / below : 0);
const modulo = (value, length) => { const rest = value % length; return rest < 0 ? rest + length : rest; };
const percent = share => String(Math.floor(100 * share + 0.5));
const fill = (sentence, values) => sentence.replace(/\{(\w+)\}/g, (_, name) => values[name]);

function roundHalfEven(value) {
  const low = Math.floor(value), rest = value - low;
  return rest > 0.5 || (rest === 0.5 && low % 2) ? low + 1 : low;
}

// Number of sorted values below `value`.
function countBelow(sorted, value) {
  let low = 0, high = sorted.length;
  while (low < high) { const middle = (low + high) >> 1; if (sorted[middle] < value) low = middle + 1; else high = middle; }
  return low;
}

const countUpTo = (sorted, value) => {
  let low = 0, high = sorted.length;
  while (low < high) { const middle = (low + high) >> 1; if (sorted[middle] <= value) low = middle + 1; else high = middle; }
  return low;
};

// Index of the value of a sorted list nearest to `value`, the first of two; -1 in an empty list.
function nearestIndex(sorted, value) {
  const after = countBelow(sorted, value);
  if (after === 0 || after === sorted.length) return Math.min(after, sorted.length - 1);
  return Math.abs(sorted[after] - value) < Math.abs(sorted[after - 1] - value) ? after : after - 1;
}

const distanceTo = (sorted, value) => (sorted.length ? Math.abs(sorted[nearestIndex(sorted, value)] - value) : Infinity);

// Standard deviation, 0 of an empty list.
function deviation(values) {
  const middle = mean(values);
  return values.length ? Math.sqrt(mean(values.map(value => (value - middle) ** 2))) : 0;
}

const indices = (values, test) => values.flatMap((value, index) => (test(value) ? [index] : []));
const pick = (values, chosen) => chosen.map(index => values[index]);

// The settings as one formula may read them: those that READS (live.py) declares, each with a value.
const declared = (settings, formula) => new Proxy(settings, { get: (all, name) => {
  if (!READS[formula].includes(name)) throw new Error(`the formula ${formula} reads ${name}, which READS in live.py does not declare`);
  if (!(name in all)) throw new Error(`the formula ${formula} reads ${name}, which has no value`);
  return all[name];
} });

// Probability that a positive ranks above a negative, ties counted half (harmolab.significance.auc).
function areaUnderCurve(positives, negatives) {
  const low = [...negatives].sort((a, b) => a - b);
  return sum(positives.map(value => countBelow(low, value) + countUpTo(low, value))) / (2 * positives.length * low.length);
}

const isClose = (a, b) => Math.abs(a - b) <= 1e-8 + 1e-5 * Math.abs(b);
