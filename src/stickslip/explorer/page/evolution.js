// A rate-independent evolution of one's own in the panel of effective friction: K(s) as it moves with the
// phase, what all have in common, the motion with oscillating friction and that of the average.
explorer.evolution = {sets: null, averaged: null, resolved: null, refused: null}
const LIMIT = "~"  // the choice that shows motions; others are components

explorer.listen((kind, state) => {
  explorer.$("evolution-end").hidden = explorer.$("evolution-values").hidden = state.evolution === ""
  explorer.$("friction-go").hidden = state.evolution !== ""
  if (kind === "evolution") { explorer.showValues(); explorer.evolution.soon() }
  if (state.evolution === "") return
  if (kind === "model" || kind === "set") {
    // Another text, or other numbers, by the address or by undo.
    if (explorer.evolution.asked !== asking()) explorer.evolution.soon()
  } else if (kind === "view" && explorer.seen("friction")) {
    if (explorer.evolution.asked !== asking()) explorer.evolution.look()
    else explorer.evolution.draw()
  } else if (kind === "theme" || kind === "resize") explorer.evolution.draw()
})
const asking = () => JSON.stringify([explorer.state.evolution, explorer.state.given])

explorer.evolution.take = (text) => explorer.change("view", (state) => {
  state.evolution = text
  state.given = {}
  state.panel = "friction"
  delete state.view.contact
})
explorer.$("evolution-file").addEventListener("change", async () => {
  const file = explorer.$("evolution-file").files[0]
  if (file && file.size < 200000) explorer.evolution.take(await file.text())
})
explorer.$("evolution-end").addEventListener("click", () => {
  explorer.change("view", (state) => { state.evolution = ""; state.given = {}; delete state.view.contact })
  explorer.friction.asked = null
  explorer.friction.draw()
})

explorer.evolution.look = () => {
  if (explorer.state.evolution === "" || !explorer.seen("friction")) return
  explorer.evolution.asked = asking()
  const {evolution: toml, given: values} = explorer.state
  explorer.evolution.averaged = explorer.evolution.resolved = explorer.evolution.refused = null
  explorer.ask("evolution", "evolution", {toml, values}, (head, numbers) => {
    if (explorer.state.evolution !== toml) return  // of another one
    if (head.refused) { explorer.evolution.refused = head.refused; explorer.evolution.sets = null }
    else if (head.part) explorer.evolution[head.part] = {head, numbers}
    if (head.part === "sets") showParameters(head.parameters)
    explorer.evolution.draw()
  })
}
explorer.evolution.soon = explorer.debounced(() => explorer.evolution.look(), 60)

let shown = ""
const showParameters = (parameters) => {
  const key = parameters.map((p) => p.name).join() + explorer.state.evolution
  if (shown === key) return
  shown = key
  explorer.fill("evolution-values", parameters.map((p) => explorer.valueRow(p, "given")))
  explorer.showValues()
}

