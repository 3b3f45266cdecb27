# SPDX-License-Identifier: Apache-2.0
"""README and docs say what the code does: their code runs, their tables and links are compared."""

from __future__ import annotations

import contextlib
import doctest
import importlib
import io
import json
import pkgutil
import re
import runpy
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
import numpy as np
import pytest
import typer.main
import yaml
from matplotlib.image import imread
from pydantic import BaseModel
from pydantic.fields import FieldInfo

import locfuse.core
from configuration_page import CONFIGURATION, SECTIONS, configuration_page, unit_of
from locfuse.cli.app import COMMANDS, app, load
from locfuse.config import ros, scenario, schema
from locfuse.config.base import Strict, description, is_tag
from locfuse.config.load import load_config, parse_config
from locfuse.report.results import write_results
from locfuse.run.run import run
from papers.claims import Claim
from papers.datasets import CONVERTERS
from papers.ekim2020.world import RECORDINGS
from papers.reproduce import PAPERS
from support_runs import locfuse as command_line

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
RESULTS = ROOT / "results"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "TESTING.md", "WALKTHROUGHS.md")),
    *sorted(DOCS.rglob("*.md")),
    *sorted(RESULTS.rglob("*.md")),
]
SOURCES = [
    path
    for folder in ("cpp", "bindings", "python/locfuse", "examples", "benchmarks")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in (".hpp", ".cpp", ".py", ".yaml")
]
NOT_RUN = "<!-- not run -->"


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@dataclass(frozen=True)
class Block:
    """A fenced block of a page, and the line before it that is not empty."""

    language: str
    text: str
    line: int
    before: str


def blocks_of(path: Path) -> Iterator[Block]:
    language, begin, before, last = "", 0, "", ""
    text: list[str] = []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if line.startswith("```"):
            if begin:
                yield Block(language, "\n".join(text) + "\n", begin, before)
                begin = 0
            else:
                language, begin, before, text = line[3:].strip(), number, last, []
        elif begin:
            text.append(line)
        if line.strip():
            last = line
    assert begin == 0, f"{path}: the block of line {begin} does not end"


def prose_of(path: Path) -> str:
    """Return a page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)


def table_under(path: Path, heading: str) -> list[list[str]]:
    """Return the rows of the first table below a heading, header left out."""
    lines = path.read_text().splitlines()
    begin = lines.index(heading) + 1
    rows: list[list[str]] = []
    for line in lines[begin:]:
        if line.startswith("#") or (rows and not line.startswith("|")):
            break
        if line.startswith("|"):
            rows.append([cell.strip() for cell in line.strip("|").split("|")])
    assert len(rows) > 2, f"{path}: no table under {heading!r}"
    return rows[2:]


# Code ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "page", [p for p in PAGES if any(b.language == "python" for b in blocks_of(p))], ids=name_of
)
def test_python_blocks_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {"__name__": "page"}
    for block in blocks_of(page):
        if block.language == "python" and block.before != NOT_RUN:
            code = "\n" * block.line + block.text  # so that a traceback names the page's line
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(code, str(page), "exec"), namespace)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_yaml_blocks_are_configurations_or_log_yaml(page: Path) -> None:
    for block in blocks_of(page):
        if block.language == "yaml":
            data = yaml.safe_load(block.text)
            if not set(data) <= {"tags", "laser", "map", "description", "licence"}:
                parse_config(data, f"{page}, line {block.line}")


def test_quickstart_leads_from_an_empty_folder_to_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its blocks in order: Python runs, YAML with a name is saved, locfuse commands succeed."""
    monkeypatch.chdir(tmp_path)
    ran = 0
    for block in blocks_of(DOCS / "quickstart.md"):
        if block.language == "python":
            exec(compile(block.text, "quickstart.md", "exec"), {"__name__": "page"})
        elif block.language == "yaml" and (file := re.match(r"# (\w+\.yaml)\n", block.text)):
            (tmp_path / file[1]).write_text(block.text)
        elif block.language == "sh":
            for line in block.text.splitlines():
                if line.startswith("locfuse "):
                    done = command_line(*shlex.split(line)[1:])
                    assert done.status == 0, f"{line}: {done.err}"
                    ran += 1
    runs = {
        path.parent.name: json.loads(path.read_text()) for path in Path("out").glob("*/m*.json")
    }
    assert ran > len(runs) > 7
    for name, metrics in runs.items():
        assert metrics["position_rmse_m"] < 0.25, name
        assert metrics["health"]["share"].get("lost", 0.0) == 0.0, name


