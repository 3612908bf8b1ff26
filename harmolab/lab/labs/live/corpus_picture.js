// The picture of the corpus lab: scores with true and with wrong music, as histograms and as a mark for each clip.
const CORPUS_PLACES = [[[0, 22, 0.46, 330], [0.5, 22, 0.5, 330]], [[0, 22, 1, 170], [0, 262, 1, 300]]];
const CORPUS_HEIGHTS = [396, 604], BINS = 25;

function drawCorpus(canvas, width, data, settings, numbers) {
  const pen = sharpened(canvas, width, CORPUS_HEIGHTS[width >= WIDE ? 0 : 1]), [left, right] = placed(width, CORPUS_PLACES);
  const low = settings.score === "harmony_above_chance" ? -1 : 0, name = data.controls.find(one => one.name === "score").options.find(one => one[0] === settings.score)[1];
  const shown = values => values.map(value => Math.max(value, low)), [right_, wrong] = [shown(numbers.true), shown(numbers.wrong)];
  const source = data.evidence.source ? `, ${data.evidence.source} data` : "";
  drawSpread(pen, left, low, right_, wrong, `${name}${low ? ", lower ones at -1" : ""}${source}`);
  const range = [low - 0.03, 1.05], chart = axes(pen, right, range, range, { x: `${name}, wrong music`, y: "true music", yTicks: 5 });
  curve(chart, [low, 1], [low, 1], COLOUR.grey, { width: 1.2, dash: [5, 4] });
  const beats = right_.map((value, clip) => ({ kind: "clip", index: clip, x: chart.x(wrong[clip]), y: chart.y(value) }));
  beats.forEach(({ index, x, y }) => {
    const kind = numbers.tied[index] ? "square" : numbers.true[index] > numbers.wrong[index] ? "circle" : "cross";
    mark(chart, kind, x, y, { square: COLOUR.grey, circle: COLOUR.hit, cross: COLOUR.miss }[kind], kind === "square" ? 3 : 4.5);
  });
  const { x, y } = beats[settings.clip];
  mark(chart, "ring", x, y, COLOUR.ink, 10);
  return { beats, chart, panels: [] };
}

// Two histograms: true music blue, wrong music an outline; lines at the means.
function drawSpread(pen, box, low, right, wrong, name) {
  const counts = values => values.reduce((row, value) => { row[clamp(Math.floor((Math.min(value, 1) - low) / (1 - low) * BINS), 0, BINS - 1)]++; return row; }, new Array(BINS).fill(0));
  const [blue, outline] = [counts(right), counts(wrong)], highest = Math.max(1, ...blue, ...outline);
  const top = 5 * Math.ceil(1.1 * highest / 5);  // in steps, so that the axis seldom changes
  const chart = axes(pen, box, [low, 1.02], [0, top], { x: name, y: "dances; blue: true music" }), width = (1 - low) / BINS;
  blue.forEach((count, bin) => { pen.fillStyle = COLOUR.bins; pen.fillRect(chart.x(low + bin * width), chart.y(count), chart.x(width) - chart.x(0), chart.y(0) - chart.y(count)); });
  const corners = outline.flatMap((count, bin) => [[low + bin * width, count], [low + (bin + 1) * width, count]]);
  curve(chart, corners.map(one => one[0]), corners.map(one => one[1]), COLOUR.ink, { width: 1.6 });
  curve(chart, [mean(right), mean(right)], [0, top], COLOUR.music, { width: 1.6 });
  curve(chart, [mean(wrong), mean(wrong)], [0, top], COLOUR.ink, { width: 1.6, dash: [5, 4] });
}
