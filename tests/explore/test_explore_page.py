"""The page in a real browser: load, drag, change, profiles, phone, dark, save, two tabs; and who may ask the server."""

import http.client
import io
import re
import shutil
import signal
import time
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from asperity import geometry as geo
from asperity.geometry.plotting.walls import vertical_stretch
from commands import ended, environment, refused, started

pytest.importorskip("panel", reason="the page needs asperity[explore]")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
]  # fmt: skip
# Milliseconds; a machine with other work takes long.
PATIENCE = 60_000
# Bytes of memory that a closed tab may leave; without a leak it is about 1,000.
LEFT = 100_000
# Milliseconds: longer than the server waits for the websocket of a page that it has given.
LATE = 7000
# Of the figure of the wall, from bokeh's own views: the pixel of the vertex k, all vertices, the words above the wall
# and beside it, pixels a unit of y over those of x; and the answers at the same moment.
VERTEX = """k => {
  const find = view => {
    if (view.model.toolbar?.tools?.some(tool => tool.type == "PointDrawTool")) return view
    for (const child of view.child_views ?? []) { const found = find(child); if (found) return found }
    return null
  }
  const roots = Array.from(Bokeh.index)
  const view = roots.map(find).find(found => found)
  const {data} = view.model.toolbar.tools.find(tool => tool.type == "PointDrawTool").renderers[0].data_source
  const {left, top} = view.el.getBoundingClientRect()
  const x = Array.from(data.x), y = Array.from(data.y)
  const {x_scale, y_scale} = view.frame, size = scale => Math.abs(scale.compute(1) - scale.compute(0))
  const {title, above, left: beside} = view.model
  const words = [title.text.text ?? title.text, ...above.map(one => one.text), beside[0].axis_label.text].join(" | ")
  return {x, y, at: [left + x_scale.compute(x[k]), top + y_scale.compute(y[k])], words,
          stretch: size(y_scale) / size(x_scale), answers: FIND(".asperity-answers").innerText}
}""".replace(
    "FIND",
    """(selector => {
    const find = root => root.querySelector(selector) ?? Array.from(root.querySelectorAll("*"))
      .map(one => one.shadowRoot && find(one.shadowRoot)).find(found => found)
    return find(document)
  })""",
)
PHONE = {"viewport": {"width": 360, "height": 740}, "is_mobile": True, "has_touch": True}


class Server:
    """`asperity explore` in a process of its own."""

    def __init__(self, *arguments, folder, waits_for="shows the page"):
        # a browser that writes down what it is asked for, and a module that must not be imported
        browser = folder / "browser"
        browser.write_text(f'#!/bin/sh\necho "$@" > {folder}/part && mv {folder}/part {folder}/asked\n')
        browser.chmod(0o700)
        (folder / "trap.py").write_text(f"open({str(folder / 'sprung')!r}, 'w')\n")
        command, env = ["-m", "asperity", "explore", *arguments, "--port", "0"], environment(BROWSER=f"{browser} %s")
        self.process, self.folder = started(*command, cwd=folder, env=env), folder
        self.lines = []
        for line in self.process.stderr:
            self.lines.append(line)
            if waits_for in line:
                break
        assert waits_for in self.lines[-1], self.lines
        found = re.search(r"http://127\.0\.0\.1:(\d+)(/[-\w]{43}/)", self.lines[-1])
        if found:
            self.address, self.port, self.path = found[0], int(found[1]), found[2]

    def stop(self):
        """Ctrl-C, which ends it at once in one line."""
        begun = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        self.process.wait(20)
        assert time.monotonic() - begun < 5.0
        assert self.process.returncode == 130
        assert self.process.stderr.read() == "asperity: interrupted\n"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("server")
    with Server("triangular-teeth:angle=0.9", "--out", str(folder / "saved"), folder=folder) as made:
        yield made


@pytest.fixture(scope="module")
def server_without_folder(tmp_path_factory):
    with Server("triangular-teeth", folder=tmp_path_factory.mktemp("server")) as made:
        yield made


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="the browser is driven by playwright")
    if CHROMIUM is None:
        pytest.skip("no chromium is installed here")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture
def page(browser, server):
    yield from opened_tab(browser, server)


