"""The page in a real browser: what is dragged, clicked, typed and shared, and what is drawn."""

from __future__ import annotations

import io
import runpy
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import stickslip as ss
from explorer.browsing import ActionChains, By, Keys, Screen
from stickslip.explorer.explore import listening_explorer
from stickslip.explorer.serving.server import Explorer
from stickslip.sweeps.request.user_measures import offered_measures


@pytest.fixture
def screen(chromium, explorer: Explorer) -> Iterator[Screen]:
    """The page; afterwards its console has no errors, and nothing was asked of anybody else."""
    page = Screen(chromium, explorer.address)
    page.drain()
    yield page
    said, asked = page.drain()
    assert said == []
    assert page.strangers(asked) == []


def assert_drawn(screen: Screen, motion: ss.Trajectory) -> None:
    """What the page has drawn is this motion: all its switches, and the numbers at all times."""
    assert_holds(screen, motion)
    lines = screen.js("explorer.model('motion3_lines').data.xs.length ?? 1")
    assert lines


def assert_holds(screen: Screen, motion: ss.Trajectory) -> None:
    """The page has the numbers of this motion."""
    t = screen.numbers("explorer.motion.t")
    assert np.isin(motion.knots.time, t).all()
    values = motion.at(t)
    index = np.searchsorted(motion.knots.time, t, side="right") - 1
    smooth = np.append(np.diff(index) == 0, False)  # not at jumps, of which one side is drawn
    for name in motion.final:
        drawn = screen.numbers(f"explorer.motion.q['{name}']")
        size = np.abs(values[name]).max() or 1.0
        assert_allclose(drawn[smooth], values[name][smooth], rtol=0, atol=1e-6 * size)


def test_a_motion_is_drawn_as_it_is_computed(screen: Screen) -> None:
    screen.open("rocking_toy?P=1.2&psi@=0.7&until=80").motion()
    toy = ss.catalogue.rocking_toy()
    expected = ss.simulate(toy, (0.0, 80.0), initial={"psi": 0.7}, parameters={"P": 1.2})
    assert_drawn(screen, expected)
    assert screen.js("explorer.motion.head.switches") == expected.n_switches
    assert "certified" in screen.element("#verdict-text").text
    assert "not" not in screen.element("#verdict-text").text
    figure = screen.js("explorer.view(explorer.model('phase')).frame.bbox.width")
    assert figure > 200


def test_dragging_a_slider(screen: Screen) -> None:
    """Pointer events move the slider; what is drawn then is the motion of that value."""
    screen.show("belt_block").motion()
    screen.js("explorer.redraws.length = 0, 0")
    screen.drag("#values-V-slider", 30)
    screen.motion()
    speed = screen.js("explorer.state.values.V")
    assert speed != ss.catalogue.belt_block().values["V"]
    assert screen.js("explorer.redraws.length") >= 3  # while it was dragged
    assert_drawn(screen, ss.simulate(ss.catalogue.belt_block(V=speed)))
    assert screen.js("Number(document.getElementById('values-V').value)") == pytest.approx(speed)


def test_a_value_is_typed(screen: Screen) -> None:
    screen.show("belt_block").motion()
    box = screen.element("#values-V")
    box.send_keys(Keys.CONTROL, "a")
    box.send_keys("1/8", Keys.ENTER)
    screen.until("explorer.state.values.V === 0.125")
    screen.motion()
    assert_drawn(screen, ss.simulate(ss.catalogue.belt_block(V=0.125)))
    box.send_keys(Keys.CONTROL, "a")
    box.send_keys("fast", Keys.ENTER)
    assert screen.js("document.querySelector('.row[data-name=V]').classList.contains('wrong')")
    assert screen.js("explorer.state.values.V") == 0.125


