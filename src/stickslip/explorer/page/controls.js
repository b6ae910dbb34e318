// The model: its parameters as sliders with numbers, functions as text, initial values, the time.
//
// A slider changes the state while it is dragged ("drag"), and once more when it is let go ("set").
explorer.described = null

explorer.listen((kind) => {
  if (kind === "model") { explorer.described = null; explorer.describe() }
  else if (kind === "set") { explorer.showValues(); explorer.describeFunctions() }
  else if (kind === "drag") explorer.showValues()
})

explorer.describe = () => {
  document.body.classList.add("loading")
  explorer.ask("model", "model", {}, (head, numbers) => {
    if (head.final) return
    if (head.refused) return explorer.refuse(head.refused)
    explorer.described = head
    explorer.showModel(head, numbers)
    for (const part of explorer.parts) explorer.guard(() => part("described", explorer.state))
  })
}
// Equations and graphs follow the functions, not the numbers.
let formulas = ""
explorer.describeFunctions = () => {
  const texts = JSON.stringify(Object.entries(explorer.state.values).filter(([, v]) => typeof v === "string"))
  if (texts === formulas) return
  formulas = texts
  explorer.describe()
}

// What is wrong is said at its place, if that is on the page, and above the parameters in any case.
explorer.refuse = (refused) => {
  document.body.classList.remove("loading", "compiling")
  const box = explorer.$("refusal")
  for (const row of document.querySelectorAll(".row.wrong")) row.classList.remove("wrong")
  if (!refused) { box.hidden = true; return }
  const where = (refused.where ?? "").split(".").pop()
  box.replaceChildren(
    explorer.element("strong", {}, refused.where ? `${refused.where}: ` : ""), `${refused.reason}.`,
    refused.remedy ? explorer.element("span", {class: "remedy"}, ` ${refused.remedy}.`) : "")
  box.hidden = false
  document.querySelector(`#controls .row[data-name="${CSS.escape(where)}"]`)?.classList.add("wrong")
}

explorer.showModel = (head, numbers) => {
  explorer.$("title").textContent = head.title
  explorer.$("source").textContent = head.source
  document.title = `${head.title} · stickslip`
  document.querySelector("#equations .math").innerHTML = head.equations
  formulas = JSON.stringify(Object.entries(explorer.state.values).filter(([, v]) => typeof v === "string"))
  explorer.fill("parameters", head.parameters.map((p) => explorer.valueRow(p, "values")))
  explorer.fill("initial", head.initial.map((p) => explorer.valueRow(p, "initial")))
  const [start, end] = head.span
  explorer.fill("span", [explorer.valueRow({name: "until", symbol: "<i>t</i>", meaning: `from ${explorer.number(start)} to`, unit: head.time_unit,
    value: end, low: start + (end - start) / 50, high: start + 4 * (end - start), step: (end - start) / 50, range: ""}, "until")])
  explorer.$("functions-box").hidden = head.functions.length === 0
  explorer.fill("functions", head.functions.map((f) => functionRow(f, numbers)))
  explorer.showValues()
}

explorer.fill = (id, rows) => {
  const place = explorer.$(id)
  const focused = document.activeElement?.id
  place.replaceChildren(...rows)
  if (focused && place.querySelector(`#${CSS.escape(focused)}`)) explorer.$(focused).focus()
}

// -- one value ---------------------------------------------------------------------------------------

const current = (entry, where) => {
  if (where === "until") return explorer.state.until ?? entry.value
  const set = explorer.state[where][entry.name]
  return typeof set === "number" ? set : entry.value
}

const setValue = (entry, where, value, kind, event) => {
  explorer.event = event?.timeStamp ?? performance.now()
  // The parameters of an evolution change nothing of the motion.
  explorer.change(where === "given" ? "evolution" : kind, (state) => {
    if (where === "until") state.until = value === entry.value ? null : value
    else if (value === entry.value) delete state[where][entry.name]
    else state[where][entry.name] = value
  })
}

