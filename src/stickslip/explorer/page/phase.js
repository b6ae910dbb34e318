// The plane of two quantities: the motion, a ghost of the one before, what it settles on. A click starts
// a motion there.
explorer.phase = {ghost: null, settled: null, zoomed: false}

explorer.listen((kind) => {
  if (kind === "model") { explorer.cancel("plane"); zoom(false); explorer.phase.ghost = explorer.phase.settled = null; explorer.phase.base = null }
  if (kind === "drag" || kind === "set") explorer.phase.outdated()
  if (kind === "view" || kind === "resize" || kind === "theme") explorer.phase.draw()
  if (kind === "set") explorer.phase.settleSoon()
})

explorer.phase.axes = () => {
  const {states, groups} = explorer.motion.head
  const coordinate = groups.find((g) => g.kind === "coordinate")?.names[0] ?? states[0]
  const {x, y} = explorer.state.view
  const known = (name) => name in explorer.motion.q
  const across = known(x) ? x : coordinate
  const up = known(y) ? y : known(`d_${across}`) ? `d_${across}` : states.find((n) => n !== across) ?? across
  return [across, up]
}

// The ghost is the motion that stood when the last change began.
explorer.phase.take = (before) => {
  if (before !== null && !explorer.dragging) explorer.phase.ghost = explorer.phase.base
  if (!explorer.dragging) explorer.phase.base = explorer.motion
  else explorer.phase.ghost = explorer.phase.base
  explorer.phase.choices()
  explorer.phase.draw()
}

explorer.phase.choices = () => {
  const names = Object.keys(explorer.motion.q).filter((n) => !n.startsWith("threshold_"))
  const [across, up] = explorer.phase.axes()
  for (const [id, chosen] of [["phase-x", across], ["phase-y", up]]) {
    const select = explorer.$(id)
    if (select.dataset.names !== names.join()) {
      select.dataset.names = names.join()
      select.replaceChildren(...names.map((n) => explorer.element("option", {value: n}, explorer.motion.head.plain[n])))
    }
    if (select.value !== chosen) select.value = chosen
  }
}
for (const [id, key] of [["phase-x", "x"], ["phase-y", "y"]]) {
  explorer.$(id).addEventListener("change", () => {
    explorer.phase.fitted = null
    zoom(false)
    explorer.change("view", (state) => { state.view[key] = explorer.$(id).value })
  })
}

explorer.phase.draw = () => {
  if (!explorer.seen("phase") || explorer.models === null || explorer.motion === null) return
  const [across, up] = explorer.phase.axes()
  const {q, t, numbers} = explorer.motion
  const x = q[across], y = q[up]
  fitPlane(across, up, x, y)
  const lines = {xs: [], ys: [], color: [], width: [], alpha: []}
  addCurve(lines, t, x, y, numbers.stick ?? [])
  explorer.setQuietly(explorer.model("phase_lines"), {data: lines})
  const old = explorer.phase.ghost
  const wanted = explorer.$("ghost").getAttribute("aria-pressed") === "true"
  const ghost = wanted && old && old !== explorer.motion && across in old.q && up in old.q
  const grey = explorer.dark() ? "#6A757E" : "#9AA4AC"
  const shadow = {xs: [], ys: [], color: [], width: [], alpha: []}
  const key = ghost ? `${across}|${up}|${grey}|${scale()}` : "none"
  if (explorer.phase.ghostDrawn !== key || explorer.phase.ghostOf !== old) {
    explorer.phase.ghostDrawn = key
    explorer.phase.ghostOf = old
    if (ghost) addLine(shadow, old.q[across], old.q[up], grey, 1, 0.9)
    explorer.setQuietly(explorer.model("phase_ghost"), {data: shadow})
  }
  explorer.phase.drawSettled(across, up)
  explorer.phase.drawnAt = scale()
  explorer.clock.place()
}
// Lines are as fine as the figure shows them: zoomed, they are drawn anew.
const scale = () => {
  const {x_range, y_range} = explorer.model("phase")
  return [x_range.end - x_range.start, y_range.end - y_range.start].map((w) => w.toPrecision(6)).join()
}
const drawFiner = explorer.debounced(() => {
  if (explorer.motion !== null && explorer.phase.drawnAt !== scale()) explorer.phase.draw()
}, 120)
// A view that a person has chosen stays until the whole plane is asked for.
const zoom = (on) => { explorer.phase.zoomed = on; explorer.$("phase-whole").hidden = !on }
explorer.$("phase-whole").addEventListener("click", () => { zoom(false); explorer.phase.draw() })
explorer.phase.watchView = () => {
  const {x_range, y_range} = explorer.model("phase")
  for (const range of [x_range, y_range]) range.change.connect(() => explorer.guard(() => {
    const {fitted} = explorer.phase
    if (!fitted || explorer.motion === null) return
    const own = [x_range.start, x_range.end, y_range.start, y_range.end].every((end, i) => end === [...fitted.a, ...fitted.b][i])
    if (!own && !fitting) { zoom(true); drawFiner() }
  }))
}
const addLine = (lines, xs, ys, color, width, alpha) => {
  const [x, y] = explorer.thinned("phase", xs, ys)
  lines.xs.push(x); lines.ys.push(y); lines.color.push(color); lines.width.push(width); lines.alpha.push(alpha)
}

