// The meter lab: strong beats, and the meter units they are grouped into (harmolab.beats.meter, Eq. 22).
const LENGTHS = [6, 5, 4];  // beats of a unit, the longest first
const METER_PLACES = [[[0, 22, 1, 180], [0, 280, 0.62, 122], [0.64, 280, 0.36, 122]], [[0, 22, 1, 140], [0, 234, 1, 64], [0, 366, 1, 72]]];

// Indices of the beats that are compared, and the strengths of all.
function measuredBeats({ strengths, noise }, settings) {
  const { every, first, error } = declared(settings, "meter"), spread = deviation(strengths);
  const { heights, kept } = salientMusic(strengths.map((strength, index) => Math.max(strength + error * spread * noise[index], 0)), settings);
  return { kept: kept.filter((_, place) => place >= first && (place - first) % every === 0), heights };
}

function meterUnits(times, strong, categories) {
  const units = [], last = times.length - 1;
  for (let beat = 0; beat < last;) {
    const accents = LENGTHS.map(length => strong.slice(beat, beat + length).map(isStrong => (isStrong ? "S" : "w")).join("")).find(text => text in categories) || "";
    if (accents && beat + accents.length <= last) units.push([times[beat], times[beat + accents.length], categories[accents]]);
    beat += accents.length || 1;
  }
  return units;
}

function drawMeter(canvas, width, data, settings, numbers) {
  const pen = sharpened(canvas, width, SCORING_HEIGHTS[width >= WIDE ? 0 : 1]), { evidence } = data, [above, below, right] = placed(width, METER_PLACES);
  const ends = [-0.01, 1.01].map(share => share * evidence.duration), top = Math.max(1e-12, ...numbers.strengths);
  const chart = axes(pen, above, ends, [-0.25, 1.5], { x: timeName(data), y: "strength of the beats (of the largest)" });
  numbers.units.forEach(([start, end, label]) => bracket(chart, start, end, label, evidence.colours[label]));
  line(chart, [above.left, above.left + above.width], [chart.y(0), chart.y(0)], COLOUR.ink);
  numbers.times.forEach((time, index) => {
    const height = numbers.strengths[index] / top, isStrong = numbers.mask[index];
    stem(chart, time, height, COLOUR.music, { width: isStrong ? 2.4 : 1.2 });
    mark(chart, isStrong ? "dot" : "circle", chart.x(time), chart.y(height), COLOUR.music, isStrong ? 5 : 3.5);
  });
  (evidence.downbeats || []).forEach(time => mark(chart, "triangle", chart.x(time), chart.y(-0.12), COLOUR.ink));
  const names = [...Object.keys(numbers.shares), "none"];
  bars(pen, below, names, [...Object.values(numbers.shares), 1 - numbers.covered], names.map(name => evidence.colours[name] || COLOUR.grey), { x: "meter unit", y: "share of the time" });
  drawAccents(pen, right, numbers);
  return { beats: [], chart, panels: [above] };
}

// A bracket from the unit's first beat to just before the next unit's, with as much of its name as there is room for.
function bracket(chart, start, end, label, colour) {
  const { pen, box } = chart, gap = 0.02 * (end - start), [left, right] = [chart.x(start - gap), chart.x(end - 3 * gap)];
  pen.globalAlpha = 0.1; pen.fillStyle = colour;
  pen.fillRect(left, chart.y(1.2), right - left, box.top + box.height - chart.y(1.2));
  pen.globalAlpha = 1;
  line(chart, [left, left, right, right], [1.1, 1.2, 1.2, 1.1].map(chart.y), colour, { width: 3 });
  const name = [label, label.split(" ")[0]].find(text => pen.measureText(text).width <= right - left);
  pen.textAlign = "center"; pen.fillStyle = colour;
  if (name) pen.fillText(name, (left + right) / 2, chart.y(1.34));
}

// Share of strong beats at each place of the annotated bar, with 95 % intervals; dashed: of all beats.
function drawAccents(pen, box, { accents, counts, chance }) {
  const chart = bars(pen, box, accents.map((_, place) => String(place + 1)), accents, accents.map((_, place) => (place ? COLOUR.pale : COLOUR.music)), { x: accents.length ? "place in the annotated bar (1: downbeat)" : "no annotated bars", y: "share called strong" });
  accents.forEach((share, place) => {
    const spread = 1.96 * Math.sqrt(share * (1 - share) / Math.max(counts[place], 1)), [low, high] = [share - spread, share + spread].map(value => chart.y(clamp(value, 0, 1)));
    line(chart, [place - 0.1, place + 0.1, place, place, place - 0.1, place + 0.1].map(chart.x), [low, low, low, high, high, high], COLOUR.ink, { width: 1.4 });
  });
  if (chance !== null) level(chart, chance, COLOUR.ink);
}