def opened_tab(browser, server, late=0, **options):
    tab = browser.new_page(**{"viewport": {"width": 1400, "height": 1100}, **options})
    tab.set_default_timeout(PATIENCE)
    tab.requests, tab.errors = [], []
    tab.on("request", lambda request: tab.requests.append(request.url))
    tab.on("pageerror", lambda error: tab.errors.append(str(error)))
    if late:
        tab.route("**/bokeh.min.js*", lambda route: (tab.wait_for_timeout(late), route.continue_()))
    tab.goto(server.address)
    settled(tab)
    yield tab
    assert tab.errors == []
    tab.close()


def settled(tab):
    tab.get_by_role("status").filter(has_text=re.compile("^done$")).wait_for()


def answers(tab):
    return tab.locator(".asperity-answers").inner_text()


@contextmanager
def held(tab, k, right, down):
    """Drag the vertex k by so many pixels, in steps as a hand does, and drop it at the end."""
    x, y = tab.evaluate(VERTEX, k)["at"]
    tab.mouse.move(x, y)
    tab.mouse.down()
    for step in range(1, 9):
        tab.mouse.move(x + right * step / 8, y + down * step / 8)
        tab.wait_for_timeout(30)
    yield
    tab.mouse.up()


def is_dark(tab, **options):
    """Whether the page is dark; but for the kernel, the wall and the letters everything has the one colour."""
    grey = imread(io.BytesIO(tab.screenshot(**options)), format="png")[..., :3].mean(axis=2)
    return np.median(grey) < 0.2 and np.mean(grey > 0.95) < 0.02


def wait_until(condition, pause=lambda milliseconds: time.sleep(0.001 * milliseconds)):
    """Wait for a condition; a tab has a pause of its own, in which its messages come."""
    end = time.monotonic() + 0.001 * PATIENCE
    while not condition():
        assert time.monotonic() < end
        pause(50)


def vertices_when(tab, condition):
    """The vertices (x, y) as soon as they meet a condition."""
    found = {}

    def met():
        found.update(tab.evaluate(VERTEX, 0))
        return condition(found["x"], found["y"])

    wait_until(met, tab.wait_for_timeout)
    return found["x"], found["y"]


def test_the_page_loads_from_this_machine_alone_and_answers_for_the_disk(page, server):
    assert {url.split("/")[2] for url in page.requests if "//" in url} == {f"127.0.0.1:{server.port}"}
    before = answers(page)
    assert "no gap" in before and "exact" in before
    assert page.evaluate(VERTEX, 1)["y"][1] == pytest.approx(geo.triangular_teeth(0.9).vertices[1, 1])
    assert not is_dark(page)
    slider = page.locator(".noUi-handle").nth(1)
    slider.focus()
    for _ in range(20):
        slider.press("ArrowRight")
    wait_until(lambda: answers(page) != before, page.wait_for_timeout)


def test_a_dragged_vertex_changes_wall_and_answers_while_it_is_still_held(page):
    before, text = page.evaluate(VERTEX, 1), answers(page)
    with held(page, 1, 25, -40):
        x, _ = vertices_when(page, lambda x, y: x[1] > before["x"][1] + 0.02 and y[1] > before["y"][1] + 0.05)
        assert (x[0], x[2]) == (0, 1)
        wait_until(lambda: answers(page) != text, page.wait_for_timeout)
    page.locator(".asperity-answers").get_by_text("exact").wait_for()
    settled(page)
    assert answers(page) != text
    # the ends of the period stay where they are
    with held(page, 0, 30, 30):
        vertices_when(page, lambda x, y: (x[0], y[0]) != (0, 0))
    vertices_when(page, lambda x, y: (x[0], y[0]) == (0, 0))


def test_a_tap_adds_a_vertex_and_a_wall_that_crosses_itself_is_refused_while_the_last_answer_stays(page):
    found = page.evaluate(VERTEX, 0)
    (x0, y0), (x1, y1) = found["at"], page.evaluate(VERTEX, 1)["at"]
    page.mouse.click(0.5 * (x0 + x1) - 12, 0.5 * (y0 + y1) + 6)
    # the tap adds it at the end of the list, the page moves it into its side
    x, _ = vertices_when(page, lambda x, _: len(x) == len(found["x"]) + 1 and x[-1] == 1)
    assert x[1] == pytest.approx(0.25, abs=0.1)
    assert x == sorted(x)
    page.get_by_label("Wall", exact=True).select_option("rectangular-teeth")
    vertices_when(page, lambda x, _: len(x) == 5)
    settled(page)
    text = answers(page)
    (x2, _), (x4, _) = (page.evaluate(VERTEX, k)["at"] for k in (2, 4))
    # the lower left corner of the crevice beyond its right side
    with held(page, 2, 1.2 * (x4 - x2), -15):
        pass
    alert = page.get_by_role("alert").inner_text()
    assert "cross" in alert
    assert "The last valid answer stays" in alert
    assert len(answers(page).splitlines()) == len(text.splitlines())
    # the vertices return to those of the last valid wall
    x, y = vertices_when(page, lambda x, _: x[2] < x[4])
    assert geo.Wall.from_vertices(list(zip(x, y, strict=True))).closes


