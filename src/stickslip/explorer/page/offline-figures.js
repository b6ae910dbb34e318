// The figures, as SVG: rows over the time, and the plane of two quantities.
const {svg, element, number} = explorer
const {lines} = explorer.stored
const LEFT = 62, RIGHT = 12
const left = () => window.innerWidth < 700 ? 46 : LEFT

const ticks = (low, high, count) => {
  const rough = (high - low) / count
  const power = 10 ** Math.floor(Math.log10(rough))
  const step = [1, 2, 5, 10].map((m) => m*power).find((s) => s >= rough*0.999)
  const found = []
  for (let i = Math.ceil(low / step - 1e-9); i*step <= high + 1e-9*step; i++) found.push(i*step)
  return found
}
const tickText = (values) => {
  const largest = Math.max(...values.map(Math.abs))
  const power = largest === 0 ? 0 : Math.floor(Math.log10(largest))
  const plain = power > -4 && power < 5
  return values.map((v) => {
    const text = String(Number((plain ? v : v / 10 ** power).toPrecision(6))).replace("-", "−")
    return plain || v === 0 ? text : `${text}e${power < 0 ? "−" : ""}${Math.abs(power)}`
  })
}

const airy = ([low, high], part = 0.06) => {
  const air = (high - low)*part || Math.abs(high)*0.1 || 1
  return [low - air, high + air]
}
const union = (all) => [Math.min(...all.map((e) => e[0])), Math.max(...all.map((e) => e[1]))]
const rangeOf = (names) => airy(union(names.map((name) => {
  const {motion, turn, state, kind} = explorer
  if (state.same[kind]) return explorer.ends(name, kind)
  return union([motion, turn].filter(Boolean).map((one) => explorer.endsOf(name, one)))
})))