explorer.valueRow = (entry, where) => {
  const id = `${where}-${entry.name}`
  const slider = explorer.element("input", {type: "range", id: `${id}-slider`, min: entry.low, max: entry.high, step: "any",
    "aria-label": `${entry.name}, ${entry.meaning}`,
    oninput: (event) => setValue(entry, where, rounded(Number(slider.value), entry.step), "drag", event),
    onchange: (event) => setValue(entry, where, rounded(Number(slider.value), entry.step), "set", event)})
  // Arrow keys go by the step of the value, not by one of a hundred parts of the slider.
  slider.addEventListener("keydown", (event) => {
    const by = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10}[event.key]
    if (by === undefined) return
    event.preventDefault()
    const next = rounded(current(entry, where) + by * entry.step, entry.step)
    setValue(entry, where, Math.min(Math.max(next, Number(slider.min)), Number(slider.max)), "set", event)
  })
  const box = explorer.element("input", {type: "text", id, inputmode: "decimal", autocomplete: "off", "aria-label": `${entry.name}, value`,
    onchange: (event) => {
      const value = explorer.typed(box.value)
      row.classList.toggle("wrong", !isFinite(value))
      if (isFinite(value)) setValue(entry, where, value, "set", event)
    },
    onkeydown: (event) => {
      const by = {ArrowUp: 1, ArrowDown: -1}[event.key]
      if (by) { event.preventDefault(); setValue(entry, where, rounded(current(entry, where) + by * entry.step, entry.step), "set", event) }
    }})
  const reset = explorer.element("button", {class: "reset", title: `Reset to ${explorer.number(entry.value)}`, "aria-label": `Reset ${entry.name}`,
    onclick: (event) => setValue(entry, where, entry.value, "set", event)}, "↺")
  const row = explorer.element("div", {class: "row", "data-name": entry.name},
    explorer.element("label", {for: id, title: entry.range ? `admissible: ${entry.range}` : ""},
      explorer.element("span", {class: "symbol", html: entry.symbol}),
      explorer.element("span", {class: "meaning"}, entry.meaning)),
    slider, box, explorer.element("span", {class: "unit"}, entry.unit), reset)
  row.show = () => {
    const value = current(entry, where)
    if (document.activeElement !== box || explorer.typed(box.value) !== value) box.value = explorer.number(value, 7)
    if (Number(slider.value) !== value) slider.value = value
    row.classList.toggle("changed", value !== entry.value)
  }
  return row
}

const rounded = (value, step) => Number((Math.round(value / step) * step).toPrecision(12))

explorer.showValues = () => {
  for (const row of document.querySelectorAll(".values .row")) row.show?.()
}

// -- functions -----------------------------------------------------------------------------------------

const functionRow = (entry, numbers) => {
  const id = `function-${entry.name}`
  const graph = sketch(numbers[`graph:${entry.name}`])
  const box = explorer.element("textarea", {id, rows: 1, spellcheck: "false", disabled: entry.measured,
    "aria-label": `${entry.signature}, formula`,
    oninput: explorer.debounced(() => {
      const text = box.value.trim()
      if (text === "") return
      explorer.event = performance.now()
      explorer.change("set", (state) => { state.values[entry.name] = text })
    }, 350)})
  box.value = entry.measured ? "measured" : explorer.state.values[entry.name] ?? entry.formula
  const reset = explorer.element("button", {class: "reset", title: "Reset to the formula of the model", "aria-label": `Reset ${entry.name}`,
    onclick: () => explorer.change("model", (state) => { delete state.values[entry.name] })}, "↺")
  const row = explorer.element("div", {class: "row function", "data-name": entry.name},
    explorer.element("label", {for: id}, explorer.element("span", {class: "symbol", html: `${entry.symbol}(${entry.arguments})`})),
    box, graph, reset)
  row.show = () => {
    row.classList.toggle("changed", entry.name in explorer.state.values)
    if (document.activeElement !== box && entry.name in explorer.state.values) box.value = explorer.state.values[entry.name]
  }
  return row
}

