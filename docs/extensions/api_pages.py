"""Reference pages of the public names, one for each area of `harmolab`, its `systems`, its `lab` and its `musician`."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections.abc import Mapping
from pathlib import Path

from generated_pages import write_pages
from sphinx.application import Sphinx

# A bar or a last underscore outside backquotes.
PROSE = re.compile(r"(?P<quoted>`[^`]*`)|(?P<mark>\||(?<=\w)_(?!\w))")
FACADES = ("harmolab", "harmolab.systems", "harmolab.lab", "harmolab.musician")
AREAS = {
    "harmolab.beats": "Beats of music and movement",
    "harmolab.body": "Skeletons",
    "harmolab.clips": "Two files, one clip, one score",
    "harmolab.data": "Recordings and synthetic data",
    "harmolab.score": "Scores",
    "harmolab.readers": "Files: motion, sound, beats, video",
    "harmolab.lab": "Comparing and harmonising",
    "harmolab.metrics": "Measures of quality and likeness",
    "harmolab.params": "Settings",
    "harmolab.significance": "Significance",
    "harmolab.soft_score": "The score as a loss",
    "harmolab.types": "Motion, sound, beats, clips",
    "harmolab.verdict": "Results of a score",
    "harmolab.musician": "Audio to Body: musicians",
    "harmolab.musician.explain": "Hands and sound",
    "harmolab.musician.page": "Pages of musicians",
    "harmolab.musician.system": "The system",
    "harmolab.musician.video": "Pictures of musicians",
    "harmolab.systems.choreographer": "The choreographer",
    "harmolab.systems.training": "Shared by all systems",
    "harmolab.systems.contract": "Finding and loading a system",
    "harmolab.systems.harmogan": "HarmoGAN",
    "harmolab.systems.lee2019": "Lee et al. 2019",
    "harmolab.systems.music2dance": "Music2Dance",
    "harmolab.systems.ren2020": "Ren et al. 2020",
    "harmolab.lab.compare": "Which score tells right from wrong music?",
    "harmolab.lab.evaluate": "Tables of systems that dance",
    "harmolab.lab.explain": "Explaining one dance",
    "harmolab.lab.figures": "Figures",
    "harmolab.lab.harmonise": "Bringing a dance into harmony",
    "harmolab.lab.labs": "Labs in JupyterLab",
    "harmolab.lab.listening": "Listening studies",
    "harmolab.lab.player_data": "The player",
    "harmolab.lab.render": "Videos",
    "harmolab.lab.report": "The report",
}


def public_names(facade: str) -> dict[str, list[str]]:
    """Names in the stub of a facade, sorted, by the area that they are imported from."""
    package = importlib.import_module(facade)
    stub = Path(str(package.__file__)).with_suffix(".pyi")
    areas: dict[str, list[str]] = {}
    for node in ast.parse(stub.read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            area = f"{facade}.{(node.module or '').split('.')[0]}"
            areas.setdefault(area, []).extend(alias.asname or alias.name for alias in node.names)
    return {area: sorted(names, key=str.lower) for area, names in sorted(areas.items())}


def directive(facade: str, name: str) -> str:
    """Autodoc's directive for one public name."""
    value = getattr(importlib.import_module(facade), name)
    if inspect.isclass(value):
        bases = value.__mro__[1:-1]  # of a class of ours alone: those of torch and of Python have hundreds of members
        inherited = all(base.__module__.startswith("harmolab") for base in bases if base.__module__ != "typing")
        return f".. autoclass:: {facade}.{name}\n   :members:\n" + "   :inherited-members:\n" * inherited
    if callable(value):
        return f".. autofunction:: {facade}.{name}\n"
    held = f"For {', '.join(f'``{key}``' for key in value)}." if isinstance(value, Mapping) else type(value).__name__
    return f".. py:data:: {facade}.{name}\n\n   {held}\n"


def area_page(facade: str, area: str, names: list[str]) -> str:
    """reStructuredText of one area."""
    title = AREAS.get(area, area)
    body = "\n".join(directive(facade, name) for name in names)
    return f"{title}\n{'=' * len(title)}\n\nImported from ``{facade}``.\n\n{body}"


def summary(facade: str) -> str:
    """First line of the docstring of a facade."""
    return (inspect.getdoc(importlib.import_module(facade)) or "").partition("\n")[0]


def write_reference(app: Sphinx) -> None:
    """Write the pages and their index."""
    pages, lines = {}, []
    for facade in FACADES:
        lines += [f"## `{facade}`", "", summary(facade), "", "```{toctree}", ":maxdepth: 1", ""]
        for area, names in public_names(facade).items():
            pages[f"api/{area}.rst"] = area_page(facade, area, names)
            lines.append(f"generated/api/{area}")
        lines += ["```", ""]
    write_pages({"areas.inc": "\n".join(lines), **pages})


def escaped(found: re.Match[str]) -> str:
    """The same text, a backslash before it unless it stands in backquotes."""
    return found[0] if found["quoted"] else f"\\{found[0]}"


def escape_prose(app: Sphinx, what: str, name: str, value: object, options: object, lines: list[str]) -> None:
    """Keep `|x|` and `name_` of a docstring what they are: reStructuredText would take them for references."""
    lines[:] = [line if line.lstrip().startswith((">>>", "...")) else PROSE.sub(escaped, line) for line in lines]


def plain_aliases(
    app: Sphinx, what: str, name: str, thing: object, options: object, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Signature and return type with the bare names of type aliases, as in the source."""
    plain = [text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text) for text in (signature, returns)]
    return plain[0], plain[1]


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for sources."""
    app.connect("builder-inited", write_reference)
    app.connect("autodoc-process-docstring", escape_prose, priority=400)
    app.connect("autodoc-process-signature", plain_aliases)
    return {"parallel_read_safe": True}