explorer.evolution.draw = () => {
  if (!explorer.seen("friction") || explorer.models === null || explorer.state.evolution === "") return
  const {sets, averaged, resolved, refused} = explorer.evolution
  const lines = {xs: [], ys: [], color: [], dash: [], width: []}
  const average = {y0: [], y1: [], color: []}
  const plane = {xs: [], ys: [], color: [], dash: [], width: []}
  const second = sets !== null && "common" in sets.numbers
  explorer.$("friction-second").hidden = !second
  document.querySelector(".friction .figure").classList.toggle("void", sets === null)
  if (refused) say([explorer.element("p", {class: "bad"}, `${refused.where ? `${refused.where}: ` : ""}${refused.reason}. ${refused.remedy}`)])
  else if (sets === null) say([explorer.element("p", {class: "busy"}, "Loading the evolution")])
  if (sets !== null) {
    const chosen = offer(sets.head)
    explorer.$("friction-caption").textContent = chosen === LIMIT ? `${sets.head.names.join(", ")} over t` : "force over the phase s"
    explorer.$("forces-caption").textContent = `force on ${sets.head.names.slice(0, 2).join(" (horizontal) and on ")} (vertical)`
    if (chosen === LIMIT) drawMotions(lines, sets, averaged, resolved)
    else drawCosts(lines, average, sets, resolved, Number(chosen))
    if (second) drawPlane(plane, sets, resolved)
    if (!refused) say(words(sets, averaged, resolved, chosen))
  }
  const empty = (name) => Object.fromEntries(explorer.model(name).columns().map((column) => [column, []]))
  explorer.setQuietly(explorer.model("friction_lines"), {data: lines})
  explorer.setQuietly(explorer.model("friction_average"), {data: average})
  explorer.setQuietly(explorer.model("friction_slip"), {data: empty("friction_slip")})
  explorer.setQuietly(explorer.model("forces_lines"), {data: plane})
  explorer.setQuietly(explorer.model("forces_sets"), {data: empty("forces_sets")})
}
const say = (parts) => explorer.$("friction-said").replaceChildren(...parts)

const offer = (head) => {
  const select = explorer.$("friction-contact")
  const choices = [...(head.moves ? [[LIMIT, "the motion and its limit"]] : []), ...head.names.map((name, i) => [String(i), `cost of ${name}`])]
  const key = `evolution ${choices.join("|")}`
  if (select.dataset.names !== key) {
    select.dataset.names = key
    select.replaceChildren(...choices.map(([value, text]) => explorer.element("option", {value}, text)))
  }
  const wished = explorer.state.view.contact
  select.value = choices.some(([value]) => value === wished) ? wished : choices[0][0]
  return select.value
}

const put = (lines, name, x, y, color, dash, width) => {
  const [xs, ys] = explorer.thinned(name, x, y)
  lines.xs.push(xs); lines.ys.push(ys); lines.color.push(color); lines.dash.push(dash); lines.width.push(width)
}
const ends = (...many) => explorer.ends(...many) ?? [0, 1]
const fit = (plot, x, y) => {
  const [[a, b], [c, d]] = [x, y]
  const air = 0.07 * (d - c) || 1
  explorer.range(plot.x_range, a, b)
  explorer.range(plot.y_range, c - air, d + air)
}

// z with oscillating friction in full lines, that of the average dashed.
const drawMotions = (lines, sets, averaged, resolved) => {
  const there = [resolved, averaged].filter((part) => part?.numbers?.t)
  if (there.length === 0) return
  const all = there.flatMap(({numbers}) => sets.head.names.map((_, i) => numbers[`z:${i}`]))
  fit(explorer.model("friction"), ends(there[0].numbers.t), ends(...all))
  for (const part of there) sets.head.names.forEach((_, i) => {
    const {numbers} = part
    put(lines, "friction", numbers.t, numbers[`z:${i}`], explorer.colour(i), part === averaged ? "dashed" : "solid", part === averaged ? 1.6 : 1.8)
  })
}

// Over a phase: what it costs to move forwards and backwards, the force that is held, and the average as a band.
const drawCosts = (lines, average, sets, resolved, i) => {
  const {numbers, head} = sets
  const plus = numbers[`plus:${i}`], below = numbers[`minus:${i}`].map((v) => -v)
  fit(explorer.model("friction"), [0, 1], ends(plus, below))
  const edge = explorer.tone(explorer.facts.colours.threshold)
  for (const values of [plus, below]) put(lines, "friction", numbers.s, values, edge, "solid", 1.8)
  average.y0.push(-head.costs[i].minus); average.y1.push(head.costs[i].plus); average.color.push(explorer.colour(2))
  if (!resolved?.numbers?.t) return
  const {phase, [`force:${i}`]: force} = resolved.numbers
  const x = [], y = []
  phase.forEach((s, k) => { if (k && s < phase[k - 1]) { x.push(NaN); y.push(NaN) } x.push(s); y.push(force[k]) })
  put(lines, "friction", x, y, explorer.colour(0), "solid", 1)
}

