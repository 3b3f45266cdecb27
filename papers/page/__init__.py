# SPDX-License-Identifier: Apache-2.0
"""All five papers: what each reports, what came out here, one page of it."""

from papers.page.cells import HEAD, OURS, cells_of, figure_of
from papers.page.compare import differences
from papers.page.html import PAGE, page_of
from papers.page.paper import Paper, Statement, Told, tell
from papers.page.repeated import (
    FIVE,
    PAPERS_IN_ORDER,
    ROWS,
    Repeated,
    read_rows,
    write_rows,
)
from papers.page.runs import repeat, repeat_all, seeds_of, stages, write_page

__all__ = [
    "FIVE",
    "HEAD",
    "OURS",
    "PAGE",
    "PAPERS_IN_ORDER",
    "ROWS",
    "Paper",
    "Repeated",
    "Statement",
    "Told",
    "cells_of",
    "differences",
    "figure_of",
    "page_of",
    "read_rows",
    "repeat",
    "repeat_all",
    "seeds_of",
    "stages",
    "tell",
    "write_page",
    "write_rows",
]