// An empty figure: its frame, and where numbers are in it.
const frame = (host, across, up, options) => {
  const width = host.clientWidth || 600, height = host.clientHeight
  const box = {left: left(), right: width - RIGHT, top: options.name ? 22 : 6, bottom: height - (options.axis ? (options.name ? 36 : 22) : 6)}
  const x = (v) => box.left + (v - across[0]) / (across[1] - across[0])*(box.right - box.left)
  const y = (v) => box.bottom - (v - up[0]) / (up[1] - up[0])*(box.bottom - box.top)
  const root = svg("svg", {viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": options.about})
  const add = (...nodes) => root.append(...nodes)
  const clip = `clip-${host.id || options.id}`
  add(svg("clipPath", {id: clip}, svg("rect", {x: box.left, y: box.top - 2, width: Math.max(box.right - box.left, 1), height: Math.max(box.bottom - box.top + 4, 1)})))
  const ups = ticks(...up, Math.max(2, (box.bottom - box.top) / 26)), acrosses = ticks(...across, Math.max(3, (box.right - box.left) / 80))
  for (const v of acrosses) add(svg("line", {class: "grid", x1: x(v), x2: x(v), y1: box.top, y2: box.bottom}))
  for (const v of ups) add(svg("line", {class: "grid", x1: box.left, x2: box.right, y1: y(v), y2: y(v)}))
  tickText(ups).forEach((text, i) => add(svg("text", {x: box.left - 6, y: y(ups[i]) + 4, "text-anchor": "end"}, text)))
  if (options.axis) {
    tickText(acrosses).forEach((text, i) => add(svg("text", {x: x(acrosses[i]), y: box.bottom + 15, "text-anchor": "middle"}, text)))
    add(svg("line", {class: "axis", x1: box.left, x2: box.right, y1: box.bottom, y2: box.bottom}))
  }
  const inside = svg("g", {"clip-path": `url(#${clip})`})
  add(inside)
  host.replaceChildren(root)
  return {root, box, x, y, draw: (...nodes) => inside.append(...nodes), add}
}

const path = (xs, ys, from, to, fx, fy) => {
  let d = ""
  for (let i = from; i <= to; i++) d += `${d ? "L" : "M"}${fx(xs[i]).toFixed(1)} ${fy(ys[i]).toFixed(1)}`
  return d
}
const curve = (d, kind, colour) => svg("path", {class: `curve ${kind}`, d, style: colour ? `stroke:${colour}` : null})
const sample = (kind, colour) => svg("svg", {viewBox: "0 0 26 10", "aria-hidden": "true"}, curve("M1 5H25", kind, colour))

// -- rows over the time -----------------------------------------------------------------------------------

let heads = []
explorer.makeRows = () => {
  heads = lines.rows.map((row, i) => {
    const friction = row.kind === "friction"
    const names = friction
      ? [element("span", {class: "name"}, sample("", explorer.colour(0)), `friction, ${row.title}`, element("b", {"data-value": row.names[0]})),
         element("span", {class: "name"}, sample("dashed", explorer.threshold()), "thresholds")]
      : row.names.map((name, k) => element("span", {class: "name"}, sample("", explorer.colour(k)), element("span", {html: lines.symbols[name]}), element("b", {"data-value": name})))
    const shade = svg("svg", {viewBox: "0 0 16 10", "aria-hidden": "true"}, svg("rect", {class: "held", width: 16, height: 10}))
    if (lines.contacts.length && (i === 0 || (friction && lines.contacts.length > 1))) names.push(element("span", {class: "name"}, shade, friction || lines.contacts.length === 1 ? "stick" : "stick (all contacts)"))
    const host = element("div", {class: `figure${i === lines.rows.length - 1 ? " last" : ""}`, id: `row-${i}`})
    return {row, host, head: element("div", {class: "row-head"}, ...names, element("span", {class: "unit"}, row.unit))}
  })
  explorer.$("rows").classList.toggle("few", heads.length < 3)
  explorer.$("rows").replaceChildren(...heads.flatMap(({head, host}) => [head, host]))
}

const MOST = 2.5  // times the largest force, up to which thresholds are shown
const drawRow = ({row, host}, i, motion) => {
  const last = i === lines.rows.length - 1
  const friction = row.kind === "friction"
  let range = rangeOf(row.names.slice(0, friction ? 1 : row.names.length))
  if (friction) {
    // Thresholds may be without bound; the force is not.
    const [low, high] = range, reach = Math.max(Math.abs(low), Math.abs(high))
    const edges = rangeOf(row.names.slice(1)).map((e) => Math.min(Math.max(e, -MOST*reach), MOST*reach))
    range = union([[low, high], edges, edges.map((e) => -e).reverse()])
  }
  const {x, y, box, draw, add, root} = frame(host, motion.packed.t, range, {axis: last, about: `${row.title ?? row.names.map((n) => lines.plain[n]).join(", ")} over time`})
  const stick = motion.stick[row.contact ?? ""] ?? []
  for (let k = 0; k + 1 < stick.length; k += 2) draw(svg("rect", {class: "held", x: x(stick[k]), y: box.top, width: Math.max(x(stick[k + 1]) - x(stick[k]), 0.5), height: box.bottom - box.top}))
  const full = motion.t.length - 1
  const line = (values, kind, colour) => draw(curve(path(motion.t, values, 0, full, x, y), kind, colour))
  if (friction) {
    const [force, plus, minus] = row.names.map((name) => motion.q[name])
    line(minus, "dashed", explorer.threshold())
    line(plus.map((v) => -v), "dashed", explorer.threshold())
    line(force, "", explorer.colour(0))
  } else row.names.forEach((name, k) => line(motion.q[name], "", explorer.colour(k)))
  if (last) add(svg("text", {x: box.left - 12, y: box.bottom + 15, "text-anchor": "end"}, `t${lines.time_unit ? ` / ${lines.time_unit}` : ""}`))
  const now = svg("line", {class: "now", y1: box.top, y2: box.bottom})
  add(now)
  return {now, x, root}
}

// -- the plane of two quantities ------------------------------------------------------------------------------

const drawPlane = (motion, turn) => {
  const {state} = explorer
  const about = `${lines.plain[state.y]} over ${lines.plain[state.x]}`
  const {x, y, box, draw, add} = frame(explorer.$("plane"), rangeOf([state.x]), rangeOf([state.y]), {axis: true, name: true, about})
  const named = (name) => lines.plain[name] + (lines.units[name] ? ` / ${lines.units[name]}` : "")
  add(svg("text", {class: "name", x: box.right, y: box.bottom + 31, "text-anchor": "end"}, named(state.x)))
  add(svg("text", {class: "name", x: box.left, y: 13}, named(state.y)))
  const [xs, ys, t] = [motion.q[state.x], motion.q[state.y], motion.t]
  if (turn && turn !== motion) draw(curve(path(turn.q[state.x], turn.q[state.y], 0, turn.t.length - 1, x, y), "turn", explorer.colour(2)))
  draw(curve(path(xs, ys, 0, t.length - 1, x, y), "", explorer.colour(0)))
  const stick = motion.stick[state.stick] ?? []
  const near = 2*(t.at(-1) - t[0]) / 64 ** 3
  let d = ""
  for (let k = 0; k + 1 < stick.length; k += 2) {
    const from = explorer.before(t, stick[k] + near), to = explorer.before(t, stick[k + 1] + near)
    if (to > from) d += path(xs, ys, from, to, x, y)
  }
  if (d) draw(curve(d, "ink"))
  add(svg("circle", {cx: x(xs[0]), cy: y(ys[0]), r: 3.4, style: `fill:var(--paper);stroke:${explorer.colour(0)}`}))
  const point = svg("circle", {class: "point", r: 6})
  add(point)
  return {point, x, y}
}

const showLegend = (motion, turn) => {
  const {state} = explorer
  const contact = lines.contacts.length > 1 && !state.stick ? "stick (all contacts)" : "stick"
  const start = svg("svg", {viewBox: "0 0 26 10", "aria-hidden": "true"}, svg("circle", {cx: 13, cy: 5, r: 3.4, style: `stroke:${explorer.colour(0)}`}))
  const said = [[sample("", explorer.colour(0)), lines.contacts.length ? "slip" : "motion"], [start, "start"]]
  if (lines.contacts.length) said.splice(1, 0, [sample("ink"), contact])
  if (turn && turn !== motion) said.push([sample("turn", explorer.colour(2)), "cycle"])
  explorer.$("plane-legend").replaceChildren(...said.map(([mark, text]) => element("span", {}, mark, text)))
}

// -- all of them --------------------------------------------------------------------------------------------------

let drawn = {rows: [], plane: null}
explorer.drawFigures = () => {
  const {motion, turn} = explorer
  document.querySelector("main").classList.toggle("still", !motion?.head.scene)
  if (heads.length === 0) explorer.makeRows()
  if (motion === null) {
    for (const {host} of heads) host.replaceChildren()
    explorer.$("plane").replaceChildren()
    drawn = {rows: [], plane: null}
    return
  }
  if (motion.head.scene) explorer.mechanism.take()
  drawn = {rows: heads.map((head, i) => drawRow(head, i, motion)), plane: drawPlane(motion, turn)}
  showLegend(motion, turn)
}

explorer.placeNow = (time) => {
  const {motion, state} = explorer
  if (motion === null) return
  if (motion.head.scene) explorer.mechanism.place(time)
  const {t, q} = motion
  const i = explorer.before(t, time)
  const gap = t[i + 1] - t[i]
  const w = i + 1 < t.length && gap > 0 ? Math.min(Math.max((time - t[i]) / gap, 0), 1) : 0
  const at = (name) => q[name][i] + (w ? w*(q[name][i + 1] - q[name][i]) : 0)
  for (const {now, x} of drawn.rows) { now.setAttribute("x1", x(time)); now.setAttribute("x2", x(time)) }
  if (drawn.plane) {
    drawn.plane.point.setAttribute("cx", drawn.plane.x(at(state.x)))
    drawn.plane.point.setAttribute("cy", drawn.plane.y(at(state.y)))
  }
  // As many digits as are stored.
  const shown = (name) => {
    const [low, high] = explorer.endsOf(name, motion)
    const places = high > low ? Math.floor(Math.log10(4095 / (high - low))) : 12
    return number(places > 100 ? at(name) : Number(at(name).toFixed(Math.max(places, 0))), 4)
  }
  for (const host of document.querySelectorAll("b[data-value]")) host.textContent = shown(host.dataset.value)
}
