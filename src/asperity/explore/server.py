"""The server of the page: on the loopback address, for its own origin, without resources from the network."""

from __future__ import annotations

import errno
import hmac
import logging
import os
import secrets
import signal
import socket
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..core.errors import INTERRUPTED, InputError
from ..geometry import WALLS, wall_from_text
from .background import end_all, private_folder

ADDRESS, PORT = "127.0.0.1", 5006
# The file descriptor.
STANDARD_ERROR = 2
# By these names the page may be called; another name may be an attacker's that leads to this machine.
NAMES = (ADDRESS, "localhost")
# Bytes of one message of the browser: a file of 64 MiB in base64.
LARGEST_MESSAGE = 96 * 2**20
# Milliseconds after which the computation of a closed tab ends, and between two checks.
CLOSED_AFTER, CHECKED_EVERY = 3000, 2000
FIRST_WALL = "triangular-teeth"
# Styles: dark where the system is. In every component, where the light colours of panel come later.
COMPONENTS = """
.bk-btn.bk-active { outline: 2px solid #56B4E9; outline-offset: -2px; }
@media (prefers-color-scheme: dark) {
  :host {
    --panel-background-color: #1b1e22 !important; --panel-on-background-color: #e8e8e8 !important;
    --panel-surface-color: #2b3035 !important; --panel-on-surface-color: #e8e8e8 !important;
    --panel-secondary-color: #343a40 !important; --panel-on-secondary-color: #ffffff !important;
    --panel-border-color: #4a4f55 !important; --color: #d0d0d0 !important; --file: #343a40 !important;
  }
  select.bk-input { appearance: auto !important; background-image: none !important; }
  .noUi-target { background: #2b3035; border-color: #4a4f55; box-shadow: none; }
  .noUi-connect { background: #6a7078; }
}
"""
# Of the whole page; bokeh draws axes and text in the colours that begin with --bk.
HEAD = """
{% block postamble %}
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
@media (prefers-color-scheme: dark) {
  :root {
    color-scheme: dark; background: #1b1e22; --icon-color: #b0b0b0; --bk-text-color: #e8e8e8;
    --bk-background-fill-color: #1b1e22; --bk-border-fill-color: #1b1e22;
    --bk-outline-line-color: #4a4f55; --bk-grid-line-color: #4a4f55;
    --bk-axis-line-color: #b0b0b0; --bk-major-tick-line-color: #b0b0b0; --bk-minor-tick-line-color: #b0b0b0;
    --bk-major-label-text-color: #d0d0d0; --bk-axis-label-text-color: #d0d0d0;
  }
}
</style>
{% endblock %}
"""


def page_server(text: str = FIRST_WALL, port: int = PORT, out: Path | None = None) -> Any:
    """Return a server of the page, which listens already and answers as soon as its ``io_loop`` is started.

    Every address begins with the ``prefix`` of the server, a token that is made for it.

    Parameters
    ----------
    text : str
        The wall that is shown first, as on the command line.
    port : int
        0 for any that is free.
    out : Path, optional
        Folder for what is saved; by default the browser takes it.

    Raises
    ------
    InputError
        If the wall cannot be made, the port is in use or not permitted, or panel and bokeh are missing.
    """
    wall = wall_from_text(text)
    name, parameters = _called(text)
    panel = _panel()
    from panel.io.resources import LOCAL_DIST
    from tornado.ioloop import IOLoop

    from .page import Page

    def page() -> Any:
        document = panel.state.curdoc
        document.template = HEAD
        # panel sets it when it answers with the page; a tab that connects late would ask the network for styles
        document.template_variables["dist_url"] = LOCAL_DIST
        shown = Page(wall, name, parameters, out)
        panel.state.on_session_destroyed(lambda _: shown.close())
        return shown.view()

    number = _usable(port)
    hosts = [f"{name}:{number}" for name in NAMES]
    token = secrets.token_urlsafe()
    # panel sets a handler of its own, which would end the loop without a word
    interrupt = signal.getsignal(signal.SIGINT)
    try:
        made = panel.io.server.get_server(
            page, address=ADDRESS, port=number, prefix=token, show=False, start=False, title="asperity explore",
            websocket_origin=hosts, websocket_max_message_size=LARGEST_MESSAGE,
            check_unused_sessions_milliseconds=CHECKED_EVERY, unused_session_lifetime_milliseconds=CLOSED_AFTER,
            # from Python 3.14 on no loop is made without being asked for
            loop=IOLoop(make_current=False),
        )  # fmt: skip
    finally:
        signal.signal(signal.SIGINT, interrupt)
    _refuse_strangers(made, hosts)
    return made


