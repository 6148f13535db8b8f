# SPDX-License-Identifier: Apache-2.0
"""The live page of a fit in headless Chromium: live_page.py PROGRAM. Skips, and says so, where
Chromium is absent."""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request

BROWSER = ["chromium", "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
           "--enable-unsafe-swiftshader", "--virtual-time-budget=3000", "--dump-dom"]
NAME = "<b>fit & co"  # what a page must not obey


def ask(address, host=None):
    request = urllib.request.Request(address, headers={"Host": host} if host else {})
    return urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=60)


def fit(program, folder):
    (folder / "ball.obj").write_text("v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n" + "".join(
        f"f {a} {b} {c}\n" for a, b, c in ((1, 3, 5), (3, 2, 5), (2, 4, 5), (4, 1, 5), (3, 1, 6),
                                           (2, 3, 6), (4, 2, 6), (1, 4, 6))))
    views, run = folder / "views", folder / NAME
    subprocess.run([program, "views", folder / "ball.obj", "--views", "4", "--size", "32", "--out",
                    views, "--quiet"], check=True)
    # --live serves while the fit goes on, which here is too short to look at.
    done = subprocess.run([program, "fit", views, "--steps", "40", "--timelapse", "3", "--out", run,
                           "--live", "--quiet"], check=True, capture_output=True, text=True)
    assert re.search(r"live view: http://127\.0\.0\.1:\d+/", done.stderr), done.stderr
    return run


def check_answers(address):
    state = json.load(ask(address + "state"))
    assert state["name"] == NAME and not state["running"], state
    assert state["step"] == 40 and len(state["curves"]["loss"]) > 3, state
    assert state["pictures"] == state["meshes"] and len(state["meshes"]) == 3, state
    mesh = json.load(ask(f"{address}mesh?step=40"))["mesh"]
    assert mesh["face_count"] > 100, mesh["face_count"]
    assert ask(f"{address}picture?step=40").read(4) == b"\x89PNG"
    for path, host, code in (("mesh?step=7", None, 404), ("picture?step=../../x", None, 404),
                             ("state", "evil.example", 403), ("nothing", None, 404)):
        try:
            ask(address + path, host)
            raise AssertionError(f"{path} was answered")
        except urllib.error.HTTPError as error:
            assert error.code == code, (path, error.code)


def check_page(address):
    page = subprocess.run([*BROWSER, address], capture_output=True, text=True, timeout=120,
                          check=True).stdout
    assert "&lt;b&gt;fit &amp; co" in page and "<b>fit" not in page, page[-3000:]
    assert "Finished. Step 40 of 40" in page and "mesh after 40 steps" in page, page[-3000:]
    assert page.count('class="chart"') >= 3, page.count('class="chart"')
    assert 'src="picture?step=40"' in page
    assert not re.search(r'(src|href)="https?:', page)


def main():
    program = pathlib.Path(sys.argv[1])
    if not shutil.which(BROWSER[0]):
        print("SKIPPED: chromium is not installed")
        return
    with tempfile.TemporaryDirectory() as folder:
        run = fit(program, pathlib.Path(folder))
        server = subprocess.Popen([program, "live", run, "--json"], stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True, env={**os.environ})
        try:
            said = "".join(server.stdout.readline() for _ in range(3))
            address = json.loads(said)["address"]
            check_answers(address)
            check_page(address)
        finally:
            server.send_signal(signal.SIGINT)
        assert server.wait(timeout=30) == 0
    print("the live page shows the fit")


if __name__ == "__main__":
    main()
