"""A page of results: text, tables, charts and pictures, as Markdown with separate files and as one HTML file."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from benchmarks.tables import Table
from rlacd.io.write import write_file


@dataclass(frozen=True)
class Heading:
    """The title of a section."""

    text: str


@dataclass(frozen=True)
class Text:
    """A paragraph; lines that begin with ``- `` are a list."""

    text: str


@dataclass(frozen=True)
class Code:
    """Commands, as typed."""

    text: str


@dataclass(frozen=True)
class Figure:
    """An encoded picture.

    Attributes
    ----------
    name : str
        File name with its ending, ``.svg`` or ``.png``.
    content : bytes
    caption : str
    """

    name: str
    content: bytes
    caption: str


Block: TypeAlias = Heading | Text | Code | Table | Figure


@dataclass
class Page:
    """A title and blocks.

    Attributes
    ----------
    title : str
    blocks : list of Block
    """

    title: str
    blocks: list[Block] = field(default_factory=list)

    def add(self, *blocks: Block) -> None:
        """Append blocks."""
        self.blocks += blocks

    def save(self, folder: Path, name: str) -> list[Path]:
        """Write ``NAME.md`` with its pictures beside it, and ``NAME.html``, which is self-contained.

        Raises
        ------
        OutputError
            The folder cannot be written to.
        """
        written = []
        for file_name, content in {
            **{block.name: block.content for block in self.blocks if isinstance(block, Figure)},
            f"{name}.md": self.markdown().encode(),
            f"{name}.html": as_html([self]).encode(),
        }.items():
            write_file(folder / file_name, content)
            written.append(folder / file_name)
        return written

    def markdown(self) -> str:
        """The page as Markdown."""
        return "\n\n".join([f"# {self.title}", *map(_markdown, self.blocks)]) + "\n"


def as_html(pages: Sequence[Page]) -> str:
    """Render pages below each other as one self-contained HTML file without scripts."""
    body = "\n".join(
        f"<section>\n<h1>{html.escape(page.title)}</h1>\n" + "\n".join(map(_html, page.blocks)) + "\n</section>"
        for page in pages
    )
    title = html.escape(pages[0].title if pages else "rlacd")
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>{_STYLE}</style></head>
<body>
{body}
</body></html>
"""


_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c1e22; max-width: 1400px; margin: 2em auto; padding: 0 1.5em }
h1 { font-size: 1.6em } h2 { font-size: 1.2em; margin-top: 2em }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .88em }
th, td { padding: .3em .7em; text-align: right; border-bottom: 1px solid #e4e6ea; white-space: nowrap }
th:first-child, td:first-child { text-align: left } th { border-bottom: 2px solid #1c1e22 }
tbody tr:hover { background: #f5f6f8 }
.wide { overflow-x: auto } .note, figcaption { color: #6b6f76; font-size: .88em }
figure { margin: 1.5em 0 } img { max-width: 100%; height: auto }
pre { background: #f5f6f8; padding: .8em 1em; overflow-x: auto }
"""


def _markdown(block: Block) -> str:
    match block:
        case Heading(text):
            return f"## {text}"
        case Text(text):
            return text
        case Code(text):
            return f"```sh\n{text}\n```"
        case Figure(name, _, caption):
            return f"![{caption}]({name})"
        case Table():
            return block.markdown()


def _html(block: Block) -> str:
    match block:
        case Heading(text):
            return f"<h2>{html.escape(text)}</h2>"
        case Text(text):
            return _paragraph(text)
        case Code(text):
            return f"<pre>{html.escape(text)}</pre>"
        case Figure(name, content, caption):
            kind = "image/svg+xml" if name.endswith(".svg") else "image/png"
            data = base64.b64encode(content).decode()
            alt = html.escape(caption, quote=True)
            shown = html.escape(caption)
            return f'<figure><img alt="{alt}" src="data:{kind};base64,{data}"><figcaption>{shown}</figcaption></figure>'
        case Table(header, lines, note):
            head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
            rows = "\n".join(
                "<tr>" + "".join(f"<td>{html.escape(str(cell))}</td>" for cell in line) + "</tr>" for line in lines
            )
            below = f'\n<p class="note">{html.escape(note)}</p>' if note else ""
            table = f"<table><thead><tr>{head}</tr></thead><tbody>\n{rows}\n</tbody></table>"
            return f'<div class="wide">{table}</div>{below}'


def _paragraph(text: str) -> str:
    lines = text.splitlines()
    if lines and all(line.startswith("- ") for line in lines):
        return "<ul>" + "".join(f"<li>{html.escape(line[2:])}</li>" for line in lines) + "</ul>"
    return f"<p>{html.escape(text)}</p>"