@pytest.mark.parametrize("config", sorted((ROOT / "examples/configs").glob("*.yaml")), ids=name_of)
def test_ready_configurations_parse(config: Path) -> None:
    load_config(config)


def command_lines() -> list[tuple[str, str]]:
    return [
        (f"{name_of(page)}:{block.line}", line)
        for page in PAGES
        for block in blocks_of(page)
        if block.language == "sh"
        for line in block.text.splitlines()
    ] + [
        (name_of(page), text)
        for page in PAGES
        for text in re.findall(r"`(locfuse [^`]+)`", prose_of(page))
    ]


def click_of(words: list[str]) -> tuple[Any, list[str]]:
    """Return the command that words name, and the words that are left for it."""
    command: Any = typer.main.get_command(app)
    if words and not words[0].startswith("-"):
        assert words[0] in COMMANDS, f"no command {words[0]!r}"
        command, words = load(words[0]), words[1:]
    while hasattr(command, "commands") and words and not words[0].startswith("-"):
        assert words[0] in command.commands, f"no command {words[0]!r}"
        command, words = command.commands[words[0]], words[1:]
    return command, words


@pytest.mark.parametrize(
    ("where", "line"), [c for c in command_lines() if c[1].startswith("locfuse ")]
)
def test_command_lines_name_commands_and_options_that_exist(where: str, line: str) -> None:
    words = shlex.split(line, comments=True)[1:]
    if words[:1] == ["COMMAND"]:
        return
    command, rest = click_of(words)
    options = {name for parameter in command.params for name in parameter.opts} | {"--help"}
    for word in rest:
        if word.startswith("--"):
            assert word.split("=")[0] in options, f"{where}: no option {word}"


def test_every_command_and_option_is_on_the_page_of_the_command_line() -> None:
    headings = re.findall(r"^## `locfuse (.+)`$", (DOCS / "cli.md").read_text(), re.MULTILINE)
    documented = {" ".join(w for w in h.split() if w.islower()): h for h in headings}
    commands: dict[str, Any] = {}
    for name in COMMANDS:
        command = load(name)
        nested = getattr(command, "commands", None)
        commands |= {f"{name} {k}": v for k, v in nested.items()} if nested else {name: command}
    assert set(documented) == set(commands)
    for name, command in commands.items():
        arguments = [p.name.upper() for p in command.params if p.param_type_name == "argument"]
        assert documented[name].split() == [*name.split(), *arguments]
        options = [p for p in command.params if p.param_type_name == "option"]
        if not options:
            continue
        rows = table_under(DOCS / "cli.md", f"## `locfuse {documented[name]}`")
        assert [row[0].strip("`") for row in rows] == [p.opts[0] for p in options]
        for row, option in zip(rows, options, strict=True):
            if option.default is not None:
                assert row[1].strip("`") == str(option.default)


def test_every_dev_command_is_documented() -> None:
    commands = re.findall(r"^([\w-]+)\)$", (ROOT / "dev").read_text(), re.MULTILINE)
    rows = table_under(ROOT / "CONTRIBUTING.md", "## Commands")
    assert sorted(row[0].strip("`") for row in rows) == sorted(f"./dev {c}" for c in commands)


def modules() -> list[str]:
    return ["locfuse", *(m.name for m in pkgutil.walk_packages(locfuse.__path__, "locfuse."))]


@pytest.mark.parametrize("name", modules())
def test_doctests_run(name: str) -> None:
    module = importlib.import_module(name)
    runner = doctest.DocTestRunner(verbose=False)
    for test in doctests_of(module):
        runner.run(test)
    assert runner.summarize(verbose=False).failed == 0


