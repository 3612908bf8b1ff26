// The numbers of each lab at its settings, with the sentence under its picture.

// All settings: those of the controls, the others as the mode has them.
const complete = (data, settings) => ({ ...data.modes[settings.mode || "paper"], ...settings });

// Times of a track whose beats of some numbers were dragged.
const movedTimes = (times, moves = {}) => times.map((time, index) => moves[index] ?? time);

function scoringNumbers(data, settings) {
  if (settings.mode === "recommended") return verdictNumbers(data, settings);
  const { evidence, words } = data, { music, duration } = evidence, { moves = {} } = settings, visual = visualBeats(evidence, settings);
  const [allMusic, allDance] = [movedTimes(music.times, moves.music), movedTimes(visual.times, moves.dance)];
  const numbers = hitScore({ ...music, times: allMusic }, { ...visual, times: allDance }, duration, settings, evidence.shifts);
  return { ...numbers, sentence: hitSentence(numbers, words, settings.matching), allMusic, allDance, visual };
}

function hitSentence(numbers, words, matching) {
  if (!numbers.beats || !numbers.movements) return numbers.beats ? words.unseen : words.unheard;
  const luck = numbers.p === null ? "" : words[numbers.p <= 0.05 ? "more" : "luck"];
  const p = numbers.p === null ? "" : numbers.p.toFixed(3), chance = (matching === "many" ? "" : "at most ") + percent(numbers.chance);
  return fill(words.hits, { ...numbers, chance }) + fill(luck, { p });
}

function saliencyNumbers({ evidence, words }, settings) {
  const tracks = [[evidence.music, salientMusic, "lambda1"], [evidence.dance, salientDance, "lambda2"]];
  const [loud, large] = tracks.map(([{ strengths }, salientOf]) => salientOf(strengths, settings));
  const mask = ({ heights, kept }) => { const set = new Set(kept); return heights.map((_, index) => set.has(index)); };
  const [music_shares, dance_shares] = tracks.map(([{ strengths }, salientOf, name]) => (
    strengths.length ? evidence.lambdas.map(value => salientOf(strengths, { ...settings, [name]: value }).kept.length / strengths.length) : []));
  const counts = { music: loud.kept.length, beats: loud.heights.length, dance: large.kept.length, movements: large.heights.length };
  return { ...counts, music_mask: mask(loud), dance_mask: mask(large), music_shares, dance_shares, sentence: fill(words.kept, counts), loud, large };
}

function detectorNumbers({ evidence, words }, settings) {
  const { music, planted, near, duration } = evidence, { curve, times, strengths } = visualBeats(evidence, settings);
  const mask = planted && planted.map(time => distanceTo(times, time) <= near);
  const counts = { beats: times.length, music: music.length, planted: planted ? planted.length : 0, found: mask ? mask.filter(Boolean).length : 0, near: Math.round(1000 * near) };
  return {
    ...counts, times, heights: strengths, mask, rate: times.length / duration,
    distance: times.length && music.length ? median(times.map(time => distanceTo(music, time))) : null,
    sentence: fill(planted ? words.planted : words.detected, counts), curve,
  };
}

function meterNumbers({ evidence, words }, settings) {
  const track = evidence.tracks[declared(settings, "meter").beats], { kept, heights } = measuredBeats(track, settings);
  const times = pick(track.times, kept), strengths = pick(heights, kept), strong = strengths.map((strength, index) => index > 0 && strength > strengths[index - 1]);
  const units = meterUnits(times, strong, evidence.categories), places = pick(track.places, kept), placed = indices(places, place => place >= 0);
  const shares = Object.fromEntries(Object.keys(evidence.colours).map(label => [label, sum(units.filter(unit => unit[2] === label).map(([start, end]) => (end - start) / evidence.duration))]));
  const covered = sum(Object.values(shares)), count = of => strong.filter((isStrong, index) => isStrong && of(index)).length;
  const counts = placed.length ? Array.from({ length: 1 + Math.max(...pick(places, placed)) }, (_, place) => places.filter(one => one === place).length) : [];
  const numbers = {
    beats: kept.length, strong: count(() => true), units, covered, shares, counts,
    accents: counts.map((total, place) => count(index => places[index] === place) / Math.max(total, 1)),
    chance: placed.length ? count(index => places[index] >= 0) / placed.length : null,
    downbeats: counts[0] || 0, strong_downbeats: count(index => places[index] === 0),
  };
  const text = fill(words.meter, { ...numbers, covered: percent(covered) }) + (evidence.downbeats ? fill(words.downbeats, numbers) : "");
  return { ...numbers, sentence: text, times, strengths, mask: strong };
}

// Music that starts `seconds` later, round its end.
function lateTrack({ times, strengths, duration }, seconds) {
  const turned = times.map((time, index) => [modulo(time + seconds, duration), strengths[index]]).sort((a, b) => a[0] - b[0]);
  const kept = turned.filter(([time], index) => !index || time > turned[index - 1][0]);
  return { times: kept.map(beat => beat[0]), strengths: kept.map(beat => beat[1]) };
}

function corpusNumbers({ evidence, words }, settings) {
  const { late, score, clip: chosen } = declared(settings, "corpus"), { music, periods, places } = evidence, dances = evidence.dances[settings.mode];
  const name = { harmony: "harmony", harmony_above_chance: "above", hit_rate: "rate" }[score];
  const scores = seconds => music.map((track, clip) => (settings.mode === "recommended" ? placeScore(places, clip, settings, seconds[clip])
    : hitScore(seconds[clip] ? lateTrack(track, seconds[clip]) : track, dances[clip], track.duration, settings))[name]).map(value => roundHalfEven(1e12 * value) / 1e12);
  const [right, wrong] = [scores(periods.map(() => 0)), scores(periods.map(period => late * period))];
  const tied = right.map((value, clip) => isClose(value, wrong[clip])), auc = areaUnderCurve(right, wrong);
  const counts = { wins: right.filter((value, clip) => value > wrong[clip] && !tied[clip]).length, ties: tied.filter(Boolean).length, clips: right.length };
  return {
    ...counts, auc, mean_true: mean(right), mean_wrong: mean(wrong), true: right, wrong, chosen: [right[chosen], wrong[chosen]],
    sentence: fill(words.corpus, { ...counts, auc: percent(auc) }), tied,
  };
}

const NUMBERS = { scoring: scoringNumbers, saliency: saliencyNumbers, detector: detectorNumbers, meter: meterNumbers, corpus: corpusNumbers };
const numbersOf = (data, settings) => NUMBERS[data.kind](data, complete(data, settings));