def test_a_click_into_the_phase_plane_starts_there(screen: Screen) -> None:
    screen.show("belt_block").motion()
    place = screen.element("section.phase .hold")
    ActionChains(screen.driver).move_to_element_with_offset(place, 40, -50).click().perform()
    screen.until("'x' in explorer.state.initial && 'd_x' in explorer.state.initial")
    screen.motion()
    initial = screen.js("explorer.state.initial")
    box = screen.js(
        "((f) => [f.box.left, f.box.top, f.box.width, f.box.height, f.plot.x_range.start,"
        " f.plot.x_range.end, f.plot.y_range.start, f.plot.y_range.end])(explorer.frame('phase'))"
    )
    assert len(box) == 8
    expected = ss.simulate(ss.catalogue.belt_block(), initial=initial)
    assert_drawn(screen, expected)
    assert screen.numbers("explorer.motion.q.x")[0] == pytest.approx(initial["x"])


def test_a_stale_answer_is_never_drawn(screen: Screen) -> None:
    """While values change faster than they can be answered, the last one stays."""
    screen.show("rocking_toy").motion()
    for value in np.linspace(0.9, 1.3, 41):
        screen.js(f"explorer.change('drag', (s) => {{ s.values.P = {value:.3f} }})")
    screen.js("explorer.change('set', (s) => { s.values.P = 1.1 })")
    screen.motion()
    assert_drawn(screen, ss.simulate(ss.catalogue.rocking_toy(P=1.1)))
    # And an answer of an older question that comes late is dropped.
    before = screen.js("explorer.motion.head.serial")
    screen.js(
        "(explorer.wire.setv({said: [JSON.stringify([{lane: 'motion', serial: 1, part: 'motion',"
        " final: true, arrays: {}}]), new Uint8Array(8)]}, {sync: false}), 1)"
    )
    assert screen.js("explorer.motion.head.serial") == before


def test_the_address_holds_the_state(screen: Screen) -> None:
    state = "rocking_toy?P=1.2&H_R=H_star*(1%20%2B%20psi)%2F2&psi%40=0.6&until=44&.x=x_R&.y=psi"
    screen.open(state).motion()
    before = screen.js("JSON.stringify(explorer.state)")
    motion = screen.numbers("explorer.motion.q.x_R")
    screen.js("explorer.address.show()")
    address = screen.driver.current_url
    assert unquote(address.partition("#")[2]).startswith("rocking_toy?P=1.2&H_R=H_star*(1 + psi)/2")
    screen.open("belt_block").motion()
    screen.open(address.partition("#")[2]).motion()
    assert screen.js("JSON.stringify(explorer.state)") == before
    assert_allclose(screen.numbers("explorer.motion.q.x_R"), motion, rtol=0, atol=0)


def test_a_link_takes_the_model_along(chromium) -> None:
    """Of a model that only this server knows: another server shows the same."""
    one = listening_explorer(ss.catalogue.belt_block(V=0.37), port=0).start()
    other = listening_explorer(None, port=0).start()
    try:
        page = Screen(chromium, one.address).open("given?x%40=0.2").motion()
        page.element("#link").click()
        page.until("explorer.shared !== undefined")
        link = page.js("explorer.shared")
        assert "own?" in link and "toml=" in link
        same = Screen(chromium, other.address).open(link.partition("#")[2]).motion()
        expected = ss.simulate(ss.catalogue.belt_block(V=0.37), initial={"x": 0.2})
        assert_drawn(same, expected)
    finally:
        chromium.get("about:blank")
        one.close()
        other.close()


def test_undo_and_redo(screen: Screen) -> None:
    screen.show("belt_block").motion()
    screen.js("explorer.change('set', (s) => { s.values.V = 0.3 })")
    screen.js("explorer.change('set', (s) => { s.values.V = 0.4 })")
    screen.press("#undo")
    assert screen.js("explorer.state.values.V") == 0.3
    ActionChains(screen.driver).key_down(Keys.CONTROL).send_keys("z").key_up(Keys.CONTROL).perform()
    assert screen.js("explorer.state.values.V ?? null") is None
    screen.press("#redo")
    screen.motion()
    assert_drawn(screen, ss.simulate(ss.catalogue.belt_block(V=0.3)))


