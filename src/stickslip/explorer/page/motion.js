// The motion: asked for at every change, drawn into the rows over the time.
//
// One set of samples (times, quantities, modes) serves the rows, the phase plane and the mechanism.
explorer.motion = null       // the last answer: {head, q, t, modes, ...}
explorer.event = 0           // when the pointer moved that the next question belongs to
explorer.redraws = []        // for measurements: [event, asked, answered, distributed] in ms

explorer.listen((kind) => {
  if (["theme", "resize", "view"].includes(kind)) return explorer.drawMotion()
  if (!["drag", "set", "model"].includes(kind)) return
  explorer.dragging = kind === "drag"
  if (kind === "model") { explorer.fitted = null; wholeTime() }
  explorer.askMotion()
})

explorer.askMotion = () => {
  explorer.ask("motion", "motion", {}, (head, numbers, event) => {
    if (head.refused) { explorer.motion = null; explorer.refuse(head.refused); explorer.showRefusal(head.refused); explorer.drawMotion(); return }
    if (head.part === "motion") {
      explorer.refuse(null)
      explorer.takeMotion(head, numbers)
      explorer.redraws.push([event, explorer.lanes.get("motion").since, performance.now()])
      if (explorer.redraws.length > 2000) explorer.redraws.shift()
    }
    if (head.part === "verdict") explorer.showVerdict(head)
  }, explorer.event || performance.now())
  explorer.event = 0
}

explorer.takeMotion = (head, numbers) => {
  document.body.classList.remove("loading", "still", "compiling")
  explorer.$("nothing").hidden = true
  const before = explorer.motion
  const q = {}, modes = {}
  for (const [name, values] of Object.entries(numbers)) {
    if (name.startsWith("q:")) q[name.slice(2)] = values
    if (name.startsWith("mode:")) modes[name.slice(5)] = values
  }
  explorer.motion = {head, numbers, q, modes, t: numbers.t}
  if (before !== null && !explorer.sameLines(before, explorer.motion)) explorer.fitted = null
  explorer.showWarnings(head.warnings)
  if (explorer.window) explorer.askWindow()
  explorer.showPending(head)
  explorer.mechanism.take()  // first: whatever is drawn places it at the times of this motion
  explorer.drawMotion()
  explorer.phase.take(before)
  explorer.clock.take(before)
}

explorer.sameLines = (one, other) => one.head.groups.length === other.head.groups.length &&
  one.head.groups.every((g, i) => g.names.join() === other.head.groups[i].names.join())

explorer.showWarnings = (warnings) => {
  const place = explorer.$("warnings")
  if (place.dataset.said === warnings.join("\n")) return
  place.dataset.said = warnings.join("\n")
  place.replaceChildren(...warnings.map((text) => explorer.element("p", {class: "notice"}, text)))
}

// -- which lines are drawn in which row --------------------------------------------------------------------

// A contact in a plane has a row for each component of its force.
const groupKey = (group) => group.contact ? `F ${group.key}` : group.names.join(" ")

explorer.shownGroups = () => {
  const groups = explorer.motion.head.groups
  const wished = explorer.state.view.rows?.split(",")
  let chosen = wished ? groups.filter((g) => wished.includes(groupKey(g))) : []
  if (chosen.length === 0) {
    const of = (kind, most) => groups.filter((g) => g.kind === kind).slice(0, most)
    const first = of("coordinate", 2)
    chosen = [...first, ...of("internal", Math.max(0, 2 - first.length)), ...of("rate", 1)]
    chosen = [...chosen.slice(0, 3), ...of("friction", 4 - Math.min(chosen.length, 3))]
  }
  return chosen.slice(0, 4)
}

explorer.drawMotion = () => {
  if (!explorer.seen("motion") || explorer.models === null) return
  const rows = [...document.querySelectorAll("#rows .row")]
  if (explorer.motion === null) {
    for (const row of rows) for (const suffix of ["lines", "stick"]) clear(`motion${row.dataset.row}_${suffix}`)
    return
  }
  const groups = explorer.shownGroups()
  // The last row has the axis of time, so rows fill from below.
  const first = rows.length - groups.length
  rows.forEach((row, i) => { row.hidden = i < first })
  const range = explorer.model("time")
  const {head} = explorer.motion
  const [low, high] = explorer.window ?? [head.span[0], head.complete ? head.span[1] : Math.max(head.end, head.span[0] + 1e-12)]
  explorer.range(range, low, high)
  groups.forEach((group, k) => drawRow(rows[first + k], group))
  explorer.showGroups(groups)
  explorer.clock.place()
}

