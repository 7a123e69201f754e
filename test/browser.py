"""A page in a real browser without a screen: what runs over its width, what is not loaded, what it asks for."""

import html
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from conftest import LONG

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
VARIABLE = "WAM_TEST_BROWSER"
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
)  # fmt: skip
# the page stands in a frame of the asked width, because a window cannot be as narrow as a telephone
LOOK = """<!doctype html><body style="margin:0">
<iframe style="border:0;width:WIDTHpx;height:900px" srcdoc="PAGE"></iframe><pre id="seen"></pre><script>
window.addEventListener("load", () => {
  const frame = document.querySelector("iframe"), page = frame.contentDocument, own = frame.contentWindow;
  const room = page.documentElement.clientWidth;
  const all = [...page.body.querySelectorAll("*")].filter(e => !e.closest(".wide"));  // which scrolls by itself
  document.getElementById("seen").textContent = JSON.stringify({
    width: own.innerWidth,
    room: room,
    scroll: page.documentElement.scrollWidth,
    height: page.documentElement.scrollHeight,
    overflow: all.filter(e => e.getBoundingClientRect().right > room + 0.5).map(e => e.tagName),
    pictures: [...page.images].map(image => image.complete && image.naturalWidth > 0),
    charts: page.querySelectorAll("figure.chart canvas").length,
    requests: own.performance.getEntriesByType("resource").map(r => r.name).filter(n => !n.startsWith("data:")),
  });
});
</script></body>"""


def browser() -> str:
    """A browser of Chromium's kind; the test is skipped where there is none."""
    asked = os.environ.get(VARIABLE)
    found = shutil.which(asked) if asked else next(filter(None, map(shutil.which, BROWSERS)), None)
    if asked and not found:
        pytest.fail(f"{VARIABLE} names '{asked}', which cannot be run")
    if not found:
        pytest.skip(
            f"no browser to open the page in: install chromium (apt install chromium), or name one in {VARIABLE}"
        )
    return found


def looked_at(page: str, width: int, folder: Path) -> dict[str, Any]:
    """Open a page at a width, px, and measure it."""
    program = browser()
    file = folder / "look.html"
    file.write_text(LOOK.replace("WIDTH", str(width)).replace("PAGE", html.escape(page)), encoding="utf-8")
    command = [program, *FLAGS, f"--user-data-dir={folder / 'profile'}", "--window-size=1400,1000"]
    command += ["--virtual-time-budget=20000", "--dump-dom", file.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONG, check=False, cwd=folder)
    seen = re.search(r'<pre id="seen">(.+?)</pre>', done.stdout)
    assert seen, f"{program} ended with {done.returncode} and showed nothing: {done.stderr[-2000:]}"
    found: dict[str, Any] = json.loads(html.unescape(seen[1]))
    return found
