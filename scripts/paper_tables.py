# SPDX-License-Identifier: Apache-2.0
"""Write results/papers.md and the papers' rows of results/README.md; --check compares.

Both are made of results/papers.json, which `locfuse reproduce all` leaves.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path[0] = str(ROOT)  # otherwise `papers` is this file

from papers.page import FIVE, HEAD, OURS, PAPERS_IN_ORDER, Repeated, cells_of, judge, read_rows  # noqa: E402

RESULTS = ROOT / "results"
ROWS, PAGE, README = RESULTS / "papers.json", RESULTS / "papers.md", RESULTS / "README.md"
BEGIN, END = "<!-- rows of the papers, by scripts/paper_tables.py -->", "<!-- end of these rows -->"

TOP = """# Five papers, repeated

`locfuse reproduce all` writes this as one page with pictures, and `papers.json` beside it, of
which `scripts/paper_tables.py` makes these tables. To check that a machine gets the same:
`locfuse reproduce all --quick --compare results/papers.json`.

![The page: the five papers, and what the first reports above our figures](images/papers_page.png)

Each claim of a paper that can be checked is a numbered row, in the paper's order: where it stands,
what the paper reports in our words, whether that is so here. Our figures about it follow: the
median over seeds, in brackets 5 % and 95 % of them; of NEES the mean. *Required* is what we ask of
ourselves. Times are those of the runs that made the figures, on 2 cores that had other work, too.
"""

Values = Mapping[str, Mapping[str, Any]]
Row = tuple[str, Callable[[Values, int], list[str]]]


def main() -> int:
    """Write or compare; return 1 if something is not as it is to be."""
    repeated = read_rows(ROWS)
    wanted = {PAGE: page_of(repeated), README: readme_with(repeated)}
    stale = [file for file, text in wanted.items()
             if not file.exists() or file.read_text(encoding="utf-8") != text]  # fmt: skip
    if "--check" in sys.argv:
        for file in stale:
            print(f"{file.name} is out of date: run scripts/paper_tables.py")
        return 1 if stale else 0
    for file in stale:
        file.write_text(wanted[file], encoding="utf-8")
    return 0


def page_of(repeated: list[Repeated]) -> str:
    """Return results/papers.md."""
    parts = [TOP, _overview(repeated)]
    for paper, one in zip(PAPERS_IN_ORDER, repeated, strict=True):
        command = f"locfuse reproduce {paper.key} --seeds {one.seeds}"
        parts.append(f"## {paper.title}\n\n{paper.what}\n\n`{command}`, {one.seconds:.0f} s.\n")
        parts.append(_table([list(HEAD), *_rows_about(one)], "---|---|---:|---:|---|---"))
    return "\n".join(parts)


def _overview(repeated: list[Repeated]) -> str:
    """Return how many claims of each paper are so here, and how many requirements are met."""
    rows = [["paper", "claims", "so here", "not so", "not run", "required", "met", "time"]]
    for one in repeated:
        so = [claim.so for claim in judge(FIVE[one.paper], one.claims)[0]]
        met = [row["met"] for row in one.claims if row["required"] != "-"]
        rows.append([one.paper, str(len(so)), *(str(so.count(x)) for x in (True, False, None)),
                     str(len(met)), str(met.count(True)), f"{one.seconds:.0f} s"])  # fmt: skip
    return _table(rows, "---" + "|---:" * 7)


def _rows_about(one: Repeated) -> list[list[str]]:
    """Return the claims of a paper, our rows below each, and our own rows last."""
    judged, own = judge(FIVE[one.paper], one.claims)
    rows = []
    for of in judged:
        said = of.statement
        rows.append([f"**{of.heading}** ({said.where})", said.reports,
                     f"**{of.verdict}**", "", "", said.remark])  # fmt: skip
        rows += map(cells_of, of.rows)
    if own:
        rows += [[f"**{OURS}**", "", "", "", "", ""], *map(cells_of, own)]
    return rows


def _table(rows: list[list[str]], line: str) -> str:
    """Return a table of Markdown; the first row is its head."""
    head, *body = [" | ".join(cell.replace("|", "\\|") for cell in row) for row in rows]
    return "\n".join([f"| {head} |", f"|{line}|", *(f"| {row} |" for row in body)]) + "\n"


def readme_with(repeated: list[Repeated]) -> str:
    """Return results/README.md with the rows of the papers made anew."""
    text = README.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{rows_of(repeated)}\n{END}{after}"


def rows_of(repeated: list[Repeated]) -> str:
    """Return the table of results/README.md."""
    values = {row["id"]: row for one in repeated for row in one.claims}
    seeds = {one.paper: one.seeds for one in repeated}
    lines = ["| paper | data | ours | the paper | command |", "|---|---|---|---|---|"]
    for key, make in ROWS_OF_README:
        cells = [*make(values, seeds[key]), f"`locfuse reproduce {key}`"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def figure(values: Values, id: str, digits: int = 2) -> str:
    """Return one figure, to so many digits."""
    return f"{values[id]['ours_median']:.{digits}g}"


def between(values: Values, ids: list[str]) -> str:
    """Return the minimum and the maximum of several figures."""
    found = sorted(values[id]["ours_median"] for id in ids)
    return f"{found[0]:.2g} to {found[-1]:.2g}"


def _room(values: Values, seeds: int) -> list[str]:
    ids = [f"room_{path}_rmse" for path in ("circle", "eight", "square", "star", "waypoints")]
    return ["Ekim, 2020: ranges, odometry and another localizer",
            f"simulated room, five paths, {seeds} seeds each",
            f"{between(values, ids)} cm", f"{values[ids[0]]['paper']:g} cm"]  # fmt: skip


def _gazebo(values: Values, _: int) -> list[str]:
    ids = [f"ieu_{run}_rmse" for run in ("run3", "straight", "home")]
    centimetres = ", ".join(f"{100.0 * values[id]['ours_median']:.1f}" for id in ids)
    return ["the same, ranges and odometry", "Gazebo, three runs of the paper's authors",
            f"{centimetres} cm", "-"]  # fmt: skip


def _recorded(values: Values, _: int) -> list[str]:
    centimetres = ", ".join(f"{100.0 * values[f'{id}_rmse']['ours_median']:.3g}"
                            for id in ("office", "labyrinth", "Plaza1"))  # fmt: skip
    return ["the same, recorded", "real: office with a beacon that is wrong by up to 13 m, small "
            "robot in a labyrinth, lawn mower on 1.9 km", f"{centimetres} cm", "-"]  # fmt: skip


def _power_up(values: Values, _: int) -> list[str]:
    return ["the same, switched on anywhere", "real office, 199 power-ups, ranges and one scan",
            f"{figure(values, 'start_office_ready', 3)} % ready at once, "
            f"{figure(values, 'start_office', 3)} % right or not ready",
            "a search in steps of 10 degrees"]  # fmt: skip


def _wells(values: Values, seeds: int) -> list[str]:
    return ["Wells: a laser on cylinders", f"simulated, four cylinders, {seeds} drives; with slip",
            f"{figure(values, 'wells')} cm, {figure(values, 'wells_heading')} deg; "
            f"{figure(values, 'wells_spoilt')} cm, {figure(values, 'wells_spoilt_heading')} deg",
            f"its method here: {figure(values, 'wells_paper_ekf')} cm; "
            f"{0.01 * values['wells_spoilt_paper_ekf']['ours_median']:.2g} m"]  # fmt: skip


def _eights(values: Values, seeds: int) -> list[str]:
    def of(name: str) -> str:
        x, y = (100.0 * values[f"celan_eight_{name}_{axis}"]["ours_median"] for axis in "xy")
        heading = figure(values, f"celan_eight_{name}_heading")
        return f"{x:.2g} cm in x, {y:.2g} cm in y, {heading} deg"

    return ["Celan, 2017: three tags and wheels on a scrubber", f"simulated eights, {seeds} rides",
            of("rigid"),
            f"its 12 states here, with the noise of least error: {of('kindest')}"]  # fmt: skip


def _switch(values: Values, seeds: int) -> list[str]:
    """Return the row of the laser alone, where a switch has nothing to do, and of the hall."""
    theirs, without = (values[f"celan_{name}_end"]["paper"]
                       for name in ("covered_switch", "covered"))  # fmt: skip
    near = [figure(values, f"celan_{name}_room", 3) for name in ("hall_switch", "hall")]
    return ["the same, half a laser on a map; blind in a wet hall, UWB by a switch",
            f"simulated, {seeds} laps of 200 m",
            f"{100.0 * values['celan_covered_end']['ours_median']:.2g} cm at the end by the laser "
            f"alone; hall, where the anchors are: {near[0]} % of the time within 0.5 m, "
            f"{near[1]} % without UWB",
            f"{100.0 * theirs:.2g} cm; {without:.2g} m without UWB"]  # fmt: skip


def _landmarks(values: Values, _: int) -> list[str]:
    ids = [f"gadau_rays_{discs}_{speed}" for discs in (5, 8) for speed in ("0", "0.3", "1")]
    return ["Gadau, 2022: range and bearing to landmarks",
            "simulated, 151 rays on 5 and 8 discs, at 0, 0.3 and 1 m/s",
            f"{between(values, ids)} cm", "diverges"]  # fmt: skip


def _kidnapped(values: Values, _: int) -> list[str]:
    id = "gadau_kidnapped_triangle"
    return ["the same, kidnapped", "simulated, three landmarks without names",
            f"noticed after {figure(values, id + '_noticed')} s, "
            f"found after {figure(values, id + '_found_after')} s", "never found"]  # fmt: skip


def _zhang(values: Values, seeds: int) -> list[str]:
    return ["Zhang: particles refined by an EKF", f"{seeds} simulated floors, nothing known",
            f"found within 10 iterations: {figure(values, 'zhang_ours_found_10', 3)} %",
            f"{values['zhang_paper_iterations']['paper']:g} iterations"]  # fmt: skip


ROWS_OF_README: list[Row] = [
    ("ekim2020", _room),
    ("ekim2020", _gazebo),
    ("ekim2020", _recorded),
    ("ekim2020", _power_up),
    ("wells", _wells),
    ("celan2017", _eights),
    ("celan2017", _switch),
    ("gadau2022", _landmarks),
    ("gadau2022", _kidnapped),
    ("zhang", _zhang),
]

if __name__ == "__main__":
    sys.exit(main())
