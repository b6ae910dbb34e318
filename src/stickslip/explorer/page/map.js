// The map: coarse at once, then finer; a click on a point shows its motion.
explorer.map = {found: null, measures: null}

explorer.listen((kind) => {
  if (kind === "model") { explorer.cancel("map"); stop(); explorer.map.found = explorer.map.measures = null; explorer.$("map-said").replaceChildren(); explorer.map.draw() }
  if (kind === "view" || kind === "resize" || kind === "theme") explorer.map.draw()
  if (kind === "set" || kind === "drag") explorer.map.place()
  if (explorer.seen("map")) explorer.map.offer()
})

explorer.map.offer = () => {
  if (explorer.described === null) return
  const first = explorer.likely()
  explorer.offerParameters(explorer.$("map-x"), first, "map.x")
  explorer.offerParameters(explorer.$("map-y"), explorer.described.parameters.map((p) => p.name).find((n) => n !== explorer.$("map-x").value), "map.y")
  for (const axis of ["x", "y"]) {
    const [low, high] = explorer.reach(explorer.$(`map-${axis}`).value)
    for (const [end, usual] of [["low", low], ["high", high]]) {
      const box = explorer.$(`map-${axis}_${end}`)
      if (document.activeElement !== box) box.value = explorer.state.view[`map.${axis}.${end}`] ?? explorer.number(usual, 3).replace("−", "-")
    }
  }
  explorer.map.offerMeasures()
}
// What can be measured of this model, the library says.
explorer.map.offerMeasures = () => {
  const {measures} = explorer.map
  if (measures === null) {
    explorer.map.measures = []
    explorer.ask("measures", "measures", {}, (head) => {
      if (head.part === "measures") { explorer.map.measures = head.measures; explorer.map.offerMeasures() }
    })
    return
  }
  const select = explorer.$("map-measure")
  const names = measures.map((m) => m.name)
  if (select.dataset.names !== names.join()) {
    select.dataset.names = names.join()
    select.replaceChildren(...measures.map((m) => explorer.element("option", {value: m.name}, m.meaning)))
  }
  const wished = explorer.state.view["map.of"]
  select.value = names.includes(wished) ? wished : names[0] ?? ""
}
for (const axis of ["x", "y"]) {
  explorer.$(`map-${axis}`).addEventListener("change", () => explorer.change("view", (s) => {
    s.view[`map.${axis}`] = explorer.$(`map-${axis}`).value
    delete s.view[`map.${axis}.low`]; delete s.view[`map.${axis}.high`]
  }))
  for (const end of ["low", "high"]) explorer.$(`map-${axis}_${end}`).addEventListener("change", () => explorer.change("view", (s) => {
    s.view[`map.${axis}.${end}`] = explorer.$(`map-${axis}_${end}`).value
  }))
}
explorer.$("map-measure").addEventListener("change", () => explorer.change("view", (s) => { s.view["map.of"] = explorer.$("map-measure").value }))

explorer.map.fill = () => {
  const options = {measure: explorer.$("map-measure").value}
  if (options.measure === "") return explorer.toast("The list of measures is still loading.")
  for (const axis of ["x", "y"]) {
    options[axis] = explorer.$(`map-${axis}`).value
    for (const end of ["low", "high"]) options[`${axis}_${end}`] = explorer.typed(explorer.$(`map-${axis}_${end}`).value)
    if (!(options[`${axis}_low`] < options[`${axis}_high`])) return explorer.toast("Enter ranges whose ends exceed their starts.")
  }
  explorer.map.found = null
  explorer.map.draw()
  explorer.$("map-empty").hidden = true
  explorer.$("map-progress").hidden = false
  explorer.$("map-go").textContent = "Stop"
  explorer.map.busy = true
  explorer.ask("map", "map", options, (head, numbers) => {
    if (head.refused) { stop(); explorer.$("map-said").replaceChildren(explorer.element("p", {class: "bad"}, head.refused.reason)); return }
    if (head.part === "progress") explorer.$("map-progress").value = head.share
    if (head.part === "map") { explorer.map.found = {head, numbers}; explorer.map.draw() }
    if (head.final) stop()
  })
}
const stop = () => { explorer.map.busy = false; explorer.$("map-progress").hidden = true; explorer.$("map-go").textContent = "Fill" }
explorer.$("map-go").addEventListener("click", () => {
  if (explorer.map.busy) { explorer.cancel("map"); stop() } else explorer.map.fill()
})