def test_another_wall_and_another_convention_change_the_gap_and_no_old_answer_stands_under_a_new_wall(page):
    page.get_by_label("Wall", exact=True).select_option("focusing-arcs")
    seen = []
    while not (seen and "isolated" in seen[-1]["answers"]):
        seen.append(page.evaluate(VERTEX, 0))
        page.wait_for_timeout(20)
    # teeth have no gap, arcs have one
    assert "focusing" in seen[-1]["words"]
    assert all("triangular" in found["words"] or "no gap" not in found["answers"] for found in seen)
    settled(page)
    assert "0.63297" in answers(page)
    page.get_by_text("specular = identity").click()
    page.locator(".asperity-answers").get_by_text("specular convention").wait_for()
    page.locator(".asperity-answers").get_by_text("isolated").wait_for()
    assert "0.688" in answers(page)


@pytest.mark.parametrize("number", [400, 20_000])
def test_a_wrong_file_is_refused_and_the_profile_after_it_is_stretched_and_has_its_answers(page, tmp_path, number):
    text, wrong = answers(page), tmp_path / "wrong.toml"
    wrong.write_text("period = [")
    page.locator("input[type=file]").set_input_files(wrong)
    assert "wrong.toml" in page.get_by_role("alert").inner_text()
    assert answers(page) == text
    x, rng = np.linspace(0.0, 200.0, number), np.random.default_rng(0)
    waves = np.arange(1, 60)
    heights = np.cos(x[:, None] * waves * np.pi / 100.0 + rng.uniform(0.0, 6.0, waves.size)) @ (0.5 / waves**1.5)
    np.savetxt(tmp_path / "rough.csv", np.c_[x, heights], delimiter=",", header="x [um], height [um]", comments="")
    page.locator("input[type=file]").set_input_files(tmp_path / "rough.csv")
    page.get_by_role("status").filter(has_text="known so far").wait_for()
    page.locator(".asperity-answers").get_by_text("tangential").wait_for()
    assert page.get_by_role("alert").count() == 0
    found = page.evaluate(VERTEX, 0)
    stretch = vertical_stretch(geo.wall_from_text(str(tmp_path / "rough.csv")))
    assert stretch > 5.0
    assert found["stretch"] == pytest.approx(stretch, rel=1e-6)
    assert found["words"].startswith("rough, depth")
    assert f"angles not to scale | y (um), stretched {stretch:.3g} times" in found["words"]
    assert found["x"] == []
    assert re.search(r"tangential 0\.\d+\(\d+\), normal 0\.\d+\(\d+\); resistance of a tumbling body 1\.\d+\(\d+\)",
                     found["answers"])  # fmt: skip


def test_on_a_dark_phone_all_is_dark_and_nothing_wider_than_the_screen_and_the_answers_come_first(browser, server):
    for tab in opened_tab(browser, server, color_scheme="dark", **PHONE):
        assert is_dark(tab, full_page=True)
        assert tab.evaluate("[innerWidth, document.documentElement.scrollWidth]") == [360, 360]
        boxes = [
            tab.locator(selector).first.bounding_box()
            for selector in ("[role=status]", ".asperity-answers", ".bk-Figure", "select", "input[type=file]")
        ]
        assert all(box["x"] >= 0 and box["x"] + box["width"] <= 360 for box in boxes)
        tops = [box["y"] for box in boxes]
        assert tops == sorted(tops)


def test_what_is_saved_is_the_wall_of_its_tab_in_the_folder_that_was_named(page, browser, server):
    for other in opened_tab(browser, server, late=LATE):
        other.get_by_label("Wall", exact=True).select_option("mushrooms")
        other.get_by_text("stem_to_cap").wait_for()
        # one that connects late asks the network for nothing
        assert {url.split("/")[2] for url in other.requests if "//" in url} == {f"127.0.0.1:{server.port}"}
    page.get_by_role("button", name="Save the wall").click()
    line = page.get_by_role("log").filter(has_text="wrote").inner_text()
    assert geo.load_wall(Path(line.removeprefix("wrote "))) == geo.triangular_teeth(0.9)
    page.get_by_role("button", name="Make the study").click()
    page.get_by_role("log").filter(has_text="being made").wait_for()
    page.get_by_role("log").filter(has_text="wrote").wait_for()
    folder = Path(page.get_by_role("log").inner_text().removeprefix("wrote "))
    assert folder.parent == server.folder / "saved"
    assert (folder / "study.json").exists()
    assert (folder / "kernel.npz").exists()


