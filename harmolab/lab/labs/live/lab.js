// A lab: settings in, numbers and a picture out, at every move.
const PICTURES = { scoring: drawScoring, saliency: drawSaliency, detector: drawDetector, meter: drawMeter, corpus: drawCorpus };
const NEAR = 16, STILL = 3, NUDGE = 0.01, APART = 0.005, AROUND = 1.2;  // pixels; those that a hand shakes; seconds of a key press; between beats; heard around a beat

// Sounds of a lab: name -> clicks, in seconds from the start of the clip, the dance earlier by the lag.
const SOUNDS = {
  scoring: (data, settings, numbers) => ({ "Play the clicks": settings.mode === "recommended"
    ? clicksOf(data.evidence.music.times, visualBeats(data.evidence, data.modes.valleys).times, settings.lag)
    : clicksOf(pick(numbers.allMusic, numbers.loud.kept), pick(numbers.allDance, numbers.large.kept), settings.lag) }),
  saliency: (data, settings, numbers) => ({ "Play what is noticed": clicksOf(data.evidence.music.times.filter((_, index) => numbers.music_mask[index]), data.evidence.dance.times.filter((_, index) => numbers.dance_mask[index]), 0) }),
  detector: (data, _, numbers) => ({ "Play the clicks": clicksOf(data.evidence.music, numbers.times, 0) }),
  meter: (_, __, { times, mask }) => ({ "Play the beats": clicksOf(times.filter((_, index) => mask[index]), times.filter((_, index) => !mask[index]), 0) }),
  corpus: ({ evidence }, { clip, late, lag }) => {
    const dances = evidence.dances.valleys, music = evidence.music[clip];
    const sound = track => clicksOf(track.times, dances[clip].times, lag);
    return { "Play with the true music": sound(music), "Play with the wrong music": sound(lateTrack(music, late * evidence.periods[clip])) };
  },
};
const clicksOf = (music, dance, lag) => [...music.map(time => ({ time, kind: "music" })), ...dance.map(time => ({ time: time - lag, kind: "dance" }))];

// A mode's own values of the controls.
const ownValues = (data, mode) => Object.fromEntries(data.controls.filter(({ name }) => name in data.modes[mode]).map(({ name }) => [name, data.modes[mode][name]]));