def test_what_is_wrong_is_said_in_its_place(screen: Screen) -> None:
    """The state of a motion that is refused is on the page, and the next value is drawn again."""
    screen.show("rocking_toy?P=5")
    screen.until("!document.getElementById('refusal').hidden")
    assert "x_R" in screen.element("#refusal").text
    assert screen.element("#verdict").get_attribute("data-state") == "refused"
    screen.js("explorer.change('set', (s) => { s.values.P = 1 })")
    screen.motion()
    screen.until("document.getElementById('refusal').hidden")


def test_a_free_function_is_checked_while_it_is_typed(screen: Screen) -> None:
    screen.show("rocking_toy").motion()
    box = screen.element("#function-H_R")
    box.send_keys(Keys.CONTROL, "a")
    box.send_keys("H_star/2*(1 + cli(psi)")
    screen.until("!document.getElementById('refusal').hidden")
    box.send_keys(Keys.CONTROL, "a")
    box.send_keys("H_star/2*(1 + tanh(psi))")
    screen.until("document.getElementById('refusal').hidden")
    screen.motion()
    assert_drawn(screen, ss.simulate(ss.catalogue.rocking_toy(H_R="H_star/2*(1 + tanh(psi))")))


def test_by_keyboard_alone(screen: Screen) -> None:
    """A parameter is reached with the tabulator and changed with arrows; the clock steps."""
    screen.open("belt_block").motion()
    reached = []
    body = ActionChains(screen.driver)
    for _ in range(60):
        body.send_keys(Keys.TAB).perform()
        reached.append(screen.js("document.activeElement.id"))
        if reached[-1] == "values-V-slider":
            break
    assert reached[-1] == "values-V-slider"
    assert {"models", "link", "export", "theme"} <= set(reached)
    before = screen.js("Number(document.activeElement.value)")
    ActionChains(screen.driver).send_keys(Keys.ARROW_UP).perform()
    screen.until("'V' in explorer.state.values")
    assert screen.js("explorer.state.values.V") > before
    screen.motion()
    screen.js("document.activeElement.blur()")
    ActionChains(screen.driver).send_keys(Keys.ARROW_RIGHT).perform()
    first = screen.js("explorer.motion.numbers.switches[0]")
    assert screen.js("explorer.clock.time") == first
    ActionChains(screen.driver).send_keys(" ").perform()
    screen.until(f"explorer.clock.time > {first} + 0.2")
    ActionChains(screen.driver).send_keys(" ").perform()
    assert not screen.js("explorer.clock.playing")


@pytest.mark.parametrize("number", range(5))
def test_a_lecture_on_a_phone(screen: Screen, number: int) -> None:
    """Each link of job 6, on a small dark screen, shows the motion that was computed for it."""
    path = Path(__file__).parents[2] / "examples" / "jobs" / "06-lecture.py"
    lecture = runpy.run_path(str(path))
    step = lecture["STEPS"][number]
    assert len(lecture["STEPS"]) == 5
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    screen.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    try:
        screen.open(step.state, width=390, height=844).motion()
        assert_holds(screen, step.motion())
        assert screen.js("document.documentElement.scrollWidth") <= 390
        assert screen.js("document.documentElement.dataset.theme") == "dark"
        assert screen.js("explorer.state.panel") == (step.panel or "phase")
        assert screen.js("document.querySelector('main > section.shown').dataset.panel") == (
            step.panel or "phase"
        )
    finally:
        screen.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
        screen.driver.get("about:blank")  # the next test is not on a phone


def taken(screen: Screen, form: str) -> dict:
    """What a page gives away."""
    screen.js("(explorer.taken = null, 1)")
    screen.press("#export")
    screen.element(f"#exports [data-save={form}], #exports [data-copy={form}]").click()
    screen.until("explorer.taken !== null")
    return screen.js(
        "({text: explorer.taken.text, file: explorer.taken.file,"
        " bytes: explorer.taken.bytes ? Array.from(explorer.taken.bytes) : null})"
    )


