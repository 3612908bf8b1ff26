// Pictures of one clip: the scoring lab and the saliency lab. Each returns its beats' places, and the axis of time.
const SCORING_PLACES = [[[0, 22, 1, 180], [0, 272, 0.62, 130], [0.64, 272, 0.36, 130]], [[0, 22, 1, 140], [0, 212, 1, 76], [0, 352, 1, 86]]];
const SALIENCY_PLACES = [[[0, 22, 0.62, 150], [0, 236, 0.62, 150], [0.64, 22, 0.36, 364]], [[0, 22, 1, 100], [0, 172, 1, 100], [0, 332, 1, 100]]];
const [SCORING_HEIGHTS, SALIENCY_HEIGHTS] = [[442, 480], [428, 476]];

const timeName = data => `time (s)${data.evidence.source ? `, ${data.evidence.source} data` : ""}`;

function drawScoring(canvas, width, data, settings, numbers, state) {
  const pen = sharpened(canvas, width, SCORING_HEIGHTS[width >= WIDE ? 0 : 1]);
  const [above, below, right] = placed(width, SCORING_PLACES), time = [0, data.evidence.duration];
  const draw = settings.mode === "recommended" ? drawVerdict : drawHits;
  return draw(pen, above, below, right, time, data, settings, numbers, state);
}

function drawHits(pen, above, below, right, time, data, settings, numbers, { selected }) {
  const { evidence } = data, { delay, lag } = settings, { loud, large, visual } = numbers;
  const chart = axes(pen, above, time, [-1.15, 1.15], { x: "", y: "music up, dance down: how noticeable", yTicks: 0 });
  const beats = [], served = new Set(numbers.pairs);
  pen.fillStyle = COLOUR.field;
  pick(numbers.allMusic, loud.kept).forEach(beat => {
    const [from, to] = [-delay, delay].map(side => clamp(chart.x(beat + lag + side), above.left, above.left + above.width));
    pen.fillRect(from, above.top, to - from, above.height);
  });
  const stems = (kind, times, { heights, level: threshold, kept }, way) => {
    const isKept = new Set(kept), top = Math.max(1e-12, ...heights);
    times.forEach((moment, index) => {
      const height = way * Math.max(heights[index] / top, 0.06), look = isKept.has(index) ? { width: 2.4 } : { width: 1.4, dash: [3, 3] };
      stem(chart, moment, height, isKept.has(index) ? COLOUR[kind] : COLOUR.faded, look);
      beats.push({ kind, index, time: moment, x: chart.x(moment), y: chart.y(height), middle: chart.y(0) });
    });
    if (threshold > 0) level(chart, way * Math.min(1.1, threshold / top), COLOUR[kind], [2, 4]);
  };
  stems("music", numbers.allMusic, loud, 1);
  stems("dance", numbers.allDance, large, -1);
  line(chart, [above.left, above.left + above.width], [chart.y(0), chart.y(0)], COLOUR.ink);
  const spot = (kind, index) => beats[kind === "music" ? index : numbers.allMusic.length + index];
  loud.kept.forEach((index, place) => {
    const { x, y } = spot("music", index), isHit = numbers.pairs[place] >= 0;
    mark(chart, isHit ? "circle" : "cross", x, y, isHit ? COLOUR.hit : COLOUR.miss, 4.5);
  });
  large.kept.forEach((index, place) => {
    const { x, y } = spot("dance", index), isHit = served.has(place);
    mark(chart, isHit ? "circle" : "cross", x, y, isHit ? COLOUR.hit : COLOUR.grey, isHit ? 4 : 2.5);
  });
  if (selected) { const { x, y } = spot(selected.kind, selected.index); mark(chart, "ring", x, y, COLOUR.ink, 9); }
  drawCurve(pen, below, time, visual.curve, pick(numbers.allDance, large.kept), pick(visual.strengths, large.kept), { x: timeName(data) });
  drawMoved(pen, right, evidence.duration, evidence.shifts, numbers);
  return { beats, chart, panels: [above, below] };
}

// The curve of a dance, a triangle at each visual beat, lines at the music's; returns the scales.
function drawCurve(pen, box, time, dance, beats, heights, { x = "", music = [] } = {}) {
  const { times, values } = sampled(dance), top = 1.1 * Math.max(1e-9, ...values);
  const chart = axes(pen, box, time, [Math.min(0, ...values), top], { x, y: dance.unit });
  music.forEach(beat => line(chart, [beat, beat].map(chart.x), [box.top, box.top + box.height], COLOUR.pale));
  curve(chart, times, values, COLOUR.dance, { width: 1.6 });
  beats.forEach((beat, index) => mark(chart, "triangle", chart.x(beat), chart.y(heights[index]), COLOUR.dance));
  return chart;
}

// The null distribution over the shifts behind it, brought to both sides of 0.
function drawMoved(pen, box, duration, shifts, numbers) {
  const chart = axes(pen, box, [-duration / 2, duration / 2], [0, 1.05], { x: "music moved by (s)", y: "share of strength met", xTicks: 4 });
  const moved = numbers.null.map((share, index) => [modulo(-shifts[index] + duration / 2, duration) - duration / 2, share]).sort((a, b) => a[0] - b[0]);
  curve(chart, moved.map(pair => pair[0]), moved.map(pair => pair[1]), COLOUR.grey, { width: 1.6 });
  level(chart, numbers.chance, COLOUR.ink);
  mark(chart, "diamond", chart.x(0), chart.y(numbers.share), COLOUR.hit, 7);
}

