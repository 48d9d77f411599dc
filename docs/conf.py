"""The documentation site: `./with-fenicsx python3 -m sphinx -W --keep-going docs site/html` makes it."""

from __future__ import annotations

import re

from docutils.nodes import SkipNode
from latex2mathml.converter import convert

import rotfem

project, author, copyright = "rotfem", "The rotfem authors", "The rotfem authors"
version = release = rotfem.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["*.py"]
html_theme = "furo"
html_title = f"rotfem {release}"
html_math_renderer = "mathml"
default_role = "code"

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4
suppress_warnings = ["myst.header", "misc.highlighting_failure"]

# Tutorials are scripts with text in comments; building the site runs them, and shows what they print and draw.
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_show_tb = True

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
napoleon_use_ivar = True


def to_pages(app, name, source):
    """Let links to files above this folder lead to the pages that show them."""
    for file, page in (("CONTRIBUTING", "contributing"), ("CHANGELOG", "changelog"), ("README", "index")):
        source[0] = source[0].replace(f"](../{file}.md", f"](/{page}.md").replace(f"]({file}.md", f"](/{page}.md")


def as_text(app, what, name, thing, options, lines):
    """Docstrings are plain text: bars and stars in them mark nothing up."""
    lines[:] = [line.replace("\\", r"\\").replace("|", r"\|").replace("*", r"\*") for line in lines]


def mathml(tex, display):
    """Return a formula as MathML in the letters of the text: not every machine has a font for formulas."""
    text = convert(tex, display=display).replace('mathvariant="bold"', 'mathvariant="normal" style="font-weight:bold"')
    return re.sub("<mi>(.|&#x[0-9A-F]+;)</mi>", r'<mi mathvariant="normal" style="font-style:italic">\1</mi>', text)


def inline(writer, node):
    """Write a formula of a line."""
    writer.body.append(mathml(node.astext(), "inline"))
    raise SkipNode


def block(writer, node):
    """Write a formula by itself."""
    writer.body.append(f"<div>{mathml(node.astext(), 'block')}</div>\n")
    raise SkipNode


def setup(app):
    """Register the directives of this file: formulas are MathML, which browsers draw by themselves."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.connect("source-read", to_pages)
    app.connect("include-read", lambda app, path, name, content: to_pages(app, name, content))
    app.connect("autodoc-process-docstring", as_text, priority=100)