export function mount(parent, data, { changed = () => {}, play = null, heading = "h2" } = {}) {
  const state = { settings: { ...data.start }, selected: null, sound: null, numbers: null, picture: null };
  const view = panel(data, { set, choose, heading });
  parent.replaceChildren(view.root);  // a page that a browser saved holds its lab already
  // Of labs and players in frames of one page, or in other tabs, only the last one started sounds.
  const others = new BroadcastChannel("harmolab players");
  others.onmessage = stop;

  function set(values) {
    const own = "mode" in values ? ownValues(data, values.mode) : {}, moves = { ...state.settings.moves };
    if ("mode" in values || "detector" in values) { delete moves.dance; state.selected = null; }
    update({ ...state.settings, ...own, ...values, moves: values.moves || moves });
  }

  function choose(preset) {
    const own = ownValues(data, preset.values.mode || "paper");
    state.selected = null;
    update({ ...state.settings, ...own, ...preset.values, moves: {} });
    view.note.textContent = preset.note;
  }

  function update(settings) {
    const { moves = {}, ...rest } = settings;
    state.settings = Object.values(moves).some(one => Object.keys(one).length) ? { ...rest, moves } : rest;
    show();
    changed(state.settings);
  }

  function show() {
    const { settings } = state, idle = data.idle[settings.mode] || [];
    state.numbers = numbersOf(data, settings);
    draw();
    view.sentence.textContent = state.numbers.sentence;
    view.canvas.setAttribute("aria-label", `${data.title}. ${state.numbers.sentence}`);
    for (const [name, { show: showValue, input, row }] of Object.entries(view.rows)) {
      showValue(settings[name]);
      input.disabled = idle.includes(name); row.classList.toggle("idle", input.disabled);
    }
    view.board.replaceChildren(...BOARDS[data.kind](state.numbers, settings, data).map(([name, text]) => element("div", {}, element("dt", {}, name), element("dd", {}, String(text)))));
    view.code.textContent = settingsLine(data, settings);
    data.presets.forEach((preset, index) => {
      const target = { ...settings, ...ownValues(data, preset.values.mode || "paper"), ...preset.values }, isOn = !settings.moves && Object.keys(target).every(name => target[name] === settings[name]);
      view.buttons[index].setAttribute("aria-pressed", String(isOn));
      if (isOn) view.note.textContent = preset.note;
    });
    if (![...view.buttons].some(button => button.getAttribute("aria-pressed") === "true")) view.note.textContent = "";
  }

  function draw() {
    const width = view.canvas.clientWidth || 700;
    state.picture = PICTURES[data.kind](view.canvas, width, data, state.settings, state.numbers, state);
    if (!state.sound) return;
    const time = state.sound.time(), { chart, panels } = state.picture;
    if (time >= 0) panels.forEach(({ top, height }) => line(chart, [chart.x(time), chart.x(time)], [top, top + height], COLOUR.miss, { width: 1.5 }));
  }

  function sound(clicks, from, to) {
    const before = state.sound;
    stop();
    if (before) return;
    others.postMessage("play");
    state.sound = playClicks(clicks, from, to);
    const step = () => {
      if (!state.sound) return;
      if (state.sound.time() > state.sound.to || !view.canvas.isConnected) stop(); else { draw(); requestAnimationFrame(step); }
    };
    requestAnimationFrame(step);
  }

  function stop() {
    state.sound?.stop();
    state.sound = null;
    draw();
  }

  function soundButtons() {
    const names = Object.keys(SOUNDS[data.kind](data, state.settings, state.numbers));
    const press = name => { const clicks = SOUNDS[data.kind](data, state.settings, state.numbers)[name]; sound(clicks, 0, Math.max(0, ...clicks.map(one => one.time)) + 0.1); };
    view.sounds.append(...names.map(name => element("button", { type: "button", onclick: () => press(name) }, name)), element("span", {}, data.kind === "meter" ? "high: strong, low: weak" : "high: music, low: dance"));
    if (play) view.sounds.append(element("button", { type: "button", onclick: play }, "Open the chosen dance in the player"));
  }

  // Beats of the clip: dragged, or moved with shift and arrows.
  const beatTimes = kind => (kind === "music" ? state.numbers.allMusic : state.numbers.allDance);

  function moveBeat({ kind, index }, time) {
    const times = beatTimes(kind), low = index ? times[index - 1] + APART : 0, high = index < times.length - 1 ? times[index + 1] - APART : data.evidence.duration;
    if (low > high) return;
    const moves = state.settings.moves || {}, moved = Math.round(1000 * clamp(time, low, high)) / 1000;
    set({ moves: { ...moves, [kind]: { ...moves[kind], [index]: clamp(moved, low, high) } } });
  }

  function hear({ kind, index }) {
    const time = beatTimes(kind)[index] - (kind === "dance" ? state.settings.lag : 0);
    stop();
    sound(Object.values(SOUNDS[data.kind](data, state.settings, state.numbers))[0], time - AROUND, time + AROUND);
  }

  const spot = event => { const frame = view.canvas.getBoundingClientRect(); return [event.clientX - frame.left, event.clientY - frame.top]; };

  function nearest([x, y]) {
    const away = beat => (beat.kind === "clip" ? Math.hypot(beat.x - x, beat.y - y) : (beat.kind === "music") === (y < beat.middle) && Math.abs(y - beat.middle) < 110 ? Math.abs(beat.x - x) : Infinity);
    const { beats } = state.picture, least = Math.min(Infinity, ...beats.map(away)), best = beats.filter(beat => away(beat) <= least + 1e-6);
    if (!(least <= NEAR)) return null;
    return best.find(beat => beat.index > state.settings.clip) || best[0];  // clips on one spot take turns
  }

  view.canvas.addEventListener("pointerdown", event => {
    const at = spot(event), beat = nearest(at);
    if (!beat) return;
    if (beat.kind === "clip") { set({ clip: beat.index }); return; }
    state.selected = beat; state.drag = { grip: beat.x - at[0], begun: false };
    view.canvas.setPointerCapture(event.pointerId);
    draw();
  });
  view.canvas.addEventListener("pointermove", event => {
    if (!view.canvas.hasPointerCapture(event.pointerId)) { view.canvas.style.cursor = nearest(spot(event)) ? (data.kind === "corpus" ? "pointer" : "ew-resize") : ""; return; }
    const { box, x } = state.picture.chart, { drag, selected } = state, at = spot(event)[0] + drag.grip;  // the beat does not jump to the hand
    drag.begun ||= Math.abs(at - selected.x) > STILL;
    if (drag.begun) moveBeat(selected, (at - box.left) / (x(1) - x(0)));
  });
  view.canvas.addEventListener("pointerup", () => { if (state.selected && data.kind === "scoring") hear(state.selected); });
  view.canvas.addEventListener("keydown", event => {
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key], beats = [...state.picture.beats].sort((a, b) => a.time - b.time);
    if (data.kind !== "scoring" || !beats.length || (!way && event.key !== "Enter")) return;
    event.preventDefault();
    const { selected } = state, at = beats.findIndex(beat => selected && beat.kind === selected.kind && beat.index === selected.index);
    if (event.key === "Enter") { if (selected) hear(selected); return; }
    if (event.shiftKey && selected) moveBeat(selected, beats[at].time + way * NUDGE);
    else { state.selected = beats[clamp(at < 0 ? 0 : at + way, 0, beats.length - 1)]; draw(); }
    view.note.textContent = `${state.selected.kind} beat at ${beatTimes(state.selected.kind)[state.selected.index].toFixed(2)} s`;
  });

  readColours();
  for (const media of ["print", "screen and (prefers-color-scheme: dark)"]) matchMedia(media).addEventListener("change", () => { readColours(); draw(); });
  show();
  soundButtons();
  // JupyterLab would take arrow keys for shortcuts of its own, and looks for this on the element that has the focus.
  for (const node of view.root.querySelectorAll("input, select, button, canvas")) node.setAttribute("data-lm-suppress-shortcuts", "true");
  new ResizeObserver(draw).observe(view.canvas);
  return {
    set, update, state, below: view.below,
    close: () => { stop(); others.close(); },
  };
}

// In JupyterLab: the page answers at once; Python is told a moment later.
const PAUSE = 150;  // milliseconds
function render({ model, el }) {
  let timer = 0, told = JSON.stringify(model.get("settings"));
  const send = settings => { told = JSON.stringify(settings); model.set("settings", settings); model.save_changes(); };
  const changed = settings => { clearTimeout(timer); timer = setTimeout(() => send(settings), PAUSE); };
  const data = { ...model.get("data"), start: model.get("settings") };
  const lab = mount(el, data, { changed, play: data.plays ? () => model.send({ play: true }) : null });
  const follow = () => { const settings = model.get("settings"); if (JSON.stringify(settings) !== told) { told = JSON.stringify(settings); lab.update(settings); } };
  const open = () => { lab.below.innerHTML = model.get("player"); };
  model.on("change:settings", follow); model.on("change:player", open);
  open();
  return () => { clearTimeout(timer); lab.close(); model.off("change:settings", follow); model.off("change:player", open); };
}
export default { render };
