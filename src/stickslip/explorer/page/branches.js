// The long run: branches over a parameter. Their line for the present value can be dragged; a click on a
// point shows the orbit that it stands for.
//
// What is found is curves, of whatever kind of result: variables over one of them, with what is special
// on them. Points come first, one after the other; then the curves that were made of them take their place.
explorer.branches = {found: [], over: null, hand: false}

explorer.listen((kind, state) => {
  if (kind === "model") { explorer.cancel("branch"); ended(); explorer.branches.found = []; explorer.branches.choices = null; note(""); explorer.branches.draw() }
  if (kind === "theme" || kind === "resize" || kind === "view") explorer.branches.draw()
  if (kind === "drag" || kind === "set") explorer.branches.place()
  if (explorer.seen("branch")) explorer.branches.offer()
})
const note = (...parts) => explorer.$("branch-said").replaceChildren(...parts)

// Choices of the panel stand in the address as soon as they differ from what would be chosen anyway.
explorer.offerParameters = (select, chosen, key) => {
  const names = explorer.described.parameters.map((p) => p.name)
  if (select.dataset.names !== names.join()) {
    select.dataset.names = names.join()
    select.replaceChildren(...explorer.described.parameters.map((p) => explorer.element("option", {value: p.name}, p.meaning ? `${p.name} — ${p.meaning}` : p.name)))
  }
  const wished = explorer.state.view[key]
  select.value = names.includes(wished) ? wished : names.includes(chosen) ? chosen : names[0] ?? ""
}
explorer.parameter = (name) => explorer.described?.parameters.find((p) => p.name === name)
explorer.present = (name) => {
  const set = explorer.state.values[name]
  return typeof set === "number" ? set : explorer.parameter(name)?.value ?? 0
}
// Where a parameter may reasonably go: about its value, within its range.
explorer.reach = (name) => {
  const p = explorer.parameter(name), value = explorer.present(name)
  if (!p) return [0, 1]
  const low = value > 0 ? value * 0.4 : value - Math.abs(value) - 0.5, high = value > 0 ? value * 2 : value + Math.abs(value) + 0.5
  return [Math.max(low, p.low), Math.max(Math.min(high, Math.max(p.high, value * 1.5)), value)]
}
explorer.likely = () => ["V", "P", "omega", "gamma", "shear", "Omega", "mu"].find((n) => explorer.parameter(n)) ?? explorer.described?.parameters[0]?.name

explorer.branches.offer = () => {
  if (explorer.described === null) return
  explorer.offerParameters(explorer.$("branch-over"), explorer.likely(), "over")
  const over = explorer.$("branch-over").value
  const [low, high] = explorer.reach(over)
  for (const [id, usual] of [["low", low], ["high", high]]) {
    const box = explorer.$(`branch-${id}`)
    if (document.activeElement !== box) box.value = explorer.state.view[`over.${id}`] ?? explorer.number(usual, 3).replace("−", "-")
  }
}
explorer.$("branch-over").addEventListener("change", () => explorer.change("view", (s) => {
  s.view.over = explorer.$("branch-over").value
  delete s.view["over.low"]; delete s.view["over.high"]
}))
for (const id of ["low", "high"]) explorer.$(`branch-${id}`).addEventListener("change", () => explorer.change("view", (s) => {
  s.view[`over.${id}`] = explorer.$(`branch-${id}`).value
}))

explorer.branches.follow = () => {
  const over = explorer.$("branch-over").value
  const [low, high] = ["low", "high"].map((id) => explorer.typed(explorer.$(`branch-${id}`).value))
  if (!(low < high)) return note(explorer.element("p", {class: "bad"}, "Enter a range whose end exceeds its start."))
  explorer.branches.found = []
  explorer.branches.over = over
  explorer.branches.range = [low, high]
  explorer.$("branch-empty").hidden = true
  document.body.classList.add("following")
  explorer.$("branch-go").textContent = "Stop"
  note(explorer.element("p", {class: "busy"}, "Following equilibria, then the cycle"))
  const notes = []
  explorer.ask("branch", "branch", {over, low, high}, (head, numbers) => {
    if (head.refused) notes.push(head.refused.reason)
    if (head.part === "note") { notes.push(head.text); settle(head.name, null) }
    if (head.part === "points") come(head)
    if (head.part === "curves") settle(head.name, {head, numbers})
    if (head.final) ended()
    say(notes)
    drawSoon()
  })
}

