// Data: a CSV file beside the motion, what is left of it, and the parameters that explain it best.
explorer.data = {table: null, residual: null}

explorer.listen((kind) => {
  if (kind === "theme" || kind === "resize" || kind === "view") explorer.data.draw()
  if (kind === "set" || kind === "model") explorer.data.soon()
})
explorer.data.soon = explorer.debounced(() => explorer.data.compare(), 250)

// Columns of numbers with names, of a file with commas, semicolons, tabs or blanks.
explorer.data.read = (text) => {
  const lines = text.split(/\r?\n/).filter((line) => line.trim() !== "" && !line.startsWith("#")).slice(0, 20001)
  const mark = [",", ";", "\t"].find((m) => lines[0]?.includes(m)) ?? /\s+/
  const cells = lines.map((line) => line.trim().split(mark).map((cell) => cell.trim()))
  const headed = cells[0]?.some((cell) => cell !== "" && !isFinite(Number(cell)))
  const names = headed ? cells.shift() : cells[0]?.map((_, i) => `column ${i + 1}`)
  if (!names || names.length < 2 || cells.length === 0) return null
  return {names, columns: names.map((_, i) => cells.map((row) => row[i] === undefined || row[i] === "" ? null : Number(row[i])).map((v) => v === null || isFinite(v) ? v : null))}
}

explorer.dropped = (name, text) => {
  const table = explorer.data.read(text)
  if (table === null) return explorer.toast(`${name}: the file needs at least two columns of numbers, with names in the first line.`)
  explorer.data.table = table
  const at = (pattern, otherwise) => { const i = table.names.findIndex((n) => pattern.test(n)); return i < 0 ? otherwise : i }
  const options = () => table.names.map((n, i) => explorer.element("option", {value: i}, n))
  explorer.$("data-time").replaceChildren(...options())
  explorer.$("data-value").replaceChildren(...options())
  const time = at(/^(t|time|Zeit)\b/i, 0)
  explorer.$("data-time").value = time
  const known = table.names.findIndex((n, i) => i !== time && n in (explorer.motion?.q ?? {}))
  explorer.$("data-value").value = known >= 0 ? known : time === 0 ? 1 : 0
  explorer.change("view", (s) => { s.panel = "data" })
  explorer.data.compare()
}
explorer.$("data-file").addEventListener("change", async () => {
  const file = explorer.$("data-file").files[0]
  if (file && file.size < 3000000) explorer.dropped(file.name, await file.text())
})
for (const id of ["data-time", "data-value", "data-quantity"]) explorer.$(id).addEventListener("change", () => explorer.data.compare())

explorer.data.points = () => {
  const {table} = explorer.data
  if (table === null) return null
  const times = table.columns[explorer.$("data-time").value], values = table.columns[explorer.$("data-value").value]
  const good = times.map((t, i) => t !== null && values[i] !== null)
  return {times: times.filter((_, i) => good[i]), values: values.filter((_, i) => good[i])}
}

explorer.data.offer = () => {
  if (explorer.motion === null || explorer.data.table === null) return
  const names = Object.keys(explorer.motion.q).filter((n) => !n.startsWith("threshold_"))
  const select = explorer.$("data-quantity")
  if (select.dataset.names !== names.join()) {
    const column = explorer.data.table.names[explorer.$("data-value").value]
    select.dataset.names = names.join()
    select.replaceChildren(...names.map((n) => explorer.element("option", {value: n}, explorer.motion.head.plain[n])))
    select.value = names.includes(column) ? column : names[0]
  }
  const place = explorer.$("data-free")
  const parameters = explorer.described?.parameters.map((p) => p.name) ?? []
  if (place.dataset.names !== parameters.join()) {
    place.dataset.names = parameters.join()
    place.replaceChildren(...parameters.map((n) => explorer.element("button", {class: "chip", "aria-pressed": "false", "data-name": n,
      onclick: (event) => event.currentTarget.setAttribute("aria-pressed", String(event.currentTarget.getAttribute("aria-pressed") !== "true"))}, n)))
  }
}

