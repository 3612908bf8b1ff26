// Scores of many clips (harmolab.lab.compare.batch): all beats in two flat arrays, the clips a gap apart.
function movedBatch(batch, seconds) {
  if (!batch.curves) {
    const audio = batch.audio.map((time, index) => {
      const clip = batch.audio_clip[index], origin = clip * batch.gap;
      return origin + modulo(time - origin + seconds[clip], batch.durations[clip]);
    });
    return { ...batch, audio };
  }
  const turned = rows => rows.map((row, clip) => {
    const steps = roundHalfEven(seconds[clip] / batch.periods[clip] * MOMENTS);
    return row.map((_, lag) => row[modulo(lag + steps, row.length)]);
  });
  return { ...batch, curves: turned(batch.curves), hits: turned(batch.hits), hitting: turned(batch.hitting) };
}

const MOMENTS = 48;  // a beat
const batchHarmony = (score, n, m, beta) => (n > 0 && m > 0 ? quotient((1 + beta ** 2) * score, n * beta ** 2 + m) : 0);

function rescoredPlaces(batch, settings) {
  const rows = batch.curves.map((curve, clip) => {
    const now = modulo(roundHalfEven(settings.lag / batch.periods[clip] * MOMENTS), curve.length), n = batch.n_audio[clip];
    return {
      harmony: batchHarmony(batch.hitting[clip][now], n, batch.n_visual[clip], settings.beta),
      hit_rate: quotient(batch.hits[clip][now], n),
      harmony_above_chance: aboveChance(curve[now], batch.chance[clip]),
    };
  });
  return columns(rows);
}

const columns = rows => Object.fromEntries(Object.keys(rows[0]).map(name => [name, rows.map(row => row[name])]));

function rescored(batch, settings) {
  const clips = batch.durations.length, zeros = () => new Array(clips).fill(0), { lambda1, lambda2, delay, beta } = settings;
  const [n, m, every, score, total, hits, covered] = Array.from({ length: 7 }, zeros), dance = [];
  let reached = -Infinity;
  batch.visual.forEach((time, index) => {
    const clip = batch.visual_clip[index], origin = clip * batch.gap;
    if (lambda2 && !(batch.steps[index] > lambda2 * batch.spread[clip])) return;
    const expected = time - settings.lag, end = Math.min(expected + delay, origin + batch.durations[clip]);
    covered[clip] += Math.max(end - Math.max(expected - delay, origin, reached), 0);
    reached = Math.max(reached, end);
    dance.push(expected); m[clip]++;
  });
  batch.audio.forEach((time, index) => {
    const clip = batch.audio_clip[index], strength = batch.audio_strengths[index], after = countBelow(dance, time);
    const nearest = dance.length ? Math.min(Math.abs(time - dance[Math.max(after - 1, 0)]), Math.abs(dance[Math.min(after, dance.length - 1)] - time)) : Infinity;
    const isHit = nearest <= delay + EDGE, weight = strength > lambda1 * batch.level[clip] ? strength : 0;
    every[clip]++; hits[clip] += isHit; total[clip] += weight; n[clip] += strength > lambda1 * batch.level[clip];
    if (isHit) score[clip] += weight;
  });
  return columns(batch.durations.map((duration, clip) => ({
    harmony: batchHarmony(score[clip], n[clip], m[clip], beta),
    hit_rate: quotient(hits[clip], every[clip]),
    harmony_above_chance: n[clip] && m[clip] ? aboveChance(quotient(score[clip], total[clip]), covered[clip] / duration) : 0,
  })));
}

let lateBatch = { key: "", batch: null };  // the wrong music stays where it is while other sliders move

function corpusNumbers(data, settings) {
  const { evidence, words } = data, { mode, late } = settings, batch = evidence.batches[mode];
  if (lateBatch.key !== `${mode} ${late}` || lateBatch.evidence !== evidence) {
    lateBatch = { key: `${mode} ${late}`, evidence, batch: movedBatch(batch, evidence.periods.map(period => late * period)) };
  }
  const scores = part => (batch.curves ? rescoredPlaces : rescored)(part, settings)[settings.score];
  const [right, wrong] = [scores(batch), scores(lateBatch.batch)], tied = right.map((value, clip) => isClose(value, wrong[clip]));
  const counts = { wins: right.filter((value, clip) => value > wrong[clip] && !tied[clip]).length, ties: tied.filter(Boolean).length, clips: right.length };
  const auc = areaUnderCurve(right, wrong);
  return {
    ...counts, auc, mean_true: mean(right), mean_wrong: mean(wrong), true: right, wrong,
    sentence: fill(words.corpus, { ...counts, auc: percent(auc) }), tied,
  };
}
