// The clock: one time for the mechanism, the line over the rows, the point in the phase plane, and the
// numbers beside the names. It runs on arrays that are here already; no frame asks the server for anything.
explorer.clock = {time: 0, playing: false, share: null, last: 0}
const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4, 8, 16, 32]

// The usual speed shows the whole motion in about half a minute, or is real time if that is not much longer.
explorer.clock.usual = () => {
  const {head} = explorer.motion
  const length = head.end - head.span[0]
  return length >= 2 && length <= 60 ? 1 : length / 30 || 1
}
explorer.clock.rate = () => (explorer.state.view.speed ? Number(explorer.state.view.speed) : 1) * explorer.clock.usual()

explorer.clock.take = (before) => {
  const {span, end} = explorer.motion.head
  const scrub = explorer.$("scrub")
  scrub.min = span[0]
  scrub.max = end
  // After a change the clock stays where it is, as long as the motion is there.
  if (before === null || explorer.clock.time < span[0] || explorer.clock.time > end) explorer.clock.time = span[0]
  showSpeeds()
  explorer.clock.place()
}

const showSpeeds = () => {
  const usual = explorer.clock.usual()
  const select = explorer.$("speed")
  const key = `${usual}|${explorer.motion.head.time_unit}`
  if (select.dataset.key === key) return
  select.dataset.key = key
  select.replaceChildren(...SPEEDS.map((s) => explorer.element("option", {value: s}, `${explorer.number(s * usual, 2)} ×`)))
  select.value = explorer.state.view.speed ?? "1"
}
explorer.$("speed").addEventListener("change", () => explorer.change("view", (state) => {
  const chosen = explorer.$("speed").value
  if (chosen === "1") delete state.view.speed; else state.view.speed = chosen
}))

explorer.clock.set = (time) => {
  if (explorer.motion === null) return
  const {span, end} = explorer.motion.head
  explorer.clock.time = Math.min(Math.max(time, span[0]), end)
  explorer.clock.place()
}

explorer.clock.toggle = (on = !explorer.clock.playing) => {
  explorer.clock.playing = on && explorer.motion !== null
  document.body.classList.toggle("playing", explorer.clock.playing)
  explorer.$("play").setAttribute("aria-label", explorer.clock.playing ? "Pause" : "Play")
  if (!explorer.clock.playing) return
  const {span, end} = explorer.motion.head
  if (explorer.clock.time >= end) explorer.clock.time = span[0]
  explorer.clock.last = performance.now()
  requestAnimationFrame(frame)
}

const frame = (now) => {
  if (!explorer.clock.playing || explorer.motion === null) return
  const passed = Math.min(now - explorer.clock.last, 200) / 1000
  explorer.clock.last = now
  const {span, end} = explorer.motion.head
  const from = explorer.clock.time
  let time = from + passed * explorer.clock.rate()
  explorer.sound?.between(from, time)
  if (time >= end) time = span[0]  // and again
  explorer.clock.time = time
  explorer.guard(placeNow)
  requestAnimationFrame(frame)
}

// To the next or previous switch, exactly.
explorer.clock.jump = (direction) => {
  if (explorer.motion === null) return
  explorer.clock.toggle(false)
  const {switches} = explorer.motion.numbers
  const time = explorer.clock.time
  let found = null
  if (direction > 0) found = switches.find((s) => s > time)
  else for (const s of switches) { if (s < time) found = s; else break }
  const {span, end} = explorer.motion.head
  explorer.clock.set(found ?? (direction > 0 ? end : span[0]))
}

// -- showing it ------------------------------------------------------------------------------------------

// However many things ask for it, once a frame.
let asked = false
explorer.clock.place = () => {
  if (asked) return
  asked = true
  requestAnimationFrame(() => { asked = false; explorer.guard(placeNow) })
}
const placeNow = () => {
  if (explorer.motion === null) return
  const {time} = explorer.clock
  const {head, t, q} = explorer.motion
  explorer.mechanism.place(time)
  const scrub = explorer.$("scrub")
  if (document.activeElement !== scrub || explorer.clock.playing) scrub.value = time
  explorer.$("clock").textContent = `t = ${time.toPrecision(4)} ${head.time_unit}`
  const i = explorer.before(t, time)
  if (explorer.seen("motion")) placeLine(time, q, i)
  if (explorer.seen("phase")) placeSpot(q, i, time, t)
}

