# SPDX-License-Identifier: Apache-2.0
"""Self-contained HTML pages: one file with the pictures inside, for light and dark themes."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from html import escape
from pathlib import Path

# The Content-Security-Policy lets the browser load nothing and execute only the script of the page,
# which it identifies by its hash.
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; img-src data:; style-src 'unsafe-inline'{script}">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; --page: #f6f7f8; --card: #ffffff; --ink: #1f2328;
  --muted: #5b636b; --line: #d9dde1; --bad: #b04a00; --good: #00694c; }}
@media (prefers-color-scheme: dark) {{
  :root {{ --page: #16181b; --card: #202327; --ink: #e8eaec; --muted: #a3abb3; --line: #3a3f45;
    --bad: #ff9a57; --good: #4fd0a6; }}
  img {{ filter: brightness(0.92); }}
}}
* {{ box-sizing: border-box; }}
body {{ margin: 0; background: var(--page); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", sans-serif; }}
main {{ max-width: 1120px; margin: 0 auto; padding: 24px 16px 48px; }}
h1 {{ font-size: 1.7rem; line-height: 1.25; margin: 0 0 4px; overflow-wrap: anywhere; }}
h2 {{ font-size: 1.2rem; margin: 40px 0 4px; }}
p {{ margin: 4px 0 12px; max-width: 80ch; overflow-wrap: anywhere; }}
.quiet {{ color: var(--muted); }}
.cards {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(150px, 1fr));
  gap: 12px; margin: 20px 0 12px; }}
@media (min-width: 760px) {{ .cards {{ grid-template-columns: repeat(4, 1fr); }} }}
.card {{ background: var(--card); border: 1px solid var(--line); border-radius: 8px;
  padding: 10px 14px; }}
.card b {{ display: block; font-size: 1.35rem; line-height: 1.3; white-space: nowrap;
  font-variant-numeric: tabular-nums; }}
.card span {{ display: block; color: var(--muted); font-size: 0.85rem; line-height: 1.35; }}
.bad {{ color: var(--bad) !important; font-weight: 600; }}
.good {{ color: var(--good) !important; font-weight: 600; }}
.wide {{ overflow-x: auto; }}
figure {{ margin: 8px 0 0; }}
img {{ display: block; width: 100%; min-width: 640px; height: auto; background: #ffffff;
  border: 1px solid var(--line); border-radius: 8px; }}
table {{ border-collapse: collapse; background: var(--card); margin: 8px 0;
  font-variant-numeric: tabular-nums; }}
th, td {{ border-bottom: 1px solid var(--line); padding: 5px 14px; text-align: right;
  white-space: nowrap; }}
th {{ color: var(--muted); font-weight: 600; font-size: 0.88rem; }}
th:first-child, td:first-child {{ text-align: left; }}
#rejected-table th:last-child, #rejected-table td:last-child {{ text-align: left;
  white-space: normal; min-width: 10em; }}
.rows td:nth-child(n+2) {{ white-space: nowrap; }}
.rows td:first-child, .rows td:last-child {{ white-space: normal; }}
.rows td:first-child {{ min-width: 16rem; padding-left: 28px; }}
.rows td:last-child {{ text-align: left; color: var(--muted); font-size: 0.85rem;
  min-width: 9rem; }}
.rows th:last-child {{ text-align: left; }}
.rows .claim td {{ text-align: left; font-size: inherit; color: inherit; padding: 14px 10px 5px;
  border-bottom-color: var(--muted); }}
.rows .claim div {{ position: sticky; left: 10px; max-width: calc(100vw - 64px); }}
a {{ color: inherit; }}
figcaption a {{ overflow-wrap: anywhere; }}
@media print {{
  :root {{ color-scheme: light; --page: #ffffff; --card: #ffffff; --ink: #1f2328; --muted: #5b636b;
    --line: #d9dde1; --bad: #b04a00; --good: #00694c; }}
  body {{ background: none; }}
  main {{ max-width: none; padding: 0; }}
  h2 {{ break-after: avoid; }}
  figure, .card {{ break-inside: avoid; }}
  img {{ min-width: 0; filter: none; }}
  pre {{ white-space: pre-wrap; }}
}}
@media screen and (max-width: 672px) {{
  figure::after {{ content: "Swipe the picture sideways to see all of it."; color: var(--muted);
    font-size: 0.85rem; }}
  table {{ font-size: 0.82rem; }}
  th, td {{ padding: 5px; }}
  th, #rejected-table td {{ white-space: normal; font-size: inherit; }}
}}
summary {{ cursor: pointer; font-size: 1.2rem; font-weight: 600; margin-top: 40px; }}
pre {{ background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 14px;
  overflow-x: auto; font-size: 0.85rem; }}
</style>
</head>
<body>
<main>
{body}
</main>
</body>
</html>
"""


def page(title: str, body: str, script: str = "") -> str:
    """Return a whole page; `body` is HTML, `title` text, `script` all it may execute."""
    allowed = f"; script-src '{_hash(script)}'" if script else ""
    return _PAGE.format(title=escape(title), body=body, script=allowed)


def _hash(script: str) -> str:
    """Return the hash that identifies a script in a Content-Security-Policy."""
    digest = hashlib.sha256(script.encode("utf-8")).digest()
    return "sha256-" + base64.b64encode(digest).decode("ascii")


def picture(name: str, heading: str, caption: str, file: Path) -> str:
    """Return a PNG with a heading and a caption, held in the page itself."""
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    return (
        f'<h2 id="{name}">{escape(heading)}</h2>\n<figure><figcaption><p class="quiet">'
        f'{escape(caption)}</p></figcaption><div class="wide"><img alt="{escape(heading)}" '
        f'src="data:image/png;base64,{data}"></div></figure>'
    )


def table(name: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table; its cells are escaped here and nowhere else."""
    lines = ["<tr>" + "".join(f"<th>{escape(c)}</th>" for c in head) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows]
    body = "\n".join(lines)
    return f'<div class="wide"><table id="{name}-table">\n{body}\n</table></div>'
