// What a person takes away: the address, texts on the clipboard, files.
explorer.copy = async (text, what) => {
  try {
    await navigator.clipboard.writeText(text)
    explorer.toast(`Copied: ${what}`)
  } catch {
    // A browser may not allow that (a notebook's frame): show it, to be copied by hand.
    const box = explorer.element("textarea", {rows: 12, style: "width:min(640px,86vw);margin:14px", "aria-label": what})
    box.value = text
    const dialog = explorer.element("dialog", {onclose: () => dialog.remove()}, box)
    document.body.append(dialog)
    dialog.showModal()
    box.select()
  }
}

// A model that only this program was opened with goes along in the link, if it is not too long.
explorer.$("link").addEventListener("click", async () => {
  await explorer.address.show()
  const {state, described} = explorer
  let hash = explorer.address.write(state)
  if (state.model === "given" && described?.toml && described.toml.length < 20000) {
    await explorer.address.pack(described.toml)
    hash = explorer.address.write({...state, model: "own", toml: described.toml})
  }
  explorer.shared = `${location.href.split("#")[0]}#${hash}`
  explorer.copy(explorer.shared, "the URL; open it with: stickslip explore 'URL'")
})

const exports = explorer.$("exports")
const open = (on) => { exports.hidden = !on; explorer.$("export").setAttribute("aria-expanded", String(on)) }
explorer.$("export").addEventListener("click", () => { open(exports.hidden); if (!exports.hidden) exports.querySelector("button").focus() })
document.addEventListener("click", (event) => { if (!event.target.closest(".menu")) open(false) })
exports.addEventListener("keydown", (event) => {
  const items = [...exports.querySelectorAll("button")]
  const step = {ArrowDown: 1, ArrowUp: -1}[event.key]
  if (step) { items[(items.indexOf(document.activeElement) + step + items.length) % items.length].focus(); event.preventDefault() }
  if (event.key === "Escape") { open(false); explorer.$("export").focus() }
})

explorer.taken = null  // what was taken last, for who tests it
for (const item of exports.querySelectorAll("[data-copy], [data-save]")) {
  item.addEventListener("click", () => {
    open(false)
    const form = item.dataset.copy ?? item.dataset.save
    if (item.dataset.save) explorer.toast("Saving the file")
    explorer.ask("export", "export", {form}, (head, numbers) => {
      if (head.refused) return explorer.toast(head.refused.reason)
      if (head.text) { explorer.taken = head; explorer.copy(head.text, item.textContent) }
      if (head.file) {
        explorer.taken = {...head, bytes: numbers.bytes}
        const anchor = explorer.element("a", {href: URL.createObjectURL(new Blob([numbers.bytes], {type: head.type})), download: head.file})
        anchor.click()
        setTimeout(() => URL.revokeObjectURL(anchor.href), 10000)
      }
    })
  })
}