// Ranges by the kind of the scale, as pictures have them: viridis, RdYlBu and twilight, between these anchors.
const ANCHORS = {
  "one way": [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]],
  "both ways": [[49, 54, 149], [145, 194, 222], [255, 255, 191], [248, 142, 83], [165, 0, 38]],
  "round": [[226, 217, 226], [98, 118, 186], [47, 20, 54], [178, 88, 77], [226, 217, 226]],
}
const coloured = (kind, share) => {
  const anchors = ANCHORS[kind]
  const place = Math.min(Math.max(share, 0), 1) * (anchors.length - 1)
  const i = Math.min(Math.floor(place), anchors.length - 2)
  return `rgb(${anchors[i].map((c, k) => Math.round(c + (place - i) * (anchors[i + 1][k] - c))).join(",")})`
}

explorer.map.draw = () => {
  if (!explorer.seen("map") || explorer.models === null) return
  explorer.map.offer()
  const {found} = explorer.map
  explorer.$("map-empty").hidden = found !== null || explorer.map.busy === true
  explorer.$("map-scale").hidden = found === null
  const source = explorer.model("map_fields")
  const data = {left: [], right: [], bottom: [], top: [], color: []}
  if (found === null) { explorer.setQuietly(source, {data}); explorer.map.place(); return }
  const {head, numbers: {x, y, values}} = found
  const n = head.count
  const {low, high, kind} = head.scale
  // Every point is the middle of its field; what has no number has none.
  const dx = (x[n - 1] - x[0]) / (n - 1), dy = (y[n - 1] - y[0]) / (n - 1)
  values.forEach((v, k) => {
    if (!isFinite(v)) return
    const [i, j] = [k % n, Math.floor(k / n)]
    data.left.push(x[i] - dx / 2); data.right.push(x[i] + dx / 2); data.bottom.push(y[j] - dy / 2); data.top.push(y[j] + dy / 2)
    data.color.push(coloured(kind, (v - low) / (high - low)))
  })
  explorer.setQuietly(source, {data})
  const plot = explorer.model("map")
  explorer.range(plot.x_range, x[0] - dx / 2, x[n - 1] + dx / 2)
  explorer.range(plot.y_range, y[0] - dy / 2, y[n - 1] + dy / 2)
  explorer.$("map-bar").style.background = `linear-gradient(90deg, ${ANCHORS[kind].map((c) => `rgb(${c.join(",")})`).join(", ")})`
  explorer.$("map-low").textContent = explorer.number(low, 3)
  explorer.$("map-high").textContent = `${explorer.number(high, 3)} ${head.unit}`
  const outcomes = Object.values(head.outcomes).join(", ")
  explorer.$("map-said").replaceChildren(
    explorer.element("p", {}, `${head.meaning} over ${head.x} (across) and ${head.y} (up), ${n} × ${n} points: ${outcomes}`),
    explorer.element("p", {class: "hint"}, head.verdict),
    explorer.element("p", {}, explorer.element("button", {class: "quiet link", onclick: () => explorer.copy(head.command, "the command")}, "continue on the command line"), explorer.element("code", {}, head.command)))
  requestAnimationFrame(() => explorer.guard(explorer.map.place))
}

explorer.map.place = () => {
  const spot = explorer.$("map-spot")
  const frame = explorer.frame("map")
  if (frame === null || explorer.map.found === null || !explorer.seen("map")) { spot.hidden = true; return }
  const {head} = explorer.map.found
  const {x_range, y_range} = frame.plot
  const across = (explorer.present(head.x) - x_range.start) / (x_range.end - x_range.start)
  const up = (explorer.present(head.y) - y_range.start) / (y_range.end - y_range.start)
  spot.hidden = !(across >= 0 && across <= 1 && up >= 0 && up <= 1)
  spot.style.transform = `translate(${frame.box.left + across * frame.box.width}px, ${frame.box.bottom - up * frame.box.height}px)`
}

explorer.map.watch = () => explorer.clicked("map", (sx, sy, {box, plot}) => {
  if (explorer.map.found === null) return
  const {head} = explorer.map.found
  const value = (range, share) => Number((range.start + share * (range.end - range.start)).toPrecision(4))
  explorer.change("set", (state) => {
    state.values[head.x] = value(plot.x_range, (sx - box.left) / box.width)
    state.values[head.y] = value(plot.y_range, (box.bottom - sy) / box.height)
  })
})