const drawPlane = (lines, sets, resolved) => {
  const {numbers} = sets
  const halves = (array) => [array.subarray(0, array.length / 2), array.subarray(array.length / 2)]
  const borders = Object.keys(numbers).filter((name) => name.startsWith("set:")).map((name) => halves(numbers[name]))
  const common = halves(numbers.common)
  // As long across as up.
  const [left, right] = ends(...borders.map(([x]) => x)), [low, high] = ends(...borders.map(([, y]) => y))
  const frame = explorer.frame("forces"), plot = explorer.model("forces")
  const ratio = frame ? frame.box.width / frame.box.height : 1
  const tall = 1.1 * Math.max(high - low, (right - left) / ratio) / 2
  explorer.range(plot.x_range, (left + right) / 2 - tall * ratio, (left + right) / 2 + tall * ratio)
  explorer.range(plot.y_range, (low + high) / 2 - tall, (low + high) / 2 + tall)
  for (const [x, y] of borders) put(lines, "forces", x, y, explorer.tone(explorer.facts.colours.threshold), "solid", 1)
  if (resolved?.numbers?.t) put(lines, "forces", resolved.numbers["force:0"], resolved.numbers["force:1"], explorer.colour(0), "solid", 1)
  put(lines, "forces", ...common, explorer.colour(2), "solid", 3)
}

const words = (sets, averaged, resolved, chosen) => {
  const n = explorer.number
  const {head} = sets
  const found = [explorer.element("p", {}, explorer.element("strong", {}, head.title), head.source ? ` · ${head.source}` : "")]
  const costs = head.costs.map((c, i) => `${head.names[i]}: ${n(c.plus)} forwards, ${n(c.minus)} backwards (mean over the phases ${n(c.mean)}), smallest at the phase ${n(c.plus_at, 3)}` + (c.plus_at === c.minus_at ? "" : ` and ${n(c.minus_at, 3)}`))
  found.push(explorer.element("p", {html: `<i>Ψ</i><sub>av</sub> of a unit motion: ${costs.map(escapeText).join("; ")}.`}))
  for (const [name, part] of [["average", averaged], ["motion", resolved]]) {
    if (part === null) { if (head.moves) found.push(explorer.element("p", {class: "busy"}, `${name}: computing`)) }
    else found.push(explorer.element("p", {class: part.head.reason ? "bad" : "hint"}, part.head.reason ?? `${name}: ${part.head.outcome}, ${part.head.verdict}`))
  }
  const far = distance(averaged, resolved, head.names.length)
  if (far !== null) found.push(explorer.element("p", {}, `Largest distance between the motion and its averaged limit: ${n(far, 3)}.`))
  found.push(explorer.element("p", {class: "hint"}, chosen === LIMIT ? "Solid lines: oscillating friction. Dashed lines: averaged friction." : "Green: intersection over all phases. Line: the friction force as a function of the phase."))
  return found
}
const escapeText = (text) => text.replace(/[&<>]/g, (c) => ({"&": "&amp;", "<": "&lt;", ">": "&gt;"})[c])

// sup |z - z_0| over the times of the motion.
const distance = (averaged, resolved, count) => {
  if (!averaged?.numbers?.t || !resolved?.numbers?.t) return null
  const [own, other] = [resolved.numbers, averaged.numbers]
  let worst = 0, k = 0
  own.t.forEach((t, j) => {
    while (k < other.t.length - 2 && other.t[k + 1] <= t) k++
    const share = (t - other.t[k]) / (other.t[k + 1] - other.t[k] || 1)
    let square = 0
    for (let i = 0; i < count; i++) {
      const z = other[`z:${i}`]
      square += (own[`z:${i}`][j] - z[k] - share * (z[k + 1] - z[k])) ** 2
    }
    worst = Math.max(worst, Math.sqrt(square))
  })
  return worst
}
