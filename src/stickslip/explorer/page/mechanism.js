// The mechanism: the scene that the server has described (shapes, and where they are at the times of the
// motion), moved by the clock. It is drawn as SVG, so that a frame costs a few attributes: a figure would
// draw all that it shows anew.
explorer.mechanism = {nodes: [], scene: null}

const SVG = "http://www.w3.org/2000/svg"
const svgElement = (name, attributes = {}) => {
  const made = document.createElementNS(SVG, name)
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value)
  return made
}

// One node for each part; `place(get, mode)` puts it where it is, get(name) giving its numbers.
const makers = {
  polygon: (part) => shaped(part, "polygon"),
  path: (part) => shaped(part, "polyline"),
  curve: (part) => {
    const node = svgElement("polyline")
    return [node, (get) => node.setAttribute("points", Array.from({length: part.count}, (_, i) => `${get(`x${i}`)},${get(`y${i}`)}`).join(" "))]
  },
  disc: (part) => {
    const node = svgElement("g")
    node.append(svgElement("circle", {r: part.radius}))
    for (let i = 0; i < part.spokes; i++) {
      const angle = 2 * Math.PI * i / part.spokes
      node.append(svgElement("line", {x1: 0, y1: 0, x2: 0.92 * part.radius * Math.cos(angle), y2: 0.92 * part.radius * Math.sin(angle)}))
    }
    return [node, (get) => node.setAttribute("transform", turn(get))]
  },
  rod: () => {
    const node = svgElement("line")
    return [node, (get) => ends(node, get)]
  },
  arrow: () => {
    const node = svgElement("g")
    const [shaft, tip] = [svgElement("line"), svgElement("polygon", {points: "0,0 -0.2,0.09 -0.2,-0.09"})]
    node.append(shaft, tip)
    return [node, (get) => {
      ends(shaft, get)
      const angle = Math.atan2(get("y2") - get("y"), get("x2") - get("x")) * 180 / Math.PI
      tip.setAttribute("transform", `translate(${get("x2")} ${get("y2")}) rotate(${angle})`)
    }]
  },
  spring: (part) => {
    const node = svgElement("polyline")
    return [node, (get) => {
      const [x, y, x2, y2] = ["x", "y", "x2", "y2"].map(get)
      const length = Math.hypot(x2 - x, y2 - y) || 1e-9
      const [dx, dy] = [(x2 - x) / length, (y2 - y) / length]
      const points = [[0, 0], [0.12, 0]]
      for (let i = 0; i < 2 * part.coils; i++) points.push([0.12 + 0.76 * (i + 0.5) / (2 * part.coils), i % 2 ? -part.width : part.width])
      points.push([0.88, 0], [1, 0])
      node.setAttribute("points", points.map(([s, w]) => `${x + s * length * dx - w * dy},${y + s * length * dy + w * dx}`).join(" "))
    }]
  },
  ground: (part, scene) => {
    const node = svgElement("g")
    const marks = svgElement("path")
    const far = 3 * scene.width
    const gap = scene.width / 26
    node.append(svgElement("rect", {x: -far, y: -far, width: 2 * far, height: far, class: "earth"}), svgElement("line", {x1: -far, y1: 0, x2: far, y2: 0}), marks)
    let d = ""
    for (let x = -far; x < far; x += gap) d += `M${x} 0l${-gap * 0.55} ${-gap * 0.55}`
    marks.setAttribute("d", d)
    return [node, (get, mode, middle) => {
      // The marks move with the ground; they repeat, so they never run out.
      const from = middle - ((middle - get("x")) % gap)
      node.setAttribute("transform", `rotate(${part.tilt * 180 / Math.PI}) translate(${from} ${get("y")})`)
    }]
  },
  label: (part) => {
    const node = svgElement("text", {"text-anchor": "middle"})
    node.textContent = part.text
    return [node, (get) => node.setAttribute("transform", `translate(${get("x")} ${get("y")}) scale(1 -1)`)]
  },
}
const shaped = (part, name) => {
  const node = part.smooth ? svgElement("path", {d: roundedPath(part.points)}) : svgElement(name, {points: part.points.map((p) => p.join(",")).join(" ")})
  return [node, (get) => node.setAttribute("transform", turn(get))]
}
// A closed curve through points, Catmull and Rom's.
const roundedPath = (points) => {
  const at = (i) => points[(i + points.length) % points.length]
  let d = `M${at(0)}`
  for (let i = 0; i < points.length; i++) {
    const [before, from, to, after] = [at(i - 1), at(i), at(i + 1), at(i + 2)]
    const out = [0, 1].map((k) => from[k] + (to[k] - before[k]) / 6), back = [0, 1].map((k) => to[k] - (after[k] - from[k]) / 6)
    d += `C${out} ${back} ${to}`
  }
  return d + "Z"
}
const turn = (get) => `translate(${get("x")} ${get("y")}) rotate(${get("turn") * 180 / Math.PI})`
const ends = (node, get) => {
  node.setAttribute("x1", get("x")); node.setAttribute("y1", get("y"))
  node.setAttribute("x2", get("x2")); node.setAttribute("y2", get("y2"))
}

