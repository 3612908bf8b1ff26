// The recommended mode: the place test of many clips, and the verdict of one, both prepared by Python.
const MOMENTS = 48;  // a beat

// The place test of a clip, to the nearest moment (harmolab.lab.compare.batch.rescore_places); `late` seconds are the music's.
function placeScore(places, clip, settings, late) {
  const { lag, beta } = declared(settings, "place"), moments = seconds => roundHalfEven(seconds / places.periods[clip] * MOMENTS);
  const curve = places.curves[clip], now = modulo(moments(lag) + moments(late), curve.length), n = places.n_audio[clip];
  return {
    harmony: harmonyOf(places.hitting[clip][now], n, places.n_visual[clip], beta),
    rate: quotient(places.hits[clip][now], n),
    above: aboveChance(curve[now], places.chance[clip]),
  };
}

// The verdict at the step of the lag's slider.
function verdictNumbers(data, settings) {
  const { lag } = declared(settings, "verdict"), { verdicts } = data.evidence, slider = data.controls.find(control => control.name === "lag");
  return verdicts[clamp(Math.round((lag - slider.low) / slider.step), 0, verdicts.length - 1)];
}

// Place of each time on the music's beats (harmolab.verdict.bar_pattern.beat_positions): 2.5 is half way between two beats.
function beatPositions(times, beats, place) {
  const last = beats.length - 1;
  return times.map(time => {
    const index = clamp(countUpTo(beats, time) - 1, 0, last - 1), gap = beats[index + 1] - beats[index];
    return index + (time - beats[index]) / gap + (place || 0);
  });
}

// Expected speed at beat positions, between -1 and 1 or so.
function expectedSpeed(pattern, positions) {
  const [cosines, sines] = pattern.waves;
  return positions.map(position => sum(cosines.map((cosine, wave) => {
    const angle = 2 * Math.PI * (wave + 1) * position / pattern.beats;
    return cosine * Math.cos(angle) + sines[wave] * Math.sin(angle);
  })));
}