def test_what_is_taken_away_is_what_the_library_writes(screen: Screen, tmp_path) -> None:
    screen.show("belt_block?V=0.25&x%40=0.1&until=30").motion()
    block = ss.catalogue.belt_block()
    motion = ss.simulate(block, (0.0, 30.0), initial={"x": 0.1}, parameters={"V": 0.25})
    table = pd.read_csv(io.BytesIO(bytes(taken(screen, "csv")["bytes"])))
    pd.testing.assert_frame_equal(table, motion.table, check_exact=True, check_dtype=False)

    (tmp_path / "got.nc").write_bytes(bytes(taken(screen, "nc")["bytes"]))
    got = ss.open(tmp_path / "got.nc")
    assert got.certificate.ok
    assert np.array_equal(got.knots.state, motion.knots.state)

    assert bytes(taken(screen, "png")["bytes"]).startswith(b"\x89PNG")
    assert b"<svg" in bytes(taken(screen, "svg")["bytes"])

    namespace: dict = {}
    code = taken(screen, "python")["text"]
    exec(code.replace('trajectory.plot().savefig("motion.png")', ""), namespace)
    assert np.array_equal(namespace["trajectory"].knots.state, motion.knots.state)
    assert taken(screen, "command")["text"] == (
        "stickslip run belt_block --set V=0.25 --initial x=0.1 --until 30.0"
    )
    (tmp_path / "got.toml").write_text(taken(screen, "toml")["text"], encoding="utf-8")
    again = ss.simulate(ss.load(tmp_path / "got.toml"))
    assert np.array_equal(again.knots.state, motion.knots.state)


def test_a_model_of_ones_own(screen: Screen) -> None:
    """A model file is typed, drawn, and stands in the address."""
    toml = ss.catalogue.belt_block(V=0.3).to_toml().replace('"belt_block"', '"mine"')
    screen.show("rocking_toy").motion()
    screen.driver.execute_script("explorer.useToml(arguments[0])", toml)
    screen.motion()
    assert_drawn(screen, ss.simulate(ss.catalogue.belt_block(V=0.3)))
    screen.js("explorer.address.show()")
    screen.until("location.hash.includes('toml=')")
    state = screen.driver.current_url.partition("#")[2]
    screen.open(state).motion()
    assert screen.js("explorer.described.name") == "mine"
    screen.driver.execute_script("explorer.useToml('name = ')")
    screen.until("!document.getElementById('refusal').hidden")


def test_the_gallery(screen: Screen) -> None:
    """Every system of the catalogue has a picture, and is one click away."""
    screen.open("")
    screen.until("document.getElementById('gallery').open")
    names = ss.catalogue.names()
    screen.until(f"document.querySelectorAll('.card svg').length === {len(names)}", 60)
    screen.element("#search").send_keys("crawler")
    shown = [c for c in screen.driver.find_elements(By.CSS_SELECTOR, ".card") if c.is_displayed()]
    assert [card.get_attribute("data-model") for card in shown] == ["two_leg_crawler"]
    shown[0].click()
    screen.until("explorer.described?.name === 'two_leg_crawler'")
    screen.motion()


def test_zoom_shows_more(screen: Screen) -> None:
    """A part of the time is looked at anew, as fine as the whole."""
    screen.show("plate_compactor").motion()
    screen.js("(explorer.model('time').setv({start: 1, end: 1.2}), 1)")
    screen.until("explorer.closer !== null && explorer.closer.t.length > 500")
    t = screen.numbers("explorer.closer.t")
    assert (t.min(), t.max()) == (1.0, 1.2)
    expected = ss.simulate(ss.catalogue.plate_compactor()).at(t)["x"]
    assert_allclose(screen.numbers("explorer.closer.q.x"), expected, atol=1e-12)
    screen.press("#unzoom")
    assert screen.js("explorer.model('time').end") == 4.0


