"""What a person does with the page, and what is seen there."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import numpy as np

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from selenium import webdriver
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.remote.webelement import WebElement

__all__ = ["ActionChains", "By", "Keys", "Screen"]


class Screen:
    """The page in a browser.

    Parameters
    ----------
    driver : webdriver.Chrome
    address : str
        Without the part behind the #.
    """

    def __init__(self, driver: webdriver.Chrome, address: str) -> None:
        self.driver = driver
        self.address = address.partition("#")[0]

    def open(self, state: str, width: int = 1440, height: int = 900) -> Screen:
        """Load the page anew, in a state, and wait until it stands."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.driver.get("about:blank")
        self.drain()
        self.driver.get(f"{self.address}#{state}")
        self.until("document.documentElement.dataset.ready === 'yes'")
        return self

    def show(self, state: str) -> Screen:
        """Another state in the page that is open, if it is this server's: a second less."""
        if not self.driver.current_url.startswith(self.address):
            return self.open(state)
        self.driver.execute_async_script(
            "const [text, done] = arguments; explorer.address.read(text).then((state) => {"
            " for (const lane of explorer.lanes.keys()) explorer.cancel(lane);"
            " explorer.state = state; explorer.motion = null; explorer.change('model'); done() })",
            state,
        )
        return self

    def motion(self) -> Screen:
        """Wait until a motion is there with its verdict, and nothing is under way."""
        self.until(
            "explorer.motion !== null && explorer.described !== null"
            " && [...explorer.lanes.values()]"
            ".every((own) => own.serial < 0 && own.waiting === null)"
        )
        return self

    def js(self, code: str, *given: Any) -> Any:
        """The value of an expression on the page."""
        return self.driver.execute_script(f"return ({code})", *given)

    def until(self, condition: str, seconds: float = 30.0) -> None:
        """Wait for something on the page."""
        self.wait_for(lambda: self.js(condition), condition, seconds)

    def wait_for(self, holds: Callable[[], Any], what: str, seconds: float = 30.0) -> None:
        """Wait for something."""
        ends = time.monotonic() + seconds
        while time.monotonic() < ends:
            try:
                if holds():
                    return
            except Exception as error:
                if "explorer is not defined" not in str(error):
                    raise
            time.sleep(0.03)
        raise AssertionError(f"waited in vain for: {what}")

    def element(self, selector: str) -> WebElement:
        """An element by a CSS selector."""
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def press(self, selector: str) -> None:
        """Click on an element, as soon as it can be seen."""
        element = self.element(selector)
        self.wait_for(
            lambda: element.is_displayed() and element.is_enabled(), f"{selector} in view"
        )
        element.click()

    def numbers(self, code: str) -> np.ndarray:
        """An array of the page."""
        return np.array(self.js(f"Array.from({code})"), float)

    def drag(self, selector: str, by: int, steps: int = 12) -> None:
        """Drag the thumb of a slider by pixels."""
        slider = self.element(selector)
        share = self.js(
            "((s) => (s.value - s.min)/(s.max - s.min))(document.querySelector(arguments[0]))",
            selector,
        )
        width = slider.size["width"] - 16
        chain = ActionChains(self.driver, duration=20)
        chain.move_to_element_with_offset(slider, round((share - 0.5) * width), 0).click_and_hold()
        for _ in range(steps):
            chain.move_by_offset(by // steps, 0)
        chain.release().perform()

    def drain(self) -> tuple[list[str], list[str]]:
        """Errors of the console, and addresses that the browser has asked for, since the last
        time."""
        said = [
            entry["message"]
            for entry in self.driver.get_log("browser")
            if entry["level"] in ("SEVERE", "WARNING")
        ]
        asked = []
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] in ("Network.requestWillBeSent", "Network.webSocketCreated"):
                request = message["params"]
                asked.append(request.get("request", request)["url"])
        return said, asked

    def strangers(self, asked: list[str]) -> list[str]:
        """Those of the addresses that are not the server's."""
        own = urlsplit(self.address).netloc
        return [
            url
            for url in asked
            if urlsplit(url).netloc != own
            and urlsplit(url).scheme not in ("data", "blob", "about", "chrome", "file")
        ]
