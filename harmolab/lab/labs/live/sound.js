// Clicks for beats, made in the page: high for the music, low for the dance.
const PITCH = { music: 1800, dance: 500 }, FALL = 0.05, LEAD = 0.08;  // hertz; seconds a click takes; seconds before the first
let speaker = null;

function click(time, pitch) {
  const tone = speaker.createOscillator(), gain = speaker.createGain();
  tone.frequency.value = pitch;
  gain.gain.setValueAtTime(0.5, time);
  gain.gain.exponentialRampToValueAtTime(0.001, time + FALL);
  tone.connect(gain).connect(speaker.destination);
  tone.start(time); tone.stop(time + FALL);
  return tone;
}

// Plays the clicks between two times; returns { time, stop }.
function playClicks(clicks, from, to) {
  speaker ??= new AudioContext();
  speaker.resume();
  const start = speaker.currentTime + LEAD;
  const tones = clicks.filter(one => one.time >= from && one.time <= to).map(one => click(start + one.time - from, PITCH[one.kind]));
  return { time: () => from + speaker.currentTime - start, to, stop: () => tones.forEach(tone => tone.stop()), count: tones.length };
}
