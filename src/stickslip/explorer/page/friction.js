// Effective friction: the stable set as it goes with the motion, and what is left of it on the average.
explorer.friction = {found: null}
explorer.listen((kind) => {
  if (kind === "model") { explorer.cancel("friction"); explorer.friction.found = null; explorer.friction.asked = null }
  if (kind === "set") explorer.friction.asked = null
  if (kind === "drag") return
  explorer.friction.soon()
})
explorer.friction.soon = explorer.debounced(() => {
  if (explorer.state.evolution !== "" || !explorer.seen("friction") || explorer.motion === null) return
  if (explorer.friction.asked === null || explorer.friction.asked === undefined) explorer.friction.look()
  else explorer.friction.draw()
}, 200)

explorer.friction.look = () => {
  explorer.friction.asked = true
  explorer.$("friction-said").replaceChildren(explorer.element("p", {class: "busy"}, "Computing one period of the long-term motion"))
  explorer.ask("friction", "friction", {}, (head, numbers) => {
    if (head.refused) { explorer.$("friction-said").replaceChildren(explorer.element("p", {class: "hint"}, head.refused.reason)); explorer.friction.found = null; explorer.friction.draw(); return }
    if (head.part === "friction") { explorer.friction.found = {head, numbers}; explorer.friction.draw() }
  })
}
explorer.$("friction-go").addEventListener("click", () => explorer.friction.look())
explorer.$("friction-contact").addEventListener("change", () => explorer.change("view", (s) => { s.view.contact = explorer.$("friction-contact").value }))

explorer.friction.draw = () => {
  if (explorer.state.evolution !== "" || !explorer.seen("friction") || explorer.models === null) return
  const {found} = explorer.friction
  const lines = {xs: [], ys: [], color: [], dash: [], width: []}
  const average = {y0: [], y1: [], color: []}
  const slip = {x0: [], x1: [], color: []}
  const second = found !== null && found.head.contacts.length > 1
  document.querySelector(".friction .figure").classList.toggle("void", found === null)
  explorer.$("friction-second").hidden = !second
  if (found !== null) {
    const {head, numbers} = found
    const select = explorer.$("friction-contact")
    const names = head.contacts.map((c) => c.key).join()
    if (select.dataset.names !== names) {
      select.dataset.names = names
      select.replaceChildren(...head.contacts.map((c) => explorer.element("option", {value: c.key}, c.name)))
    }
    const shown = head.contacts.find((c) => c.key === explorer.state.view.contact) ?? head.contacts[0]
    select.value = shown.key
    const t = numbers.t, force = numbers[`force:${shown.key}`], plus = numbers[`plus:${shown.key}`], minus = numbers[`minus:${shown.key}`]
    const threshold = explorer.tone(explorer.facts.colours.threshold)
    const below = minus.map((v) => -v)
    let low = 0, high = 0
    for (const [values, color, dash, width] of [[plus, threshold, "solid", 1.6], [below, threshold, "solid", 1.6], [force, explorer.colour(0), "solid", 1.8]]) {
      lines.xs.push(t); lines.ys.push(values); lines.color.push(color); lines.dash.push(dash); lines.width.push(width)
      for (const v of values) { if (v < low) low = v; if (v > high) high = v }
    }
    average.y0.push(-shown.minus); average.y1.push(shown.plus); average.color.push(explorer.colour(2))
    const mode = numbers[`mode:${shown.key}`]
    for (let i = 0; i < t.length;) {
      let j = i
      while (j + 1 < t.length && mode[j + 1] === mode[i]) j++
      if (mode[i] !== 0 && t[Math.min(j + 1, t.length - 1)] > t[i]) { slip.x0.push(t[i]); slip.x1.push(t[Math.min(j + 1, t.length - 1)]); slip.color.push(explorer.tone(explorer.facts.colours[mode[i] > 0 ? "slip+" : "slip-"])) }
      i = j + 1
    }
    const plot = explorer.model("friction")
    explorer.range(plot.x_range, 0, t[t.length - 1])
    const air = 0.08 * (high - low) || 1
    explorer.range(plot.y_range, low - air, high + air)
    explorer.$("friction-caption").textContent = `force [${shown.unit || "1"}] over t [${head.time_unit || "1"}]`
    if (second) drawForces(head, numbers, shown)
    sayFriction(head, shown)
  }
  explorer.setQuietly(explorer.model("friction_lines"), {data: lines})
  explorer.setQuietly(explorer.model("friction_average"), {data: average})
  explorer.setQuietly(explorer.model("friction_slip"), {data: slip})
}