function drawVerdict(pen, above, below, right, time, data, settings, numbers) {
  const { evidence } = data, { shape } = evidence;
  const chart = axes(pen, above, time, [0, 1.1], { y: "rank of each music beat among all moments" });
  numbers.shares.forEach((share, index) => {
    stem(chart, numbers.times[index], share, COLOUR.music);
    mark(chart, share > 0.5 ? "circle" : "cross", chart.x(numbers.times[index]), chart.y(share), share > 0.5 ? COLOUR.hit : COLOUR.miss, 4.5);
  });
  if (numbers.chance !== null) level(chart, numbers.chance, COLOUR.ink);
  const { times, values } = sampled(shape.curve), high = Math.max(3, ...values.map(Math.abs));
  const speed = axes(pen, below, time, [-high, high], { x: timeName(data), y: `${shape.curve.unit}; dashed: expected` });
  evidence.music.times.forEach(beat => line(speed, [beat, beat].map(one => speed.x(one + settings.lag)), [below.top, below.top + below.height], COLOUR.pale));
  curve(speed, times, values, COLOUR.dance, { width: 1.6 });
  const pattern = shape.pattern || numbers.pattern, isPlaced = shape.pattern && shape.place !== null;
  if (evidence.music.times.length > 1 && (isPlaced || pattern.beats === 1)) {
    const expected = expectedSpeed(pattern, beatPositions(times.map(one => one - settings.lag), evidence.music.times, shape.place));
    const reach = Math.max((Math.max(...expected) - Math.min(...expected)) / 2, 1e-12);
    curve(speed, times, expected.map(value => 1.5 * value / reach), COLOUR.ink, { width: 1.4, dash: [5, 4] });
  }
  drawLags(pen, right, numbers);
  return { beats: [], chart, panels: [above, below] };
}

// Mean rank of the beats at every lag of one cycle, the lags brought to both sides of 0.
function drawLags(pen, box, numbers) {
  const size = numbers.curve.length, reach = size ? size / 2 * numbers.step : 0.5;
  const chart = axes(pen, box, [-reach, reach], [0, 1.05], { x: "music moved by (s)", y: "mean rank of the beats", xTicks: 4 });
  if (!size) return;
  const half = size >> 1, order = Array.from({ length: size }, (_, index) => index - half);
  curve(chart, order.map(lag => lag * numbers.step), order.map(lag => numbers.curve[modulo(lag, size)]), COLOUR.grey, { width: 1.6 });
  level(chart, numbers.chance, COLOUR.ink);
  mark(chart, "diamond", chart.x(0), chart.y(numbers.curve[0]), COLOUR.hit, 7);
}

function drawSaliency(canvas, width, data, settings, numbers) {
  const pen = sharpened(canvas, width, SALIENCY_HEIGHTS[width >= WIDE ? 0 : 1]), { evidence } = data, { dance } = evidence;
  const [above, below, right] = placed(width, SALIENCY_PLACES), time = [0, evidence.duration], isSpeed = settings.visual_saliency === "strength";
  const tracks = [
    [above, "music", evidence.music.times, numbers.loud, numbers.music_mask, { y: `music: strength (${evidence.units[settings.normalisation]})` }],
    [below, "dance", dance.times, numbers.large, numbers.dance_mask, { x: timeName(data), y: `dance: ${isSpeed ? "" : "step in "}joint speed (m/s)` }],
  ];
  const charts = tracks.map(([box, kind, times, { heights, level: height }, mask, names]) => {
    const chart = axes(pen, box, time, [0, 1.12 * Math.max(1e-12, ...heights)], names);
    times.forEach((moment, index) => stem(chart, moment, heights[index], mask[index] ? COLOUR[kind] : COLOUR.faded, { width: mask[index] ? 2.4 : 1.4, dash: mask[index] ? [] : [3, 3] }));
    if (chart.y(height) >= box.top) level(chart, height, COLOUR[kind], [2, 4]);
    return chart;
  });
  const { lambdas } = evidence, chart = axes(pen, right, [0, lambdas[lambdas.length - 1]], [0, 1.03], { x: "λ (standard deviations)", y: "share of beats kept", xTicks: 4 });
  [["music", numbers.music_shares, settings.lambda1], ["dance", numbers.dance_shares, settings.lambda2]].forEach(([kind, shares, lambda]) => {
    if (!shares.length) return;
    const nearest = lambdas.reduce((best, value, index) => (Math.abs(value - lambda) < Math.abs(lambdas[best] - lambda) ? index : best), 0);
    curve(chart, lambdas, shares, COLOUR[kind], { width: 2, dash: kind === "music" ? [] : [6, 4] });
    mark(chart, kind === "music" ? "circle" : "diamond", chart.x(lambda), chart.y(shares[nearest]), COLOUR[kind], 6);
  });
  return { beats: [], chart: charts[0], panels: [above, below] };
}