const sketch = (values) => {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg")
  svg.setAttribute("class", "sketch")
  svg.setAttribute("viewBox", "0 0 60 28")
  svg.setAttribute("aria-hidden", "true")
  if (!values || values.length < 2) { svg.classList.add("empty"); return svg }
  const [low, high] = explorer.ends(values) ?? [0, 1]
  const size = high - low || 1
  const points = Array.from(values, (v, i) => `${(58 * i / (values.length - 1) + 1).toFixed(1)},${(high === low ? 14 : 26 - 24 * (v - low) / size).toFixed(1)}`)
  svg.innerHTML = `<polyline points="${points.join(" ")}"/>`
  return svg
}

explorer.$("reset-all").addEventListener("click", () => explorer.change("model", (state) => {
  state.values = {}; state.initial = {}; state.until = null
}))

// -- models of one's own -------------------------------------------------------------------------------

explorer.useToml = (text) => {
  // What has a dissipation is an evolution.
  if (/^\s*\[?dissipation\b/m.test(text)) return explorer.evolution.take(text)
  explorer.change("model", () => { explorer.state = {...explorer.fresh("own", text), panel: explorer.state.panel} })
}
explorer.$("toml-use").addEventListener("click", () => explorer.useToml(explorer.$("toml").value))
explorer.$("toml-take").addEventListener("click", () => explorer.ask("export", "export", {form: "toml"}, (head) => {
  if (head.text) { explorer.$("toml").value = head.text; explorer.$("toml").focus() }
}))
document.addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("dropping") })
document.addEventListener("dragleave", (event) => { if (!event.relatedTarget) document.body.classList.remove("dropping") })
document.addEventListener("drop", async (event) => {
  event.preventDefault()
  document.body.classList.remove("dropping")
  const file = event.dataTransfer?.files?.[0]
  if (!file) return
  if (file.size > 3000000) return explorer.toast("The file is too large (at most 3 MB).")
  const text = await file.text()
  if (/\.toml$/i.test(file.name)) { explorer.$("toml").value = text; explorer.useToml(text) }
  else explorer.dropped?.(file.name, text)
})

// -- the gallery -----------------------------------------------------------------------------------------

explorer.gallery = {asked: false}
explorer.gallery.open = () => {
  const dialog = explorer.$("gallery")
  if (!dialog.open) dialog.showModal()
  if (explorer.gallery.asked) return
  explorer.gallery.asked = true
  explorer.$("cards").replaceChildren(...explorer.facts.catalogue.map((name) => explorer.element("button",
    {class: "card", "data-model": name, onclick: () => explorer.gallery.take(name)},
    explorer.element("span", {class: "picture"}), explorer.element("strong", {}, name.replaceAll("_", " ")), explorer.element("small", {}))))
  explorer.ask("gallery", "gallery", {}, (head, numbers) => {
    if (!head.name) return
    const card = explorer.$("cards").querySelector(`[data-model="${head.name}"]`)
    card.querySelector("strong").textContent = head.title
    card.querySelector("small").textContent = head.source
    if (head.scene) card.querySelector(".picture").append(explorer.mechanism.still(head.scene, numbers))
  })
}
explorer.gallery.take = (name) => {
  explorer.$("gallery").close()
  explorer.change("model", () => { explorer.state = {...explorer.fresh(name), panel: explorer.state.panel} })
}
explorer.$("models").addEventListener("click", () => explorer.gallery.open())
explorer.$("home").addEventListener("click", (event) => { event.preventDefault(); explorer.gallery.open() })
explorer.$("gallery-close").addEventListener("click", () => explorer.$("gallery").close())
explorer.$("gallery").addEventListener("click", (event) => { if (event.target === explorer.$("gallery")) explorer.$("gallery").close() })
explorer.$("search").addEventListener("input", () => {
  const wanted = explorer.$("search").value.toLowerCase()
  for (const card of explorer.$("cards").children) card.hidden = !`${card.dataset.model} ${card.textContent}`.toLowerCase().includes(wanted)
})
