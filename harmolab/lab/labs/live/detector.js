// Visual beats, the only reading of the labs: a curve of the dance, smoothed, and the moments at which it turns (harmolab.beats.visual).
const TIE = 1e-6, REACH = 4;  // as in harmolab.body.kinematics; standard deviations to either side of a Gaussian
const decoded = new Map();  // a curve is decoded once, not at each move of a slider
function doubles(text) {
  if (!decoded.has(text)) decoded.set(text, Array.from(new Float64Array(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer)));
  return decoded.get(text);
}

// Values smoothed by a Gaussian of `sigma` samples; the ends go on as they are.
function smoothed(values, sigma) {
  if (!sigma) return values;
  const reach = Math.floor(REACH * sigma + 0.5), last = values.length - 1;
  const bell = Array.from({ length: reach + 1 }, (_, away) => Math.exp(-0.5 * (away / sigma) ** 2)), whole = 2 * sum(bell) - bell[0];
  return values.map((value, at) => {
    let total = value * bell[0];
    for (let away = 1; away <= reach; away++) total += (values[Math.max(at - away, 0)] + values[Math.min(at + away, last)]) * bell[away];
    return total / whole;
  });
}

// Sign of each step; a tie takes the sign before it when `carry` (Eq. 8).
function stepSigns(values, carry) {
  const level = TIE * values.reduce((top, value) => Math.max(top, Math.abs(value)), 0), signs = [];
  for (let at = 0; at + 1 < values.length; at++) {
    const step = values[at + 1] - values[at], sign = Math.abs(step) <= level ? 0 : Math.sign(step);
    signs.push(sign || !carry ? sign : signs[at - 1] || 0);
  }
  return signs;
}

// Samples at which the values turn from rising to falling or back (Eq. 9).
function turningPoints(values, plateau) {
  const signs = stepSigns(values, plateau !== "literal");
  const turns = [...signs.keys()].slice(1).filter(at => signs[at - 1] * signs[at] < 0);
  if (plateau !== "middle") return turns;
  const slopes = [], plain = stepSigns(values, false);
  plain.forEach((sign, at) => slopes.push(sign ? at : at ? slopes[at - 1] : -1));
  return turns.map(turn => (slopes[turn - 1] + 1 + turn) >> 1);
}

function turnsOf(values, detector, plateau) {
  const turns = turningPoints(values, plateau), signs = stepSigns(values, true), way = detector === "valleys" ? 1 : -1;
  const ends = plateau === "middle" ? turningPoints(values, "last") : turns;  // where the step after a turn is no tie
  return detector === "turns" ? turns : turns.filter((_, place) => signs[ends[place]] === way);
}

// Top of the parabola through a sample and its neighbours.
function refined(values, at) {
  const [before, top, after] = values.slice(at - 1, at + 2), bend = before - 2 * top + after;
  return at + (bend ? clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0);
}

// The curve of these settings and its visual beats.
function visualBeats({ rates, levels, valid }, settings) {
  const { detector, fps, plateau, smoothing, position_smoothing: positions, subframe } = declared(settings, "detector");
  const rate = rates[fps === null ? (subframe ? "interpolated" : "own") : String(fps)];
  const curves = rate.curves[detector === "direction" ? "direction" : "joints"];
  const values = smoothed(doubles(curves[levels.indexOf(positions)]), smoothing * rate.fps), delay = subframe ? 0.5 : 0;
  const isValid = beat => !valid.gaps.includes(Math.min(roundHalfEven(beat.time * valid.fps), valid.frames - 1));
  const beats = turnsOf(values, detector, plateau).map(at => ({ time: ((subframe ? refined(values, at) : at) - delay) / rate.fps, height: values[at] })).filter(isValid);
  const unit = detector === "direction" ? "change of direction (SD)" : "speed of all joints (m/s)";
  return { curve: { start: -delay / rate.fps, step: 1 / rate.fps, values, unit }, times: beats.map(beat => beat.time), strengths: beats.map(beat => Math.abs(beat.height)) };
}

const median = values => { const row = [...values].sort((a, b) => a - b), half = row.length >> 1; return row.length % 2 ? row[half] : (row[half - 1] + row[half]) / 2; };

const DISTANCE_BINS = 32, WIDEST = 0.4;  // of the histogram, seconds to either side

function drawDetector(canvas, width, data, settings, numbers) {
  const pen = sharpened(canvas, width, SCORING_HEIGHTS[width >= WIDE ? 0 : 1]), { evidence } = data, { music, planted } = evidence;
  const [above, below, right] = placed(width, SCORING_PLACES), time = [0, evidence.duration];
  drawCurve(pen, above, time, numbers.curve, numbers.times, numbers.heights, { music });
  const chart = axes(pen, below, time, [planted ? -2 : -1.15, 1.15], { x: timeName(data), y: `music up, dance down${planted ? "; below: planted rests" : ""}`, yTicks: 0 });
  music.forEach(beat => stem(chart, beat, 1, COLOUR.music));
  numbers.times.forEach(beat => stem(chart, beat, -1, COLOUR.dance));
  line(chart, [below.left, below.left + below.width], [chart.y(0), chart.y(0)], COLOUR.ink);
  (planted || []).forEach((rest, index) => mark(chart, numbers.mask[index] ? "circle" : "cross", chart.x(rest), chart.y(-1.55), numbers.mask[index] ? COLOUR.hit : COLOUR.miss, 4.5));
  drawDistances(pen, right, numbers.times, music);
  return { beats: [], chart, panels: [above, below] };
}

// Seconds from its nearest music beat to each visual beat; beats at random would lie flat.
function drawDistances(pen, box, times, music) {
  const counts = new Array(DISTANCE_BINS).fill(0), bin = 2 * WIDEST / DISTANCE_BINS;
  if (music.length) times.map(time => time - music[nearestIndex(music, time)]).filter(away => Math.abs(away) <= WIDEST).forEach(away => { counts[Math.min(DISTANCE_BINS - 1, Math.floor((away + WIDEST) / bin))] += 1; });
  // In steps, so that the axis seldom changes.
  const chart = axes(pen, box, [-WIDEST, WIDEST], [0, 4 * (1 + Math.floor(Math.max(...counts) / 4))], { x: "after the nearest music beat (s)", y: "visual beats", xTicks: 4 });
  pen.fillStyle = COLOUR.dance;
  counts.forEach((count, index) => pen.fillRect(chart.x(index * bin - WIDEST), chart.y(count), box.width / DISTANCE_BINS, chart.y(0) - chart.y(count)));
  line(chart, [chart.x(0), chart.x(0)], [box.top, box.top + box.height], COLOUR.music, { width: 1.6 });
}