// The curve in two: what slips, and what sticks, in ink. While a slider is dragged lines are hairlines, which
// browsers draw ten times as fast.
const addCurve = (lines, t, x, y, stick) => {
  const parts = [[[], []], [[], []]]
  const go = (part, from, to) => {
    const [xs, ys] = parts[part]
    if (to <= from) return
    if (xs.length) { xs.push(NaN); ys.push(NaN) }
    for (let i = from; i <= to; i++) { xs.push(x[i]); ys.push(y[i]) }
  }
  let i = 0
  for (let k = 0; k + 1 < stick.length; k += 2) {
    const from = i
    while (i < t.length - 1 && t[i] < stick[k]) i++
    go(0, from, i)
    const held = i
    while (i < t.length - 1 && t[i + 1] <= stick[k + 1]) i++
    go(1, held, i)
  }
  go(0, i, t.length - 1)
  const [slips, sticks] = explorer.dragging ? [1, 1] : [1.6, 2.2]
  addLine(lines, ...parts[0], explorer.colour(0), slips, 1)
  addLine(lines, ...parts[1], explorer.ink(), sticks, 1)
}

const fitPlane = (across, up, x, y) => {
  const ends = (values) => {
    const [low, high] = explorer.ends(values) ?? [0, 1]
    const air = (high - low) * 0.06 || Math.abs(high) * 0.1 || 1
    return [low - air, high + air]
  }
  const key = `${across}|${up}`
  if (explorer.phase.zoomed) return
  let [a, b] = [ends(x), ends(y)]
  const before = explorer.phase.fitted
  if (explorer.dragging && before?.key === key) {
    a = [Math.min(a[0], before.a[0]), Math.max(a[1], before.a[1])]
    b = [Math.min(b[0], before.b[0]), Math.max(b[1], before.b[1])]
  }
  explorer.phase.fitted = {key, a, b}
  const plot = explorer.model("phase")
  fitting = true
  explorer.range(plot.x_range, ...a)
  explorer.range(plot.y_range, ...b)
  fitting = false
}
let fitting = false

// -- what it settles on ------------------------------------------------------------------------------------

explorer.phase.outdated = () => { explorer.phase.settled = null }
explorer.phase.wantsLongRun = () => explorer.state.view.settle === "1"
explorer.phase.settle = () => {
  if (!explorer.phase.wantsLongRun() || !explorer.seen("phase")) return
  explorer.$("phase-said").replaceChildren(explorer.element("span", {class: "busy"}, "Computing equilibria and a cycle"))
  explorer.ask("plane", "plane", {}, (head, numbers) => {
    if (head.refused) { explorer.$("phase-said").textContent = head.refused.reason; return }
    if (head.part === "plane") {
      explorer.phase.settled = {head, numbers}
      explorer.phase.draw()
    }
  })
}
explorer.phase.settleSoon = explorer.debounced(() => explorer.phase.settle(), 500)

