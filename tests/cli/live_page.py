# SPDX-License-Identifier: Apache-2.0
"""The live page of a fit in headless Chromium, from the disk: live_page.py PROGRAM. Nothing listens
meanwhile. The part with Chromium is left out, and says so, where that is absent."""

import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

BROWSER = ["chromium", "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
           "--enable-unsafe-swiftshader", "--virtual-time-budget=5000", "--dump-dom"]
NAME = "<b>fit & co"  # what a page must not obey


def listening(pid):
    """The listening sockets, of any family, of a process."""
    held = set()
    for link in pathlib.Path(f"/proc/{pid}/fd").iterdir():
        try:
            held.update(re.findall(r"socket:\[(\d+)\]", os.readlink(link)))
        except OSError:
            pass  # closed meanwhile
    found = []
    for table in ("tcp", "tcp6", "udp", "udp6", "unix"):
        for line in pathlib.Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            # Flag 10000 of a Unix socket: it accepts connections.
            listens, inode = ((words[3] == "00010000", words[6]) if table == "unix" else
                              (table.startswith("udp") or words[3] == "0A", words[9]))
            if listens and inode in held:
                found.append((table, inode))
    return found


def check_listening():
    with socket.create_server(("127.0.0.1", 0)):
        assert listening(os.getpid()), "the check sees no socket that listens"
    assert not listening(os.getpid())


def make_views(program, folder):
    (folder / "ball.obj").write_text("v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n" + "".join(
        f"f {a} {b} {c}\n" for a, b, c in ((1, 3, 5), (3, 2, 5), (2, 4, 5), (4, 1, 5), (3, 1, 6),
                                           (2, 3, 6), (4, 2, 6), (1, 4, 6))))
    subprocess.run([program, "views", folder / "ball.obj", "--views", "4", "--size", "32", "--out",
                    folder / "views", "--quiet"], check=True)


def state_of(run):
    text = (run / "live/state.js").read_text()
    return json.loads(text.removeprefix("tilegradState(").removesuffix(");\n"))


def dump(page):
    return subprocess.run([*BROWSER, page.as_uri()], capture_output=True, text=True, timeout=120,
                          check=True).stdout


def drawn(page):
    """With curves, which a busy machine may not have laid out in the time that dump gives it."""
    for _ in range(4):
        text = dump(page)
        if 'class="raw" d="' in text:
            break
    return text


def check_meanwhile(program, folder, browser):
    """A fit without an end: its page follows it, and nothing listens."""
    run = folder / "endless"
    fit = subprocess.Popen([program, "fit", folder / "views", "--steps", "1000000", "--stop-gain",
                            "0", "--out", run, "--live", "--quiet"], stderr=subprocess.PIPE,
                           text=True)
    try:
        assert fit.stderr.readline() == f"live page: {(run / 'live.html').as_uri()}\n"
        deadline = time.monotonic() + 60
        steps = set()
        state = {"step": 0}
        while len(steps) < 3 or state["step"] == 0:
            assert time.monotonic() < deadline and fit.poll() is None, steps
            assert not listening(fit.pid)
            state = state_of(run)
            steps.add((state["stage"], state["done"]))
            time.sleep(0.1)
        if browser:
            page = dump(run / "live.html")
            assert re.search(r">Fitting: [\d,]+ of 1,000,000\.<", page), page[-3000:]
    finally:
        fit.send_signal(signal.SIGINT)
    assert fit.wait(timeout=60) == 130
    state = state_of(run)
    assert not state["running"] and not state["finished"] and state["step"] > 0, state


def check_afterwards(program, folder, browser):
    run = folder / NAME
    subprocess.run([program, "fit", folder / "views", "--steps", "40", "--timelapse", "3", "--out",
                    run, "--quiet"], check=True)
    log = run / "metrics.jsonl"
    lines, written = log.read_text().splitlines(), log.stat().st_mtime_ns
    lines[-1] = lines[-1][:-1] + ', "below": -2}'  # as losses of critics are
    log.write_text("\n".join(lines) + "\n")
    os.utime(log, ns=(written, written))  # a log after the mesh is of a fit that goes on
    said = subprocess.run([program, "live", run, "--json"], check=True, capture_output=True,
                          text=True)
    page = pathlib.Path(json.loads(said.stdout)["page"])
    assert json.loads(said.stdout)["address"] == page.as_uri()
    assert sorted(p.name for p in (run / "live").iterdir()) == [
        f"mesh_{step:08}.js" for step in (0, 20, 40)] + ["state.js"]
    if browser:
        text = drawn(page)
        assert "&lt;b&gt;fit &amp; co" in text and "<b>fit" not in text, text[-3000:]
        assert "Finished after 40 steps." in text and "mesh after 40 steps, " in text, text[-3000:]
        assert text.count('class="chart"') >= 3, text.count('class="chart"')
        assert 'src="timelapse/00000040.png?' in text
        curves = re.findall(r'class="raw" d="([^"]*)"', text)
        heights = [float(y) for curve in curves for y in re.findall(r"[ML][\d.-]+ ([\d.-]+)", curve)]
        assert curves[-1].endswith("h0"), curves[-1]  # a dot
        assert all(0 <= y <= 164 for y in heights), heights  # above the axis' numbers
        assert not re.search(r'(src|href)="https?:', text)


def main():
    program = pathlib.Path(sys.argv[1])
    browser = shutil.which(BROWSER[0]) is not None
    check_listening()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        make_views(program, folder)
        check_meanwhile(program, folder, browser)
        check_afterwards(program, folder, browser)
    print("the live page shows the fit" if browser else "no Chromium: the page itself is not tried")


if __name__ == "__main__":
    main()
