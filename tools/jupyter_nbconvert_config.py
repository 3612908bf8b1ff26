"""Plain nbconvert draws formulas without a network, as the report does: `make setup` puts this into the environment."""

from contextlib import suppress

config = get_config()  # type: ignore[name-defined]  # noqa: F821
with suppress(ImportError):
    from harmolab.lab.report.pages import markdown_to_html

    config.HTMLExporter.filters = {"markdown2html": markdown_to_html}
