// The score by hits of one clip (Eq. 10-21), its chance and null distribution; and its salient beats.

// Indices of attentional music beats (Eq. 11).
function salientMusic(track, lambda, literal) {
  return indices(track.strengths, value => literal ? Math.sign(value - track.spread) * lambda > 0 : value > lambda * track.spread);
}

// Indices of attentional visual beats (Eq. 13); a lambda of 0 keeps all.
function salientDance(track, lambda, { literal = false, strength = false, drop = false } = {}) {
  if (!lambda) return [...track.times.keys()];
  const level = track.spread;
  const kept = indices(strength ? track.speeds : track.steps, value => literal ? Math.sign(value - level) * lambda > 0 : value > lambda * level);
  return drop ? kept.filter(index => index > 0) : kept;
}

const indices = (values, test) => values.flatMap((value, index) => (test(value) ? [index] : []));

// Index of the visual beat that hits each music beat, -1 for a miss (Eq. 18).
function hitPairs(music, dance, delay, oneEach) {
  const taken = new Set();
  return music.map(time => {
    let best = -1, distance = Infinity;
    dance.forEach((other, index) => {
      const away = Math.abs(other - time);
      if (away < distance && !taken.has(index)) { distance = away; best = index; }
    });
    if (!(distance <= delay + EDGE)) return -1;
    if (oneEach) taken.add(best);
    return best;
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

// Strengths hit after each rotation of the dance, as shares of all.
function nullShares(music, weights, dance, delay, duration, shifts) {
  const around = dance.map(time => modulo(time, duration)).sort((a, b) => a - b), last = around.length - 1;
  const ring = [around[last] - duration, ...around, around[0] + duration], total = sum(weights);
  return shifts.map(shift => {
    let hit = 0;
    music.forEach((time, index) => {
      const moved = modulo(time - shift, duration), after = clamp(countBelow(ring, moved), 1, ring.length - 1);
      if (Math.min(Math.abs(ring[after] - moved), Math.abs(moved - ring[after - 1])) <= delay + EDGE) hit += weights[index];
    });
    return hit / total;
  });
}

const pick = (values, chosen) => chosen.map(index => values[index]);

// Times of a track whose beats of some numbers were dragged.
function movedTimes(times, moves = {}) {
  const moved = [...times];
  for (const [number, time] of Object.entries(moves)) moved[number] = time;
  return moved;
}

const danceKey = settings => `${settings.mode} ${settings.detector}`;

function hitNumbers(data, settings) {
  const { evidence, words } = data, { duration } = evidence, { delay, lag, beta } = settings, moves = settings.moves || {};
  const track = evidence.dance[danceKey(settings)], every = movedTimes(evidence.music.times, moves.music);
  const allDance = movedTimes(track.times, moves.dance);
  const music = salientMusic(evidence.music, settings.lambda1), dance = salientDance(track, settings.lambda2);
  const times = pick(every, music), weights = pick(evidence.music.strengths, music);
  const expected = pick(allDance, dance).map(time => time - lag), oneEach = settings.matching === "nearest";
  const pairs = hitPairs(times, expected, delay, oneEach), isHit = pairs.map(pair => pair >= 0);
  const score = sum(weights.filter((_, index) => isHit[index])), total = sum(weights);
  const chance = chanceLevel(expected, delay, duration), share = total > 0 ? score / total : chance;
  const [n, m] = [music.length, dance.length];
  const isEmpty = total === 0 || m === 0;
  const shares = isEmpty ? [] : nullShares(times, weights, expected, delay, duration, evidence.shifts);
  const numbers = {
    harmony: n && m ? (1 + beta ** 2) * score / (n * beta ** 2 + m) : 0,
    audio_harmony: quotient(score, n), visual_harmony: quotient(score, m),
    hits: isHit.filter(Boolean).length, beats: n, movements: m, share, chance, above: aboveChance(share, chance),
    p: isEmpty ? null : (1 + shares.filter(value => value >= share - 1e-12).length) / (1 + shares.length),
    rate: quotient(hitPairs(every, expected, delay, oneEach).filter(pair => pair >= 0).length, every.length),
    pairs, null: shares,
  };
  return { ...numbers, sentence: hitSentence(numbers, words), music, dance, allMusic: every, allDance };
}

function hitSentence(numbers, words) {
  if (!numbers.beats || !numbers.movements) return numbers.beats ? words.unseen : words.unheard;
  const luck = numbers.p === null ? "" : words[numbers.p <= 0.05 ? "more" : "luck"];
  const p = numbers.p === null ? "" : numbers.p.toFixed(3);
  return fill(words.hits, { ...numbers, chance: percent(numbers.chance) }) + fill(luck, { p });
}

function saliencyNumbers(data, settings) {
  const { evidence, words } = data, literal = settings.saliency === "literal";
  const reading = { literal, strength: settings.visual_saliency === "strength", drop: settings.first_beat === "drop" };
  const heights = evidence.music[settings.normalisation], dance = evidence.dance;
  const masks = [salientMusic(heights, settings.lambda1, literal), salientDance(dance, settings.lambda2, reading)];
  const counts = { music: masks[0].length, beats: evidence.times.length, dance: masks[1].length, movements: dance.times.length };
  const as = (kept, times) => { const set = new Set(kept); return times.map((_, index) => set.has(index)); };
  const shares = (count, total) => (total ? evidence.lambdas.map(value => count(value) / total) : []);
  return {
    ...counts,
    music_mask: as(masks[0], evidence.times), dance_mask: as(masks[1], dance.times),
    music_shares: shares(value => salientMusic(heights, value, literal).length, counts.beats),
    dance_shares: shares(value => salientDance(dance, value, reading).length, counts.movements),
    sentence: fill(words.kept, counts), heights,
  };
}