def doctests_of(module: ModuleType) -> list[doctest.DocTest]:
    if Path(module.__file__ or "").suffix == ".py":
        return doctest.DocTestFinder(exclude_empty=True).find(module)
    parser = doctest.DocTestParser()  # the finder passes over functions of an extension
    return [
        parser.get_doctest(value.__doc__, dict(vars(module)), f"{module.__name__}.{name}", None, 0)
        for name, value in vars(module).items()
        if not name.startswith("__") and value.__doc__
    ]


def test_the_extension_has_doctests() -> None:
    assert sum(len(test.examples) for test in doctests_of(locfuse._core)) > 10


def test_readme_shows_the_examples() -> None:
    shown = {block.language: block.text for block in blocks_of(ROOT / "README.md")}
    cpp = (ROOT / "examples/cpp/fuse_ranges.cpp").read_text()
    assert shown["cpp"] == cpp.split("\n", 1)[1]  # but for the licence line
    python = (ROOT / "examples/python/fuse_ranges.py").read_text()
    first = "anchors = "
    assert shown["python"].partition(first)[2] == python.partition(first)[2] != ""


def test_the_picture_of_the_worlds_is_what_its_example_draws(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    example = runpy.run_path(str(ROOT / "examples/python/worlds.py"))
    assert example["main"]() == 0
    drawn = Path(capsys.readouterr().out.strip().removeprefix("picture: "))
    assert drawn == tmp_path / "out/worlds.png"
    assert f"`{drawn.relative_to(tmp_path)}`" in (DOCS / "simulation.md").read_text()
    shown, again = (imread(path) for path in (DOCS / "images/worlds.png", drawn))
    assert again.shape == shown.shape
    # Axes that another matplotlib moves by a pixel change 4 %, the worlds of another seed 11 %.
    assert np.mean(np.any(again != shown, axis=-1)) < 0.05


# Links and names -------------------------------------------------------------------------------


def anchor_of(heading: str) -> str:
    return re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", heading.lower()).strip())


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=name_of)
def test_relative_links_hit_a_file_and_a_heading(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose_of(page)):
        if "://" in target:
            continue
        file, _, fragment = target.partition("#")
        path = page.parent / file if file else page
        assert path.is_file(), f"{page}: {target}"
        if fragment:
            headings = re.findall(r"^#+ (.+)$", prose_of(path), re.MULTILINE)
            assert fragment in [anchor_of(h) for h in headings], f"{page}: {target}"


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=name_of)
def test_files_of_the_repository_that_are_named_exist(page: Path) -> None:
    folders = "cpp|python|papers|bindings|tests|scripts|examples|benchmarks|docs|results|cmake"
    for name in re.findall(rf"`((?:{folders})/[\w./-]+)`", prose_of(page)):
        assert (ROOT / name).exists(), f"{page}: {name}"


def test_every_page_is_in_the_navigation_and_nothing_is_fetched() -> None:
    site = yaml.safe_load((ROOT / "mkdocs.yml").read_text())

    def leaves(item: Any) -> list[str]:
        if isinstance(item, str):
            return [item]
        values = item.values() if isinstance(item, dict) else item
        return [leaf for value in values for leaf in leaves(value)]

    assert sorted(leaves(site["nav"])) == sorted(
        str(p.relative_to(DOCS)) for p in DOCS.rglob("*.md")
    )
    assert site["theme"]["name"] == "material"
    assert site["theme"]["font"] is False
    assert not {"extra_javascript", "extra_css", "extra"} & set(site)
    for page in DOCS.rglob("*.md"):
        assert "<script" not in page.read_text()


NUMBER = r"\((\d+(?:\.\d+)?)\)"


def equations_of(page: Path) -> list[str]:
    """Return the numbers of the equations of a page, in order: 3, or 2.3 in section 2."""
    texts = [block.text for block in blocks_of(page) if block.language == "text"]
    return [n for text in texts for n in re.findall(rf"\S {{2,}}{NUMBER}$", text, re.MULTILINE)]


def numbers_between(first: str, last: str) -> list[str]:
    """Return the numbers from the first to the last, which are of one section."""
    section, _, begin = first.rpartition(".")
    other, _, end = last.rpartition(".")
    assert section == other, f"({first}) and ({last}) are of two sections"
    dot = "." if section else ""
    return [f"{section}{dot}{n}" for n in range(int(begin), int(end) + 1)]


