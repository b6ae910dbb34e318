// Questions to the server, and its answers.
//
// There are lanes. In each, one question is under way; of those that come meanwhile only the newest is
// kept and asked as soon as the first part of an answer is there. So while a slider is dragged every
// answer is drawn, none is old, and none waits in a queue. Answers that are no longer wanted are dropped.
explorer.wire = null
explorer.lanes = new Map()
explorer.serial = 0
const PATIENCE = 400  // ms after which a newer question goes out although the older one has no answer

explorer.ask = (lane, what, options, hear, event = null) => {
  const state = explorer.state
  const text = JSON.stringify({
    lane, what, options,
    setting: {model: state.toml ? "" : state.model, toml: state.toml, values: state.values,
              initial: state.initial, until: state.until},
  })
  const own = explorer.lanes.get(lane) ?? {serial: -1, waiting: null, hear: null, since: 0, timer: null}
  explorer.lanes.set(lane, own)
  own.waiting = {text, hear, stamp: event ?? performance.now()}
  explorer.send(own)
}

explorer.send = (own) => {
  if (own.waiting === null || explorer.wire === null) return
  const waited = performance.now() - own.since
  if (own.serial >= 0 && waited < PATIENCE) {
    own.timer ??= setTimeout(() => { own.timer = null; explorer.send(own) }, PATIENCE - waited + 1)
    return
  }
  const {text, hear, stamp} = own.waiting
  own.waiting = null
  own.serial = explorer.latest = ++explorer.serial
  own.hear = hear
  own.since = performance.now()
  own.stamp = stamp
  explorer.wire.asked = `{"serial":${own.serial},${text.slice(1)}`
}

explorer.cancel = (lane) => {
  const own = explorer.lanes.get(lane)
  if (!own || own.serial < 0) return
  own.serial = -1
  own.waiting = null
  explorer.wire.asked = JSON.stringify({serial: ++explorer.serial, lane, what: "cancel", setting: {}})
}

// An answer may have several parts; `numbers` are its arrays by name, views of the bytes that came.
explorer.heard = () => {
  if (explorer.wire.said === null) return
  const [text, bytes] = explorer.wire.said
  for (const head of JSON.parse(text)) explorer.guard(() => {
    const own = explorer.lanes.get(head.lane)
    if (head.lost) explorer.toast("A worker process ended; a new one was started.")
    if (own === undefined || head.serial !== own.serial) return  // stale
    if (head.compiling) return explorer.showCompiling()
    const numbers = {}
    for (const [name, [kind, at, length]] of Object.entries(head.arrays)) {
      numbers[name] = new KINDS[kind](bytes.buffer, bytes.byteOffset + at, length)
    }
    own.hear(head, numbers, own.stamp)
    if (head.final) own.serial = -1
    // The rest of an answer (the certificate) is given up for a newer question.
    if (own.waiting !== null) { own.serial = -1; explorer.send(own) }
  })
}
const KINDS = {f8: Float64Array, f4: Float32Array, i4: Int32Array, u1: Uint8Array}
