// The score by hits (Eq. 10-21) with its chance and null distribution, as harmolab.score has it: the only one of the labs.

// Strengths over their maximum, over their mean, or as they are (a reading of Eq. 19).
function normalised(strengths, how) {
  const scale = how === "raw" ? 1 : how === "max" ? Math.max(...strengths) : mean(strengths);
  return scale > 0 ? strengths.map(strength => strength / scale) : strengths;
}

// Difference of each visual beat to the one before; the first has the second's (Eq. 12).
function strengthSteps(strengths) {
  const steps = strengths.slice(1).map((strength, index) => Math.abs(strength - strengths[index]));
  return strengths.length < 2 ? strengths.map(() => 0) : [steps[0], ...steps];
}

// Indices of the heights that stand out (Eq. 11, 13), and the level above which they lie.
function salient(heights, lambda, spread, saliency) {
  const isLiteral = saliency === "literal", level = isLiteral ? spread : lambda * spread;
  return { heights, level, kept: indices(heights, value => (isLiteral ? Math.sign(value - spread) * lambda > 0 : value > level)) };
}

// Attentional music beats (Eq. 10, 11).
function salientMusic(strengths, settings) {
  const { lambda1, normalisation, saliency } = declared(settings, "salient music"), heights = normalised(strengths, normalisation);
  return salient(heights, lambda1, deviation(heights), saliency);
}

// Attentional visual beats (Eq. 12, 13); a lambda of 0 keeps all.
function salientDance(strengths, settings) {
  const { lambda2, saliency, visual_saliency: quantity, first_beat: first } = declared(settings, "salient dance"), steps = strengthSteps(strengths);
  const { heights, level, kept } = salient(quantity === "strength" ? strengths : steps, lambda2, deviation(steps.slice(1)), saliency);
  return { heights, level, kept: lambda2 ? kept.filter(index => index > 0 || first === "copy") : [...strengths.keys()] };
}

// Index of the visual beat that hits each music beat, -1 for a miss (Eq. 15-18); sorted times.
function hitPairs(music, dance, delay, matching) {
  const isNear = (time, beat) => beat >= 0 && Math.abs(dance[beat] - time) <= delay + EDGE, free = [...dance];
  return music.map(time => {
    const beat = matching === "many" ? nearestIndex(dance, time) : dance.indexOf(free[nearestIndex(free, time)]);
    if (!isNear(time, beat)) return -1;
    if (matching !== "many") free.splice(free.indexOf(dance[beat]), 1);
    return beat;
  });
}

// Share of the clip within the delay of a visual beat.
function chanceLevel(dance, delay, duration) {
  let reached = 0, covered = 0;
  for (const time of dance) {
    const start = Math.max(time - delay, 0), end = Math.min(time + delay, duration);
    covered += Math.max(end - Math.max(start, reached), 0);
    reached = Math.max(reached, end);
  }
  return covered / duration;
}

const aboveChance = (share, chance) => (chance < 1 - EDGE ? (share - chance) / (1 - chance) : 0);
const harmonyOf = (score, n, m, beta) => (n > 0 && m > 0 ? quotient((1 + beta ** 2) * score, n * beta ** 2 + m) : 0);  // Eq. 21

// Strengths hit after each rotation of the dance, as shares of all.
function nullShares(music, weights, dance, duration, shifts, { delay, matching }) {
  const around = dance.map(time => modulo(time, duration)).sort((a, b) => a - b), total = sum(weights);
  if (matching !== "many") return shifts.map(shift => {
    const moved = around.map(time => modulo(time + shift, duration)).sort((a, b) => a - b), pairs = hitPairs(music, moved, delay, matching);
    return sum(weights.filter((_, index) => pairs[index] >= 0)) / total;
  });
  const ring = [around[around.length - 1] - duration, ...around, around[0] + duration];
  return shifts.map(shift => sum(weights.filter((_, index) => distanceTo(ring, modulo(music[index] - shift, duration)) <= delay + EDGE)) / total);
}

// The score of music { times, strengths } and dance { times, strengths }; `shifts` are those of the null distribution.
function hitScore(music, dance, duration, settings, shifts = []) {
  const { delay, lag, beta, matching } = declared(settings, "hits"), loud = salientMusic(music.strengths, settings), large = salientDance(dance.strengths, settings);
  const times = pick(music.times, loud.kept), weights = pick(loud.heights, loud.kept), expected = pick(dance.times, large.kept).map(time => time - lag);
  const pairs = hitPairs(times, expected, delay, matching), score = sum(weights.filter((_, index) => pairs[index] >= 0)), total = sum(weights);
  const chance = chanceLevel(expected, delay, duration), share = total > 0 ? score / total : chance, [n, m] = [times.length, expected.length];
  const isEmpty = !shifts.length || total === 0 || m === 0, shares = isEmpty ? [] : nullShares(times, weights, expected, duration, shifts, { delay, matching });
  return {
    harmony: harmonyOf(score, n, m, beta), audio_harmony: quotient(score, n), visual_harmony: quotient(score, m),
    hits: pairs.filter(pair => pair >= 0).length, beats: n, movements: m, share, chance, above: aboveChance(share, chance),
    p: isEmpty ? null : (1 + shares.filter(value => value >= share - 1e-12).length) / (1 + shares.length),
    rate: quotient(hitPairs(music.times, expected, delay, matching).filter(pair => pair >= 0).length, music.times.length),
    pairs, null: shares, loud, large,
  };
}
