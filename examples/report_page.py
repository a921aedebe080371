"""Write the report of a few frames of the scene ``highway``, and a picture of it where there is a Chromium.

usage: python examples/report_page.py [FOLDER]
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import shenron_rt as srt
from shenron_rt.cli import main

#: Picture of the documentation: pixels, and colours that keep it below 200 kB.
SIZE, COLOURS = (1440, 1000), 256


def picture(page: Path, target: Path) -> None:
    """Write what a browser shows of a page at frame 5."""
    from PIL import Image

    program = next((p for n in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(n))), None)
    if program is None:
        print("no Chromium: no picture")
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        shot = Path(folder) / "shot.png"
        flags = (
            "--headless --no-sandbox --disable-gpu --enable-unsafe-swiftshader --disable-quic --no-first-run "
            "--disable-background-networking --disable-component-update --disable-sync --hide-scrollbars "
            "--virtual-time-budget=3000"
        )
        command = [program, *flags.split(), f"--user-data-dir={folder}/profile", f"--screenshot={shot}"]
        where = page.absolute().as_uri() + "#frame=5&view=orbit"
        subprocess.run(
            [*command, f"--window-size={SIZE[0]},{SIZE[1]}", where], check=True, capture_output=True, timeout=120
        )
        with Image.open(shot) as image:
            image.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE).save(
                target, optimize=True
            )
    print(f"{target}: {target.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    out.mkdir(parents=True, exist_ok=True)
    run = out / "report_highway"
    main(["run", "highway", "--frames", "0:12", "--rays", "50000", "--no-pictures", "-o", str(run), "--overwrite"])
    picture(srt.write_report(run, out / "report.html", overwrite=True), out / "report.png")
