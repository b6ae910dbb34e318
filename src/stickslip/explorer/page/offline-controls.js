// Sliders, the map of stored points, the clock, and what is said below.
const {stored, state, svg, element, exact, number} = explorer
const {lines} = stored
const $ = explorer.$

// -- sliders -----------------------------------------------------------------------------------------------

const named = (said) => element("span", {class: "symbol", html: said.symbol})
const withUnit = (value, unit) => unit ? `${exact(value)} ${unit}` : exact(value)
const EDGE = 8  // pixels between the end of a slider and the middle of its thumb

// A mark for each stored value: certified, not certified, no motion.
const markOf = (record, x, y, r) => {
  if (!record.motion) return svg("circle", {class: "tick none", cx: x, cy: y, r: r - 0.5})
  if (record.motion.certified) return svg("circle", {class: "tick", cx: x, cy: y, r})
  return svg("path", {class: "tick not", d: `M${x - r} ${y - r}l${2*r} ${2*r}m0 ${-2*r}l${-2*r} ${2*r}`})
}

const sliders = stored.sliders.map((slider, i) => {
  const last = slider.values.length - 1
  const input = element("input", {type: "range", id: `slider-${slider.name}`, min: 0, max: Math.max(last, 0), step: 1, disabled: last < 1,
    oninput: () => explorer.move(i, Number(input.value))})
  const output = element("output", {for: input.id})
  const strip = svg("svg", {class: "ticks", "aria-hidden": "true"})
  const label = element("label", {for: input.id}, named(slider), element("span", {class: "meaning", title: slider.meaning}, slider.meaning), output)
  return {slider, input, output, strip, host: element("div", {class: "value", "data-name": slider.name}, label, input, strip)}
})
$("sliders").replaceChildren(...sliders.map((s) => s.host))
document.body.classList.toggle("few", sliders.length <= 3)

explorer.showValues = () => {
  sliders.forEach(({slider, input, output, strip, host}, i) => {
    const index = state.at[i], value = slider.values[index]
    input.value = index
    output.textContent = withUnit(value, slider.unit)
    input.setAttribute("aria-valuetext", output.textContent)
    host.classList.toggle("idle", !stored.together && state.moved !== i && sliders.length > 1)
    const width = strip.clientWidth || 280, count = slider.values.length
    strip.replaceChildren(...slider.values.map((_, k) => {
      const at = state.at.slice()
      at[i] = k
      const record = stored.together ? explorer.record(at) : explorer.record(stored.sliders.map((s, j) => j === i ? k : state.at[j]), i)
      return markOf(record, count > 1 ? EDGE + k / (count - 1)*(width - 2*EDGE) : width / 2, 4, count > 40 ? 1.5 : 2.5)
    }))
  })
  drawMap()
  $("command").textContent = command()
}

