"""Every page of the site in Chromium: no error in the console, all pictures, no dead link within.

    NOTEBOOKS=build/notebooks python -m pytest -n 0 -m long tests/docs/test_site_in_browser.py

looks at executed notebooks, too, once `make docs` has been run.
"""

import functools
import http.server
import subprocess
import sys
import threading
import urllib.parse

import pytest

from tests.docs.test_site import ROOT
from tests.viewing import chromium

pytestmark = [pytest.mark.long, pytest.mark.skipif(chromium.path() is None, reason="no Chromium")]
LOAD_TIME = 60.0  # [s] That a page may take; notebooks have megabytes of films.
LOADED = "document.readyState === 'complete' && location.href"
BROKEN = """[
    ...[...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src),
    ...[...document.querySelectorAll('video')].filter(v => v.error).map(v => v.error.message),
]"""
EAGER = "document.querySelectorAll('img[loading=lazy]').forEach(i => { i.loading = 'eager' })"
COMPLETE = "[...document.images].every(i => i.complete)"
CUT = """[...document.querySelectorAll('pre > code')]
    .filter(c => c.scrollWidth > c.clientWidth + 1).map(c => 'cut off: ' + c.innerText)"""
LINKS = "[...document.querySelectorAll('a[href]')].map(a => a.href)"
WRAP = ".md-typeset__scrollwrap"  # Scrolls a table sideways.
FOUND = "[...document.querySelectorAll('.md-search-result__item a')].map(a => a.href)"
NAMES = "[...document.querySelectorAll('[id], a[name]')].map(e => e.id || e.name)"


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *words):
        pass


@pytest.fixture(name="site", scope="module")
def _site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    handler = functools.partial(_Quiet, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield folder, f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


def dead(links, names, folder, address):
    """Links within the site that lead to no file, or to no place of a page.

    Args:
        links: addresses by page, names: what can be led to by page; pages by their addresses.
        folder, address: of the site.
    """
    found = []
    for page, targets in links.items():
        for target in sorted({link for link in targets if link.startswith(address)}):
            whole, place = urllib.parse.urldefrag(target)
            path = folder / urllib.parse.unquote(urllib.parse.urlsplit(whole).path.lstrip("/"))
            known = path.is_file() or (path.is_dir() and (path / "index.html").is_file())
            here = names.get(whole.removesuffix("index.html"))
            is_place = not place or here is None or urllib.parse.unquote(place) in here
            if not (known and is_place):
                found.append(f"{page}: {target}")
    return found


def test_dead_links_are_found(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "index.html").touch()
    (tmp_path / "b.png").touch()
    good = ["x:/a/", "x:/a/#one", "x:/b.png", "y:/c"]
    bad = ["x:/a/#two", "x:/c", "x:/c/#one"]
    links = {"x:/a/": good + bad}
    found = dead(links, {"x:/a/": ["one"]}, tmp_path, "x:/")
    assert found == [f"x:/a/: {link}" for link in bad]


@pytest.fixture(name="browser", scope="module")
def _browser(tmp_path_factory):
    browser = chromium.Chromium(tmp_path_factory.mktemp("profile"), width=1300, height=900)
    for domain in ("Page", "Runtime", "Log"):
        browser.call(f"{domain}.enable")
    yield browser
    browser.close()


def opened(browser, page):
    """Opens a page and waits for it; what is wrong with it, as texts."""
    browser.open(page)
    chromium.wait_until(lambda: browser.evaluate(LOADED) == page, LOAD_TIME)
    browser.evaluate(EAGER)
    chromium.wait_until(lambda: browser.evaluate(COMPLETE), LOAD_TIME)
    return [f"{page}: {what}" for what in browser.errors() + browser.evaluate(BROKEN)]


def test_what_is_broken_is_found(browser, tmp_path):
    page = tmp_path / "index.html"
    page.write_text("<p>Whole.</p>")
    assert opened(browser, page.as_uri()) == []
    page.write_text("<img src='none.png'><script>console.error('says'); throw Error('no')</script>")
    wrong = "\n".join(opened(browser, page.as_uri()))
    assert all(word in wrong for word in ("none.png", "says", "Uncaught"))


def test_every_page_is_whole(site, browser):
    folder, address = site
    wrong, links, names = [], {}, {}
    for file in sorted(folder.rglob("*.html")):
        page = address + file.relative_to(folder).as_posix().removesuffix("index.html")
        wrong += opened(browser, page) + browser.evaluate(CUT)
        links[page], names[page] = browser.evaluate(LINKS), browser.evaluate(NAMES)
    assert len(links) > 40  # Data sheets, notebooks, reference and what nav lists.
    assert not wrong + dead(links, names, folder, address)


@pytest.mark.parametrize(
    "query", ["rope", "actor", "device", "make_vec", "policy", "distill", "suite.load"]
)
def test_search_lists_guides_first(site, browser, query):
    _, address = site
    browser.open(f"{address}?q={query}")
    chromium.wait_until(lambda: browser.evaluate(FOUND), LOAD_TIME)
    found = [link.removeprefix(address).split("/")[0] for link in browser.evaluate(FOUND)]
    assert not {"reference", "tasks", "changelog", "contributing"} & set(found[:2])


def test_tables_scroll_on_phones_with_their_first_column_in_place(site, browser):
    _, address = site
    phone = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    browser.call("Emulation.setDeviceMetricsOverride", **phone)
    for name in ("", "tasks/fold_cloth/", "pictures/", "results/"):
        assert opened(browser, address + name) == []
        assert browser.evaluate("document.documentElement.scrollWidth") == phone["width"]
    chromium.wait_until(lambda: browser.evaluate(f"!!document.querySelector('{WRAP}')"), LOAD_TIME)
    browser.evaluate(f"document.querySelector('{WRAP}').scrollLeft = 200")
    left = "Math.round(document.querySelector('%s').getBoundingClientRect().left)"
    assert browser.evaluate(left % f"{WRAP} td:first-child") == 0
    assert browser.evaluate(left % f"{WRAP} td:nth-child(2)") < 0
    browser.call("Emulation.clearDeviceMetricsOverride")