def test_every_system_is_drawn(screen: Screen) -> None:
    """One after the other: its mechanism, its lines, and the verdict of the library."""
    screen.show("belt_block").motion()
    for model in ss.catalogue.names():
        screen.driver.execute_script(
            "const model = arguments[0]; explorer.motion = null;"
            "explorer.change('model', () => { explorer.state = explorer.fresh(model) })",
            model,
        )
        screen.until(f"explorer.described?.name === '{model}'")
        screen.motion()
        assert screen.js("document.querySelectorAll('#mechanism .part').length") > 0
        assert screen.js("explorer.model('motion3_lines').data.xs.length") > 0
        assert screen.element("#verdict").get_attribute("data-state") == "good", model


def test_a_killed_worker_is_told(screen: Screen, explorer: Explorer) -> None:
    screen.open("two_block_rate_and_state")
    pool = explorer.pool
    assert pool is not None
    screen.js("explorer.change('set', (s) => { s.until = 3e12 })")

    def busy() -> list:
        at_work = [w.job for w in pool.workers]
        return [
            w
            for w, job in zip(pool.workers, at_work, strict=True)
            if job is not None and job.page is not None and job.request.setting.until == 3e12
        ]

    screen.wait_for(busy, "a worker at work")
    busy()[0].process.kill()
    screen.until("document.getElementById('toast').textContent.includes('a new one was started')")
    screen.js("explorer.change('model', () => { explorer.state = explorer.fresh('belt_block') })")
    screen.motion()


def test_the_page_stays_while_a_model_loads(screen: Screen) -> None:
    """What is loading covers the mechanism and hides nothing else; nor does playing."""
    screen.show("belt_block").motion()
    loading = screen.js(
        "(explorer.change('model', () => { explorer.state = explorer.fresh('rocking_toy') }),"
        " [document.body.classList.contains('loading'), getComputedStyle(document.body).display,"
        " getComputedStyle(document.getElementById('loading')).display])"
    )
    assert loading == [True, "grid", "grid"]
    screen.motion()
    assert not screen.element("#loading").is_displayed()
    screen.press("[data-tab=branch]")
    screen.press("#play")
    assert screen.element("#branch-go").is_displayed()
    screen.press("#play")


def test_a_thinned_line_passes_through_what_it_leaves_out(screen: Screen) -> None:
    """No point of the motion is further from the lines that are drawn than half a pixel."""
    screen.show("rocking_toy").motion()
    screen.until("['motion0', 'motion1', 'motion3'].every((n) => explorer.frame(n) !== null)")
    screen.js("(explorer.drawMotion(), 1)")  # lines are thinned for the figure as it stands
    far, drawn, whole = screen.js("""(() => {
      const {t, q: {psi}} = explorer.motion
      const groups = explorer.shownGroups()
      const name = `motion${4 - groups.length + groups.findIndex((g) => g.names.includes("psi"))}`
      const {box, plot: {x_range, y_range}} = explorer.frame(name)
      const {xs: [x], ys: [y]} = explorer.model(`${name}_lines`).data
      const a = box.width / (x_range.end - x_range.start)
      const b = box.height / (y_range.end - y_range.start)
      let worst = 0, k = 0
      for (let i = 0; i < t.length; i++) {
        while (k < x.length - 2 && x[k + 1] < t[i]) k++
        const [dx, dy] = [a * (x[k + 1] - x[k]), b * (y[k + 1] - y[k])]
        const [px, py] = [a * (t[i] - x[k]), b * (psi[i] - y[k])]
        const w = Math.min(Math.max((px * dx + py * dy) / (dx * dx + dy * dy), 0), 1)
        worst = Math.max(worst, Math.hypot(px - w * dx, py - w * dy))
      }
      return [worst, x.length, t.length]
    })()""")
    assert far < 0.5
    assert drawn < whole / 2
    gap, spike = screen.js("""(() => {
      const {x_range, y_range} = explorer.model("phase")
      const at = (range, share) => range.start + share * (range.end - range.start)
      const thin = (points) => {
        const xs = points.map((p) => at(x_range, p[0])), ys = points.map((p) => at(y_range, p[1]))
        return Array.from(explorer.thinned("phase", xs, ys)[0], (x) => x === x)
      }
      const [gap, half] = [[NaN, NaN], [0.5, 0.5]]
      return [thin([[0, 0], half, [1, 1], gap, [0, 1], half, [1, 0]]),
              thin([[0, 0], [0.5, 0], [1, 0], [0.2, 0], [0.4, 0]]).length]
    })()""")
    assert gap == [True, True, False, True, True]  # a gap stays, what is straight goes
    assert spike == 4  # out, back, and out again: each end is kept