// Curves take the place of the points that came before them, if there are curves.
const settle = (name, curves) => {
  const {found} = explorer.branches
  const at = found.findIndex(({head}) => head.name === name)
  found.splice(at < 0 ? found.length : at, at < 0 ? 0 : 1, ...(curves === null ? [] : [curves]))
}
// Points on the way look like curves: those behind the start, from far to near, then those ahead of it.
const come = ({name, over, points}) => {
  const {found} = explorer.branches
  let own = found.find(({head}) => head.name === name)
  if (own === undefined) {
    const variables = Object.fromEntries(Object.keys(points[0].values).map((key) => [key, {unit: "", meaning: ""}]))
    found.push(own = {head: {name, over, variables, special: [], coming: true}, back: [], forth: []})
  }
  for (const {side, values} of points) (side < 0 ? own.back : own.forth).push(values)
  const all = [...[...own.back].reverse(), ...own.forth]
  own.numbers = Object.fromEntries(Object.keys(own.head.variables).map((key) => [`b:${key}`, all.map((values) => values[key])]))
}
const say = (notes) => {
  const {found} = explorer.branches
  const hint = (text) => explorer.element("p", {class: "hint"}, text)
  const special = found.flatMap(({head}, b) => head.special.map((s) => explorer.element("p", {},
    explorer.element("button", {class: "quiet link", onclick: () => explorer.branches.goTo(b, s.index)}, s.kind), ` ${s.text.replace(s.kind, "")}`)))
  const about = found.map(({head, numbers}) => head.coming
    ? explorer.element("p", {class: "busy"}, `${head.name}: ${numbers[`b:${head.over}`].length} points${document.body.classList.contains("following") ? "" : ", stopped"}`)
    : hint(`${head.name}: ${head.verdict}; ${head.message.split("\n").at(-1)}`))
  note(...special, ...about, ...notes.map(hint))
}
let due = false
const drawSoon = () => {
  if (due) return
  due = true
  requestAnimationFrame(() => { due = false; explorer.guard(explorer.branches.draw) })
}
const ended = () => { document.body.classList.remove("following"); explorer.$("branch-go").textContent = "Follow" }
explorer.$("branch-go").addEventListener("click", () => {
  if (document.body.classList.contains("following")) { explorer.cancel("branch"); ended(); say([]) }
  else explorer.branches.follow()
})

// What is drawn over the parameter: the quantities that all branches know come first.
explorer.branches.offerQuantities = () => {
  const {found} = explorer.branches
  const select = explorer.$("branch-of")
  const key = found.map(({head}) => Object.keys(head.variables).join()).join("|")
  if (explorer.branches.choices === key) return select.value
  explorer.branches.choices = key
  const hidden = new Set(["stable", "certified", "differentiable", "sticks", "phases", "step", "residual", "defect", "margin", "eigenvalue_error", explorer.branches.over])
  const names = [...new Set(found.flatMap(({head}) => Object.keys(head.variables)))].filter((n) => !hidden.has(n) && !/^(min_|mode_)/.test(n))
  const known = (n) => found.filter(({head}) => n in head.variables).length
  names.sort((a, b) => known(b) - known(a))
  select.replaceChildren(...names.map((n) => explorer.element("option", {value: n}, n.startsWith("max_") ? `range of ${n.slice(4)}` : n.replaceAll("_", " "))))
  const range = names.find((n) => n.startsWith("max_"))
  select.value = names.includes(explorer.state.view.of) ? explorer.state.view.of : range ?? names[0] ?? ""
  return select.value
}
explorer.$("branch-of").addEventListener("change", () => explorer.change("view", (s) => { s.view.of = explorer.$("branch-of").value }))

explorer.branches.draw = () => {
  if (!explorer.seen("branch") || explorer.models === null) return
  explorer.branches.offer()
  const lines = {xs: [], ys: [], color: [], dash: [], width: []}
  const points = {x: [], y: [], color: []}
  const special = {x: [], y: [], color: [], marker: [], size: [], fill: []}
  const {found, over} = explorer.branches
  explorer.$("branch-empty").hidden = found.length > 0 || document.body.classList.contains("following")
  const of = found.length ? explorer.branches.offerQuantities() : ""
  explorer.branches.shown = []
  found.forEach(({head, numbers}, b) => {
    const x = numbers[`b:${over}`]
    const base = of.replace(/^max_/, "")
    const curves = of.startsWith("max_") ? [numbers[`b:${of}`], numbers[`b:min_${base}`]].filter(Boolean) : [numbers[`b:${of}`]].filter(Boolean)
    if (curves.length === 0 && numbers[`b:${base}`]) curves.push(numbers[`b:${base}`])
    const stable = numbers["b:stable"]
    const color = explorer.colour(b)
    for (const y of curves) {
      // Runs of one stability, each up to the first point of the next.
      for (let from = 0; from < x.length - 1;) {
        let to = from
        while (to + 1 < x.length && (stable === undefined || stable[to + 1] === stable[from])) to++
        const last = Math.min(to + 1, x.length - 1)
        lines.xs.push(x.slice(from, last + 1)); lines.ys.push(y.slice(from, last + 1)); lines.color.push(color)
        lines.dash.push(stable !== undefined && stable[from] !== 1 ? "dashed" : "solid")
        lines.width.push(stable !== undefined && stable[from] !== 1 ? 1.5 : 2.4)
        from = last === from ? from + 1 : last
      }
      for (let i = 0; i < x.length; i++) { points.x.push(x[i]); points.y.push(y[i]); points.color.push(color); explorer.branches.shown.push([x[i], y[i], b, i]) }
      for (const s of head.special) {
        if (s.index < 0 || s.index >= x.length) continue
        special.x.push(x[s.index]); special.y.push(y[s.index]); special.color.push(explorer.ink())
        special.marker.push(/Hopf/.test(s.kind) ? "diamond" : /fold/.test(s.kind) ? "square" : "triangle"); special.fill.push(color); special.size.push(11)
      }
    }
  })
  explorer.setQuietly(explorer.model("branch_lines"), {data: lines})
  explorer.setQuietly(explorer.model("branch_points"), {data: points})
  explorer.setQuietly(explorer.model("branch_special"), {data: special})
  if (explorer.branches.range && found.length) {
    const plot = explorer.model("branch")
    const [a, b] = explorer.branches.range
    const air = 0.03 * (b - a)
    explorer.range(plot.x_range, a - air, b + air)
    const [low, high] = explorer.ends(...lines.ys) ?? [0, 1]
    const up = 0.07 * (high - low) || 1
    explorer.range(plot.y_range, low - up, high + up)
  }
  requestAnimationFrame(() => explorer.guard(explorer.branches.place))
}

