"""Renew the picture of the README, `book/_static/front.png`, from the book that was built: `make picture`."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
FIGURE = ROOT / "book/_build/runs/grace-fusion/06-geoid/figures/g06-maps.light.png"
TARGET = ROOT / "book/_static/front.png"
WIDTH = 640  # pixels; shown at 420


def main() -> None:
    if not FIGURE.is_file():
        sys.exit(f"{FIGURE.relative_to(ROOT)} is not there yet; call `make book` first.")
    with Image.open(FIGURE) as image:
        size = (WIDTH, round(image.height * WIDTH / image.width))
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    small.quantize(128, dither=Image.Dither.NONE).save(TARGET, optimize=True)
    print(f"{TARGET.relative_to(ROOT)}: {TARGET.stat().st_size // 1024} kB")


if __name__ == "__main__":
    main()