def test_an_evolution_of_ones_own(screen: Screen) -> None:
    """A file that declares one goes into the panel of effective friction, and into the address;
    its parameters are dragged there."""
    path = Path(__file__).parents[2] / "examples" / "evolution" / "plate-compactor.toml"
    screen.show("belt_block").motion()
    screen.driver.execute_script("explorer.useToml(arguments[0])", path.read_text(encoding="utf-8"))
    screen.until("explorer.evolution.resolved !== null")
    model = ss.load_evolution(path)
    assert screen.js("explorer.evolution.sets.head.costs[0].plus") == pytest.approx(
        model.potential.average().support([1.0])
    )
    assert "certified" in screen.element("#friction-said").text
    screen.drag("#given-F-slider", -20)
    screen.until("explorer.state.given.F < 900")
    F = screen.js("explorer.state.given.F")
    screen.until(
        "explorer.evolution.resolved !== null"
        f" && Math.abs(explorer.evolution.sets.head.costs[0].plus - {0.6 * (981 - F)}) < 1e-6"
    )
    screen.js("explorer.address.show()")
    screen.until("location.hash.includes('evolution=')")
    state = screen.driver.current_url.partition("#")[2]
    screen.open(state).motion()
    screen.until("explorer.evolution.sets !== null")
    assert screen.js("explorer.state.given.F") == F
    screen.press("#evolution-end")
    screen.motion()
    screen.until("explorer.friction.found !== null")
    assert "belt" in screen.js("explorer.friction.found.head.contacts[0].name")


def test_measures_are_those_of_the_library(screen: Screen) -> None:
    screen.show("belt_block?.panel=map").motion()
    screen.until("document.getElementById('map-measure').options.length > 0")
    offered = screen.js(
        "[...document.getElementById('map-measure').options].map((o) => [o.value, o.text])"
    )
    known = offered_measures(ss.catalogue.belt_block())
    assert dict(offered) == {name: said["long_name"] for name, said in known.items()}


SIZES = [(1440, 900), (1024, 768), (390, 844)]


@pytest.mark.parametrize("size", SIZES)
def test_nothing_sticks_out(screen: Screen, size: tuple[int, int]) -> None:
    """At every size each panel fits, and every button can be reached."""
    screen.open("rocking_toy", *size).motion()
    for tab in screen.js(
        "[...document.querySelectorAll('.tabs [role=tab]')].map((t) => t.dataset.tab)"
    ):
        if not screen.js(f"document.querySelector('[data-tab={tab}]').offsetParent !== null"):
            continue
        screen.element(f"[data-tab={tab}]").click()
        assert screen.js("document.documentElement.scrollWidth") <= size[0]
        wide = screen.js(
            "[...document.querySelectorAll('main section, header.top > *, footer')].filter((e) =>"
            " e.offsetParent !== null && e.getBoundingClientRect().right > innerWidth + 1)"
            ".map((e) => e.id || e.className)"
        )
        assert wide == []


def test_what_the_motion_settles_on(screen: Screen) -> None:
    """Equilibria with their kind and the cycle stand in the phase plane."""
    slider = "spring_slider?mu=2%2Fsqrt(alpha)&nu=0.05&V=0.15&.x=U&.y=alpha"
    screen.show(slider).motion()
    screen.press("#settle")
    # Kept at once: a motion that comes again outdates it.
    screen.until("(window.kept = explorer.phase.settled)?.numbers?.['c:U']")
    system = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05, V=0.15)
    cycle = ss.find_cycle(system)
    u = screen.numbers("kept.numbers['c:U']")
    low, high = cycle.extrema["U"]
    assert_allclose([u.min(), u.max()], [low, high], atol=1e-4)
    (found,) = screen.js("kept.head.equilibria")
    assert found["stable"] is False
    assert found["state"]["U"] == pytest.approx(ss.equilibria(system)[0].state["U"], rel=1e-12)
    # A busy machine paints a little later than it knows.
    screen.wait_for(lambda: "unstable" in screen.element("#phase-said").text, "what is said")


