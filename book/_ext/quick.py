"""A quicker build, with the same pages: two processes, and each page unpickled once for the references to it."""

from __future__ import annotations

from functools import lru_cache

from sphinx.domains.std import StandardDomain

JOBS = 2


class _Kept:
    """An environment that keeps the pages it is asked for; a numbered reference only reads them."""

    def __init__(self, env) -> None:
        self._env = env
        self.get_doctree = lru_cache(maxsize=None)(env.get_doctree)

    def __getattr__(self, name: str):
        return getattr(self._env, name)


class _Domain(StandardDomain):
    _kept: _Kept | None = None

    def _resolve_numref_xref(self, env, *others):
        if self._kept is None:  # references are resolved once all pages are read
            self._kept = _Kept(env)
        return super()._resolve_numref_xref(self._kept, *others)


def declare(app, _config) -> None:
    """Say of two extensions what they do not: one numbers sections once all pages are read, one makes LaTeX only."""
    for name in ("sphinx_multitoc_numbering", "sphinx_jupyterbook_latex"):
        if extension := app.extensions.get(name):
            extension.parallel_read_safe = extension.parallel_write_safe = True
    app.parallel = JOBS


def setup(app) -> dict:
    app.add_domain(_Domain, override=True)
    app.connect("config-inited", declare)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