def serve_page(text: str, port: int, out: Path | None, *, browser: bool, say: Callable[[str], object]) -> None:
    """Serve the page until Ctrl-C, which ends the process; ``say`` prints a line."""
    server = page_server(text, port, out)

    def end(*_: object) -> None:
        # what runs for the tabs that are open
        end_all()
        # not by `say`: Python refuses to write while the signal interrupts a line that is being written
        os.write(STANDARD_ERROR, b"asperity: interrupted\n")
        # an exception could be caught by a library, and libraries would wait for their threads
        os._exit(INTERRUPTED)

    signal.signal(signal.SIGINT, end)
    say("preparing; the first time this compiles for some seconds")
    _prepare(text)
    address = f"http://{ADDRESS}:{server.port}{server.prefix}/"
    say(f"{address} shows the page; Ctrl-C ends it")
    server.start()
    if browser:
        # other users see the arguments of the browser, but cannot read this file
        way = Path(private_folder().name) / "asperity-explore.html"
        way.write_text(f'<meta http-equiv="refresh" content="0; url={address}">')
        server.io_loop.add_callback(webbrowser.open, way.as_uri())
    server.io_loop.start()


def _prepare(text: str) -> None:
    """Make a page and its first answer, which compiles and loads what every tab needs."""
    from .page import Page

    page = Page(wall_from_text(text), "")
    try:
        page.view().get_root()
        while page.answer is None and not page.message:
            time.sleep(0.02)
            page.collect()
    finally:
        page.close()


def _usable(port: int) -> int:
    """The port, or a free one for 0; an InputError if it is in use or not permitted."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        # as servers do: a port whose last connections are still closing is free
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((ADDRESS, port))
        except OSError as reason:
            why = "is in use" if reason.errno == errno.EADDRINUSE else f"cannot be used ({reason.strerror})"
            raise InputError(
                f"port {port} {why}; choose another with --port N, or --port 0 for any that is free"
            ) from reason
        return int(probe.getsockname()[1])


def _refuse_strangers(server: Any, hosts: list[str]) -> None:
    """Answer 403 to every request but those of the page for itself, before any handler of bokeh and panel is chosen.

    A request is the page's own if its host is ours, its origin too or not named, and its address has the token. Nothing
    is served but the page, its socket and the files that bokeh and panel have for browsers.
    """
    from tornado.routing import Matcher, Rule
    from tornado.web import ErrorHandler

    begin = f"{server.prefix}/".encode()
    origins = (None, *(f"http://{host}" for host in hosts))

    class Stranger(Matcher):
        def match(self, request: Any) -> dict[str, Any] | None:
            path, headers = request.path.encode(), request.headers
            rest = path[len(begin) :]
            known = hmac.compare_digest(path[: len(begin)], begin)
            served = request.method == "GET" and (rest in (b"", b"ws") or rest.startswith(b"static/"))
            own = headers.get("Host") in hosts and headers.get("Origin") in origins
            return None if known and served and own else {}

    server._tornado.default_router.rules.insert(0, Rule(Stranger(), ErrorHandler, {"status_code": 403}))


def _called(text: str) -> tuple[str, dict[str, float | int]]:
    """The name of a wall, and its parameters if it is a named one."""
    name, _, tail = text.partition(":")
    entry = WALLS.get(name.strip().lower().replace("_", "-"))
    if entry is None or Path(text).is_file():
        return Path(name).stem, {}
    given = (part.split("=") for part in tail.split(",") if part.strip())
    return entry.name, {key.strip().replace("-", "_"): float(value) for key, value in given}


def _panel() -> Any:
    try:
        import panel
    except ImportError as reason:
        raise InputError("the page needs panel and bokeh: pip install 'asperity[explore]'") from reason
    for name in ("tornado.access", "tornado.general", "bokeh"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    panel.extension(raw_css=[COMPONENTS])
    return panel