const clear = (name) => {
  const source = explorer.model(name)
  if (source && [...source.length ? [1] : []].length) {
    explorer.setQuietly(source, {data: Object.fromEntries(source.columns().map((c) => [c, []]))})
  }
}

const drawRow = (row, group) => {
  const name = `motion${row.dataset.row}`
  // What was looked at closer may be of another model than the motion, while one of them is on its way.
  const closer = explorer.window !== null && explorer.closer !== null && group.names.every((n) => n in explorer.closer.q)
  const data = closer ? explorer.closer : explorer.motion
  const t = data.t
  const lines = {xs: [], ys: [], color: [], dash: [], width: []}
  const add = (values, color, dash, width) => {
    lines.ys.push(values); lines.color.push(color); lines.dash.push(dash); lines.width.push(width)
  }
  if (group.kind === "friction") {
    const [force, plus, minus] = group.names.map((n) => data.q[n])
    const threshold = explorer.tone(explorer.facts.colours.threshold)
    const negative = plus.map((v) => -v)
    for (const edge of [minus, negative]) add(edge, threshold, "dashed", 1.2)
    add(force, explorer.colour(0), "solid", 1.8)
  } else {
    group.names.forEach((n, i) => add(data.q[n], explorer.colour(i), "solid", 1.8))
  }
  fit(name, groupKey(group), ...explorer.ends(...lines.ys) ?? [0, 1])
  lines.ys = lines.ys.map((values) => {
    const [x, y] = explorer.thinned(name, t, values)
    lines.xs.push(x)
    return y
  })
  explorer.setQuietly(explorer.model(`${name}_lines`), {data: lines})
  const stick = explorer.motion.numbers[group.contact ? `stick:${group.contact}` : "stick"] ?? []
  const x0 = [], x1 = []
  for (let i = 0; i + 1 < stick.length; i += 2) { x0.push(stick[i]); x1.push(stick[i + 1]) }
  explorer.setQuietly(explorer.model(`${name}_stick`), {data: {x0, x1}})
  explorer.drawData?.(name, group)
  header(row, group)
}

// Ranges of values grow while a slider is dragged and shrink when it is let go, so that nothing jitters.
const fit = (name, key, low, high) => {
  const air = (high - low) * 0.07 || Math.abs(high) * 0.1 || 1
  let [first, last] = [low - air, high + air]
  explorer.fitted ??= {}
  const before = explorer.fitted[key]
  if (explorer.dragging && before) { first = Math.min(first, before[0]); last = Math.max(last, before[1]) }
  explorer.fitted[key] = [first, last]
  explorer.range(explorer.model(name).y_range, first, last)
}

const MOST_NUMBERS = 4 // lines of a row whose values have room beside their names
const header = (row, group) => {
  const {symbols, units} = explorer.motion.head
  const place = row.querySelector("header")
  const key = groupKey(group) + document.documentElement.dataset.theme
  if (place.dataset.key === key) return
  place.dataset.key = key
  const spans = group.kind === "friction"
    ? [explorer.element("span", {class: "name"}, explorer.element("i", {class: "dot", style: `--dot:${explorer.colour(0)}`}), `friction, ${group.title}`,
        explorer.element("b", {"data-value": group.names[0]})),
       explorer.element("span", {class: "name"}, explorer.element("i", {class: "dot dashed", style: `--dot:${explorer.tone(explorer.facts.colours.threshold)}`}), "threshold")]
    : group.names.map((n, i) => explorer.element("span", {class: group.names.length > MOST_NUMBERS ? "name bare" : "name"}, explorer.element("i", {class: "dot", style: `--dot:${explorer.colour(i)}`}),
        explorer.element("span", {html: symbols[n]}), explorer.element("b", {"data-value": n})))
  place.replaceChildren(...spans, explorer.element("span", {class: "unit"}, units[group.names[0]]))
}

explorer.showGroups = (shown) => {
  const place = explorer.$("groups")
  const all = explorer.motion.head.groups
  const key = all.map(groupKey).join("|") + "#" + shown.map(groupKey).join("|")
  if (place.dataset.key === key) return
  place.dataset.key = key
  const {symbols} = explorer.motion.head
  place.replaceChildren(...all.slice(0, 24).map((group) => explorer.element("button", {
    class: "chip", "aria-pressed": String(shown.includes(group)), html: group.kind === "friction" ? `friction, ${escaped(group.title)}` : group.names.slice(0, 3).map((n) => symbols[n]).join(", ") + (group.names.length > 3 ? " …" : ""),
    onclick: () => explorer.motion !== null && explorer.change("view", (state) => {
      const keys = explorer.shownGroups().map(groupKey)
      const own = groupKey(group)
      const next = keys.includes(own) ? keys.filter((k) => k !== own) : [...keys.slice(keys.length >= 4 ? 1 : 0), own]
      if (next.length) state.view.rows = next.join(",")
    })})))
}
const escaped = (text) => text.replace(/[&<>"]/g, (c) => ({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"})[c])