// The forces of two contacts in the plane: K(t) at some times, the set that all have in common, and the way
// of the forces, which move with it.
const drawForces = (head, numbers, shown) => {
  const other = head.contacts.find((c) => c.key !== shown.key)
  explorer.$("forces-caption").textContent = `force on ${shown.name} (horizontal) and on ${other.name} (vertical)`
  const sets = {left: [], right: [], bottom: [], top: [], color: []}
  const add = (left, right, bottom, top, color, share) => {
    color += Math.round(255 * share).toString(16).padStart(2, "0")
    for (const [name, value] of Object.entries({left, right, bottom, top, color})) sets[name].push(value)
  }
  const t = numbers.t
  let reach = 0
  for (let k = 0; k < 12; k++) {
    const i = Math.round(k * (t.length - 1) / 12)
    const sides = [-numbers[`minus:${shown.key}`][i], numbers[`plus:${shown.key}`][i], -numbers[`minus:${other.key}`][i], numbers[`plus:${other.key}`][i]]
    add(...sides, explorer.tone(explorer.facts.colours.threshold), 0.04)
    reach = Math.max(reach, ...sides.map(Math.abs))
  }
  add(-shown.minus, shown.plus, -other.minus, other.plus, explorer.colour(2), 0.35)
  explorer.setQuietly(explorer.model("forces_sets"), {data: sets})
  explorer.setQuietly(explorer.model("forces_lines"), {data: {xs: [numbers[`force:${shown.key}`]], ys: [numbers[`force:${other.key}`]], color: [explorer.colour(0)], dash: ["solid"], width: [2]}})
  const plot = explorer.model("forces")
  explorer.range(plot.x_range, -1.08 * reach, 1.08 * reach)
  explorer.range(plot.y_range, -1.08 * reach, 1.08 * reach)
}

const sayFriction = (head, shown) => {
  const n = explorer.number
  const unit = shown.unit
  const equal = Math.abs(shown.plus - shown.minus) < 1e-9 * (shown.plus + shown.minus)
  explorer.$("friction-said").replaceChildren(
    explorer.element("p", {}, head.period === null ? "The motion is not periodic; its second half is shown." : `One period, ${n(head.period)} ${head.time_unit}, of the long-term motion.`),
    explorer.element("p", {html: equal
      ? `<i>Ψ</i><sub>av</sub>(<i>v</i>) = ${n(shown.plus)} ${unit} · |<i>v</i>|, while the mean threshold is ${n(shown.mean)} ${unit}.`
      : `<i>Ψ</i><sub>av</sub>(<i>v</i>) = ${n(shown.plus)} ${unit} · <i>v</i> forward, ${n(shown.minus)} ${unit} · |<i>v</i>| backward, while the mean threshold is ${n(shown.mean)} ${unit}.`}),
    explorer.element("p", {}, `Minimum at t = ${n(shown.plus_at, 4)} ${head.time_unit} (forward) and ${n(shown.minus_at, 4)} ${head.time_unit} (backward): under fast oscillations the contact moves at these phases. In this motion it slips ${n(100 * shown.slips, 3)} % of the time.`),
    explorer.element("p", {class: "hint"}, `Green: forces that are stable at every phase, sampled at ${head.samples} times. Line: the force on the contact. Edges: the thresholds.`))
}
