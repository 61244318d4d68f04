#!/usr/bin/env python3
"""Pictures of the viewer's page and of a report, for docs/images: view.png, space.png, editor.png, report.png.

usage: docs/make_view_images.py BORESIGHT RUN_FOLDER

BORESIGHT is the program, RUN_FOLDER a run of scenarios/neossat_geo_track.json. The picture of space is of a short run of
scenarios/constellation_quick.json that is made here. From the repository root, with Debian's chromium and the coastline of
python-cartopy-data (or BORESIGHT_COASTLINE). Pictures have 1280 x 720 pixels and at most 250 kB, with a palette
(docs/make_images.py). Needs numpy.
"""
import contextlib
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "tests" / "e2e")]
import chromium  # noqa: E402
import make_images  # noqa: E402

LARGEST = 250_000  # bytes
APERTURE = "/observers/0/sensors/0/camera/aperture_m"
CHECKED = "document.editor && document.editor.number > 0 && document.editor.checked === document.editor.number"


def save(page, name):
    """The picture of the page, in the finest palette that fits."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "picture.png"
        page.screenshot(path)
        image = make_images.read_png(path)
    for apart in (10, 14, 20, 28, 40):
        png = make_images.make_png(*make_images.quantise(image, apart))
        if len(png) <= LARGEST:
            break
    else:
        sys.exit(f"{name}: {len(png)} bytes in the coarsest palette (allowed: {LARGEST})")
    (HERE / "images" / name).write_bytes(png)
    print(f"images/{name}: {len(png) / 1e3:.0f} kB")


@contextlib.contextmanager
def viewer(boresight, run, folder):
    """Address of a viewer that is started in a folder; ends it."""
    server = subprocess.Popen([boresight, "view", run, "--no-browser"], stdout=subprocess.PIPE, text=True, cwd=folder)
    try:
        url = re.match(r"http://\S+", server.stdout.readline())
        if not url:
            sys.exit(f"{run}: boresight view did not start")
        yield url.group(0)
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(30)


def look_at_run(page, url):
    page.command("Page.navigate", url=url)
    page.wait_for("document.boresight && document.boresight.current >= 0 && document.boresight.plots.panels.every((one) => one.lines.length)")
    page.evaluate("document.boresight.goTo(Math.round(document.boresight.count / 2))")
    page.wait_for("document.boresight.current === Math.round(document.boresight.count / 2)")
    time.sleep(3)  # small pictures of the film-strip
    save(page, "view.png")
    page.evaluate("document.getElementById('tab-editor').click()")
    page.wait_for(CHECKED)
    page.evaluate(f"document.editor.set('{APERTURE}', 0.2, true); document.editor.form.goTo('{APERTURE}')")
    page.wait_for(CHECKED)
    time.sleep(3)  # figures of the scenario
    save(page, "editor.png")


def look_at_space(page, url):
    page.command("Page.navigate", url=url)
    page.wait_for("document.boresight && document.boresight.current >= 0")
    page.evaluate("document.getElementById('tab-space').click()")
    page.wait_for("document.space && document.space.after")
    page.evaluate("""(() => { const sun = document.space.before; // on the lit side, with the terminator in view
        Object.assign(document.space.camera, { azimuth: Math.atan2(sun[1], sun[0]) + 0.9, elevation: 0.4, distance: 6 }); document.space.draw(); })()""")
    time.sleep(2)  # coastline and orbits
    page.evaluate("document.space.draw()")
    save(page, "space.png")


def look_at_report(page, file):
    page.command("Page.navigate", url=f"file://{file}")
    page.wait_for("!!document.report")
    page.evaluate("""(() => { const one = document.report.charts.find((chart) => chart.name.startsWith('Timeline')), { high } = one.group.all;
        one.figure.scrollIntoView(); one.group.setCursor(0.4 * high); })()""")
    time.sleep(1)
    save(page, "report.png")


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    boresight, run = (str(pathlib.Path(word).resolve()) for word in sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder, chromium.Chromium(1280, 720) as page:
        place = pathlib.Path(folder) / "boresight"  # whose name the editor shows
        place.mkdir()
        shutil.copytree(HERE.parent / "scenarios", place / "scenarios")
        subprocess.run([boresight, "run", "scenarios/constellation_quick.json", "--out", folder + "/quick", "--duration", "10", "--quiet",
                        "--set", "/record/frames=none"], check=True, cwd=HERE.parent, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        subprocess.run([boresight, "report", run, "--out", folder + "/report.html"], check=True, stdout=subprocess.DEVNULL)
        page.command("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
        with viewer(boresight, folder + "/quick", place) as url:
            look_at_space(page, url)
        with viewer(boresight, run, place) as url:
            look_at_run(page, url)
        page.command("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}])
        look_at_report(page, folder + "/report.html")


if __name__ == "__main__":
    main()
