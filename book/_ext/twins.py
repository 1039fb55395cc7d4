"""Small changes to the pages' trees: dark twins of figures, their data to explore, badges for the words of verdicts."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from docutils import nodes
from sphinx.transforms import SphinxTransform

_VERDICTS = (
    "reproduced",
    "depends on the reading",
    "calibrated",
    "not reproduced",
    "not testable",
    "holds",
    "does not hold",
)


class DarkTwin(SphinxTransform):
    """Follow each image `x.light.png` by `x.dark.png`, where it exists; the style sheet shows the one of the theme."""

    default_priority = 210

    def apply(self) -> None:
        for image in list(self.document.findall(nodes.image)):
            uri = image["uri"]
            if ".light." not in uri:
                continue
            dark = uri.replace(".light.", ".dark.")
            if not os.path.exists(self.env.relfn2path(dark, self.env.docname)[1]):
                continue
            twin = image.deepcopy()
            twin["uri"] = dark
            twin["ids"], twin["names"] = [], []
            explored = ["explore"] if _data(self.env.relfn2path(uri, self.env.docname)[1]).is_file() else []
            image["classes"] = [*image["classes"], "dark-light", "twin-light", *explored]
            twin["classes"] = [*twin["classes"], "dark-light", "twin-dark"]
            parent, place = image.parent, image.parent.index(image)
            parent[place] = nodes.inline("", "", image, twin, classes=["twins"])


def _data(image: str) -> Path:
    """Give the path of the data to explore that belong to an image `x.light.png`."""
    return Path(image.replace(".light.png", ".js"))


def copy_data(app, exception) -> None:
    """Put the data of each figure that can be explored beside its image, under the image's name."""
    if exception or app.builder.format != "html":
        return
    for source, (_, name) in app.env.images.items():
        if ".light.png" in source and (data := _data(os.path.join(app.srcdir, source))).is_file():
            shutil.copyfile(data, Path(app.outdir, app.builder.imagedir, name).with_suffix(".js"))


class VerdictBadge(SphinxTransform):
    """Mark a table cell that is a verdict as a badge, and the cells of its table by their columns' names."""

    default_priority = 220

    def apply(self) -> None:
        for entry in [e for body in self.document.findall(nodes.tbody) for e in body.findall(nodes.entry)]:
            word = entry.astext().strip()
            verdict = word.partition(",")[0]  # its share of the readings may follow
            if verdict not in _VERDICTS:
                continue
            paragraph = next(iter(entry.findall(nodes.paragraph)), None)
            if paragraph is not None:
                paragraph[:] = [nodes.inline("", word, classes=["verdict", f"verdict-{verdict.replace(' ', '-')}"])]
                self._name_cells(entry.parent.parent.parent)

    @staticmethod
    def _name_cells(group: nodes.tgroup) -> None:
        """Give each cell of a table of claims a class, so that a narrow screen can stack them (book.css)."""
        if "claims" in group.parent["classes"]:
            return
        group.parent["classes"].append("claims")
        head = next(iter(group.findall(nodes.thead)))
        names = [entry.astext().strip().lower().replace(" ", "-") for entry in head.findall(nodes.entry)]
        for row in next(iter(group.findall(nodes.tbody))).findall(nodes.row):
            for name, entry in zip(names, row.children, strict=True):
                entry["classes"].append(f"claim-{name}" if entry.astext().strip() else "claim-nothing")


def setup(app) -> dict:
    app.add_transform(DarkTwin)
    app.add_transform(VerdictBadge)
    app.connect("build-finished", copy_data)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
