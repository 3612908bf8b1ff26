// The recommended mode of one clip: the verdict at each step of the lag's slider, computed beforehand.
function scoringNumbers(data, settings) {
  if (settings.mode !== "recommended") return hitNumbers(data, settings);
  const { verdicts } = data.evidence, slider = data.controls.find(control => control.name === "lag");
  return verdicts[clamp(Math.round((settings.lag - slider.low) / slider.step), 0, verdicts.length - 1)];
}

// Place of each time on the music's beats (harmolab.bar_pattern.beat_positions): 2.5 is half way between two beats.
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