def test_branches_over_a_parameter(screen: Screen) -> None:
    """They are those of the library; the line is dragged, and a point leads to its orbit."""
    state = "spring_slider?mu=2%2Fsqrt(alpha)&nu=0.05&V=0.15&.panel=branch"
    screen.show(f"{state}&.over=V&.over.low=0.05&.over.high=0.4").motion()
    # What is found after each message, drawn or not: a busy machine paints few frames.
    screen.js(
        "(window.seen = [], window.asked = explorer.ask,"
        " explorer.ask = (lane, what, options, hear, event) =>"
        " asked(lane, what, options, (head, numbers) => { hear(head, numbers); seen.push("
        "explorer.branches.found.map((f) => [f.head.name, f.head.coming === true,"
        " f.numbers['b:V'].length])) }, event), 1)"
    )
    screen.press("#branch-go")
    screen.until("!document.body.classList.contains('following')")
    screen.motion()
    # Points came before there was a branch, and the branches have taken their place.
    seen = screen.js("window.seen")
    coming = [count for found in seen for name, on, count in found if on and name == "cycles"]
    assert coming and coming == sorted(coming)
    assert [(name, on) for name, on, _ in seen[-1]] == [("equilibria", False), ("cycles", False)]
    slider = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05, V=0.15)
    steady = ss.continue_equilibrium(slider, "V", (0.05, 0.4), parameters={"V": 0.15})
    assert_allclose(
        screen.numbers("explorer.branches.found[0].numbers['b:U']"), steady["U"], rtol=1e-12
    )
    (hopf,) = steady.of_kind("Hopf")
    special = screen.js("explorer.branches.found[0].head.special")
    assert [s["value"] for s in special if s["kind"] == "Hopf"] == [
        pytest.approx(hopf.value, rel=1e-9)
    ]
    assert "Hopf" in screen.element("#branch-said").text
    handle = screen.element("#branch-now")
    ActionChains(screen.driver, duration=40).click_and_hold(handle).move_by_offset(
        40, 0
    ).release().perform()
    screen.until("explorer.state.values.V > 0.16")
    screen.motion()
    screen.js("(explorer.branches.goTo(1, 3), 1)")
    screen.motion()
    value = screen.numbers("explorer.branches.found[1].numbers['b:V']")[3]
    assert screen.js("explorer.state.values.V") == value
    start = screen.js("explorer.state.initial")
    period = screen.numbers("explorer.branches.found[1].numbers['b:period']")[3]
    orbit = ss.simulate(slider, (0.0, period), initial=start, parameters={"V": value})
    assert orbit.final["alpha"] == pytest.approx(start["alpha"], rel=1e-6)


def test_a_map_becomes_finer_and_can_be_stopped(screen: Screen) -> None:
    state = "rocking_toy?.panel=map&.map.x=P&.map.x.low=0.8&.map.x.high=1.2&.map.y=delta"
    screen.show(f"{state}&.map.y.low=0.02&.map.y.high=0.1&.map.of=speed").motion()
    screen.press("#map-go")
    screen.until("explorer.map.found?.head.count >= 17")
    # It becomes finer while one looks: count and values are taken at once.
    count, values = screen.js(
        "[explorer.map.found.head.count, Array.from(explorer.map.found.numbers.values)]"
    )
    found = ss.sweep(
        ss.catalogue.rocking_toy(), {"P": "0.8:1.2:9", "delta": "0.02:0.1:9"}, ["speed"], workers=1
    )
    got = np.array(values, float).reshape(count, count)
    step = (count - 1) // 8
    assert_allclose(got[::step, ::step], found["speed"].transpose("delta", "P"), rtol=1e-12)
    assert "stickslip sweep rocking_toy" in screen.js("explorer.map.found.head.command")
    ends = screen.js(  # colours of the least and the largest value, also taken at once
        "(() => { const v = Array.from(explorer.map.found.numbers.values).filter(isFinite);"
        " const c = explorer.model('map_fields').data.color;"
        " return [Math.min(...v), Math.max(...v)].map((x) => c[v.indexOf(x)]) })()"
    )
    assert ends[1] == "rgb(253,231,37)" and ends[0] != ends[1]
    assert screen.js("getComputedStyle(explorer.$('map-bar')).background").count("rgb") >= 5
    screen.press("#map-go")
    screen.until("!explorer.map.busy")
    place = screen.element("section.map .hold")
    ActionChains(screen.driver).move_to_element_with_offset(place, 30, 20).click().perform()
    screen.until("'P' in explorer.state.values && 'delta' in explorer.state.values")
    screen.motion()