explorer.branches.place = () => {
  const handle = explorer.$("branch-now")
  const frame = explorer.frame("branch")
  const {over, found} = explorer.branches
  if (frame === null || !explorer.seen("branch") || found.length === 0) { handle.hidden = true; return }
  const value = explorer.present(over)
  const {x_range} = frame.plot
  const share = (value - x_range.start) / (x_range.end - x_range.start)
  handle.hidden = !(share >= 0 && share <= 1)
  handle.style.transform = `translateX(${frame.box.left + share * frame.box.width}px)`
  handle.style.top = `${frame.box.top}px`
  handle.style.height = `${frame.box.height}px`
  handle.dataset.text = `${over} = ${explorer.number(value, 4)}`
  handle.setAttribute("aria-valuenow", value)
}

const moveTo = (event, kind) => {
  const frame = explorer.frame("branch")
  if (frame === null) return
  const edge = document.querySelector("section.branch .hold").getBoundingClientRect()
  const {x_range} = frame.plot
  const share = Math.min(Math.max((event.clientX - edge.left - frame.box.left) / frame.box.width, 0), 1)
  const value = Number((x_range.start + share * (x_range.end - x_range.start)).toPrecision(5))
  explorer.event = event.timeStamp
  explorer.change(kind, (state) => { state.values[explorer.branches.over] = value })
}
explorer.$("branch-now").addEventListener("pointerdown", (event) => { event.currentTarget.setPointerCapture(event.pointerId); explorer.branches.hand = true; event.preventDefault() })
explorer.$("branch-now").addEventListener("pointermove", (event) => { if (explorer.branches.hand) explorer.guard(() => moveTo(event, "drag")) })
explorer.$("branch-now").addEventListener("pointerup", (event) => { if (explorer.branches.hand) { explorer.branches.hand = false; explorer.guard(() => moveTo(event, "set")) } })
explorer.$("branch-now").addEventListener("keydown", (event) => {
  const by = {ArrowRight: 1, ArrowLeft: -1}[event.key]
  if (!by) return
  event.preventDefault(); event.stopPropagation()
  const {over} = explorer.branches
  explorer.change("set", (s) => { s.values[over] = Number((explorer.present(over) + by * (explorer.parameter(over)?.step ?? 0.01)).toPrecision(12)) })
})

// A point of a branch: its value of the parameter, and its state as the initial one.
explorer.branches.goTo = (b, i) => {
  const {head, numbers} = explorer.branches.found[b]
  explorer.change("set", (state) => {
    state.values[head.over] = numbers[`b:${head.over}`][i]
    for (const {name} of explorer.described.initial) if (numbers[`b:${name}`]) state.initial[name] = numbers[`b:${name}`][i]
  })
  explorer.toast(`${head.name}: ${head.over} = ${explorer.number(numbers[`b:${head.over}`][i])}; its orbit is shown`)
}
explorer.branches.watch = () => explorer.clicked("branch", (sx, sy, frame) => {
  let best = null
  for (const [x, y, b, i] of explorer.branches.shown ?? []) {
    const {x_range, y_range} = frame.plot
    const dx = frame.box.left + (x - x_range.start) / (x_range.end - x_range.start) * frame.box.width - sx
    const dy = frame.box.bottom - (y - y_range.start) / (y_range.end - y_range.start) * frame.box.height - sy
    const distance = Math.hypot(dx, dy)
    if (distance < 18 && (best === null || distance < best[0])) best = [distance, b, i]
  }
  if (best) explorer.branches.goTo(best[1], best[2])
})
