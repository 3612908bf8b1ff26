"""Presence of a page that can show a widget: JupyterLab has one, a program that runs notebooks has none."""

from __future__ import annotations

import os

from IPython import get_ipython


def has_front_end() -> bool:
    """False where a program runs the notebook without a page: nbconvert, papermill, and our report.

    JupyterLab, Notebook and VS Code name the cell in the metadata of each request to execute it; those programs leave
    them empty (nbclient). Voilà runs notebooks as they do and shows widgets; it names itself in the environment. True
    where there is no kernel, and where a page, not a cell, has the lab shown.
    """
    kernel = getattr(get_ipython(), "kernel", None)
    if kernel is None or os.environ.get("SERVER_SOFTWARE", "").startswith("voila"):
        return True
    request = kernel.get_parent()
    is_cell = request.get("header", {}).get("msg_type") == "execute_request"
    return not is_cell or bool(request.get("metadata"))