def test_effective_friction(screen: Screen) -> None:
    """Of the toy: a leg without weight is held by the joints alone."""
    screen.show("rocking_toy?.panel=friction").motion()
    screen.until("explorer.friction.found !== null")
    first = screen.js("explorer.friction.found.head.contacts[0]")
    assert first["plus"] == pytest.approx(ss.catalogue.rocking_toy().values["rho"], abs=1e-9)
    assert "0.2" in screen.element("#friction-said").text


def test_data_beside_the_motion(screen: Screen) -> None:
    """A file is dropped: its residuals are those of the library, and a fit finds what made it."""
    block = ss.catalogue.forced_oscillator()
    t = np.linspace(0.0, 30.0, 120)
    x = ss.simulate(block, (0.0, 30.0), parameters={"F_c": 0.4}).at(t)["x"]
    csv = pd.DataFrame({"t": t, "x": x}).to_csv(index=False)
    screen.show("forced_oscillator?until=30").motion()
    screen.driver.execute_script("explorer.dropped('x.csv', arguments[0])", csv)
    screen.until("explorer.data.residual !== null")
    expected = x - ss.simulate(block, (0.0, 30.0)).at(t)["x"]
    assert_allclose(screen.numbers("explorer.data.residual.numbers.residual"), expected, atol=1e-12)
    screen.press("#data-free [data-name=F_c]")
    screen.press("#data-go")
    screen.until("explorer.data.fitted !== undefined", 60)
    assert screen.js("explorer.state.values.F_c") == pytest.approx(0.4, rel=1e-6)


def test_in_a_frame_as_notebooks_show_it(screen: Screen, explorer: Explorer, tmp_path) -> None:
    """What a notebook is given is a frame in which the page works."""
    html = explorer._repr_html_().replace('/"', '/#belt_block"', 1)
    page = tmp_path / "notebook.html"
    page.write_text(f"<!doctype html><body>{html}", encoding="utf-8")
    screen.driver.get("about:blank")
    screen.drain()
    screen.driver.get(page.as_uri())
    screen.driver.switch_to.frame(screen.element("iframe"))
    screen.until("document.documentElement.dataset.ready === 'yes'")
    screen.motion()
    assert screen.js("explorer.described.name") == "belt_block"
    screen.driver.switch_to.default_content()


def test_a_motion_that_is_refused_stops_nothing(screen: Screen) -> None:
    """Whatever is clicked while there is no motion, the page goes on."""
    screen.show("rocking_toy").motion()
    screen.js("explorer.change('set', (s) => { s.values.P = 5 })")
    screen.until("!document.getElementById('refusal').hidden")
    for selector in (".chip", "#play", "#next", "#previous", "#ghost", "#settle", "#unzoom"):
        screen.js(f"document.querySelector('{selector}').click()")
    for tab in ("branch", "map", "friction", "data", "phase"):
        screen.element(f"[data-tab={tab}]").click()
    screen.press("#undo")
    screen.js("explorer.change('set', (s) => { delete s.values.P })")
    screen.motion()
    assert_drawn(screen, ss.simulate(ss.catalogue.rocking_toy()))