// -- zoom into the time ------------------------------------------------------------------------------------

explorer.window = null
explorer.closer = null
explorer.watchTime = () => {
  const range = explorer.model("time")
  range.change.connect(() => explorer.guard(() => {
    if (explorer.motion === null) return
    const [low, high] = [range.start, range.end]
    const {span, end, complete} = explorer.motion.head
    const whole = Math.abs(low - span[0]) < 1e-9 * (high - low) && Math.abs(high - (complete ? span[1] : end)) < 1e-6 * (high - low)
    const same = explorer.window && explorer.window[0] === low && explorer.window[1] === high
    if (whole || same) return
    explorer.window = [low, high]
    explorer.$("unzoom").hidden = false
    explorer.clock.place()
    lookCloser()
  }))
}
explorer.askWindow = () => {
  const [low, high] = explorer.window
  explorer.ask("window", "motion", {window: [low, high]}, (head, numbers) => {
    if (head.part !== "motion" || explorer.window === null) return
    const q = {}
    for (const [name, values] of Object.entries(numbers)) if (name.startsWith("q:")) q[name.slice(2)] = values
    explorer.closer = {numbers, q, t: numbers.t}
    explorer.drawMotion()
  })
}
const lookCloser = explorer.debounced(() => { if (explorer.window) explorer.askWindow() }, 120)
const wholeTime = () => {
  explorer.cancel("window")
  explorer.window = explorer.closer = null
  explorer.$("unzoom").hidden = true
}
explorer.$("unzoom").addEventListener("click", () => { wholeTime(); explorer.drawMotion() })

// -- what is always visible ------------------------------------------------------------------------------------

explorer.showPending = (head) => {
  const place = explorer.$("verdict")
  if (!explorer.dragging || place.dataset.state === "bad") {
    place.dataset.state = "busy"
    explorer.$("verdict-text").textContent = `${head.outcome}, ${head.switches} switches; checking`
  }
  explorer.$("taken").textContent = `computed in ${explorer.number(1000 * head.seconds, 2)} ms`
}

// No machine code came with the package for this processor.
explorer.showCompiling = () => {
  if (explorer.motion !== null) return explorer.toast("Compiling for this machine. This happens once and takes a few seconds.")
  document.body.classList.add("loading", "compiling", "still")
  explorer.$("verdict").dataset.state = "busy"
  explorer.$("verdict-text").textContent = "compiling"
}

explorer.showVerdict = (head) => {
  const place = explorer.$("verdict")
  place.dataset.state = head.certified ? "good" : "bad"
  explorer.$("verdict-text").textContent = head.certified ? `certified · ${head.outcome}` : `not certified · ${head.outcome}`
  explorer.$("verdict-numbers").replaceChildren(...head.residuals.map((r) => explorer.element("span", {class: r.ok ? "" : "over", title: r.note},
    r.name, " ", explorer.element("b", {}, r.value === null ? "not finite" : explorer.number(r.value, 2)))))
  const rows = head.rows.map(([name, text]) => explorer.element("tr", {}, explorer.element("th", {scope: "row"}, name.trim()), explorer.element("td", {}, text)))
  explorer.$("verdict-rows").replaceChildren(explorer.element("table", {}, ...rows))
}

explorer.showRefusal = (refused) => {
  document.body.classList.add("still")
  explorer.$("nothing").hidden = false
  explorer.$("nothing").querySelector("span").textContent = `${refused.reason}.`
  explorer.$("verdict").dataset.state = "refused"
  explorer.$("verdict-text").textContent = `refused · ${refused.reason}`
  explorer.$("verdict-numbers").replaceChildren()
  explorer.$("verdict-rows").replaceChildren()
  explorer.$("taken").textContent = ""
}

explorer.$("verdict-more").addEventListener("click", () => {
  const rows = explorer.$("verdict-rows")
  rows.hidden = !rows.hidden
  explorer.$("verdict-more").setAttribute("aria-expanded", String(!rows.hidden))
})
