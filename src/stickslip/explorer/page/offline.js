// An exported page: motions that are stored in it, and the sliders between them. Nothing is computed here
// and nothing is asked of anybody.
const explorer = window.explorer = {motion: null}
const stored = explorer.stored = JSON.parse(document.getElementById("data").textContent)
explorer.$ = (id) => document.getElementById(id)

const place = (root, name, attributes, children) => {
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "html") root.innerHTML = value
    else if (key.startsWith("on")) root.addEventListener(key.slice(2), value)
    else if (value === true) root.setAttribute(key, "")
    else if (value !== false && value !== null && value !== undefined) root.setAttribute(key, value)
  }
  root.append(...children)
  return root
}
explorer.element = (name, attributes = {}, ...children) => place(document.createElement(name), name, attributes, children)
explorer.svg = (name, attributes = {}, ...children) => place(document.createElementNS("http://www.w3.org/2000/svg", name), name, attributes, children)

explorer.number = (value, digits = 3) => {
  if (!isFinite(value)) return "–"
  const size = Math.abs(value)
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential(digits - 1).replace("-", "−")
  return String(Number(value.toPrecision(digits))).replace("-", "−")
}
// A stored value, with all digits that it has.
explorer.exact = (value) => String(Number(value.toPrecision(12))).replace("-", "−")

// The device's choice of light and dark, also when it changes.
const dark = window.matchMedia("(prefers-color-scheme: dark)")
explorer.setTheme = () => { document.documentElement.dataset.theme = dark.matches ? "dark" : "light" }
const LIGHTER = {"#0072B2": "#58A9E0", "#D55E00": "#F08B4A", "#009E73": "#3CC39A", "#CC79A7": "#E09CC3",
                 "#E69F00": "#EDB43A", "#56B4E9": "#8CCBF1", "#B8860B": "#D9A93A"}
const tone = (colour) => dark.matches ? LIGHTER[colour] ?? colour : colour
explorer.colour = (i) => tone(stored.colours.lines[i % stored.colours.lines.length])
explorer.threshold = () => tone(stored.colours.threshold)
explorer.setTheme()
dark.addEventListener("change", () => { explorer.setTheme(); explorer.makeRows(); explorer.draw() })

// -- what is stored -----------------------------------------------------------------------------------

const LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
const DIGIT = new Uint8Array(128)
for (let i = 0; i < 64; i++) DIGIT[LETTERS.charCodeAt(i)] = i
// Numbers between 0 and 1, of so many letters each.
const numbers = (text, count) => {
  const found = new Float64Array(text.length / count), most = 64 ** count - 1
  for (let i = 0; i < found.length; i++) {
    let value = 0
    for (let k = 0; k < count; k++) value = 64 * value + DIGIT[text.charCodeAt(count * i + k)]
    found[i] = value / most
  }
  return found
}

// Values at the times t of a line through points; of two at one time, the later one holds.
const between = (t, at, values) => {
  let k = 0
  return t.map((now) => {
    while (k + 1 < at.length && at[k + 1] <= now) k++
    if (k + 1 === at.length || at[k] === now) return values[k]
    return values[k] + (now - at[k]) / (at[k + 1] - at[k])*(values[k + 1] - values[k])
  })
}