const placeLine = (time, q, i) => {
  const line = explorer.$("now")
  const frame = explorer.frame("motion3")
  if (frame === null) { line.hidden = true; return }
  const range = explorer.model("time")
  const share = (time - range.start) / (range.end - range.start)
  line.hidden = !(share >= 0 && share <= 1)
  line.style.transform = `translateX(${frame.box.left + share * frame.box.width}px)`
  if (!explorer.probed) showNumbers(q, i)
}
const showNumbers = (q, i) => {
  for (const place of document.querySelectorAll("#rows b[data-value]")) {
    const text = explorer.number(q[place.dataset.value]?.[i], 4)
    if (place.textContent !== text) place.textContent = text
  }
}

const placeSpot = (q, i, time, t) => {
  const spot = explorer.$("spot")
  const frame = explorer.frame("phase")
  if (frame === null) { spot.hidden = true; return }
  const [across, up] = explorer.phase.axes()
  const gap = t[i + 1] - t[i]
  const w = i + 1 < t.length && gap > 0 ? Math.min(Math.max((time - t[i]) / gap, 0), 1) : 0
  const at = (values) => values[i] + (w ? w * (values[i + 1] - values[i]) : 0)
  const {box, plot} = frame
  const x = (at(q[across]) - plot.x_range.start) / (plot.x_range.end - plot.x_range.start)
  const y = (at(q[up]) - plot.y_range.start) / (plot.y_range.end - plot.y_range.start)
  spot.hidden = !(x >= 0 && x <= 1 && y >= 0 && y <= 1)
  spot.style.transform = `translate(${box.left + x * box.width}px, ${box.bottom - y * box.height}px)`
}

explorer.$("play").addEventListener("click", () => explorer.clock.toggle())
explorer.$("next").addEventListener("click", () => explorer.clock.jump(1))
explorer.$("previous").addEventListener("click", () => explorer.clock.jump(-1))
explorer.$("scrub").addEventListener("input", () => { explorer.clock.toggle(false); explorer.clock.set(Number(explorer.$("scrub").value)) })

// -- reading off: the numbers follow the pointer over the rows; a click sets the clock ------------------------

explorer.probed = false
const timeUnder = (event) => {
  const frame = explorer.frame("motion3")
  if (frame === null || explorer.motion === null) return null
  const edge = explorer.$("rows").getBoundingClientRect()
  const share = (event.clientX - edge.left - frame.box.left) / frame.box.width
  if (share < 0 || share > 1) return null
  const range = explorer.model("time")
  return {time: range.start + share * (range.end - range.start), x: frame.box.left + share * frame.box.width}
}
explorer.clock.watch = () => {
  const rows = explorer.$("rows")
  let down = null
  rows.addEventListener("pointermove", (event) => explorer.guard(() => {
    const found = timeUnder(event)
    const probe = explorer.$("probe")
    explorer.probed = found !== null
    probe.hidden = found === null
    if (found === null) return
    probe.style.transform = `translateX(${found.x}px)`
    probe.textContent = `t = ${found.time.toPrecision(4)}`
    showNumbers(explorer.motion.q, explorer.before(explorer.motion.t, found.time))
  }), true)
  rows.addEventListener("pointerleave", () => explorer.guard(() => {
    explorer.probed = false
    explorer.$("probe").hidden = true
    explorer.clock.place()
  }))
  rows.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY] }, true)
  rows.addEventListener("pointerup", (event) => explorer.guard(() => {
    if (down === null || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4) return
    const found = timeUnder(event)
    if (found) { explorer.clock.toggle(false); explorer.clock.set(found.time) }
  }), true)
}

// -- sound on wish: a tick for every switch ---------------------------------------------------------------------

explorer.sound = {context: null, on: false}
explorer.$("sound").addEventListener("click", () => {
  explorer.sound.on = !explorer.sound.on
  explorer.$("sound").setAttribute("aria-pressed", String(explorer.sound.on))
  explorer.sound.context ??= new AudioContext()
})
explorer.sound.between = (from, to) => {
  if (!explorer.sound.on || explorer.motion === null) return
  let ticks = 0
  for (const s of explorer.motion.numbers.switches) {
    if (s > to || ticks > 20) break
    if (s > from) { tick(explorer.sound.context, explorer.sound.context.currentTime + (s - from) / explorer.clock.rate()); ticks++ }
  }
}
const tick = (context, when) => {
  const [tone, volume] = [context.createOscillator(), context.createGain()]
  tone.frequency.value = 900
  volume.gain.setValueAtTime(0.12, when)
  volume.gain.exponentialRampToValueAtTime(1e-4, when + 0.04)
  tone.connect(volume).connect(context.destination)
  tone.start(when); tone.stop(when + 0.05)
}
