// What stands around a picture: preset buttons, the sentence, sliders and menus, numbers, and the line to copy.
const LEGENDS = {
  scoring: [["circle", "met, or ranked above 0.5"], ["cross", "missed, or ranked below"], ["field", "close enough"], ["ignored", "ignored"], ["diamond", "score now, among all starts of the music"], ["dashed", "chance"]],
  saliency: [["kept", "noticed"], ["ignored", "not noticed"], ["dotted", "threshold"]],
  detector: [["wave", "curve of the dance"], ["triangle", "visual beat"], ["kept", "music beat"], ["circle", "planted rest, found", "planted"], ["cross", "planted rest, not found", "planted"]],
  meter: [["dot", "strong beat"], ["open", "weak beat"], ["bracket", "meter unit"], ["triangle dark", "annotated downbeat", "downbeats"], ["dashed", "share of all beats that are strong", "downbeats"]],
  corpus: [["circle", "true music wins"], ["cross", "wrong music wins"], ["square", "tie"], ["ring", "chosen dance"]],
};
const signed = value => (value === null ? "–" : (value > 0 ? "+" : "") + value.toFixed(2)), fixed = (value, digits) => (value === null ? "–" : value.toFixed(digits));
const BOARDS = {
  scoring: (numbers, settings) => settings.mode === "recommended"
    ? [["level", `${numbers.level} of 4`], ["above chance", signed(numbers.above)], ["p in time", fixed(numbers.p_time, 3)], ["p in place", fixed(numbers.p_place, 3)], ["lag", numbers.late === null ? "–" : `${numbers.late.toFixed(0)} ms`]]
    : [["harmony h", fixed(numbers.harmony, 2)], ["music beats met", `${numbers.hits}/${numbers.beats}`], ["chance", fixed(numbers.chance, 2)], ["above chance", numbers.chance > 0.995 ? "–" : signed(numbers.above)], ["p", fixed(numbers.p, 3)]],
  saliency: numbers => [["music beats noticed", `${numbers.music}/${numbers.beats}`], ["movements noticed", `${numbers.dance}/${numbers.movements}`]],
  detector: (numbers, _, data) => [["visual beats", numbers.beats], ["music beats", numbers.music], ["visual beats a second", numbers.rate.toFixed(1)], ["median distance to the music", numbers.distance === null ? "–" : `${(1000 * numbers.distance).toFixed(0)} ms`],
    ...(data.evidence.planted ? [[`planted rests found within ${numbers.near} ms`, `${numbers.found}/${numbers.planted}`]] : [])],
  meter: (numbers, _, data) => [["beats", numbers.beats], ["strong", numbers.strong], ["meter units", numbers.units.length], ["time covered", `${percent(numbers.covered)} %`],
    ...(data.evidence.downbeats ? [["downbeats that are strong", `${numbers.strong_downbeats}/${numbers.downbeats}`]] : [])],
  corpus: (numbers, settings, data) => [["AUC", fixed(numbers.auc, 2)], ["true music wins", `${numbers.wins}/${numbers.clips}`], ["ties", numbers.ties], ["mean, true", fixed(numbers.mean_true, 2)], ["mean, wrong", fixed(numbers.mean_wrong, 2)],
    [data.evidence.names[settings.clip], numbers.chosen.map(value => fixed(value, 2)).join(" true, ") + " wrong"]],
};

// An element with attributes, listeners ("onclick") and children.
function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value); else node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

const decimals = step => (step >= 1 ? 0 : step >= 0.1 && Number.isInteger(step * 10) ? 1 : 2);

function sliderRow(data, control, set) {
  const { name, label, symbol, low, high, step, unit } = control;
  const input = element("input", { type: "range", min: low, max: high, step, "data-name": name, "aria-label": `${label} (${symbol})`, oninput: () => set({ [name]: input.valueAsNumber }) });
  const output = element("span", { class: "value" }), text = value => (name === "clip" ? data.evidence.names[value] : `${value.toFixed(decimals(step))} ${unit}`.trim());
  const show = value => {
    if (input.valueAsNumber !== value) input.value = value;
    output.textContent = text(value);
    input.setAttribute("aria-valuetext", text(value));
  };
  const paper = data.modes.paper[name], hasMark = name in data.start && paper >= low && paper <= high;
  const mark = hasMark ? [element("span", { class: "paper", style: `--at: ${(paper - low) / (high - low)}` }, `paper ${text(paper)}`)] : [];
  return { row: element("label", {}, element("span", {}, `${label} `, element("i", {}, symbol)), output, input, ...mark), input, show };
}

function menuRow(control, set) {
  const { name, label, symbol, options } = control;
  const choices = options.map(([value, words]) => element("option", { value: String(value) }, words));
  const input = element("select", { "data-name": name, "aria-label": `${label} (${symbol})`, onchange: () => set({ [name]: options[input.selectedIndex][0] }) }, ...choices);
  return { row: element("label", {}, element("span", {}, `${label} `, element("i", {}, symbol)), input), input, show: value => { input.selectedIndex = options.findIndex(([option]) => option === value); } };
}

// The panel of a lab; `set(values)` and `choose(preset)` are called when the reader acts.
function panel(data, { set, choose, heading }) {
  const sentence = element("p", { class: "sentence", role: "status", "aria-live": "polite" }), note = element("p", { class: "note", role: "status" });
  const canvas = element("canvas", { tabindex: 0, role: "img" }), board = element("dl", { class: "board" }), code = element("code", { title: "settings for Python" });
  const buttons = data.presets.map(preset => element("button", { type: "button", onclick: () => choose(preset) }, preset.label));
  const rows = data.controls.map(control => [control.name, control.options ? menuRow(control, set) : sliderRow(data, control, set)]);
  const legend = element("ul", { class: "legend", "aria-label": "Legend" }, ...LEGENDS[data.kind].filter(([, , needed]) => !needed || data.evidence[needed]).map(([mark, words]) => element("li", {}, element("i", { class: mark, "aria-hidden": "true" }), words)));
  const sounds = element("div", { class: "sounds", role: "group", "aria-label": "Sound" }), below = element("div", { class: "player" });
  const root = element("section", { class: "harmolab-lab", "aria-label": data.title }, element(heading, {}, data.title), element("p", { class: "about" }, data.about),
    element("div", { class: "presets", role: "group", "aria-label": "Try" }, ...buttons), note, sentence, canvas, legend,
    element("div", { class: "controls" }, ...rows.map(([, { row }]) => row)), sounds, board, element("p", { class: "line" }, "For Python: ", code), below);
  return { root, sentence, note, canvas, board, code, buttons, rows: Object.fromEntries(rows), sounds, below };
}

// The settings as Python text: a preset by its name, else the fields in which they differ from the paper.
function settingsLine({ line, controls }, settings) {
  const texts = { ...line.modes[settings.mode || "paper"] }, paper = line.named.paper;
  for (const { name, options } of controls) {
    const field = line.fields[name] || name;
    if (!(field in paper)) continue;
    const value = settings[name];
    texts[field] = options ? options.find(([option]) => option === value)[2] : name === "lambda2" && !value ? "None" : Number.isInteger(value) ? value.toFixed(1) : String(value);
  }
  const fields = line.order, named = Object.entries(line.named).find(([, preset]) => fields.every(field => preset[field] === texts[field]));
  if (named) return `HarmonyParams.${named[0]}()`;
  return `HarmonyParams(${fields.filter(field => texts[field] !== paper[field]).map(field => `${field}=${texts[field]}`).join(", ")})`;
}