def citations() -> list[tuple[Path, str, str]]:
    """Return source, page and number of every equation of our own pages that the sources cite."""
    found = []
    for source in SOURCES:
        text = source.read_text()
        pages = sorted(set(re.findall(r"(?:docs|results)/[\w/]+\.md", text)))
        text = re.sub(r"(?:ekim2020|celan2017|zhang)\W+eq\. \(\d+\)", "", text)
        for first, last in re.findall(rf"\beq\.\s+{NUMBER}(?:\s+to\s+{NUMBER})?", text):
            assert len(pages) == 1, f"{source} cites eq. ({first}) of {pages}"
            found += [(source, pages[0], n) for n in numbers_between(first, last or first)]
    return found


def test_cited_equations_exist() -> None:
    cited = citations()
    assert len(cited) > 5
    for source, page, number in cited:
        assert number in equations_of(ROOT / page), f"{source} cites {page} eq. ({number})"


@pytest.mark.parametrize("page", sorted((DOCS / "models").glob("*.md")), ids=name_of)
def test_equations_are_numbered_in_order(page: Path) -> None:
    """Each section with equations counts its own, (2.1), (2.2) and so on; its heading says 2."""
    numbers = equations_of(page)
    sections = list(dict.fromkeys(n.partition(".")[0] for n in numbers))
    assert sections == [str(k) for k in range(1, len(sections) + 1)] != []
    for k in sections:
        of_it = [n for n in numbers if n.startswith(f"{k}.")]
        assert of_it == [f"{k}.{n}" for n in range(1, len(of_it) + 1)]
    headings = re.findall(r"^## (\d+)\. ", prose_of(page), re.MULTILINE)
    assert headings == sections


def test_pages_that_the_sources_name_exist() -> None:
    named = {n for s in SOURCES for n in re.findall(r"(?:docs|results)/[\w/]+\.md", s.read_text())}
    assert named
    for name in named:
        assert (ROOT / name).is_file(), name


def test_tests_that_the_answers_name_exist() -> None:
    rows = table_under(RESULTS / "complaints.md", "# Common problems of localizers")
    assert len(rows) == 19
    tests = {path.name: path for path in (ROOT / "tests").rglob("test_*.*")}
    text = "".join(path.read_text() for path in tests.values() if path.suffix in (".py", ".cpp"))
    for _, _, test in rows:
        name = test.strip("`")
        assert name in tests or f"def {name}(" in text or f", {name})" in text, name


def test_api_lists_exactly_the_names_that_come_first() -> None:
    rows = table_under(DOCS / "api.md", "## Python names")
    assert [row[0].strip("`") for row in rows] == locfuse.__all__


def test_reference_has_each_name_of_the_core_once() -> None:
    pages = "".join(path.read_text() for path in (DOCS / "reference").glob("*.md"))
    listed = re.findall(r"^::: locfuse\._core\.(\w+)$", pages, re.MULTILINE)
    assert sorted(listed) == sorted(locfuse.core.__all__)


def test_reference_names_what_exists_and_has_docstrings() -> None:
    page = (DOCS / "reference" / "functions.md").read_text()
    named = re.findall(r"^::: (\S+)$", page, re.MULTILINE)
    assert len(named) > 50
    for path in named:
        module, _, name = path.rpartition(".")
        assert getattr(importlib.import_module(module), name).__doc__, path
    for name in locfuse.core.__all__:
        assert getattr(locfuse.core, name).__doc__, name


def test_there_is_one_version() -> None:
    cmake = (ROOT / "CMakeLists.txt").read_text()
    match = re.search(r"VERSION (\d+\.\d+\.\d+)", cmake)
    assert match is not None
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text())
    assert locfuse.__version__ == match[1] == citation["version"]
    assert recipe["context"]["version"] == match[1]
    assert f"## [{match[1]}]" in (ROOT / "CHANGELOG.md").read_text()


# Configuration ---------------------------------------------------------------------------------