explorer.data.compare = () => {
  explorer.data.offer()
  const points = explorer.data.points()
  if (points === null || explorer.motion === null) return
  explorer.$("data-empty").hidden = true
  explorer.$("data-fit").hidden = false
  explorer.drawMotion()
  explorer.ask("data", "data", {...points, quantity: explorer.$("data-quantity").value}, (head, numbers) => {
    if (head.refused) { explorer.data.residual = null; explorer.data.say([head.refused.reason]); explorer.data.draw(); return }
    if (head.part !== "residual") return
    explorer.data.residual = {head, numbers}
    const n = explorer.number
    explorer.data.say([`Root mean square of the residuals: ${n(head.root, 4)}, at most ${n(head.largest, 4)}` + (head.explained === null ? "" : `; ${n(100 * head.explained, 4)} % explained`) + `. ${head.used} of ${head.of} points are within the time of the motion.`])
    explorer.data.draw()
  })
}
explorer.data.say = (lines) => explorer.$("data-said").replaceChildren(...lines.map((text) => explorer.element("p", {}, text)))

explorer.data.draw = () => {
  if (!explorer.seen("data") || explorer.models === null) return
  const found = explorer.data.residual
  const data = {x: [], y: [], color: []}
  if (found !== null) {
    const {t, residual} = found.numbers
    const {plain, units, time_unit} = explorer.motion?.head ?? {plain: {}, units: {}}
    const name = explorer.$("data-quantity").value
    explorer.$("data-caption").textContent = `residuals of ${plain[name] ?? name} [${units[name] || "1"}] over t [${time_unit || "1"}]`
    const reach = 1.1 * found.head.largest || 1
    for (let i = 0; i < t.length; i++) { data.x.push(t[i]); data.y.push(residual[i]); data.color.push(explorer.colour(1)) }
    const plot = explorer.model("data")
    explorer.range(plot.x_range, t[0], t[t.length - 1])
    explorer.range(plot.y_range, -reach, reach)
  }
  explorer.setQuietly(explorer.model("data_points"), {data})
  explorer.setQuietly(explorer.model("data_zero"), {data: {y: found ? [0] : []}})
}

// The points beside the line that they belong to.
explorer.drawData = (name, group) => {
  const points = explorer.data.points()
  const quantity = explorer.$("data-quantity").value
  const here = points !== null && group.names.includes(quantity)
  const source = explorer.model(`${name}_data`)
  if (!here && source.data.x?.length === 0) return
  const color = explorer.colour(1)
  explorer.setQuietly(source, {data: here ? {x: points.times, y: points.values, color: points.times.map(() => color)} : {x: [], y: [], color: []}})
}

explorer.$("data-go").addEventListener("click", () => {
  const free = [...explorer.$("data-free").querySelectorAll("[aria-pressed=true]")].map((b) => b.dataset.name)
  if (free.length === 0) return explorer.toast("Choose the parameters to fit.")
  const points = explorer.data.points()
  explorer.data.say(["Fitting"])
  explorer.ask("fit", "data", {...points, quantity: explorer.$("data-quantity").value, free}, (head) => {
    if (head.refused) return explorer.data.say([head.refused.reason])
    if (head.part !== "fit") return
    const n = explorer.number
    const said = Object.entries(head.values).map(([name, v]) => `${name} = ${n(v, 6)}, between ${n(head.intervals[name][0], 6)} and ${n(head.intervals[name][1], 6)} (95 %)`)
    explorer.change("set", (state) => { Object.assign(state.values, head.values) })
    explorer.toast(`Fitted: ${Object.keys(head.values).join(", ")}`)
    explorer.data.fitted = [...said, head.verdict]
    explorer.$("data-said").append(...explorer.data.fitted.map((text) => explorer.element("p", {}, text)))
  })
})