// Fill an SVG with a scene; gives the parts with their numbers.
const build = (svg, scene, numbers) => {
  const world = svgElement("g", {class: "world"})
  const parts = scene.parts.map((part) => {
    const [node, place] = makers[part.kind](part, scene)
    node.setAttribute("class", `part ${part.kind} ${part.look}`)
    world.append(node)
    return {node, place, contact: part.contact, values: Object.entries(part.values)}
  })
  svg.setAttribute("viewBox", `${-scene.width / 2} ${-(scene.bottom + scene.height)} ${scene.width} ${scene.height}`)
  svg.setAttribute("aria-label", scene.about || "The mechanism")
  svg.replaceChildren(world)
  return {world, parts, scene, numbers}
}

const LOOKS = {"-1": "minus", 0: "stick", 1: "plus", 2: "open", 3: "plus"}
const put = (built, i, w, modes) => {
  const {numbers, scene} = built
  const value = (entry) => {
    if (typeof entry !== "string") return entry ?? 0
    const values = numbers[entry]
    return values[i] + (w ? w * (values[i + 1] - values[i]) : 0)
  }
  const middle = value(scene.follow)
  built.world.setAttribute("transform", `scale(1 -1) translate(${-middle} 0)`)
  for (const part of built.parts) {
    const found = {}
    for (const [name, entry] of part.values) found[name] = value(entry)
    part.place((name) => found[name], null, middle)
    if (part.contact && modes[part.contact]) {
      const look = LOOKS[modes[part.contact][i]] ?? "plus"
      if (part.look !== look) {
        if (part.look) part.node.classList.remove(part.look)
        part.node.classList.add(part.look = look)
      }
    }
  }
}

explorer.mechanism.take = () => {
  const {head, numbers} = explorer.motion
  const svg = document.querySelector("#mechanism svg")
  const key = JSON.stringify(head.scene.parts.map((p) => [p.kind, p.look, p.contact, p.points, p.text, p.radius, p.tilt, p.count])) + [head.scene.width, head.scene.height]
  const old = explorer.mechanism.built
  if (old && explorer.mechanism.key === key) {
    old.scene = head.scene
    old.numbers = numbers
    old.parts.forEach((part, i) => { part.values = Object.entries(head.scene.parts[i].values) })
  } else {
    explorer.mechanism.key = key
    explorer.mechanism.built = build(svg, head.scene, numbers)
  }
}

// Where everything is at a time; the switches themselves are among the samples.
explorer.mechanism.place = (time) => {
  const built = explorer.mechanism.built
  if (!built || explorer.motion === null) return
  const {t, modes} = explorer.motion
  const i = explorer.before(t, time)
  const gap = t[i + 1] - t[i]
  put(built, i, i + 1 < t.length && gap > 0 ? Math.min(Math.max((time - t[i]) / gap, 0), 1) : 0, modes)
}

explorer.before = (t, time) => {
  let [low, high] = [0, t.length - 1]
  while (low < high) {
    const middle = (low + high + 1) >> 1
    if (t[middle] <= time) low = middle; else high = middle - 1
  }
  return low
}

// A picture that stands still, for the gallery.
explorer.mechanism.still = (scene, numbers) => {
  const svg = svgElement("svg", {"aria-hidden": "true"})
  const modes = {}
  for (const [name, values] of Object.entries(numbers)) if (name.startsWith("mode:")) modes[name.slice(5)] = values
  put(build(svg, scene, numbers), 0, 0, modes)
  return svg
}
