"""The command `geokalman`: the commands of `execbook`, and later those that need the applications."""

from __future__ import annotations

from pathlib import Path

from execbook import cli

app = cli.app


def main() -> None:
    """Run the command line."""
    cli.main("geokalman", Path(__file__).resolve().parents[2])


if __name__ == "__main__":
    main()