explorer.phase.drawSettled = (across, up) => {
  const found = explorer.phase.wantsLongRun() ? explorer.phase.settled : null
  const lines = {xs: [], ys: [], color: [], width: [], alpha: []}
  const spots = {x: [], y: [], color: [], marker: [], size: [], fill: []}
  const section = {x: [], y: [], color: [], marker: [], size: [], fill: []}
  const said = []
  if (found) {
    const {head, numbers} = found
    for (const e of head.equilibria) {
      if (across in e.state && up in e.state) {
        spots.x.push(e.state[across]); spots.y.push(e.state[up]); spots.marker.push(e.stable ? "circle" : "x")
        spots.color.push(explorer.colour(1)); spots.size.push(11); spots.fill.push(e.stable ? explorer.colour(1) : "transparent")
      }
      said.push(explorer.element("p", {}, explorer.element("i", {class: "sign"}, e.stable ? "●" : "×"), ` ${e.text}`))
    }
    if (head.cycle) {
      const x = numbers[`c:${across}`], y = numbers[`c:${up}`]
      if (x && y) {
        lines.xs.push(x); lines.ys.push(y); lines.color.push(explorer.colour(2)); lines.width.push(3.5); lines.alpha.push(0.85)
        section.x.push(x[0]); section.y.push(y[0]); section.marker.push("diamond"); section.color.push(explorer.colour(2)); section.size.push(10); section.fill.push(explorer.colour(2))
      }
      said.push(explorer.element("p", {}, explorer.element("i", {class: "sign cycle"}, "◆"), ` ${head.cycle}`))
    }
    for (const text of head.notes) said.push(explorer.element("p", {class: "hint"}, text))
    const sx = numbers[`p:${across}`], sy = numbers[`p:${up}`]
    if (sx && sy) for (let i = 0; i < sx.length; i++) {
      section.x.push(sx[i]); section.y.push(sy[i]); section.marker.push("circle"); section.color.push(explorer.colour(3)); section.size.push(5); section.fill.push(explorer.colour(3))
    }
  }
  const key = `${found ? "found" : "none"}|${across}|${up}|${document.documentElement.dataset.theme}`
  if (explorer.phase.settledDrawn === key && explorer.phase.settledOf === found) return
  explorer.phase.settledDrawn = key
  explorer.phase.settledOf = found
  explorer.setQuietly(explorer.model("phase_cycle"), {data: lines})
  explorer.setQuietly(explorer.model("phase_spots"), {data: spots})
  explorer.setQuietly(explorer.model("phase_section"), {data: section})
  if (found || !explorer.phase.wantsLongRun()) explorer.$("phase-said").replaceChildren(...said)
}

const toggle = (button, on) => button.setAttribute("aria-pressed", String(on))
explorer.$("ghost").addEventListener("click", () => {
  const on = explorer.$("ghost").getAttribute("aria-pressed") !== "true"
  explorer.change("view", (state) => { if (on) delete state.view.ghost; else state.view.ghost = "0" })
})
explorer.$("settle").addEventListener("click", () => {
  const on = !explorer.phase.wantsLongRun()
  explorer.change("view", (state) => { if (on) state.view.settle = "1"; else delete state.view.settle })
  if (on) explorer.phase.settle(); else explorer.cancel("plane")
})
explorer.listen((kind, state) => {
  toggle(explorer.$("ghost"), state.view.ghost !== "0")
  toggle(explorer.$("settle"), state.view.settle === "1")
  if (kind === "model") explorer.phase.settleSoon()
})

// -- pointing --------------------------------------------------------------------------------------------------

// A click (not a drag, which moves the view) into the axes of a figure, once it has been drawn.
explorer.clicked = (name, act) => {
  const place = document.querySelector(`section.${name} .hold`)
  let down = null
  place.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY] }, true)
  place.addEventListener("pointerup", (event) => explorer.guard(() => {
    if (down === null || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4) return
    const frame = explorer.frame(name)
    if (frame === null) return
    const edge = place.getBoundingClientRect()
    const [sx, sy] = [event.clientX - edge.left, event.clientY - edge.top]
    const {box} = frame
    if (sx < box.left || sx > box.right || sy < box.top || sy > box.bottom) return
    explorer.event = event.timeStamp
    act(sx, sy, frame)
  }), true)
}

// Here it sets the initial values of the quantities on the axes.
explorer.phase.watch = () => explorer.clicked("phase", (sx, sy, {box, plot: {x_range, y_range}}) => {
  if (explorer.motion === null) return
  const at = [x_range.start + (sx - box.left) / box.width * (x_range.end - x_range.start),
              y_range.end - (sy - box.top) / box.height * (y_range.end - y_range.start)]
  const pixels = [(x_range.end - x_range.start) / box.width, (y_range.end - y_range.start) / box.height]
  const [across, up] = explorer.phase.axes()
  const {states} = explorer.motion.head
  if (!states.includes(across) && !states.includes(up)) return explorer.toast("To set the start with a click, choose coordinates or rates as axes.")
  explorer.change("set", (state) => {
    [across, up].forEach((name, i) => {
      if (!states.includes(name)) return
      // As many digits as a pixel is worth.
      const digits = Math.max(0, 1 - Math.floor(Math.log10(pixels[i])))
      state.initial[name] = Number(at[i].toFixed(Math.min(digits, 15)))
    })
  })
})
