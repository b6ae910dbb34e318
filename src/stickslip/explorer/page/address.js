// The state as the part of the address behind the #, and back: rocking_toy?P=1.2&psi@=0.8&until=60
//
// NAME=VALUE sets a parameter or a function, NAME@=VALUE an initial value, .NAME=VALUE what a panel
// shows, ~NAME=VALUE a parameter of an evolution. Texts of one's own are packed (deflated, base64) as toml=...
// and evolution=...; nothing here goes to a server.
explorer.address = {}
const PACKED = ["toml", "evolution"]
const packed = new Map()  // codes of texts

explorer.address.write = (state) => {
  const parts = []
  const add = (name, value) => parts.push(`${encodeURIComponent(name)}=${encodeURIComponent(value)}`)
  for (const [name, value] of Object.entries(state.values)) add(name, value)
  for (const [name, value] of Object.entries(state.initial)) add(`${name}@`, value)
  if (state.until !== null) add("until", state.until)
  if (state.panel !== "phase") add(".panel", state.panel)
  for (const [name, value] of Object.entries(state.view)) add(`.${name}`, value)
  for (const [name, value] of Object.entries(state.given)) add(`~${name}`, value)
  const model = state.toml ? "own" : state.model
  for (const key of PACKED) if (packed.has(state[key])) parts.push(`${key}=${packed.get(state[key])}`)
  return parts.length ? `${model}?${parts.join("&")}` : model
}

explorer.address.read = async (text) => {
  const [model, , query] = text.replace(/^#/, "").match(/^([^?]*)(\?(.*))?$/s)?.slice(1) ?? ["", "", ""]
  const state = explorer.fresh(decodeURIComponent(model) || explorer.facts.first)
  for (const pair of (query ?? "").split("&").filter(Boolean)) {
    const at = pair.indexOf("=")
    if (at < 1) continue
    let name, value
    try {
      name = decodeURIComponent(pair.slice(0, at))
      value = decodeURIComponent(pair.slice(at + 1).replace(/\+/g, " "))
    } catch { continue }  // not of this page's writing
    const number = explorer.typed(value)
    if (PACKED.includes(name)) state[name] = await explorer.address.unpack(value)
    else if (name === "until") state.until = isFinite(number) ? number : null
    else if (name === ".panel") state.panel = value
    else if (name.startsWith("~")) { if (isFinite(number)) state.given[name.slice(1)] = number }
    else if (name.startsWith(".")) state.view[name.slice(1)] = value
    else if (name.endsWith("@")) { if (isFinite(number)) state.initial[name.slice(0, -1)] = number }
    else state.values[name] = isFinite(number) ? number : value
  }
  if (state.toml) state.model = "own"
  return state
}

explorer.address.pack = async (text) => {
  if (text === "" || packed.has(text)) return
  const stream = new Blob([text]).stream().pipeThrough(new CompressionStream("deflate-raw"))
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer())
  const code = btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join(""))
  packed.set(text, code.replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, ""))
}

explorer.address.unpack = async (code) => {
  try {
    const bytes = Uint8Array.from(atob(code.replace(/-/g, "+").replace(/_/g, "/")), (c) => c.charCodeAt(0))
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"))
    const text = (await new Response(stream).text()).slice(0, 200000)
    packed.set(text, code)
    return text
  } catch { return "" }
}

explorer.address.show = async () => {
  for (const key of PACKED) await explorer.address.pack(explorer.state[key])
  const hash = `#${explorer.address.write(explorer.state)}`
  if (hash !== location.hash) history.replaceState(null, "", hash)
}
explorer.address.soon = explorer.debounced(() => explorer.address.show(), 250)

explorer.listen((kind) => { if (!["drag", "theme", "resize", "described"].includes(kind)) explorer.address.soon() })

// Somebody pastes another state into the address.
window.addEventListener("hashchange", async () => {
  const state = await explorer.address.read(location.hash)
  if (explorer.address.write(state) === explorer.address.write(explorer.state)) return
  explorer.state = state
  explorer.change("model")
})