def fields_of(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Return the fields of a model but for the tag that its heading names."""
    return {k: f for k, f in model.model_fields.items() if not is_tag(model, k)}


def bounds_of(field: FieldInfo) -> list[str]:
    """Return what must stand in the column of allowed values."""
    found: list[str] = []

    def look(part: Any) -> None:
        if isinstance(part, annotated_types.Gt):
            found.append(f"> {part.gt:g}")
        elif isinstance(part, annotated_types.Ge):
            found.append(f">= {part.ge:g}")
        elif isinstance(part, annotated_types.Le):
            found.append(f"<= {part.le:g}")
        elif get_origin(part) is Literal:
            found.extend(f"`{choice}`" for choice in get_args(part))
        elif isinstance(part, FieldInfo):
            for item in part.metadata:
                look(item)
        elif get_origin(part) in (Annotated, Union, UnionType):
            for item in get_args(part):
                look(item)

    look(field.annotation)
    look(field)
    return found


@pytest.mark.parametrize("heading", SECTIONS)
def test_configuration_tables_are_those_of_the_code(heading: str) -> None:
    fields = fields_of(SECTIONS[heading])
    rows = {row[0].strip("`"): row for row in table_under(CONFIGURATION, heading)}
    assert list(rows) == list(fields)
    for key, (_, _, allowed, meaning) in rows.items():
        field = fields[key]
        where = f"{heading} {key}"
        _, unit = description(SECTIONS[heading], key)
        if unit_of(key) is not None:
            assert unit == unit_of(key), where
        elif unit:
            assert meaning.endswith(f"[{unit}]"), where
        for bound in bounds_of(field):
            assert bound in allowed, f"{where}: {bound} is not in {allowed!r}"
        assert meaning, where


def test_configuration_tables_are_generated_from_the_schema() -> None:
    assert CONFIGURATION.read_text() == configuration_page(), (
        "run python scripts/configuration_page.py"
    )


def test_every_part_of_a_configuration_has_its_table() -> None:
    models = {
        value
        for module in (schema, scenario, ros)
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Strict) and not value.__subclasses__()
    }
    assert set(SECTIONS.values()) == models


# Results ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    result = run(parse_config({"simulation": {"duration_s": 5}}), seed=1)
    folder = tmp_path_factory.mktemp("results")
    write_results(result, folder)
    return folder, dict(result.metrics)


def test_files_of_a_run_are_documented(results: tuple[Path, dict[str, Any]]) -> None:
    rows = table_under(DOCS / "results.md", "## Files")
    assert sorted(row[0].strip("`") for row in rows) == sorted(p.name for p in results[0].iterdir())


def test_keys_of_metrics_are_documented(results: tuple[Path, dict[str, Any]]) -> None:
    rows = table_under(DOCS / "results.md", "## metrics.json")
    assert [row[0].strip("`") for row in rows if row[0].strip("`") != "truth"] == [
        key for key in results[1] if key != "truth"
    ]
    assert "truth" in results[1]


@pytest.mark.parametrize("file", ["estimate.csv", "outcomes.csv"])
def test_columns_of_results_are_documented(file: str, results: tuple[Path, dict[str, Any]]) -> None:
    text = " ".join((DOCS / "results.md").read_text().split())
    paragraph = text.partition(f"`{file}`: ")[2].partition(". ")[0]
    header = (results[0] / file).read_text().split("\n", 1)[0]
    documented = re.findall(r"`(\w+)`", paragraph)
    assert documented == header.split(",")


@pytest.mark.parametrize("heading", ["# Published recordings", "## Licences"])
def test_every_recording_is_documented(heading: str) -> None:
    rows = table_under(RESULTS / "recordings.md", heading)
    assert [row[0].strip("`") for row in rows] == list(CONVERTERS)


def test_rows_of_reproduce_are_documented() -> None:
    text = (DOCS / "cli.md").read_text()
    assert all(f"`{name}`" in text for name in Claim.__dataclass_fields__)
    assert all(f"`{paper}`" in text for paper in PAPERS)


def papers_json() -> dict[str, dict[str, Any]]:
    """Return the claims of results/papers.json by id."""
    found = json.loads((RESULTS / "papers.json").read_text())
    return {row["id"]: row for paper in found["papers"] for row in paper["claims"]}


def test_figures_of_celan2017_stand_on_one_page() -> None:
    """They once stood in results/accuracy.md, too, and stayed there when filters had changed."""
    section = (RESULTS / "accuracy.md").read_text().split("\n## Celan\n")[1].split("\n## ")[0]
    assert re.findall(r"\[[\d.,]+\.\.[\d.,]+\]", section) == []
    assert "papers.md" in section


def test_figures_of_the_scrubber_are_those_of_papers_json() -> None:
    values = {id: row["ours_median"] for id, row in papers_json().items()}
    page = " ".join((RESULTS / "components.md").read_text().split())
    eight = "celan_eight"
    gain = [values[f"{eight}_{name}_gain_{what}"] for name in ("triangle", "kindest")
            for what in ("position", "heading")]  # fmt: skip
    worse = round(0.2 * (100.0 - values[f"{eight}_triangle_better"]))
    bound = [values[f"{eight}_{name}_over_bound_position"] for name in ("kindest", "rigid")]
    rows = {"a constant per link, `PoseEkf`": "rigid_ranges",
            "a constant per link, rolling": "rolling_ranges",
            "antennas known, rolling": "rolling_antennas_antennas"}  # fmt: skip
    figures = [
        f"12 states err {gain[0]:.2g} times as much in position and {gain[1]:.2g} times in heading",
        f"in {worse} of 20 rides",
        f"it is {gain[2]:.3g} and {gain[3]:.2g}",
        f"they are at {bound[0]:.3g} of the Cramer-Rao bound, the rigid body at {bound[1]:.3g}",
        f"fitted to the truth | - | {values['celan_trolley_oracle_heading']:.2g} deg |",
    ]
    for name, id in rows.items():
        position, heading = (values[f"celan_trolley_{id}_10{what}"] for what in ("", "_heading"))
        figures.append(f"| {name} | {100.0 * position:.1f} cm | {heading:.1f} deg |")
    for figure in figures:
        assert figure in page


def test_figures_of_zhang_are_those_of_papers_json() -> None:
    values = {id: row["ours_median"] for id, row in papers_json().items()}
    rows = {row[0]: row[1:4] for row in table_under(RESULTS / "accuracy.md", "## Zhang")}

    def three(what: str, *formats: str) -> list[str]:
        names = ("standard", "paper", "ours")
        return [form.format(values[f"zhang_{name}_{what}"])
                for name, form in zip(names, formats, strict=True)]  # fmt: skip

    for within in (10, 19):
        assert rows[f"found within {within} iterations"] == three(
            f"found_{within}", *3 * ["{:.0f} %"]
        )
    for at in (5, 10, 15, 30):
        wanted = three(f"error_{at}", "{:.2f} m", "{:.3f} m", "{:.3f} m")
        assert rows[f"error at iteration {at}"] == wanted
    cost = three("cost", "{:.0f} ms (numpy)", "{:.0f} ms (numpy)", "{:.2f} ms (C++)")
    assert rows["processor time per iteration"] == cost


@pytest.mark.parametrize("name", RECORDINGS)
def test_accuracy_of_recordings_is_as_documented(name: str) -> None:
    rows = {row[0]: row for row in table_under(RESULTS / "accuracy.md", "## Recordings")}
    file, of_dataset, limit = RECORDINGS[name]
    config = load_config(ROOT / "examples/configs" / file)
    if of_dataset is not None:
        assert isinstance(config.log, schema.Dataset)
        dataset = config.log.model_copy(update={"run": of_dataset})
        config = config.model_copy(update={"log": dataset})
    try:
        metrics = run(config, base=ROOT / "examples/configs").metrics
    except locfuse.LogError as error:
        pytest.skip(f"{name}: {error}")
    _, _, rmse, required, nees, in_band = rows[name]
    assert rmse == f"{metrics['position_rmse_m']:.4f} m"
    assert required == f"<= {limit:g} m"
    assert nees == f"{metrics['nees_mean']:.1f} ({metrics['nees_dof']})"
    assert in_band == f"{100 * metrics['nees_in_band']:.0f} %"
