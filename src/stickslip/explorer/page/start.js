// The beginning: called once by the server's document as soon as the figures stand.
explorer.begin = async (wire, models) => {
  explorer.wire = wire
  explorer.models = models instanceof Map ? models : new Map(Object.entries(models))
  wire.properties.said.change.connect(() => explorer.guard(explorer.heard))
  const wished = localStorage.getItem("stickslip-theme")
  const dark = matchMedia("(prefers-color-scheme: dark)")
  explorer.setTheme(wished ?? (dark.matches ? "dark" : "light"))
  dark.addEventListener("change", () => {
    if (localStorage.getItem("stickslip-theme") === null) explorer.setTheme(dark.matches ? "dark" : "light")
  })
  explorer.watchTime()
  explorer.phase.watch()
  explorer.phase.watchView()
  explorer.branches.watch()
  explorer.map.watch()
  explorer.clock.watch()
  explorer.state = await explorer.address.read(location.hash)
  explorer.change("model")
  if (location.hash.length < 2 && explorer.facts.first !== "given") explorer.gallery.open()
  document.documentElement.dataset.ready = "yes"
}

// The connection: the page says when it is gone.
window.addEventListener("load", () => {
  const timer = setInterval(() => {
    const document_ = window.Bokeh?.documents?.[0]
    if (document_ === undefined) return
    clearInterval(timer)
    document_.on_event?.("connection_lost", () => { explorer.$("lost").hidden = false })
  }, 100)
})
// What is laid over a figure follows its size.
const placeAgain = explorer.debounced(() => {
  if (explorer.wire === null) return
  for (const place of [explorer.clock.place, explorer.branches.place, explorer.map.place]) explorer.guard(place)
}, 80)
for (const figure of document.querySelectorAll(".figure")) new ResizeObserver(placeAgain).observe(figure)

explorer.$("reload").addEventListener("click", () => location.reload())

explorer.$("theme").addEventListener("click", () => {
  const theme = explorer.dark() ? "light" : "dark"
  localStorage.setItem("stickslip-theme", theme)
  explorer.setTheme(theme)
})
document.querySelector(".skip").addEventListener("click", (event) => { event.preventDefault(); explorer.$("controls").focus() })
explorer.$("undo").addEventListener("click", () => explorer.travel(explorer.past, explorer.future))
explorer.$("redo").addEventListener("click", () => explorer.travel(explorer.future, explorer.past))

// -- tabs ------------------------------------------------------------------------------------------

explorer.showPanel = (panel) => {
  const tabs = [...document.querySelectorAll(".tabs [role=tab]")]
  if (!tabs.some((tab) => tab.dataset.tab === panel)) panel = "phase"
  const shown = tabs.find((tab) => tab.dataset.tab === panel && tab.offsetParent !== null) ?? tabs.find((tab) => tab.dataset.tab === "phase")
  // On a narrow screen tabs go on beyond its edge.
  if (document.body.dataset.panel !== shown.dataset.tab) shown.scrollIntoView({block: "nearest", inline: "center"})
  document.body.dataset.panel = shown.dataset.tab
  for (const section of document.querySelectorAll("main > section.panel")) {
    section.classList.toggle("shown", section.dataset.panel === shown.dataset.tab)
  }
  for (const tab of tabs) {
    tab.setAttribute("aria-selected", tab === shown)
    tab.tabIndex = tab === shown ? 0 : -1
  }
  explorer.look()
}
for (const tab of document.querySelectorAll(".tabs [role=tab]")) {
  tab.addEventListener("click", () => explorer.change("view", (s) => { s.panel = tab.dataset.tab }))
  tab.addEventListener("keydown", (event) => {
    const step = {ArrowLeft: -1, ArrowRight: 1}[event.key]
    if (!step) return
    const shown = [...document.querySelectorAll(".tabs [role=tab]")].filter((t) => t.offsetParent !== null)
    const next = shown[(shown.indexOf(tab) + step + shown.length) % shown.length]
    next.focus(); next.click(); event.preventDefault(); event.stopPropagation()
  })
}
explorer.parts.unshift((kind, state) => { if (kind !== "drag" && kind !== "theme") explorer.showPanel(state.panel) })
new ResizeObserver(explorer.debounced(() => {
  if (explorer.wire === null) return
  explorer.showPanel(explorer.state.panel)
  for (const part of explorer.parts) explorer.guard(() => part("resize", explorer.state))
}, 120)).observe(document.body)

// -- keys ------------------------------------------------------------------------------------------

document.addEventListener("keydown", (event) => explorer.guard(() => {
  const key = event.key.toLowerCase()
  if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y")) {
    if (event.target.matches("textarea, input[type=text]")) return
    event.preventDefault()
    if (key === "y" || event.shiftKey) explorer.travel(explorer.future, explorer.past)
    else explorer.travel(explorer.past, explorer.future)
    return
  }
  if (event.ctrlKey || event.metaKey || event.altKey) return
  if (event.target.closest("input, textarea, select, button, summary, dialog, a") && !(key === " " && event.target === document.body)) return
  if (key === " ") { event.preventDefault(); explorer.clock.toggle() }
  if (key === "arrowright") { event.preventDefault(); explorer.clock.jump(1) }
  if (key === "arrowleft") { event.preventDefault(); explorer.clock.jump(-1) }
}))