// The points of the first two sliders; those of a third at its value.
const drawMap = () => {
  const host = $("map")
  host.hidden = !stored.together || sliders.length < 2
  if (host.hidden) return
  const [across, up] = stored.sliders, [columns, rows] = [across.values.length, up.values.length]
  const width = host.clientWidth || 280, height = Math.min(Math.max(rows*12 + 16, 40), 190)
  const x = (i) => columns > 1 ? EDGE + i / (columns - 1)*(width - 2*EDGE) : width / 2
  const y = (k) => rows > 1 ? height - 8 - k / (rows - 1)*(height - 16) : height / 2
  const root = svg("svg", {viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": "Stored points; click to choose one"})
  const r = Math.min(3, 0.3*Math.min((width - 2*EDGE) / columns, (height - 16) / rows))
  for (let i = 0; i < columns; i++) for (let k = 0; k < rows; k++) root.append(markOf(explorer.record([i, k, ...state.at.slice(2)]), x(i), y(k), r))
  root.append(svg("circle", {class: "here", cx: x(state.at[0]), cy: y(state.at[1]), r: r + 3.5}))
  const choose = (event) => {
    const edge = root.getBoundingClientRect()
    const share = (v, n) => Math.min(Math.max(Math.round(v*(n - 1)), 0), n - 1)
    state.at[0] = share(((event.clientX - edge.left)*width / edge.width - EDGE) / (width - 2*EDGE), columns)
    state.at[1] = share((height - 8 - (event.clientY - edge.top)*height / edge.height) / (height - 16), rows)
    explorer.draw()
  }
  root.addEventListener("click", choose)
  host.replaceChildren(root, element("div", {class: "names"}, element("span", {}, "↑ ", named(up)), element("span", {}, named(across), " →")))
}

// What computes the motion of this point again, from the model.
const command = () => {
  const words = ["stickslip run", stored.command]
  stored.sliders.forEach((slider, i) => {
    const value = slider.values[state.at[i]]
    if (value !== slider.declared) words.push(`${slider.initial ? "--initial" : "--set"} ${slider.name}=${value}`)
  })
  if (stored.until) words.push(`--until ${stored.until}`)
  return words.join(" ")
}

// -- what certificates say -------------------------------------------------------------------------------------

const say = (id, good, strong, text, small) => {
  const host = $(id)
  host.dataset.state = good === null ? "" : good ? "good" : "bad"
  host.querySelector("span").replaceChildren(element("strong", {}, strong), text, element("small", {}, small))
}
explorer.showVerdicts = (record) => {
  const {motion, cycle} = record
  if (motion) say("motion-said", motion.certified, motion.certified ? "Motion certified" : "Motion not certified", `: ${motion.text}`, motion.word.replace(/^(not )?certified: /, ""))
  else say("motion-said", null, "No motion", "", record.refused)
  if (cycle) say("cycle-said", cycle.certified, cycle.certified ? "Cycle certified" : "Cycle not certified", `: ${cycle.text}`, cycle.word.replace(/^(not )?certified: /, ""))
  else say("cycle-said", null, "No cycle", "", record["no cycle"] ?? "")
  $("show-cycle").disabled = !cycle
  for (const kind of ["motion", "cycle"]) $(`show-${kind}`).setAttribute("aria-pressed", String(explorer.kind === kind))
  $("same").setAttribute("aria-pressed", String(state.same[explorer.kind]))
}
$("show-motion").addEventListener("click", () => { state.cycle = false; explorer.draw() })
$("show-cycle").addEventListener("click", () => { state.cycle = true; explorer.draw() })

// -- the axes of the plane -------------------------------------------------------------------------------------

const of = (kind) => lines.rows.filter((row) => row.kind === kind).flatMap((row) => row.names)
const choices = lines.names.filter((name) => !name.startsWith("threshold_"))
state.x = of("coordinate")[0] ?? choices[0]
state.y = choices.includes(`d_${state.x}`) ? `d_${state.x}` : choices.find((name) => name !== state.x) ?? state.x
// One quantity has no plane.
document.querySelector("main").classList.toggle("flat", choices.length < 2)

// Where some go much farther than most, or elsewhere, each point has axes of its own at first.
const MUCH = 4
const isOdd = (name, kind) => {
  const sizes = stored.records.filter((r) => r[kind]).map((r) => Math.abs(r[kind].q[name][2] - r[kind].q[name][1])).sort((a, b) => a - b)
  const [low, high] = explorer.ends(name, kind)
  return high - low > MUCH*sizes[sizes.length >> 1]
}
for (const kind of ["motion", "cycle"]) state.same[kind] = !choices.some((name) => !name.startsWith("friction_") && isOdd(name, kind))
for (const key of ["x", "y"]) {
  const select = $(`plane-${key}`)
  select.replaceChildren(...choices.map((name) => element("option", {value: name, selected: name === state[key]}, lines.plain[name].replace(/^friction_(.*)/, (_, contact) => `friction, ${contact.replaceAll("_", " ")}`))))
  select.addEventListener("change", () => { state[key] = select.value; explorer.draw() })
}
$("sticks-of").hidden = lines.contacts.length < 2
$("sticks").replaceChildren(element("option", {value: ""}, "all contacts"), ...lines.contacts.map((name) => element("option", {value: name}, name.replaceAll("_", " "))))
$("sticks").addEventListener("change", () => { state.stick = $("sticks").value; explorer.draw() })
$("same").addEventListener("click", () => {
  state.same[explorer.kind] = !state.same[explorer.kind]
  explorer.draw()
})

// -- the clock ----------------------------------------------------------------------------------------------------

const clock = explorer.clock = {}
clock.take = () => {
  const span = explorer.motion?.packed.t ?? [0, 1]
  const scrub = $("scrub")
  scrub.min = span[0]
  scrub.max = span[1]
  state.time = Math.min(Math.max(state.time, span[0]), span[1])
}
clock.place = () => {
  $("scrub").value = state.time
  $("clock").textContent = explorer.motion ? `t = ${number(state.time, 4)} ${lines.time_unit}` : ""
  explorer.placeNow(state.time)
}
clock.set = (time) => { state.time = time; clock.take(); clock.place() }

// A motion is shown in about twelve seconds, a cycle in four.
const SECONDS = {motion: 12, cycle: 4}
let before = 0
const frame = (now) => {
  if (!state.playing || explorer.motion === null) return
  const [first, last] = explorer.motion.packed.t
  const seconds = SECONDS[explorer.kind]
  const time = state.time + Math.min(now - before, 200) / 1000*(last - first) / seconds
  before = now
  clock.set(time > last ? first : time)
  requestAnimationFrame(frame)
}
clock.toggle = (on = !state.playing) => {
  state.playing = on
  document.body.classList.toggle("playing", on)
  $("play").setAttribute("aria-label", on ? "Pause" : "Play")
  before = performance.now()
  if (on) requestAnimationFrame(frame)
}
$("play").addEventListener("click", () => clock.toggle())
$("scrub").addEventListener("input", () => { clock.toggle(false); clock.set(Number($("scrub").value)) })

// -- what is stored -----------------------------------------------------------------------------------------------

const counted = (many, word) => `${many} ${word}${many === 1 ? "" : "s"}`
const certified = (kind) => {
  const found = stored.records.map((record) => record[kind]).filter(Boolean)
  const good = found.filter((one) => one.certified).length
  return found.length ? `${counted(found.length, kind)} (${good === found.length ? "all" : good} certified)` : ""
}
const valuesOf = (at) => stored.sliders.map((slider, i) => `${slider.name} = ${withUnit(slider.values[at[i]], slider.unit)}`).join(", ")
const table = (headings, rows) => element("table", {}, element("tr", {}, ...headings.map((text) => element("th", {scope: "col"}, text))),
  ...rows.map((cells) => element("tr", {}, ...cells.map((cell) => element("td", {}, cell)))))

// Points without a certified motion, or with a cycle that is not certified.
const doubtful = () => {
  const found = new Map()
  const look = (at, moved) => {
    const record = explorer.record(at, moved)
    const why = !record.motion ? record.refused : !record.motion.certified ? record.motion.word : record.cycle && !record.cycle.certified ? `cycle ${record.cycle.word}` : null
    if (why !== null) found.set(record, [valuesOf(at), why])
  }
  const visit = (at) => at.length === stored.sliders.length ? look(at) : stored.sliders[at.length].values.forEach((_, i) => visit([...at, i]))
  if (stored.together) visit([])
  else stored.sliders.forEach((slider, i) => slider.values.forEach((_, k) => look(stored.sliders.map((other, j) => j === i ? k : explorer.nearest(other)), i)))
  return [...found.values()]
}

const missing = stored.records.filter((record) => !record.motion).length
$("about").textContent = (stored.together || sliders.length === 1 ? "The sliders move between stored motions." : "One parameter varies at a time; the others have their declared values.")
  + " ● certified, × not certified" + (missing ? ", ○ no motion" : "") + "."
$("stored").textContent = `Stored: ${[certified("motion"), certified("cycle"), missing ? counted(missing, "point") + " without a motion" : ""].filter(Boolean).join(", ")}. `
  + `There is no interpolation between stored values. Curves are rounded to a fraction of a pixel.`
$("tables").append(table(["varied", "", "stored values", "from", "to", "declared"], stored.sliders.map((s) => [named(s), s.meaning, String(s.values.length), withUnit(Math.min(...s.values), s.unit), withUnit(Math.max(...s.values), s.unit), withUnit(s.declared, s.unit)])))
if (stored.others.length) $("tables").append(table(["fixed", "", "value"], stored.others.map((o) => [named(o), o.meaning, withUnit(o.declared, o.unit)])))
$("tables").append(element("p", {}, `Motions from t = ${exact(stored.span[0])} to ${withUnit(stored.span[1], lines.time_unit)}.`))
const doubts = doubtful()
$("tables").append(doubts.length ? table(["not certified", ""], doubts) : element("p", {}, "All stored motions and cycles are certified."))
$("again").textContent = stored.command.endsWith(".toml") ? ` (${stored.command} is the model file below)` : ""
$("model").hidden = stored.toml === ""
$("toml").textContent = stored.toml
$("made").textContent = `Computed by stickslip ${stored.version} from the model ${stored.name}. This page makes no requests; save it to keep it.`

// -- it begins ----------------------------------------------------------------------------------------------------

explorer.draw()
let width = 0
new ResizeObserver(([{contentRect}]) => {
  if (contentRect.width !== width) explorer.draw()
  width = contentRect.width
}).observe(document.querySelector("main"))
document.documentElement.dataset.ready = "yes"
