# SPDX-License-Identifier: Apache-2.0
"""All five papers: what each reports, what came out here, one page of it."""

from papers.claims import Judged, Paper, Statement, judge
from papers.page.cells import HEAD, OURS, cells_of, figure_of
from papers.page.compare import differences
from papers.page.html import PAGE, page_of
from papers.page.repeated import FIVE, PAPERS_IN_ORDER, ROWS, Repeated, read_rows, write_rows
from papers.page.runs import repeat, repeat_all, seeds_of, stages, write_page

__all__ = [
    "FIVE",
    "HEAD",
    "OURS",
    "PAGE",
    "PAPERS_IN_ORDER",
    "ROWS",
    "Judged",
    "Paper",
    "Repeated",
    "Statement",
    "cells_of",
    "differences",
    "figure_of",
    "judge",
    "page_of",
    "read_rows",
    "repeat",
    "repeat_all",
    "seeds_of",
    "stages",
    "write_page",
    "write_rows",
]