def test_without_a_folder_the_browser_takes_wall_and_study(browser, server_without_folder, tmp_path):
    for tab in opened_tab(browser, server_without_folder):
        with tab.expect_download() as download:
            tab.get_by_text("Save the wall").click()
        download.value.save_as(tmp_path / "wall.toml")
        assert geo.load_wall(tmp_path / "wall.toml") == geo.triangular_teeth(0.7)
        tab.get_by_role("button", name="Make the study").click()
        with tab.expect_download() as download:
            tab.get_by_text("Take the study").click()
        assert download.value.suggested_filename == "triangular-teeth.zip"


# -- who may ask


def answer_to(server, path=None, method="GET", **headers):
    # by default a file, which is made sooner than a page
    path = path or f"{server.path}static/js/bokeh.min.js"
    with closing(http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)) as connection:
        connection.request(method, path, headers=headers)
        with connection.getresponse() as response:
            return response.status


# What a browser sends to open a websocket.
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "A" * 24,
}


@pytest.mark.parametrize("upgrade", [{}, UPGRADE], ids=["page", "websocket"])
def test_other_hosts_origins_and_tokens_are_refused(server, upgrade):
    own, path = f"127.0.0.1:{server.port}", f"{server.path}ws" if upgrade else None
    for host in (own, f"localhost:{server.port}"):
        assert answer_to(server, path, Host=host, Origin=f"http://{host}", **upgrade) == (101 if upgrade else 200)
    for host in ("evil.example", f"evil.example:{server.port}", "127.0.0.1", f"{own}.evil.example"):
        assert answer_to(server, path, Host=host, **upgrade) == 403, host
    for origin in ("http://evil.example", "null", f"http://{own}.evil.example", f"https://{own}"):
        assert answer_to(server, path, Origin=origin, **upgrade) == 403, origin
    for token in ("/", f"/{'A' * 43}/"):
        assert answer_to(server, f"{token}ws", Origin=f"http://{own}", **upgrade) == 403, token


# The module's name comes first in the addresses of panel's handler of components, which imports it.
ADDRESSES = (
    "", "ws", "metadata", "autoload.js?bokeh-autoload-element=a", "static/js/bokeh.min.js", "components/{}/a/b/c",
    "components/{}/A/__css__/c", "static/extensions/panel/panel.min.js", "favicon.ico", "admin", "liveness", "rest",
)  # fmt: skip


def test_no_handler_is_reached_with_another_host_origin_method_or_without_the_token():
    from tornado.httputil import HTTPHeaders, HTTPServerRequest, RequestStartLine
    from tornado.web import ErrorHandler

    from asperity.explore.server import page_server

    server = page_server(port=0)
    try:
        port, token = server.port, server.prefix
        mine = {"Host": f"127.0.0.1:{port}"}

        def refused(path, headers, method="GET"):
            line = RequestStartLine(method, path, "HTTP/1.1")
            request = HTTPServerRequest(start_line=line, headers=HTTPHeaders(headers))
            found = server._tornado.find_handler(request)
            return found.handler_class is ErrorHandler and found.handler_kwargs == {"status_code": 403}

        # every pattern of every handler that bokeh and panel have, with something for what varies
        patterns = [rule.matcher.regex.pattern for rule in server._tornado.wildcard_router.rules]
        paths = {re.sub(r"\(.*\)", "a/b/c/d", pattern).rstrip("$").replace("?", "") for pattern in patterns}
        paths |= {f"{token}/{address}" for address in ADDRESSES}
        assert len(paths) > 15
        assert any("components" in path for path in paths)
        for path in paths:
            for wrong in (
                {"Host": "evil.example"}, {"Host": f"evil.example:{port}"}, {"Host": "127.0.0.1"},
                {**mine, "Origin": "http://evil.example"}, {**mine, "Origin": "null"}, {**mine, "Origin": ""},
            ):  # fmt: skip
                assert refused(path, wrong), (path, wrong)
            for method in ("POST", "PUT", "OPTIONS", "DELETE", "HEAD"):
                assert refused(path, mine, method), (path, method)
            for other in (path.replace(token, ""), path.replace(token, "/A" + token[2:]), f"http://a{path}"):
                assert refused(other or "/", mine), other
        for path in (f"{token}/", f"{token}/ws", f"{token}/static/js/bokeh.min.js"):
            assert not refused(path, {**mine, "Origin": f"http://127.0.0.1:{port}"}), path
        for path in ("components/a/b/c/d", "metadata", "autoload.js", "admin", "ws/", "static"):
            assert refused(f"{token}/{path}", mine), path
    finally:
        server._http.stop()