const unpacked = new WeakMap()
// A motion as the mechanism and the figures read it: each curve has samples of its own, where it bends; here
// all have values at the times of all.
explorer.unpack = (packed) => {
  if (unpacked.has(packed)) return unpacked.get(packed)
  const [first, last] = packed.t
  const time = (text) => numbers(text, 3).map((share) => first + share*(last - first))
  const known = packed.shapes.map(([at, values]) => [time(at), numbers(values, 2)])
  const changes = Object.entries(packed.modes).map(([name, [at, modes]]) => [name, time(at), Int8Array.from(modes, (c) => DIGIT[c.charCodeAt(0)] - 1)])
  const t = Float64Array.from(new Set([first, last, ...known.flatMap(([at]) => [...at]), ...changes.flatMap(([, at]) => [...at])])).sort()
  const shapes = known.map(([at, values]) => between(t, at, values))
  const curve = ([shape, from, to]) => shape < 0 ? new Float64Array(t.length).fill(from) : shapes[shape].map((v) => from + v*(to - from))
  const q = {}, modes = {}, stick = {}, named = {}
  for (const [name, entry] of Object.entries(packed.q)) q[name] = curve(entry)
  for (const [name, at, found] of changes) modes[name] = Int8Array.from(t, (now) => found[explorer.before(at, now)])
  for (const [name, text] of Object.entries(packed.stick)) stick[name] = time(text)
  const head = {span: packed.t, end: last, scene: null}
  if (packed.places) {
    // The places stand in the order of the parts.
    let next = 0
    const put = () => {
      const entry = packed.places[next++]
      if (typeof entry === "number") return entry
      named[next] = curve(entry)
      return String(next)
    }
    const scene = stored.scenes[packed.scene]
    head.scene = {...scene, follow: put(), parts: scene.parts.map((part) => ({...part, values: Object.fromEntries(part.values.map((name) => [name, put()]))}))}
  }
  const motion = {head, t, q, modes, stick, numbers: named, packed}
  unpacked.set(packed, motion)
  return motion
}

// Least and largest value of a quantity in all stored motions, or cycles; and in one of them.
const ends = new Map()
explorer.ends = (name, kind) => {
  const key = `${kind} ${name}`
  if (!ends.has(key)) {
    const all = stored.records.flatMap((record) => record[kind] ? record[kind].q[name].slice(1) : [])
    ends.set(key, [all.reduce((a, b) => Math.min(a, b), Infinity), all.reduce((a, b) => Math.max(a, b), -Infinity)])
  }
  return ends.get(key)
}
explorer.endsOf = (name, motion) => motion.packed.q[name].slice(1).sort((a, b) => a - b)

// -- the state of the page ----------------------------------------------------------------------------------

const nearest = explorer.nearest = (slider) => slider.values.reduce((best, v, i) => Math.abs(v - slider.declared) < Math.abs(slider.values[best] - slider.declared) ? i : best, 0)
explorer.state = {
  at: stored.sliders.map(nearest),  // which value of each slider
  moved: 0,                         // the slider that varies, where only one does
  cycle: false,                     // whether one period is drawn instead of the motion
  same: {motion: true, cycle: true},  // whether the axes are the same for all points
  x: "", y: "", stick: "",          // axes of the plane, and the contact whose stick phases are marked there
  time: 0, playing: false,
}

// The number of the point at which the sliders stand.
explorer.point = (at = explorer.state.at, moved = explorer.state.moved) => {
  if (stored.together) return stored.sliders.reduce((index, slider, i) => index*slider.values.length + at[i], 0)
  return stored.sliders.slice(0, moved).reduce((sum, slider) => sum + slider.values.length, 0) + at[moved]
}
explorer.record = (...given) => stored.records[stored.points[explorer.point(...given)]]

// Where one parameter varies at a time, the others go back to their declared values.
explorer.move = (number, index) => {
  const {state} = explorer
  state.at = stored.together ? state.at.slice() : stored.sliders.map(nearest)
  state.at[number] = Math.min(Math.max(index, 0), stored.sliders[number].values.length - 1)
  state.moved = number
  explorer.draw()
}

explorer.draw = () => {
  const record = explorer.record()
  explorer.kind = explorer.state.cycle && record.cycle ? "cycle" : "motion"
  const packed = record[explorer.kind]
  explorer.motion = packed ? explorer.unpack(packed) : null
  explorer.turn = record.cycle ? explorer.unpack(record.cycle) : null
  explorer.showValues()
  explorer.showVerdicts(record)
  explorer.clock.take()
  explorer.drawFigures()
  explorer.clock.place()
}
