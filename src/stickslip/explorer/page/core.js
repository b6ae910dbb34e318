// The state of the page, and what changes it.
//
// All that a person sets stands in one plain object, `explorer.state`; who shows something reads it
// there, who changes something calls `explorer.change`. The address, undo and redo, and what is asked
// of the server are made from it alone.
const explorer = window.explorer = {parts: [], models: null}

explorer.facts = JSON.parse(document.getElementById("facts").textContent)
explorer.$ = (id) => document.getElementById(id)

explorer.fresh = (model = explorer.facts.first, toml = "") => ({
  model, toml,          // a name of the catalogue or "given"; or the text of a model file
  values: {},           // parameters and functions that differ from those of the model
  initial: {},          // initial values that differ
  until: null,          // end of the time
  evolution: "",        // the text of the model file of an evolution, for the panel of effective friction
  given: {},            // its parameters that differ
  panel: "phase",
  view: {},             // what panels remember: axes, ranges, switches; texts by name
})
explorer.state = explorer.fresh()

// Who listens: a function of the kind of change, "drag" (a slider moves), "set" (a value is set), "model"
// (another model), "view" (nothing has to be computed).
explorer.listen = (part) => explorer.parts.push(part)

explorer.change = (kind, change = () => {}) => {
  change(explorer.state)
  for (const part of explorer.parts) explorer.guard(() => part(kind, explorer.state))
  if (kind !== "drag") explorer.remember()
}

// A mistake in one part of the page stops no other part.
explorer.guard = (act) => {
  try { return act() } catch (error) { console.error(error) }
}

// -- undo and redo --------------------------------------------------------------------------------

explorer.past = []
explorer.future = []
explorer.now = null

explorer.remember = () => {
  const text = JSON.stringify(explorer.state)
  if (text === explorer.now) return
  if (explorer.now !== null) explorer.past.push(explorer.now)
  if (explorer.past.length > 200) explorer.past.shift()
  explorer.future = []
  explorer.now = text
  explorer.showHistory()
}

explorer.travel = (from, to) => {
  if (from.length === 0) return
  to.push(explorer.now)
  explorer.now = from.pop()
  const before = explorer.state
  explorer.state = JSON.parse(explorer.now)
  const other = before.model !== explorer.state.model || before.toml !== explorer.state.toml
  for (const part of explorer.parts) explorer.guard(() => part(other ? "model" : "set", explorer.state))
  explorer.showHistory()
}

explorer.showHistory = () => {
  explorer.$("undo").disabled = explorer.past.length === 0
  explorer.$("redo").disabled = explorer.future.length === 0
}

// -- numbers and words -----------------------------------------------------------------------------

explorer.number = (value, digits = 5) => {
  if (value === null || value === undefined || !isFinite(value)) return "–"
  const size = Math.abs(value)
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential(2).replace("-", "−")
  return String(Number(value.toPrecision(digits))).replace("-", "−")
}

// A number as people type it: 0.5, 1/3, 2e-3, −1; NaN if it is none.
explorer.typed = (text) => {
  const parts = text.trim().replace("−", "-").replace(",", ".").split("/")
  if (parts.length > 2 || parts.some((part) => part.trim() === "")) return NaN
  return parts.map(Number).reduce((a, b) => a / b)
}

explorer.debounced = (act, wait) => {
  let timer = null
  return (...given) => {
    clearTimeout(timer)
    timer = setTimeout(() => explorer.guard(() => act(...given)), wait)
  }
}

explorer.element = (name, attributes = {}, ...children) => {
  const made = document.createElement(name)
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "html") made.innerHTML = value
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), (event) => explorer.guard(() => value(event)))
    else if (value === true) made.setAttribute(key, "")
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(key, value)
  }
  made.append(...children)
  return made
}

let toastTimer = null
explorer.toast = (text) => {
  const place = explorer.$("toast")
  place.textContent = text
  place.classList.add("shown")
  clearTimeout(toastTimer)
  toastTimer = setTimeout(() => place.classList.remove("shown"), 2600)
}

// -- light and dark ----------------------------------------------------------------------------------

explorer.dark = () => document.documentElement.dataset.theme === "dark"

// The palette of the pictures; on black a little lighter.
const LIGHTER = {"#0072B2": "#58A9E0", "#D55E00": "#F08B4A", "#009E73": "#3CC39A", "#CC79A7": "#E09CC3",
                 "#E69F00": "#EDB43A", "#56B4E9": "#8CCBF1", "#B8860B": "#D9A93A"}
explorer.tone = (colour) => explorer.dark() ? LIGHTER[colour] ?? colour : colour
explorer.colour = (i) => explorer.tone(explorer.facts.colours.lines[i % explorer.facts.colours.lines.length])
explorer.ink = () => explorer.dark() ? "#E6EAED" : "#1B1F23"

explorer.setTheme = (theme) => {
  document.documentElement.dataset.theme = theme
  const [text, line, grid] = theme === "dark" ? ["#AEB7BE", "#59636B", "#2B3238"] : ["#4A545C", "#A7B0B7", "#E7EBEE"]
  for (const plot of explorer.plots()) {
    for (const axis of [...plot.below, ...plot.left, ...plot.right]) {
      explorer.setQuietly(axis, {axis_line_color: line, major_tick_line_color: line, major_label_text_color: text,
                                 axis_label_text_color: text})
    }
    for (const grid_ of plot.center) explorer.setQuietly(grid_, {grid_line_color: grid})
  }
  for (const part of explorer.parts) explorer.guard(() => part("theme", explorer.state))
}