def test_no_address_runs_a_module_or_ends_the_server(server):
    modules = ("unittest.__main__", "trap", "antigravity")
    for address in dict.fromkeys(address.format(module) for module in modules for address in ADDRESSES):
        named = any(module in address for module in modules)
        for path in ("/", server.path):
            for foreign in ({}, {"Host": "evil.example", "Origin": "http://evil.example"}):
                status = answer_to(server, path + address, **foreign)
                assert status == 403 or (path == server.path and not foreign and not named)
    assert answer_to(server, server.path) == 200
    assert server.process.poll() is None
    assert not (server.folder / "sprung").exists()


CLOSED_TABS = """
import asyncio, gc, tracemalloc
from tornado.httpclient import AsyncHTTPClient
from asperity.explore import server
from asperity.explore.background import Background
from asperity.explore.page import Page

# what a tab computes is in another process
Background.ask = lambda *_, **__: None

async def open_and_close(server, tabs):
    (context,) = server._tornado.applications.values()
    for _ in range(tabs):
        await AsyncHTTPClient().fetch(f"http://127.0.0.1:{server.port}{server.prefix}/", request_timeout=60)
        (session,) = context.sessions
        await context._discard_session(session, lambda _: True)
    gc.collect()

if __name__ == "__main__":
    # milliseconds: none ends by itself
    server.CLOSED_AFTER = 10**7
    server = server.page_server(port=0)
    server.start()
    server.io_loop.run_sync(lambda: open_and_close(server, 1))
    tracemalloc.start()
    server.io_loop.run_sync(lambda: open_and_close(server, 1))
    before = tracemalloc.get_traced_memory()[0]
    server.io_loop.run_sync(lambda: open_and_close(server, 1))
    left = tracemalloc.get_traced_memory()[0] - before
    print(left, sum(type(thing) is Page for thing in gc.get_objects()))
"""


@pytest.mark.slow
def test_closed_tabs_leave_no_memory(tmp_path):
    (tmp_path / "tabs.py").write_text(CLOSED_TABS)
    done = ended("tabs.py", cwd=tmp_path, check=True)
    left, pages = map(int, done.stdout.split())
    # the last one may still be held by the loop of the server
    assert pages <= 1
    assert left < LEFT


def test_only_the_loopback_address_listens(server):
    # states of sockets: the local address is hexadecimal, 0A is LISTEN
    tables = [Path(f"/proc/net/{name}") for name in ("tcp", "tcp6")]
    if not tables[0].exists():
        pytest.skip("no list of sockets here")
    lines = [line.split() for table in tables if table.exists() for line in table.read_text().splitlines()[1:]]
    listening = [line[1] for line in lines if line[3] == "0A" and line[1].endswith(f":{server.port:04X}")]
    assert listening == [f"0100007F:{server.port:04X}"]


def test_the_browser_is_given_a_private_file_and_no_token_and_ctrl_c_removes_it_at_once(server_without_folder):
    server = server_without_folder
    wait_until((server.folder / "asked").exists)
    asked = (server.folder / "asked").read_text().strip()
    assert server.path.strip("/") not in asked
    file = Path(asked.removeprefix("file://"))
    assert f"url={server.address}" in file.read_text()
    assert file.parent.stat().st_mode & 0o077 == 0
    server.stop()
    assert not file.parent.exists()


def test_ctrl_c_ends_it_while_it_prepares(tmp_path):
    with Server("flat", folder=tmp_path, waits_for="preparing") as server:
        server.stop()


def test_a_port_in_use_and_a_wrong_wall_end_in_one_line(server):
    for arguments, words in (
        (["--port", server.port], f"asperity: port {server.port} is in use; choose another with --port N"),
        (["no-such-wall"], "asperity: 'no-such-wall' is neither"),
    ):
        assert refused("explore", "--no-browser", *arguments).startswith(words)
