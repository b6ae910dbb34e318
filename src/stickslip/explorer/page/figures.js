// Figures: where they are on the screen, whether anybody sees them, and how little is enough to draw.

// Models of the server's document are changed here without telling the server, which knows already.
explorer.setQuietly = (model, values) => { model.setv(values, {sync: false}) }
explorer.model = (name) => explorer.models?.get(name)
explorer.plots = () => explorer.models === null ? [] : [...explorer.models.values()].filter((m) => m.type === "Plot")
const views = new Map()
explorer.view = (plot) => {
  if (!views.has(plot.id)) {
    const found = window.Bokeh?.index?.find_one_by_id?.(plot.id) ?? null
    if (found === null) return null
    views.set(plot.id, found)
  }
  return views.get(plot.id)
}

// Where a figure has drawn its axes, in pixels of its element; null before it was drawn at all.
explorer.frame = (name) => {
  const plot = explorer.model(name)
  const view = plot && explorer.view(plot)
  const box = view?.frame?.bbox
  return box && box.width > 1 && box.height > 1 ? {box, view, plot} : null
}

explorer.range = (range, low, high) => {
  if (!(isFinite(low) && isFinite(high))) return
  if (low === high) { const air = Math.abs(low) * 0.1 || 1; low -= air; high += air }
  if (range.start !== low || range.end !== high) explorer.setQuietly(range, {start: low, end: high})
}

// Whether a panel is on the screen; what is not is not drawn. Asking the browser each time would make it
// compute its layout for every answer.
explorer.onScreen = new Set()
explorer.seen = (panel) => explorer.onScreen.has(panel)
explorer.look = () => {
  const sections = [...document.querySelectorAll("section[data-panel]")].filter((s) => s.offsetParent !== null)
  explorer.onScreen = new Set(sections.map((s) => s.dataset.panel))
}

// The least and the largest of many numbers; nothing if there are none.
explorer.ends = (...many) => {
  let low = Infinity, high = -Infinity
  for (const values of many) for (let i = 0; i < values.length; i++) { const v = values[i]; if (v < low) low = v; if (v > high) high = v }
  return isFinite(low) ? [low, high] : null
}

// A number at an axis: all of one axis with the same power of ten, if they need one.
explorer.tick = (value, all) => {
  const largest = all.reduce((most, v) => Math.max(most, Math.abs(v)), 0)
  const power = largest === 0 ? 0 : Math.floor(Math.log10(largest))
  const plain = power > -4 && power < 5
  const text = String(Number((plain ? value : value / 10 ** power).toPrecision(6))).replace("-", "−")
  return plain || value === 0 ? text : `${text}e${power < 0 ? "−" : ""}${Math.abs(power)}`
}

// -- what makes them quick ---------------------------------------------------------------------------

// Whenever they paint, Bokeh's figures write the place of each of their parts into a style sheet of its own,
// be it the same as before, and before each colour (--bk-...) and each text they ask the browser for styles,
// which it then computes anew: together half of what a figure costs. Here a place that has not changed is
// not written, and what is asked for is known.
const quicken = () => {
  const part = (name) => window.Bokeh?.require?.(name) ?? {}
  const sheets = part("core/dom").InlineStyleSheet?.prototype
  if (sheets?._update) {
    const update = sheets._update
    sheets._update = function (css) { if (this.el.textContent !== css) update.call(this, css) }
  }
  const visuals = part("core/visuals/visual").VisualProperties?.prototype
  if (visuals?._get_css_value) visuals._get_css_value = () => ""
  const plots = part("models/plots/plot_canvas").PlotView?.prototype
  if (plots && "base_font_size" in plots) Object.defineProperty(plots, "base_font_size", {get: () => 13})
}
explorer.guard(quicken)

// A line of many points, with as few of them as look the same: from each point that is kept the line goes
// straight on as long as it passes within a quarter of a pixel of all that it leaves out (a cone of
// directions that becomes narrower with every point; Zhao and Saalfeld 1997). Drawing a line costs a
// browser ten times as much as this. NaN is a gap, and stays one.
const NEAR = 0.25
explorer.thinned = (name, xs, ys) => {
  const frame = explorer.frame(name)
  if (frame === null || xs.length < 3) return [xs, ys]
  const {box, plot: {x_range, y_range}} = frame
  const a = box.width / (x_range.end - x_range.start), b = box.height / (y_range.end - y_range.start)
  const n = xs.length, x = new Float64Array(n), y = new Float64Array(n)
  let count = 0, anchor = 0, farthest = 0
  let lx = 0, ly = 0, rx = 0, ry = 0  // the edges of the cone, left and right; none yet if farthest is 0
  const keep = (i) => { x[count] = xs[i]; y[count++] = ys[i]; anchor = i; farthest = 0 }
  keep(0)
  for (let i = 1; i < n; i++) {
    const gap = !(xs[i] === xs[i] && ys[i] === ys[i])
    if (gap || !(xs[anchor] === xs[anchor] && ys[anchor] === ys[anchor])) {
      if (anchor !== i - 1) keep(i - 1)
      keep(i)
      continue
    }
    let dx = a * (xs[i] - xs[anchor]), dy = b * (ys[i] - ys[anchor]), far = Math.hypot(dx, dy)
    const within = farthest === 0 || (far >= farthest - NEAR && lx * dy - ly * dx <= 0 && rx * dy - ry * dx >= 0)
    if (!within) {
      keep(i - 1)
      dx = a * (xs[i] - xs[anchor]); dy = b * (ys[i] - ys[anchor]); far = Math.hypot(dx, dy)
    }
    if (far <= NEAR) continue
    const sine = NEAR / far, cosine = Math.sqrt(1 - sine * sine)
    const [px, py] = [dx * cosine - dy * sine, dx * sine + dy * cosine]
    const [qx, qy] = [dx * cosine + dy * sine, dy * cosine - dx * sine]
    if (farthest === 0 || lx * py - ly * px < 0) { lx = px; ly = py }
    if (farthest === 0 || rx * qy - ry * qx > 0) { rx = qx; ry = qy }
    if (far > farthest) farthest = far
  }
  if (anchor !== n - 1) keep(n - 1)
  return [x.subarray(0, count), y.subarray(0, count)]
}
